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
import shutil
import tempfile
import tomllib
import weakref
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
class Placed:
    """The files of a document, of each kind those that there are, in a `folder` that goes with this."""

    folder: Path
    rig: tuple[Path]
    dbc: tuple[Path, ...]
    rules: tuple[Path, ...]
    waivers: tuple[Path, ...]


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
    held: Placed
    """The folder goes with it."""

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
    kinds = {"rig": [named], "dbc": dbc, "rules": [rules], "waivers": [waivers]}
    load(document, {kind: [os.fspath(n) for n in names if n is not None] for kind, names in kinds.items()})
    return document


_NO_DATABASE = "cannot read the CAN database"


def identity(document: Document) -> str:
    """SHA-256 of a setting."""
    return _sha256(document)


def load(document: Document, given: Mapping[str, Sequence[str]] | None = None) -> Setting:
    """The setting of a document; the same again for the same document. ConfigurationError as of the files themselves,
    by the names that were `given` for the rig, the databases (dbc), the rules and the waivers."""
    text = json.dumps(document, sort_keys=True)
    try:
        return _loaded(text)
    except ConfigurationError as error:
        raise ConfigurationError(_as_given(str(error), _placed(text), given or {})) from error


@lru_cache(maxsize=64)
def _loaded(text: str) -> Setting:
    from nineaudit.checking import load_book
    from nineaudit.rig import load_rig
    from nineaudit.waivers import load_waivers

    document, placed = json.loads(text), _placed(text)
    rig = load_rig(placed.rig[0])
    rules = next(iter(placed.rules), None)
    book = load_book(rules, document["select"], document["ignore"])
    waivers = [load_waivers(path, load_book(rules).codes) for path in placed.waivers]
    return Setting(document, rig, book, waivers[0] if waivers else None, placed.dbc, placed.folder, placed)


@lru_cache(maxsize=64)
def _placed(text: str) -> Placed:
    document = json.loads(text)
    folder = Path(tempfile.mkdtemp(prefix="nineaudit-"))
    home = folder / "rig" / "/".join(["in"] * _depth(document["databases"]))
    for name, file in document["databases"].items():
        if not _absolute(name):
            _put(home / name, file)
    for name, file in (document["rules"] or {}).items():
        _put(folder / "rules" / name, file)
    placed = Placed(
        folder,
        rig=(_put(home / document["rig"]["name"], document["rig"]),),
        dbc=tuple(_put(folder / "dbc" / str(i) / file["name"], file) for i, file in enumerate(document["dbc"])),
        rules=() if document["rules"] is None else (folder / "rules",),
        waivers=tuple(_put(folder / "waivers" / one["name"], one) for one in (document["waivers"],) if one is not None),
    )
    weakref.finalize(placed, shutil.rmtree, folder, ignore_errors=True)
    return placed


def _as_given(said: str, placed: Placed, given: Mapping[str, Sequence[str]]) -> str:
    """A sentence with the names that were given for files of the folder."""
    for kind, names in given.items():
        for path, name in zip(getattr(placed, kind), names, strict=True):
            said = said.replace(str(path), name)
    return said.replace(f"{placed.folder}{os.sep}", "")


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
    return {path.name: _coded(_file(path)) for path in sorted(folder.glob("*.toml"))}


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
