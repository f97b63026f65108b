"""Entries of a lake for the tests of its tables and pages: real audits of simulated recordings, multiplied."""

from __future__ import annotations

import copy
import hashlib
import random
from collections.abc import Iterable, Iterator
from functools import cache
from pathlib import Path
from typing import Any

import nineaudit as na
from nineaudit.campaign import lake as lakes
from nineaudit.commands import simulated
from nineaudit.errors import RecordingError
from nineaudit.files import sealed
from nineaudit.report import failure_document, result_document
from nineaudit.rig import parse_rig, preset_text

Entry = dict[str, Any]
EDITION = "abc123abc123"
FAULTS = ((), ("a1y:clipping=0.5",), ("a2z:zero_shift",))


@cache
def audited(fault: tuple[str, ...]) -> Entry:
    """The result of an audit of nine accelerometers in general motion with `fault`."""
    return result_document(na.audit(simulated(parse_rig(preset_text("naap-3222")), "general", fault, seed=3)))


def entry(number: int, *, edition: str = EDITION, fault: tuple[str, ...] | None = None, **changes: Any) -> Entry:
    """The entry of recording `number`: every 50th could not be read, the others are healthy, clipped or shifted.

    `changes`: uri, rig, reason, test, item, sha256 of the entry or its result.
    """
    drawn = random.Random(number)
    uri = changes.get("uri", f"data/series-{number % 7}/T{number:05d}.csv")
    if fault is None and number % 50 == 49:
        error = RecordingError(changes.get("reason", "is empty"), file=uri)
        result = failure_document(Path(uri), error, {"version": "0.1.0"})
    else:
        result = _varied(audited(drawn.choice(FAULTS) if fault is None else fault), uri, number, drawn, changes)
    key = hashlib.sha256(f"{number} {edition}".encode()).hexdigest()[:32]
    date = f"2026-{number % 12 + 1:02d}-{number % 28 + 1:02d}"
    test = changes.get("test", {"number": f"T{number}", "item": changes.get("item", "head"), "date": date})
    head = {"schema": "nineaudit/lake-entry/1", "key": key, "uri": uri, "edition": edition}
    return {**head, "test": test, "result": result}


def _varied(base: Entry, uri: str, number: int, drawn: random.Random, changes: Entry) -> Entry:
    result = copy.deepcopy({name: value for name, value in base.items() if name != "seal"})
    content = changes.get("sha256", hashlib.sha256(str(number).encode()).hexdigest())
    result["recording"] |= {"path": uri, "sha256": content}
    result["rig"]["name"] = changes.get("rig", f"rig {number % 3}")
    for finding in result["findings"]:
        if finding["value"]:
            finding["value"] = float(f"{finding['value'] * drawn.uniform(0.9, 1.1):.6g}")
        if "finding" in changes:
            finding["reason"] = changes["finding"]
    return sealed(result)


def entries(count: int, **changes: Any) -> Iterator[Entry]:
    """`count` entries, sorted by uri."""
    numbers = sorted(range(count), key=lambda n: f"data/series-{n % 7}/T{n:05d}.csv")
    return (entry(number, **changes) for number in numbers)


def lake_of(place: str | Path, some: Iterable[Entry], edition: str = EDITION) -> lakes.Lake:
    """A lake of entries, written in the order given; `edition` is its newest."""
    lake = lakes.open_lake(place, create=True)
    for one in some:
        lakes.write_entry(lake, one)
    lakes.write(lake, "head.json", {"edition": edition})
    return lake
