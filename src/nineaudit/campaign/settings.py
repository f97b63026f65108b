"""What an audit needs besides the recording: rig, CAN databases, rule sheets, waivers, as one document.

A worker on another machine finds it in the lake (inputs/<sha256>.json), and so does who asks in five years with what a
recording was judged. Files are put into a folder of their own to be loaded as they are on the command line.
"""

from __future__ import annotations

import base64
import datetime as dt
import hashlib
import json
import os
import tempfile
import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path, PurePosixPath
from typing import TYPE_CHECKING, Any

from nineaudit.campaign.places import child, name_of, read_bytes
from nineaudit.errors import ConfigurationError

if TYPE_CHECKING:
    from nineaudit.rig import Rig
    from nineaudit.rulebook import Rulebook
    from nineaudit.waivers import Waiver

Document = Mapping[str, Any]


@dataclass(frozen=True, eq=False)
class Setting:
    """A `document` as it is loaded: the `rig`, the `rulebook`, the `waivers` (None: no file was given), and the CAN
    databases that take the place of the rig's (`dbc`), all in `folder`."""

    document: Document
    rig: Rig
    rulebook: Rulebook
    waivers: tuple[Waiver, ...] | None
    dbc: tuple[Path, ...]
    folder: Path
    held: tempfile.TemporaryDirectory[str]
    """The folder goes with the setting."""

    @property
    def edition(self) -> str:
        """Of the rules and of the version of the tool."""
        from nineaudit.auditing import versions
        from nineaudit.campaign.lake import edition_of

        return edition_of(self.rulebook.sha256, versions()["version"])

    def parts_of_key(self, today: dt.date) -> list[object]:
        """What an entry depends on besides the recording: rig (its name may be that of its file), databases, rules,
        tool, waivers and which hold."""
        from nineaudit.auditing import versions

        held = [waiver.holds(today) for waiver in self.waivers or ()]
        files = {name: self.document[name] for name in ("databases", "dbc", "waivers")}
        return [self.rig.sha256, self.rig.name, self.rulebook.sha256, versions()["version"], _sha256(files), held]


def collect(
    rig: str | os.PathLike[str],
    *,
    dbc: Sequence[str | os.PathLike[str]] = (),
    rules: str | os.PathLike[str] | None = None,
    select: str | None = None,
    ignore: str | None = None,
    waivers: str | os.PathLike[str] | None = None,
) -> Document:
    """Read the files of a setting, wherever they are (fsspec). ConfigurationError: one cannot be read or is wrong."""
    named = os.fspath(rig)
    data = read_bytes(named, "cannot read the rig file")
    document = {
        "rig": {"name": name_of(named), **_coded(data)},
        "databases": {name: _coded(read_bytes(child(named, name), _NO_DATABASE)) for name in _databases(data)},
        "dbc": [{"name": name_of(os.fspath(p)), **_coded(read_bytes(os.fspath(p), _NO_DATABASE))} for p in dbc],
        "rules": None if rules is None else _sheets(Path(rules)),
        "select": select,
        "ignore": ignore,
        "waivers": None if waivers is None else {"name": Path(waivers).name, **_coded(_file(waivers))},
    }
    load(document, named)
    return document


_NO_DATABASE = "cannot read the CAN database"


def identity(document: Document) -> str:
    """SHA-256 of a setting."""
    return _sha256(document)


def load(document: Document, rig: str | None = None) -> Setting:
    """The setting of a document; the same again for the same document. ConfigurationError as of the files themselves;
    of the rig file it names `rig`."""
    try:
        return _loaded(json.dumps(document, sort_keys=True))
    except ConfigurationError as error:
        if rig is None or error.file is None or Path(error.file).name != name_of(rig):
            raise
        raise ConfigurationError(str(error).replace(str(error.file), rig)) from error


@lru_cache(maxsize=64)
def _loaded(text: str) -> Setting:
    from nineaudit.checking import load_book
    from nineaudit.rig import load_rig
    from nineaudit.waivers import load_waivers

    document = json.loads(text)
    held = tempfile.TemporaryDirectory(prefix="nineaudit-")
    folder = Path(held.name)
    home = folder / "rig" / "/".join(["in"] * _depth(document["databases"]))
    for name, file in document["databases"].items():
        if not _absolute(name):
            _put(home / name, file)
    rig = load_rig(_put(home / document["rig"]["name"], document["rig"]))
    dbc = tuple(_put(folder / "dbc" / str(i) / file["name"], file) for i, file in enumerate(document["dbc"]))
    for name, file in (document["rules"] or {}).items():
        _put(folder / "rules" / name, file)
    rules = folder / "rules" if document["rules"] is not None else None
    book = load_book(rules, document["select"], document["ignore"])
    given = document["waivers"]
    waivers = None if given is None else load_waivers(_put(folder / given["name"], given), load_book(rules).codes)
    return Setting(document, rig, book, waivers, dbc, folder, held)


def _databases(data: bytes) -> list[str]:
    """The names of the CAN databases in a rig file; none where it is no TOML (it is loaded next, and says so)."""
    try:
        table = tomllib.loads(data.decode("utf-8-sig")).get("recording", {})
    except ValueError:
        return []
    named = table.get("dbc", []) if isinstance(table, dict) else []
    return [name for name in named if isinstance(name, str)] if isinstance(named, list) else []


def _sheets(folder: Path) -> dict[str, Any]:
    """The rule sheets of a folder."""
    return {path.name: _coded(path.read_bytes()) for path in sorted(folder.glob("*.toml"))}


def _file(path: str | os.PathLike[str]) -> bytes:
    return read_bytes(os.fspath(path), "cannot be read")


def _coded(data: bytes) -> dict[str, str]:
    """Bytes as text where they are, so that the document can be read; else as base64."""
    try:
        text = data.decode("utf-8")
    except UnicodeDecodeError:
        return {"base64": base64.b64encode(data).decode("ascii")}
    return {"text": text}


def _put(path: Path, file: Mapping[str, str]) -> Path:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(file["text"].encode() if "text" in file else base64.b64decode(file["base64"]))
    return path


def _depth(names: Mapping[str, Any]) -> int:
    """How many folders up the names lead at most."""
    return max((PurePosixPath(name).parts.count("..") for name in names if not _absolute(name)), default=0)


def _absolute(name: str) -> bool:
    return Path(name).is_absolute() or "://" in name


def rig_bytes(document: Document) -> bytes:
    """The rig file as it was read."""
    file = document["rig"]
    return file["text"].encode() if "text" in file else base64.b64decode(file["base64"])


def _sha256(value: object) -> str:
    return hashlib.sha256(json.dumps(value, sort_keys=True).encode()).hexdigest()
