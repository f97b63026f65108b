"""Which recordings a campaign has: folders, globs, archives, tables, anywhere fsspec knows.

- A folder, with the folders below it: every file that a reader knows by its suffix. Hidden files and folders are left
  out, lakes, and what lies beside recordings (BESIDE: README.txt). A folder with a .mme file is one recording, named
  by that file.
- A glob (``s3://bucket/2025/**/*.mf4``): of what it matches, the same.
- A ZIP archive: with one .mme file it is one recording; else every file in it as of a folder (``zip://T1.csv::a.zip``).
- A table (CSV, TSV, Parquet, JSON lines) with a column ``recording``: one row a recording. ``recording``, ``rig`` and
  ``dbc`` are relative to the table; every other column is said of the test (number, item, date, ...).
- A recording.

Files of one recording (the rig's parts) are one, named by its first part.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from fnmatch import fnmatchcase
from pathlib import PurePosixPath
from typing import TYPE_CHECKING, Any, Final

from nineaudit.campaign.places import child, is_local, name_of, on_path, recording_files, split
from nineaudit.campaign.source_tables import is_table, rows
from nineaudit.errors import ConfigurationError

if TYPE_CHECKING:
    from nineaudit.parts import Part

_GLOB: Final = frozenset("*?[")
BESIDE: Final = ("readme*", "license*.txt", "licence*.txt", "changelog*.txt", "*sums.txt", "thumbs.db")
"""Names, in small letters, of what lies in a folder of recordings and is none, though its suffix is that of one."""


@dataclass(frozen=True)
class Found:
    """A recording: its `uri`, its `rig` and `dbc` where a table says so, what a table says of its `test`, and where
    it was named (`place`)."""

    uri: str
    rig: str | None = None
    dbc: tuple[str, ...] = ()
    test: Mapping[str, str] = field(default_factory=dict)
    place: str = ""


def find(
    sources: Sequence[str],
    parts: Callable[[Found], Sequence[Part]],
    without: str = "",
    exclude: Sequence[str] = (),
) -> Iterator[Found]:
    """The recordings of the sources, in their order, each once.

    `parts` gives the parts of the rig of a recording. `without`: a lake, whose files are none. `exclude`: patterns of
    what is none in folders, globs and archives, by its name or by its path.
    ConfigurationError: a source that is not there or holds no recording, one named twice, a table that is wrong.
    """
    seen: dict[str, str] = {}
    for source in sources:
        count = 0
        for found in _as_one(_of(source, without, exclude), parts):
            count += 1
            if found.uri in seen:
                first, second = seen[found.uri] or source, found.place or source
                advice = f"it is in {first} and in {second}: name it once" if first != second else "name it once"
                raise ConfigurationError("the recording is named twice", file=found.uri, advice=advice)
            seen[found.uri] = found.place or source
            yield found
        if not count:
            raise ConfigurationError(
                "no recording in it", file=source, expected="files with a suffix such as .csv, .mf4, .blf, .mcap, .mme"
            )


def _of(source: str, without: str, exclude: Sequence[str]) -> Iterator[Found]:
    """What one source names."""
    protocol, path, rest = split(source)
    if _GLOB & set(path) and not _exists(source):
        return _in_files(_matches(source), without, exclude)
    if not _exists(source):
        raise ConfigurationError("no such file or folder", file=source)
    if not rest and is_table(source):
        return _in_table(source)
    if name_of(source).lower().endswith(".zip") and protocol != "zip://":
        return _in_archive(source, exclude)
    return _in_files(_below(source), without, exclude) if _is_folder(source) else iter([Found(source)])


def _as_one(found: Iterable[Found], parts: Callable[[Found], Sequence[Part]]) -> Iterator[Found]:
    """One for each recording of several files; a file that is named twice by itself stays."""
    firsts: set[str] = set()
    for one in found:
        own = parts(one)
        first = recording_files(one.uri, own)[0] if own else one.uri
        several = own and len(recording_files(one.uri, own)) > 1
        if several and first in firsts:
            continue
        firsts.add(first)
        yield Found(first, one.rig, one.dbc, one.test, one.place)


def _in_table(table: str) -> Iterator[Found]:
    for place, row in rows(table):
        recording, rig = row.pop("recording"), row.pop("rig", None)
        dbc = tuple(child(table, name.strip()) for name in row.pop("dbc", "").split(";") if name.strip())
        yield Found(child(table, recording), child(table, rig) if rig else None, dbc, row, place)


def _in_archive(archive: str, exclude: Sequence[str]) -> Iterator[Found]:
    from nineaudit.readers import READERS

    inside = f"zip://::{archive}"
    names = [name for name in _below(inside) if not _left_out(name, exclude)]
    tests = [name for name in names if name_of(name).lower().endswith(".mme")]
    if len(tests) == 1 and not any(_suffix(name) in READERS and name not in tests for name in names):
        return iter([Found(archive)])
    return _in_files(names, "", exclude)


def _left_out(uri: str, exclude: Sequence[str]) -> bool:
    """Whether a file is no recording by its name: of those that lie beside recordings everywhere, or as asked."""
    name, path = name_of(uri), split(uri)[1]
    beside = any(fnmatchcase(name.lower(), one) for one in BESIDE)
    return beside or any(fnmatchcase(name, one) or fnmatchcase(path, one) for one in exclude)


def _in_files(names: Iterable[str], without: str, exclude: Sequence[str]) -> Iterator[Found]:
    """Those that are recordings."""
    from nineaudit.readers import READERS

    for name in names:
        if _left_out(name, exclude):
            continue
        if _suffix(name) in READERS and not (without and _absolute(name).startswith(f"{without}/")):
            yield Found(name)


def _suffix(uri: str) -> str:
    return PurePosixPath(name_of(uri)).suffix.lower()


def _below(folder: str) -> Iterator[str]:
    """The files of a folder and of those below it, sorted; hidden ones and lakes left out."""
    fs, root = _opened(folder)
    for home, folders, files in fs.walk(root, on_error=_unreadable):
        if "lake.json" in files and "results" in folders:
            folders.clear()
            continue
        for name in [name for name in folders if name.startswith(".")]:
            _drop(folders, name)
        yield from (_named(folder, root, f"{home.rstrip('/')}/{name}") for name in sorted(files) if name[:1] != ".")


def _unreadable(error: OSError) -> None:
    """A folder that cannot be listed is not left out without a word; one that went meanwhile has nothing in it."""
    if isinstance(error, FileNotFoundError):
        return
    raise ConfigurationError(f"cannot be listed: {error.strerror or error}", file=error.filename) from error


def _drop(folders: Any, name: str) -> None:
    """Take a folder out of a walk (a list, or a table by name)."""
    folders.pop(name) if isinstance(folders, dict) else folders.remove(name)


def _matches(pattern: str) -> Iterator[str]:
    """The files that a glob matches, sorted."""
    fs, path = _opened(pattern)
    start = _plain(pattern)
    home = _opened(start)[1] if start else _opened(".")[1]
    for name in sorted(fs.glob(path)):
        if fs.isfile(name):
            yield _named(start, home, str(name))


def _plain(pattern: str) -> str:
    """The folder of a glob before its first wildcard, as it was written."""
    protocol, path, rest = split(pattern)
    kept = []
    for part in path.split("/")[:-1]:
        if _GLOB & set(part):
            break
        kept.append(part)
    return f"{protocol}{'/'.join(kept)}{rest}"


def _named(folder: str, root: str, full: str) -> str:
    """A file as seen from a folder as the folder was written."""
    below = full.removeprefix(root.rstrip("/")).lstrip("/")
    if not folder or folder.endswith("://"):
        return folder + below
    if split(folder)[2]:
        protocol, path, rest = split(folder)
        return f"{protocol}{path.rstrip('/') + '/' if path else ''}{below}{rest}"
    return on_path(folder, lambda at: at / below) if is_local(folder) else f"{folder.rstrip('/')}/{below}"


def _opened(uri: str) -> tuple[Any, str]:
    from fsspec.core import url_to_fs

    try:
        fs, path = url_to_fs(uri)
    except (ImportError, ValueError, OSError) as error:
        raise ConfigurationError(f"cannot be opened: {error}", file=uri) from error
    return fs, str(path)


def _exists(uri: str) -> bool:
    fs, path = _opened(uri)
    try:
        return bool(fs.exists(path))
    except OSError as error:
        raise ConfigurationError(f"cannot be opened: {error}", file=uri) from error


def _is_folder(uri: str) -> bool:
    fs, path = _opened(uri)
    return bool(fs.isdir(path))


def _absolute(uri: str) -> str:
    return _opened(uri)[1]
