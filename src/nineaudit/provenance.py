"""What says of a file that readings in it are made, not measured: the record that `repair` writes beside it or in it.

The record names the original and its hash, the channels, where and how they were made, how well, from what, by whom,
when and with which software (ISO/IEC 17025 7.5, 7.11). A repair of a repaired file holds the record before it in
`previous`, so the newest tells all.
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any, Final

from nineaudit.errors import RecordingError

SCHEMA: Final = "nineaudit/provenance/1"
MCAP_RECORD: Final = "nineaudit.provenance"
"""Name of the metadata record in an MCAP log; the key `json` holds the document."""
_NEEDED: Final = {"original": dict, "channels": list, "method": str, "donors": list, "samples_replaced": int}


@dataclass(frozen=True)
class Remade:
    """One channel that is not as measured: in `stretches` (s, s) of the recording's clock, ends included, `samples` of
    them. `from_others`: its values there are made of the other channels, so that they agree with those is no evidence;
    else a fault was undone by its model in what was measured. `original`: SHA-256 of the recording before."""

    channel: str
    stretches: tuple[tuple[float, float], ...]
    samples: int
    method: str
    from_others: bool
    original: str


@dataclass(frozen=True)
class Provenance:
    """A record as it was found: the `document`, the `place` where it stands, and whether it `fits` the file."""

    document: Mapping[str, Any]
    place: str
    fits: bool = True

    @cached_property
    def remade(self) -> tuple[Remade, ...]:
        """What was made, repair after repair, the oldest first."""
        return tuple(remade for one in reversed(list(chain(self.document))) for remade in _remade(one))


def chain(document: Mapping[str, Any]) -> Iterator[Mapping[str, Any]]:
    """A record and those before it, the newest first."""
    at: Mapping[str, Any] | None = document
    while at is not None:
        yield at
        at = at.get("previous")


def path_beside(file: Path) -> Path:
    """Where the record of a file stands."""
    return file.with_name(file.name + ".provenance.json")


def to_text(document: Mapping[str, Any]) -> str:
    """The document as it is written."""
    return json.dumps(document, indent=1, ensure_ascii=False, allow_nan=False) + "\n"


def parse(text: str | bytes, place: Path | str) -> dict[str, Any]:
    """A record. RecordingError where it is none: then nobody knows which channels were measured."""
    try:
        document = json.loads(text)
        wrong = next(filter(None, (_wrong(one) for one in chain(document))), None if document else "it is empty")
    except (ValueError, AttributeError, RecursionError) as error:
        wrong, document = str(error), {}
    if wrong is None:
        return dict(document)
    raise RecordingError(
        f"is no record of a repair: {wrong}",
        file=place,
        expected=SCHEMA,
        advice="without it nobody knows which channels were measured; put back the one that repair wrote",
    )


def _wrong(document: Mapping[str, Any]) -> str | None:
    """The first thing that is wrong with a record."""
    if document.get("schema") != SCHEMA:
        return f"its schema is {document.get('schema')!r}"
    for name, kind in _NEEDED.items():
        if not isinstance(document.get(name), kind):
            return f"{name} is not there" if name not in document else f"{name} is {document[name]!r}"
    if not all(isinstance(channel, str) for channel in document["channels"]):
        return "channels are not names"
    return None if _times(document.get("stretches_s", {})) else "stretches_s are not times"


def _times(stretches: object) -> bool:
    """Whether these are pairs of numbers by channel."""
    if not isinstance(stretches, dict):
        return False
    pairs = [pair for found in stretches.values() for pair in (found if isinstance(found, list) else [None])]
    return all(isinstance(p, list) and len(p) == 2 and all(isinstance(t, int | float) for t in p) for p in pairs)


def beside(file: Path, sha256: str) -> Provenance | None:
    """The record beside a file of this hash; None where there is none. RecordingError: it cannot be read."""
    place = path_beside(file)
    try:
        text = place.read_bytes()
    except FileNotFoundError:
        return None
    except OSError as error:
        raise RecordingError(f"cannot be read: {error.strerror or error}", file=place) from error
    document = parse(text, place)
    output = document.get("output")
    return Provenance(document, place.name, isinstance(output, dict) and output.get("sha256") == sha256)


def _remade(document: Mapping[str, Any]) -> Iterator[Remade]:
    stretches = document.get("stretches_s", {})
    for channel in document["channels"]:
        yield Remade(
            channel=channel,
            stretches=tuple((float(a), float(b)) for a, b in stretches.get(channel, ())),
            samples=document["samples_replaced"],
            method=document["method"],
            from_others=document.get("undone") is None,
            original=str(document["original"].get("sha256", "")),
        )
