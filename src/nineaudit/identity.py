"""Which test a recording is of: number, item, date, laboratory, each with where it was stated.

Stated in the rig file ([test], what all recordings of the rig have in common), by the recording (the header of an
ISO-MME test, the metadata of a log), and by the option --test: what comes later takes the place of what comes earlier.
What nobody states is not known; what is stated twice, and differently, in one place is not known either, and a remark
says so. When a measurement was started is not the date of the test: it stands for itself.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from datetime import UTC, date, datetime, timedelta
from typing import Any, Final

from nineaudit.errors import ConfigurationError

KEYS: Final[Mapping[str, str]] = {
    "number": "Test number",
    "title": "Title of the test",
    "item": "Test item",
    "item_serial": "Serial number of the item",
    "date": "Date of the test",
    "laboratory": "Laboratory",
    "customer": "Customer",
    "notes": "Notes",
}
"""What can be stated of a test, and what reports call it."""
METADATA: Final = "test"
"""Name of the metadata record of an MCAP log that states KEYS."""
STARTED: Final = "Recording started"
LONGEST: Final = 500
"""Characters of a statement that are kept."""
EARLIEST: Final = 1990
"""Year before which no recording was started."""
_DATE: Final = re.compile(r"\d{4}-\d\d-\d\d")
_A_DAY: Final = timedelta(days=1)
"""Clocks of all time zones are within a day of the date at the test."""


@dataclass(frozen=True)
class Stated:
    """One statement: `key` of KEYS or "started", its `value`, and the `source` in words."""

    key: str
    value: str
    source: str


@dataclass(frozen=True)
class Identity:
    """What is known of a test, "" for what is not. `date` is YYYY-MM-DD; `started` is when the recording says that it
    began, ISO 8601, with a zone where the file states one. `sources`: key -> where it was stated; `remarks`:
    what contradicts, and what cannot be used."""

    number: str = ""
    title: str = ""
    item: str = ""
    item_serial: str = ""
    date: str = ""
    laboratory: str = ""
    customer: str = ""
    notes: str = ""
    started: str = ""
    sources: Mapping[str, str] = field(default_factory=dict)
    remarks: tuple[str, ...] = ()

    @property
    def known(self) -> dict[str, str]:
        """Key -> value of what is known, "started" last."""
        return {key: value for key in (*KEYS, "started") if (value := getattr(self, key))}

    def document(self) -> dict[str, Any]:
        """The block `test` of a result: what is known, its sources, and the remarks; empty where nothing is."""
        told = {"sources": dict(self.sources)} if self.sources else {}
        return self.known | told | ({"remarks": list(self.remarks)} if self.remarks else {})


def is_date(text: str) -> bool:
    """Whether a text is a day of the calendar as YYYY-MM-DD; other ways of writing one leave open what is the month."""
    try:
        return bool(_DATE.fullmatch(text)) and bool(date.fromisoformat(text))
    except ValueError:
        return False


def stated(values: Mapping[str, str], source: str) -> tuple[Stated, ...]:
    """The statements of one source, blanks at the ends and what is empty left out."""
    tidy = {key: " ".join(value.split()) for key, value in values.items()}
    return tuple(
        Stated(key, value if len(value) <= LONGEST else value[:LONGEST] + "…", source)
        for key, value in tidy.items()
        if value
    )


def identify(*layers: Iterable[Stated]) -> Identity:
    """The test by all that is stated; a later layer takes the place of an earlier one."""
    taken: dict[str, Stated] = {}
    remarks: list[str] = []
    for layer in layers:
        for key, found in _by_key(layer, remarks).items():
            before = taken.pop(key, None)
            if key != "started" and len({s.value for s in found}) > 1:
                said = ", ".join(f"{s.value!r} ({s.source})" for s in found)
                remarks.append(f"{_called(key)}: {said}: they contradict each other, and none is taken")
                continue
            new = taken[key] = found[0]
            if before is not None and before.value != new.value:
                instead = f"not {before.value!r} ({before.source})"
                remarks.append(f"{_called(key)}: {new.value!r} ({new.source}) is taken, {instead}")
    values = {key: s.value for key, s in taken.items()}
    sources = {key: taken[key].source for key in (*KEYS, "started") if key in taken}
    return Identity(**values, sources=sources, remarks=(*remarks, *_apart(values)))


def _by_key(layer: Iterable[Stated], remarks: list[str]) -> dict[str, list[Stated]]:
    """The statements of a layer that can be used; a remark on dates that are none."""
    found: dict[str, list[Stated]] = {}
    for one in layer:
        if one.key == "date" and not is_date(one.value):
            remarks.append(f"{_called('date')}: {one.value!r} ({one.source}) is no date YYYY-MM-DD and is not used")
        else:
            found.setdefault(one.key, []).append(one)
    return found


def _called(key: str) -> str:
    return KEYS.get(key, STARTED)


def _apart(values: Mapping[str, str]) -> tuple[str, ...]:
    """A remark where the recording was started on another day than that of the test, time zones aside."""
    day, began = values.get("date", ""), values.get("started", "")[:10]
    if not (day and is_date(began)) or abs(date.fromisoformat(day) - date.fromisoformat(began)) <= _A_DAY:
        return ()
    return (f"the recording was started on {began}, the test is dated {day}",)


def moment(seconds: float, zone: bool) -> str:
    """A time stamp, s since 1970, as ISO 8601 to the millisecond, with Z where it is known to be UTC; "" for one that
    the calendar does not have, or before there were loggers with a clock (it counts from something else)."""
    try:
        found = datetime.fromtimestamp(seconds, UTC).replace(tzinfo=None)
    except (OverflowError, ValueError, OSError):
        return ""
    return found.isoformat(timespec="milliseconds") + ("Z" if zone else "") if found.year >= EARLIEST else ""


def began(moment: str, source: str) -> tuple[Stated, ...]:
    """The statement that a recording was started then; none for ""."""
    return (Stated("started", moment, source),) if moment else ()


def from_options(given: Sequence[str]) -> tuple[Stated, ...]:
    """What ``--test KEY=VALUE`` states. ConfigurationError: no such key, no value, a key twice, a date that is none."""
    values: dict[str, str] = {}
    for one in given:
        key, sign, value = one.partition("=")
        key = key.strip().replace("-", "_")
        if not sign or key not in KEYS:
            expected = f"KEY=VALUE, KEY one of {', '.join(KEYS)}"
            raise ConfigurationError("no statement about the test", place="--test", found=one, expected=expected)
        if key in values or not value.strip():
            what = f"{key} is stated twice" if key in values else f"{key} without a value"
            raise ConfigurationError(what, place="--test", found=one, expected="each key once, with its value")
        if key == "date" and not is_date(value.strip()):
            raise ConfigurationError("no date", place="--test date", found=value, expected="a day as YYYY-MM-DD")
        values[key] = value
    return stated(values, "option --test")
