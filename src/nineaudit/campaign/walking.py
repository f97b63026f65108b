"""The files of a folder, of what is below it, and of a pattern, anywhere fsspec knows.

fsspec's own walk passes over what it cannot list and lists a link to a folder as a file; its glob takes hidden files.
"""

from __future__ import annotations

import os
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from fnmatch import fnmatchcase
from pathlib import Path
from typing import Any, Final, NamedTuple

from nineaudit.campaign.places import is_local, split
from nineaudit.campaign.stores import told
from nineaudit.readers.mme.files import BROKEN

GLOB: Final = frozenset("*?[")
OF_A_TEST: Final = frozenset({"channel", "diagram", "document", "movie", "photo", "report", "static"})
"""Folders, in small letters, of an ISO-MME test, beside its .mme file; not compared with the text of ISO/TS 13499."""

Skip = Callable[[str], bool]
"""Whether the folder of a path, as it is written, is left out."""


class File(NamedTuple):
    """A file, and its path as seen from the folder as that was written."""

    uri: str
    path: str


class _Listing(NamedTuple):
    """What is in a folder, sorted: folders, links to folders, everything else."""

    folders: list[str]
    links: list[str]
    files: list[str]


@dataclass(frozen=True)
class _Home:
    """A folder as it was written (`uri`), in its file system there called `root`; which folders are left out."""

    uri: str
    fs: Any
    root: str
    skip: Skip

    def written(self, full: str) -> File:
        """What is below it as the user would write it."""
        protocol, path, rest = split(self.uri)
        below = full.removeprefix(self.root.rstrip("/")).lstrip("/")
        if is_local(self.uri):
            path = (Path(path) / below).as_posix()
        else:
            path = f"{path.rstrip('/')}/{below}" if path else below
        return File(f"{protocol}{path}{rest}", path)

    def own_name(self, folder: str) -> str:
        """One name for a folder, however it was come to."""
        return os.path.realpath(folder) if is_local(self.uri) else folder

    def entered(self, folders: Iterable[str]) -> list[str]:
        """Those that are not left out."""
        return [folder for folder in folders if not self.skip(self.written(folder).path)]


def below(folder: str, skip: Skip) -> list[File]:
    """The files of a folder and of those below it, sorted; left out are hidden ones, lakes, and what belongs to the
    ISO-MME test of a .mme file beside it.

    Links to folders are followed; a folder that is come to twice is listed once, by its own name where that is below.
    ConfigurationError: a folder cannot be listed."""
    home = _Home(folder, *opened(folder), skip)
    return _sorted(home, (file for _, files in _walk(home, home.root) for file in files))


def matches(pattern: str, skip: Skip) -> list[File]:
    """The files that a pattern matches, sorted.

    As in a shell ``**`` stands for any folders and what is hidden must be named, and so must what belongs to a test; a
    name with brackets that is there is that name. ConfigurationError: a folder cannot be listed."""
    start, parts = _plain(pattern)
    home = _Home(start, *opened(start or "."), skip)
    return _sorted(home, set(_expanded(home, home.root, parts)))


def opened(uri: str) -> tuple[Any, str]:
    """(file system, path in it) of a uri. ConfigurationError."""
    from fsspec.core import url_to_fs

    with told(uri, "cannot be opened", also=BROKEN):
        fs, path = url_to_fs(uri)
        return fs, str(path)


def exists(uri: str) -> bool:
    """Whether something is there. ConfigurationError where the store cannot be asked."""
    fs, path = opened(uri)
    with told(uri, "cannot be opened", also=BROKEN):
        return bool(fs.exists(path))


def is_folder(uri: str) -> bool:
    """Whether it is a folder. ConfigurationError where the store cannot be asked."""
    fs, path = opened(uri)
    with told(uri, "cannot be opened", also=BROKEN):
        return bool(fs.isdir(path))


def _sorted(home: _Home, files: Iterable[str]) -> list[File]:
    return sorted(map(home.written, files), key=lambda file: file.path)


def _walk(home: _Home, root: str) -> Iterator[tuple[str, list[str]]]:
    """(folder, its files) of a folder and of those below it, links last."""
    folders, links, seen = [root], deque[str](), set[str]()
    while folders or links:
        folder = folders.pop() if folders else links.popleft()
        if home.own_name(folder) in seen:
            continue
        seen.add(home.own_name(folder))
        listing = _listed(home, folder)
        if "lake.json" in map(_name, listing.files) and "results" in map(_name, listing.folders):
            continue
        shown = _shown(listing)
        folders += home.entered(shown.folders)
        links += home.entered(shown.links)
        yield folder, shown.files


def _expanded(home: _Home, folder: str, parts: list[str]) -> Iterator[str]:
    """The files below a folder that the parts of a pattern match, some perhaps twice."""
    first, *rest = parts
    if first == "**":
        for place, files in _walk(home, folder):
            yield from _expanded(home, place, rest) if rest else files
        return
    listing = _listed(home, folder)
    shown = listing if first.startswith(".") else _shown(listing)
    if not rest:
        yield from _fitting(first, listing.files, shown.files)
        return
    all_folders = [*listing.folders, *listing.links]
    for place in home.entered(_fitting(first, all_folders, [*shown.folders, *shown.links])):
        yield from _expanded(home, place, rest)


def _fitting(part: str, paths: list[str], among: list[str]) -> list[str]:
    """The one of the paths that is called so, else those among some of them that the pattern matches."""
    named = [path for path in paths if _name(path) == part]
    return named or [path for path in among if fnmatchcase(_name(path), part)]


def _listed(home: _Home, folder: str) -> _Listing:
    """What is in a folder; nothing in one that went meanwhile."""
    listing = _Listing([], [], [])
    with told(home.written(folder).uri, "cannot be listed", "leave it out with --exclude", BROKEN):
        try:
            entries = home.fs.ls(folder, detail=True)
        except FileNotFoundError:
            return listing
        named = {str(entry["name"]).rstrip("/"): str(entry["type"]) for entry in entries}
        for path in sorted(named.keys() - {folder.rstrip("/")}):
            if named[path] == "directory":
                listing.folders.append(path)
            else:
                linked = named[path] != "file" and home.fs.isdir(path)
                (listing.links if linked else listing.files).append(path)
    return listing


def _shown(listing: _Listing) -> _Listing:
    """Without what is hidden and what belongs to a test: its comment file, its folders."""
    folders, links, files = ([path for path in paths if not _name(path).startswith(".")] for paths in listing)
    tests = {path[: -len(".mme")].lower() for path in files if path.lower().endswith(".mme")}
    if tests:
        folders, links = (
            [path for path in paths if _name(path).lower() not in OF_A_TEST] for paths in (folders, links)
        )
    return _Listing(folders, links, [path for path in files if path.lower() not in {f"{test}.txt" for test in tests}])


def _name(path: str) -> str:
    return path.rpartition("/")[2]


def _plain(pattern: str) -> tuple[str, list[str]]:
    """The folder of a pattern before its first wildcard, as it was written, and the parts that follow."""
    protocol, path, rest = split(pattern)
    parts = path.split("/")
    first = next(i for i, part in enumerate(parts) if GLOB & set(part))
    start = "/".join(parts[:first]) or "/" * bool(first)
    return f"{protocol}{start}{rest}", [*filter(None, parts[first:-1]), parts[-1]]
