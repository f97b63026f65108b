"""The lake: where a campaign keeps its results. One JSON document a recording is the truth; tables are made from it.

    lake.json                              {"schema": "nineaudit/lake/1"}
    head.json                              {"edition"}: the newest
    rigs/<sha256>.toml                     each rig file as used
    inputs/<sha256>.json                   what an audit needs besides the recording (settings.py)
    results/<u2>/<u>/<key>.json            an entry; u = sha256(uri)[:32], u2 = its first two characters
    editions/<edition>/<u2>/<u>.json       {"key", "uri", ...}: the current entry of a uri (edition: rules and tool)
    stats/<u2>/<u>.json                    size, time or etag, and sha256 of the recording as it was read
    reports/<u>-<key>.html                 of those asked for
    runs/<utc>-<id>-<n>.jsonl              what varies: seconds, host, attempts

Any place that fsspec knows. Writes are atomic: a local file is renamed into its place, an object is put at once.
"""

from __future__ import annotations

import hashlib
import json
import os
import uuid
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

from nineaudit.campaign.stores import told
from nineaudit.errors import ConfigurationError
from nineaudit.files import settle

LAKE: Final = "nineaudit/lake/1"
ENTRY: Final = "nineaudit/lake-entry/1"
_AT_ONCE: Final = 256
"""Documents that are asked for together."""


@dataclass(frozen=True)
class Lake:
    """A place to keep results: `root` on the file system `fs` (fsspec); `uri` as it was named."""

    fs: Any
    root: str
    uri: str

    @property
    def local(self) -> bool:
        return "file" in _protocols(self.fs)

    def place(self, name: str) -> str:
        """The full path of a name such as ``results/ab/...``."""
        return f"{self.root}/{name}"


def open_lake(uri: str | os.PathLike[str], create: bool = False) -> Lake:
    """The lake at any fsspec URI (a folder, s3://, memory://). ConfigurationError: it is none, or cannot be made."""
    from nineaudit.campaign.extra import require

    require("fsspec")
    from fsspec.core import url_to_fs

    named = os.fspath(uri)
    with told(named, "cannot be opened"):
        fs, root = url_to_fs(named)
    lake = Lake(fs, root.rstrip("/"), named)
    _require_lake(lake, create)
    return lake


def entry_name(uri: str, key: str) -> str:
    """Where the entry of a recording stands."""
    return f"results/{hashed(uri)}/{key}.json"


def hashed(uri: str) -> str:
    """``u2/u`` of a uri."""
    u = hashlib.sha256(uri.encode()).hexdigest()[:32]
    return f"{u[:2]}/{u}"


def report_name(uri: str, key: str) -> str:
    """Where the report of an entry stands."""
    return f"reports/{hashed(uri).rpartition('/')[2]}-{key}.html"


def edition_of(rules_sha256: str, version: str) -> str:
    """The edition: rules and version of the tool."""
    return hashlib.sha256(f"{rules_sha256}\0{version}".encode()).hexdigest()[:12]


def write_entry(lake: Lake, entry: Mapping[str, Any], **pointer: Any) -> None:
    """Write an entry, then make it the current one of its uri and edition. `pointer`: more keys of the pointer."""
    write(lake, entry_name(entry["uri"], entry["key"]), entry)
    point(lake, entry["edition"], entry["uri"], entry["key"], **pointer)


def point(lake: Lake, edition: str, uri: str, key: str, **more: Any) -> None:
    """Make an entry the current one of its uri in an edition; one that could not be finished (`transient`) and was
    current until now goes. `more`: other keys of the pointer."""
    before = current(lake, edition, uri)
    write(lake, _pointer(edition, uri), {"key": key, "uri": uri, **more})
    if before and before.get("transient") and before["key"] != key:
        remove(lake, entry_name(uri, before["key"]))


def current(lake: Lake, edition: str, uri: str) -> dict[str, Any] | None:
    """The pointer of a uri in an edition; None where there is none."""
    return read(lake, _pointer(edition, uri))


def read_entry(lake: Lake, uri: str, key: str) -> dict[str, Any] | None:
    """An entry; None where there is none."""
    return read(lake, entry_name(uri, key))


def entries(lake: Lake, edition: str | None = None) -> Iterator[dict[str, Any]]:
    """The current entries of an edition (default: the newest) in the order of their uris."""
    edition = edition or head(lake)
    if edition is None:
        return
    pointers = (pointer for _, pointer in documents(lake, _names(lake, f"editions/{edition}")))
    found = sorted((pointer["uri"], entry_name(pointer["uri"], pointer["key"])) for pointer in pointers)
    for _, entry in documents(lake, [name for _, name in found]):
        yield entry


