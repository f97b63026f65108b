"""The current entries of an edition, in the order of their uris, a batch at a time; those that are damaged, or of
something else, are told apart and named."""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any, Final

from nineaudit.campaign.lake import ENTRY, Lake, contents, current, entry_name, hashed
from nineaudit.errors import ConfigurationError, RecordingError
from nineaudit.files import is_sealed

BATCH: Final = 200
"""Documents that are asked for at once: an object store answers them side by side."""
RESULT: Final = "nineaudit/result/1"


@dataclass(frozen=True)
class Damaged:
    """A document of the lake that cannot be used: its `place` in the lake, and `why`."""

    place: str
    why: str


def chosen(lake: Lake, edition: str | None) -> str:
    """An edition of the lake by the beginning of its name, or the newest. ConfigurationError: there is none such, or
    there is no entry in it."""
    from nineaudit.campaign.lake import editions, head

    there = editions(lake)
    newest = head(lake)
    found = [name for name in there if name.startswith(edition or newest or "")]
    if len(found) == 1:
        return found[0]
    none = f"no edition {edition}" if edition else f"no result of its newest edition, {newest}"
    what = "several editions to choose from" if found else none
    raise ConfigurationError(
        what if edition or there else "has no results yet",
        file=lake.uri,
        expected=f"one of {', '.join(there)}" if there else None,
        advice="" if there else "`nineaudit campaign run` makes them",
    )


def current_entries(lake: Lake, edition: str, damaged: list[Damaged]) -> Iterator[dict[str, Any]]:
    """The entries of an edition, sorted by uri; what cannot be used is added to `damaged`."""
    places = sorted(_places(lake, edition, damaged))
    for start in range(0, len(places), BATCH):
        batch = places[start : start + BATCH]
        for (uri, place), data in zip(batch, _read(lake, [place for _, place in batch]), strict=True):
            try:
                entry = _moved(lake, edition, uri) if data is None else checked(data, place)
                if entry["uri"] != uri or entry["edition"] != edition:
                    raise RecordingError(f"is of another recording or edition: {entry['uri']} {entry['edition']}")
                yield entry
            except RecordingError as error:
                damaged.append(Damaged(place, str(error)))


def _moved(lake: Lake, edition: str, uri: str) -> dict[str, Any]:
    """The entry of a recording whose entry went after its pointer was read: a run put another in its place.
    RecordingError."""
    pointer = current(lake, edition, uri)
    place = entry_name(uri, str(pointer["key"])) if pointer else ""
    return checked(_read(lake, [place])[0] if place else None, place)


def checked(data: bytes | None, place: str) -> dict[str, Any]:
    """An entry from its bytes: ours, of this version, whole, under its own name. RecordingError."""
    entry = _object(data)
    result = entry.get("result")
    if entry.get("schema") != ENTRY or not isinstance(result, dict) or result.get("schema") != RESULT:
        found = entry.get("schema"), result.get("schema") if isinstance(result, dict) else None
        raise RecordingError("is of something else, or of another version", found=found, expected=f"{ENTRY}, {RESULT}")
    if not is_sealed(result):
        raise RecordingError("was changed since it was written: the result is not that of its seal")
    uri, key = str(entry.get("uri")), entry.get("key")
    if place != f"results/{hashed(uri)}/{key}.json":
        raise RecordingError(f"stands in the wrong place: it is {key} of {uri}")
    return entry


def _places(lake: Lake, edition: str, damaged: list[Damaged]) -> Iterator[tuple[str, str]]:
    """(uri, name of its entry), in no order."""
    names = _names(lake, f"editions/{edition}")
    for start in range(0, len(names), BATCH):
        batch = names[start : start + BATCH]
        for name, data in zip(batch, _read(lake, batch), strict=True):
            try:
                pointer = _object(data)
                yield str(pointer["uri"]), f"results/{_hashed(name)}/{pointer['key']}.json"
            except RecordingError as error:
                damaged.append(Damaged(name, str(error)))
            except KeyError as error:
                damaged.append(Damaged(name, f"has no {error}"))


def _hashed(pointer: str) -> str:
    """``u2/u`` of the name of a pointer."""
    return pointer.removesuffix(".json").split("/", 2)[2]


def _object(data: bytes | None) -> dict[str, Any]:
    if data is None:
        raise RecordingError("is not there")
    try:
        document = json.loads(data)
    except ValueError as error:
        raise RecordingError(f"is no JSON document: {error}") from error
    if not isinstance(document, dict):
        raise RecordingError("is no JSON object")
    return document


def _read(lake: Lake, names: Sequence[str]) -> list[bytes | None]:
    """The bytes of documents; None of one that is not there. ConfigurationError: the place cannot be read."""
    return [_bytes(data, lake.place(name)) for name, data in zip(names, contents(lake, names), strict=True)]


def _bytes(data: Any, path: str) -> bytes | None:
    if isinstance(data, FileNotFoundError):
        return None
    if isinstance(data, Exception):
        raise ConfigurationError(f"cannot be read: {data}", file=path)
    return bytes(data)


def _names(lake: Lake, folder: str) -> list[str]:
    """The documents below a folder, as seen from the lake."""
    lake.fs.invalidate_cache()
    below = lake.place(folder)
    found = lake.fs.find(below) if lake.fs.exists(below) else []
    start = lake.fs._strip_protocol(lake.root) + "/"
    return sorted(str(name).removeprefix(start) for name in found if str(name).endswith(".json"))
