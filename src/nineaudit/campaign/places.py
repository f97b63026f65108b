"""Names of files anywhere fsspec knows: a path, s3://bucket/key, zip://member::archive.zip. Text only, save for
`read_bytes`, `signature` and `fetched`, which look."""

from __future__ import annotations

import hashlib
import shutil
import tempfile
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path, PurePosixPath
from typing import Any, Final

from nineaudit.campaign.stores import asked, told
from nineaudit.parts import Part, files, part_of

SIDECAR: Final = ".provenance.json"
_TELLING: Final = (
    *("ETag", "etag", "CRC", "md5Hash", "Content-MD5", "Digest"),
    *("Last-Modified", "LastModified", "last_modified", "mtime", "modify", "modificationTime", "created"),
)
"""What stores call an entity tag, a checksum or a time of change; the first that is there counts."""


def split(uri: str) -> tuple[str, str, str]:
    """(protocol with ://, path, what follows from ::) of a uri; "" where it has none."""
    first, chain, rest = uri.partition("::")
    protocol, found, path = first.partition("://")
    return (f"{protocol}://" if found else "", path if found else first, chain + rest)


def is_local(uri: str) -> bool:
    """Whether it is a file of this machine, to be read in place."""
    protocol, _, rest = split(uri)
    return protocol in ("", "file://", "local://") and not rest


def local_path(uri: str) -> Path:
    """The path of a local uri."""
    return Path(split(uri)[1])


def name_of(uri: str) -> str:
    """The file name."""
    return PurePosixPath(split(uri)[1].replace("\\", "/")).name


def on_path(uri: str, change: Callable[[Path], Path]) -> str:
    """The uri with another path."""
    protocol, path, rest = split(uri)
    return f"{protocol}{change(Path(path)).as_posix()}{rest}"


def child(uri: str, name: str) -> str:
    """A name as seen from the folder of a file; as it is where it is absolute or a uri."""
    if "://" in name or Path(name).is_absolute():
        return name
    return on_path(uri, lambda path: _normal(path.parent / name))


def recording_files(uri: str, parts: Sequence[Part]) -> list[str]:
    """The files of the recording to which a file belongs, in the order of the rig's parts."""
    protocol, path, rest = split(uri)
    return [f"{protocol}{file.as_posix()}{rest}" for file in files(Path(path), parts)]


def read_bytes(uri: str, what: str) -> bytes:
    """The content of a file. ConfigurationError, which begins with `what`."""
    from fsspec.core import url_to_fs

    with told(uri, what):
        fs, path = url_to_fs(uri)
        return bytes(fs.cat_file(path))


def signature(uris: Sequence[str]) -> str | None:
    """What tells without reading whether files are as they were: sizes with times, entity tags or checksums; None
    where one is not there. OSError where a store cannot be asked."""
    with asked():
        said = [_signature(file) for uri in uris for file in _with_company(uri)]
    if any(one is None for one in said):
        return None
    return hashlib.sha256("\0".join(str(one) for one in said).encode(errors="surrogateescape")).hexdigest()


@contextmanager
def fetched(uri: str, parts: Sequence[Part]) -> Iterator[Path]:
    """The path of a recording: as it is where it is local, else of a copy that is gone afterwards, with the other
    files of the recording and the record of its repair. OSError where it cannot be fetched."""
    if is_local(uri):
        yield local_path(uri)
        return
    folder = Path(tempfile.mkdtemp(prefix="nineaudit-"))
    try:
        own = part_of(Path(split(uri)[1]), parts)
        depth = own.depth if own else 1
        with asked():
            for file in recording_files(uri, parts):
                for one in _with_company(file):
                    _fetch(one, folder / _below(one, uri, depth))
        yield folder / _below(uri, uri, depth)
    finally:
        shutil.rmtree(folder, ignore_errors=True)


def _fetch(uri: str, place: Path) -> None:
    from fsspec.core import url_to_fs

    place.parent.mkdir(parents=True, exist_ok=True)
    fs, path = url_to_fs(uri)
    fs.get_file(path, str(place))


def _with_company(uri: str) -> list[str]:
    """A file with those that are read with it: the record of its repair; the channels of a .mme file.

    A worker lives long: what it was told of the store before is forgotten."""
    from fsspec.core import url_to_fs

    fs, path = url_to_fs(uri)
    fs.invalidate_cache()
    if name_of(uri).lower().endswith(".mme"):
        return sorted({uri, *(on_path(uri, lambda _, f=f: Path(f)) for f in _beside(fs, path))})  # type: ignore[misc]
    beside = on_path(uri, lambda at: at.with_name(at.name + SIDECAR))
    return [uri, *([beside] if fs.exists(url_to_fs(beside)[1]) else [])]


def _beside(fs: Any, path: str) -> Iterator[str]:
    """The files in the folder of a .mme file and in its folder Channel."""
    for name, kind in _listed(fs, fs._parent(path)):
        if kind == "directory" and name.rpartition("/")[2].lower() == "channel":
            yield from (one for one, what in _listed(fs, name) if what == "file")
        elif kind == "file":
            yield name


def _listed(fs: Any, folder: str) -> Iterator[tuple[str, str]]:
    """(name, "file" or "directory") of what is in a folder; of a symbolic link, what it leads to."""
    for entry in fs.ls(folder, detail=True):
        name, kind = str(entry["name"]).rstrip("/"), str(entry["type"])
        if kind not in ("file", "directory"):
            kind = "directory" if fs.isdir(name) else "file" if fs.isfile(name) else kind
        yield name, kind


def _signature(uri: str) -> str | None:
    """Of a file that may be renamed: the name is in it."""
    from fsspec.core import url_to_fs

    fs, path = url_to_fs(uri)
    try:
        if is_local(uri):
            stat = Path(path).stat()
            return f"{name_of(uri)} {stat.st_size} {stat.st_mtime_ns}"
        info = fs.info(path)
    except FileNotFoundError:
        return None
    tag = next((info[key] for key in _TELLING if info.get(key)), None)
    return None if tag is None else f"{name_of(uri)} {info.get('size')} {tag}"


def _below(uri: str, first: str, depth: int) -> Path:
    """The path of a file as seen from the folder of the recording whose file `first` has `depth` names."""
    home = PurePosixPath(split(first)[1]).parts[:-depth]
    return Path(*PurePosixPath(split(uri)[1]).parts[len(home) :])


def _normal(path: Path) -> Path:
    """The path without its ``..``, where they can be told."""
    kept: list[str] = []
    for part in path.parts:
        if part == ".." and kept and kept[-1] != "..":
            kept.pop()
        else:
            kept.append(part)
    return Path(*kept)
