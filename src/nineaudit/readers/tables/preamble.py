"""What stands around the header row of an exported table: units, labels of rows, the sampling rate.

Exports put `Key,Value` lines above the header (DTS DataPRO and SLICEWare, LabVIEW, loggers), or a row for each
property of the channels that a label begins (DTS: `Channel Description,...`, `EU,...`, `Sample Rate,...`), or a row of
units below the names (DIAdem and many loggers). Units may stand in brackets after a name (DIAdem, enDAQ).
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Final

from nineaudit.array import Kind
from nineaudit.errors import ConfigurationError
from nineaudit.readers.tables.dialect import Dialect, base, is_number
from nineaudit.signals import QUANTITY
from nineaudit.units import FACTORS, Quantity, factor

if TYPE_CHECKING:
    from nineaudit.rig import Rig

TIME_NAME: Final = re.compile(
    r"(t|time|timestamp|zeit)([_ ]?[\[(]?(s|sec|seconds?|ms|msec|us|µs|ns)[\])]?)?", re.IGNORECASE
)
_UNIT_LABEL: Final = re.compile(r"(eu|(engineering )?units?|einheit(en)?)\W*", re.IGNORECASE)
_NAME_LABEL: Final = re.compile(
    r"((channel|kanal)[ _-]?(description|names?|code|id)?|names?|description|signal|"
    r"iso[ _-]?(channel[ _-]?)?(code)?)\W*",
    re.IGNORECASE,
)
_LABEL: Final = re.compile(
    r"(comment|description|sensor|serial|range|filter|location|sample|sampling|channel|iso|excitation|sensitivity|eu\b|"
    r"units?\b|einheit|name|number|type|software|hardware|test|data|trigger|zero|offset|scale|capacity|bridge|axis)",
    re.IGNORECASE,
)
_RATE: Final = re.compile(
    r"(actual |hardware )?(sampl(e|ing)[ _-]?(rate|freq(uency)?)|abtast(rate|frequenz))", re.IGNORECASE
)
_STEP: Final = re.compile(
    r"(sampl(e|ing)[ _-]?(interval|period|time)|abtastintervall|delta[ _]?[xt]|dt)", re.IGNORECASE
)
_WORD: Final = re.compile(r"[^\W\d_][^\W\d_/-][\w ./()%:#-]+")
_NO_VALUE: Final = re.compile(r"null|none|n/?a\b|missing|invalid|over|error", re.IGNORECASE)
_VALUE: Final = re.compile(r"\s*([-+]?\d+(?:[.,]\d+)?(?:[eE][-+]?\d+)?)\s*([a-zA-Zµ]*)")
_NO_UNIT: Final = re.compile(r"[xyz?-]+|\d.*|CFC.*|n/?a|none|unknown|no ?value", re.IGNORECASE)
"""What stands in brackets and is no unit: an axis, a range, a filter class, nothing."""
_LIKE_A_UNIT: Final = re.compile(
    r"[munµkM]?V(/\w+)?|[mµk]?[ANW]|k?Nm|[kM]?Pa|bar|[kM]?Hz|%|%? ?FS|°\w*|deg|rad|m?g's|gees?|counts?|bits?|LSB|"
    r"digits?|EU|"
    r"[^\W\d_]+/[^\W\d_]+[\d²^]*",
)
"""Units that a measuring chain writes besides those of the quantity; in round brackets words stand as well."""
_SCALE: Final = {
    "hz": 1.0, "khz": 1e3, "mhz": 1e6, "sps": 1.0, "ksps": 1e3, "s": 1.0, "sec": 1.0, "seconds": 1.0, "ms": 1e-3,
    "msec": 1e-3, "us": 1e-6, "µs": 1e-6, "ns": 1e-9, "": 1.0,
}  # fmt: skip
_DEEPEST: Final = 50
_SLOWEST, _FASTEST = 1e-6, 1e12
"""Hz between which a sampling rate is one."""


@dataclass(frozen=True)
class Surroundings:
    """`first` row of numbers (index among the head's lines); `units` by column; `rate` in Hz and where it is said."""

    first: int
    units: dict[int, str] = field(default_factory=dict)
    rate: float | None = None
    place: str = ""
    notes: tuple[str, ...] = ()


def time_named(table: Dialect) -> tuple[Dialect, str]:
    """The table with its first column named as time where a label of rows names it, and the note that says so.

    In a table whose rows have labels the label of the names stands over the column of time; a later label may be the
    name of that column (`Time (s)`).
    """
    first = table.names[0]
    if any(TIME_NAME.fullmatch(name) for name in table.names) or not _NAME_LABEL.fullmatch(first):
        return table, ""
    found = next((label for label, _, _ in _rows_below(table) if TIME_NAME.fullmatch(label)), "")
    if not found and not _numeric_first(table):
        return table, ""
    note = f"the first column, under the label {first!r}, is taken as time"
    return replace(table, names=(found or "time", *table.names[1:])), note


def surroundings(table: Dialect, time: int | None, channels: Sequence[int], rig: Rig) -> Surroundings:
    """Units, sampling rate and the first row of numbers; `time` None: there is no such column."""
    wanted = [*channels] if time is None else [time, *channels]
    units: dict[int, str] = {}
    notes: list[str] = []
    first = table.header + 1
    for label, cells, index in _rows_below(table):
        if _UNIT_LABEL.fullmatch(label) or _are_units(cells, wanted, rig):
            units |= _stated(cells, wanted)
        elif not (_LABEL.match(label) or TIME_NAME.fullmatch(label)):
            if _has_numbers(cells, wanted) and not (
                time == 0 and _WORD.fullmatch(label) and not _NO_VALUE.match(label)
            ):
                break
            notes.append(f"line {index + 1} below the header holds no readings: taken as a description")
        first = index + 1
    else:
        first = table.header + 1 if notes and not _numbers_begin(table, first) else first
    if not units:
        units = _units_above(table, wanted, rig)
    hertz, place = _rate(table, first)
    return Surroundings(first, units, hertz, place, tuple(notes[:3]))


def unit_in_name(name: str, kind: Kind) -> str | None:
    """The unit in brackets that ends the name of a column, None where what they hold is a range, an axis, or a word.

    A unit of another quantity, or one that is not known (`[V]`, `(counts)`), is one all the same: that of the readings.
    """
    brackets = name.removeprefix(base(name)).strip()
    unit = _bare(brackets)
    if not unit or _NO_UNIT.fullmatch(unit) or is_number(unit):
        return None
    known = any(is_unit(unit, quantity) for quantity in (QUANTITY[kind], *FACTORS))
    return unit if known or brackets.startswith("[") or _LIKE_A_UNIT.fullmatch(unit) else None


def _rows_below(table: Dialect) -> Iterator[tuple[str, list[str], int]]:
    """(label, cells, index) of the lines below the header, until one whose first cell is a number."""
    end = min(table.header + _DEEPEST, len(table.lines))
    for index in range(table.header + 1, end):
        if not table.lines[index].strip():
            continue
        cells = table.cells(table.lines[index])
        if is_number(cells[0]):
            return
        yield cells[0], cells, index


def _numbers_begin(table: Dialect, index: int) -> bool:
    """Whether the next line that is not blank begins with a number."""
    following = next((line for line in table.lines[index:] if line.strip()), "")
    return is_number(table.cells(following)[0])


def _numeric_first(table: Dialect) -> bool:
    below = (table.cells(line) for line in table.lines[table.header + 1 :] if line.strip())
    return any(cells and is_number(cells[0]) for cells in below)


def _has_numbers(cells: Sequence[str], wanted: Sequence[int]) -> bool:
    return any(i < len(cells) and is_number(cells[i]) for i in wanted)


def _are_units(cells: Sequence[str], wanted: Sequence[int], rig: Rig) -> bool:
    """At least half of what stands in the wanted columns are units."""
    there = [cells[i] for i in wanted if i < len(cells) and cells[i]]
    known = [cell for cell in there if _is_any_unit(cell, rig)]
    return bool(known) and 2 * len(known) >= len(there)


def _units_above(table: Dialect, wanted: Sequence[int], rig: Rig) -> dict[int, str]:
    """Units of a labelled row above the row of names."""
    for line in table.lines[: table.header]:
        cells = table.cells(line)
        if len(cells) >= len(table.names) > 2 and _UNIT_LABEL.fullmatch(cells[0]) and _are_units(cells, wanted, rig):
            return _stated(cells, wanted)
    return {}


def _stated(cells: Sequence[str], wanted: Sequence[int]) -> dict[int, str]:
    """Units by column, without their brackets; a dash, a number, nothing and the label of the row are none."""
    bare = {i: _bare(cells[i]) for i in wanted if i < len(cells) and not (i == 0 and _UNIT_LABEL.fullmatch(cells[0]))}
    return {i: unit for i, unit in bare.items() if unit.strip("-") and not is_number(unit)}


def _bare(cell: str) -> str:
    """A unit without the brackets around it."""
    found = re.fullmatch(r"\[(.*)\]|\((.*)\)", cell)
    return (found[1] or found[2] or "").strip() if found else cell


def _is_any_unit(cell: str, rig: Rig) -> bool:
    names = (rig.units.acceleration, rig.units.angular_rate)
    return cell in names or any(is_unit(_bare(cell), quantity) for quantity in FACTORS)


def is_unit(text: str, quantity: Quantity) -> bool:
    """Whether a text is a known unit of a quantity."""
    try:
        factor(text, quantity)
    except ConfigurationError:
        return False
    return True


def _rate(table: Dialect, first: int) -> tuple[float | None, str]:
    """Sampling rate in Hz that one line of the head states, and which; None where none does or they differ."""
    found: dict[float, str] = {}
    for index, line in enumerate(table.lines[:first]):
        if index != table.header:
            for hertz in _rates(line):
                found.setdefault(hertz, f"line {index + 1}")
    if len(found) != 1:
        return None, ""
    return next(iter(found.items()))


def _rates(line: str) -> Iterator[float]:
    """Every rate that a line `Key,Value,...` states: `Sample Rate (Hz),20000`, `SampleRate: 100,Hz`, `dt=50 us`."""
    line = line.strip("#;\"' \t")
    key, *cells = re.split(r"[:=;\t|]" if re.search(r"[;\t|]", line) else "[:=,]", line)
    name = key.strip("\"' ")
    kind = _RATE.match(name) or _STEP.match(name)
    if kind is None:
        return
    in_key = re.search(r"[\[(]([a-zA-Zµ]+)[\])]", name)
    for cell, after in zip(cells, [*cells[1:], ""], strict=False):
        number = _VALUE.fullmatch(cell.strip("\"' "))
        unit = (number[2] if number else "") or (in_key[1] if in_key else "") or after.strip("\"' ")
        scale = _SCALE.get(unit.lower() if not is_number(unit or "0") else "")
        if number is None or scale is None:
            continue
        value = float(number[1].replace(",", ".")) * scale
        if _SLOWEST < value < _FASTEST if _RATE.match(name) else 1 / _FASTEST < value < 1 / _SLOWEST:
            yield value if _RATE.match(name) else 1 / value