def documents(lake: Lake, names: Sequence[str]) -> Iterator[tuple[str, dict[str, Any]]]:
    """(name, document) of each that is there, some hundred at once (object stores are asked in parallel)."""
    for start in range(0, len(names), _AT_ONCE):
        batch = names[start : start + _AT_ONCE]
        for name, data in zip(batch, contents(lake, batch), strict=True):
            if not isinstance(data, FileNotFoundError):
                yield name, _parsed(data, lake.place(name))


def contents(lake: Lake, names: Sequence[str]) -> list[bytes | Exception]:
    """The bytes of each, or why there are none. By ranges, which is all of it: `cat` takes ``[`` in a folder for a
    pattern."""
    places = [lake.place(name) for name in names]
    found: list[bytes | Exception] = lake.fs.cat_ranges(places, None, None, on_error="return") if places else []
    return found


def editions(lake: Lake) -> list[str]:
    """The editions of which there are entries, in the order of their names."""
    return sorted({name.split("/")[1] for name in _names(lake, "editions")})


def make_newest(lake: Lake, edition: str) -> None:
    """Make an edition, of which there is an entry by now, the newest."""
    if head(lake) != edition:
        write(lake, "head.json", {"edition": edition})


def head(lake: Lake) -> str | None:
    """The edition of the newest run that audited something; None where there was none."""
    document = read(lake, "head.json")
    return None if document is None else str(document["edition"])


def read(lake: Lake, name: str) -> dict[str, Any] | None:
    """A JSON document of the lake; None where there is none. ConfigurationError where it is no JSON."""
    try:
        return _parsed(lake.fs.cat_file(lake.place(name)), lake.place(name))
    except FileNotFoundError:
        return None


def write(lake: Lake, name: str, document: Mapping[str, Any]) -> None:
    """Write a document: whole or not at all."""
    write_text(lake, name, json.dumps(document, indent=1, ensure_ascii=False, allow_nan=False) + "\n")


def write_text(lake: Lake, name: str, text: str) -> None:
    """Write a text: whole or not at all."""
    write_bytes(lake, name, text.encode())


def write_bytes(lake: Lake, name: str, data: bytes) -> None:
    """Write a file: whole or not at all."""
    if lake.local:
        place = Path(lake.place(name))
        place.parent.mkdir(parents=True, exist_ok=True)
        _write_whole(place, data)
    else:
        lake.fs.pipe_file(lake.place(name), data)


def _write_whole(place: Path, data: bytes) -> None:
    partial = place.with_name(f".{place.name}.{uuid.uuid4().hex}")  # containers on one file system share numbers
    try:
        partial.write_bytes(data)
        settle(partial, place)
    finally:
        partial.unlink(missing_ok=True)


def exists(lake: Lake, name: str) -> bool:
    """Whether there is a document of this name."""
    return bool(lake.fs.exists(lake.place(name)))


def remove(lake: Lake, name: str) -> None:
    """Remove a document, if it is there."""
    if exists(lake, name):
        lake.fs.rm_file(lake.place(name))


def _names(lake: Lake, folder: str) -> list[str]:
    """The documents below a folder, sorted, as seen from the lake."""
    lake.fs.invalidate_cache()
    below = lake.place(folder)
    found = lake.fs.find(below) if lake.fs.exists(below) else []
    return sorted(str(name).removeprefix(f"{lake.root}/") for name in found if str(name).endswith(".json"))


def _parsed(data: object, place: str) -> dict[str, Any]:
    if isinstance(data, Exception):
        raise data
    assert isinstance(data, bytes)
    try:
        return dict(json.loads(data))
    except ValueError as error:
        raise ConfigurationError("is no JSON document", file=place) from error


def _pointer(edition: str, uri: str) -> str:
    return f"editions/{edition}/{hashed(uri)}.json"


def _require_lake(lake: Lake, create: bool) -> None:
    with told(lake.uri, "cannot be opened"):
        found = read(lake, "lake.json")
        if found is None and create:
            write(lake, "lake.json", {"schema": LAKE})
            return
    if found is None:
        raise ConfigurationError("is no lake", file=lake.uri, advice="`nineaudit campaign run` makes one")
    if found.get("schema") != LAKE:
        raise ConfigurationError("is no lake of this version", file=lake.uri, found=found.get("schema"), expected=LAKE)


def _protocols(fs: Any) -> tuple[str, ...]:
    return (fs.protocol,) if isinstance(fs.protocol, str) else tuple(fs.protocol)
