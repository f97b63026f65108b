"""Which recordings a campaign has: folders, globs, archives, tables, anywhere fsspec knows.

- A folder, with the folders below it and those that links lead to: every file that a reader knows by its suffix.
  Hidden files and folders are left out, lakes, and what lies beside recordings (BESIDE: README.txt). An ISO-MME test is
  one recording, named by its .mme file: its comment file and its folders (walking.OF_A_TEST) are none of their own.
- A glob (``s3://bucket/2025/**/*.mf4``): of what it matches, the same.
- A ZIP archive: where it holds one ISO-MME test it is one recording; else every file in it as of a folder
  (``zip://T1.csv::a.zip``).
- A table (CSV, TSV, Parquet, JSON lines) with a column ``recording``: one row a recording. ``recording``, ``rig`` and
  ``dbc`` are relative to the table; every other column is said of the test (number, item, date, ...).
- A recording.

Files of one recording (the rig's parts) are one, named by its first part.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from fnmatch import fnmatchcase
from pathlib import PurePosixPath
from typing import TYPE_CHECKING, Final

from nineaudit.campaign.places import child, is_local, local_path, recording_files, split
from nineaudit.campaign.source_tables import is_table, rows
from nineaudit.campaign.walking import GLOB, File, below, exists, is_folder, matches, opened
from nineaudit.errors import ConfigurationError

if TYPE_CHECKING:
    from nineaudit.parts import Part

BESIDE: Final = ("readme*", "license*.txt", "licence*.txt", "changelog*.txt", "*sums.txt", "thumbs.db")
"""Names, in small letters, of what lies in a folder of recordings and is none, though its suffix is that of one."""
_EXCLUDE: Final = "leave it out with --exclude"


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
    what is none in folders, globs and archives, by its name or by its path, and of folders that are not entered.
    ConfigurationError: a source that is not there, cannot be asked or holds no recording, a recording that is named
    twice or by a name that cannot be kept, a table that is wrong.
    """
    seen: dict[str, str] = {}
    for source in sources:
        count = 0
        for found in _as_one(_of(source, without, exclude), parts):
            count += 1
            _require_usable(found.uri)
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
    _require_usable(source)
    protocol, path, rest = split(source)
    there = exists(source)
    if GLOB & set(path) and not there:
        return _in_files(matches(source, lambda path: _excluded(path, exclude)), without, exclude)
    if not there:
        raise ConfigurationError("no such file or folder", file=source)
    if is_folder(source):
        return _in_files(below(source, lambda path: _excluded(path, exclude)), without, exclude)
    if not rest and is_table(source):
        return _in_table(source)
    if _suffix(path) == ".zip" and protocol != "zip://":
        return _in_archive(source, exclude)
    return iter([Found(source)])


def _require_usable(uri: str) -> None:
    """ConfigurationError: the name cannot be written into a lake, or opening the file may never end."""
    try:
        uri.encode()
    except UnicodeEncodeError as error:
        name = uri.encode(errors="backslashreplace").decode()
        raise ConfigurationError("its name is not UTF-8", file=name, advice=f"rename it, or {_EXCLUDE}") from error
    at = local_path(uri)
    if is_local(uri) and not os.path.isfile(at) and not os.path.isdir(at) and os.path.exists(at):
        raise ConfigurationError("is neither a file nor a folder", file=uri, advice=_EXCLUDE)


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
    """One recording where it holds one ISO-MME test and nothing else, or cannot be opened: its reader salvages such."""
    try:
        files = below(f"zip://::{archive}", lambda path: _excluded(path, exclude))
    except ConfigurationError:
        return iter([Found(archive)])
    found = list(_in_files(files, "", exclude))
    headers = any(_suffix(file.path) == ".mme" for file in files)
    channels = any("channel" in file.path.lower().split("/") for file in files)
    one = not headers and channels if not found else len(found) == 1 and _suffix(split(found[0].uri)[1]) == ".mme"
    return iter([Found(archive)] if one else found)


def _in_files(files: Iterable[File], without: str, exclude: Sequence[str]) -> Iterator[Found]:
    """Those that are recordings."""
    from nineaudit.readers import READERS

    for uri, path in files:
        if _suffix(path) not in READERS or _left_out(path, exclude):
            continue
        if "::" in path:
            what = "its name has ::, which stands for an archive"
            raise ConfigurationError(what, file=uri, advice=f"rename it, or {_EXCLUDE}")
        if not (without and opened(uri)[1].startswith(f"{without}/")):
            yield Found(uri)


def _left_out(path: str, exclude: Sequence[str]) -> bool:
    """Whether a file is no recording by its name: of those that lie beside recordings everywhere, or as asked."""
    name = PurePosixPath(path).name.lower()
    return any(fnmatchcase(name, one) for one in BESIDE) or _excluded(path, exclude)


def _excluded(path: str, exclude: Sequence[str]) -> bool:
    return any(fnmatchcase(PurePosixPath(path).name, one) or fnmatchcase(path, one) for one in exclude)


def _suffix(path: str) -> str:
    return PurePosixPath(path).suffix.lower()
