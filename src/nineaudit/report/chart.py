"""What a chart shows, before anything is drawn."""

from __future__ import annotations

from dataclasses import dataclass

from nineaudit.array import BoolArray, FloatArray


@dataclass(frozen=True, eq=False)
class Line:
    """A curve: `values` (n,), `style` its class in the style sheet, `label` in the legend."""

    values: FloatArray
    style: str
    label: str
    name_at_peak: bool = False


@dataclass(frozen=True, eq=False)
class Band:
    """The area between `lower` (n,) and `upper` (n,)."""

    lower: FloatArray
    upper: FloatArray
    style: str
    label: str


@dataclass(frozen=True, eq=False)
class Flags:
    """Samples of `values` (n,) to be marked where `mask` (n,)."""

    values: FloatArray
    mask: BoolArray
    label: str


@dataclass(frozen=True)
class Level:
    """A horizontal line with its name."""

    value: float
    label: str


@dataclass(frozen=True, eq=False)
class Chart:
    """What to draw over `time` (n,) s; the ground is tinted where `shaded` (n,). `key` makes the element ids unique,
    `unit` is the y axis'. `recorded`: the curves are readings, to be kept as finely as they were taken; `zooms`: the
    page's script may draw it again, closer. `across`, `up`: other axes than time and value, as (place, word) of each
    tick, `across_label` what they are.
    """

    key: str
    title: str
    description: str
    time: FloatArray
    unit: str
    lines: tuple[Line, ...]
    bands: tuple[Band, ...] = ()
    flags: tuple[Flags, ...] = ()
    levels: tuple[Level, ...] = ()
    shaded: BoolArray | None = None
    height: int = 200
    columns: int = 900
    recorded: bool = False
    zooms: bool = True
    across: tuple[tuple[float, str], ...] = ()
    across_label: str = ""
    up: tuple[tuple[float, str], ...] = ()
