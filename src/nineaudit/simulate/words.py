"""The fault words as a user writes them: ``a0x:gain=10%``, ``a1y:dropout=5ms,hold@30ms``."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from difflib import get_close_matches
from typing import Final, Literal

from nineaudit.array import FloatArray
from nineaudit.errors import ConfigurationError
from nineaudit.simulate import faults
from nineaudit.simulate.faults import Scene
from nineaudit.units import factor

Quantity = Literal["nothing", "channel", "fraction", "level", "factor", "time", "length", "frequency", "class"]

PEAK: Final = "peak"
"""The unit of a level that is a fraction of the channel's own peak."""

UNITS: Final[dict[Quantity, str]] = {
    "nothing": "no value",
    "channel": "another channel",
    "fraction": "a fraction or a percentage",
    "level": "a percentage of the channel's peak, or a number in the rig's unit",
    "factor": "a factor",
    "time": "a time, in s or with its unit (ms, us)",
    "length": "a length, in the rig's unit or with its own (mm, in)",
    "frequency": "a frequency in Hz",
    "class": "CFC60, CFC180, CFC600 or CFC1000",
}


@dataclass(frozen=True)
class FaultKind:
    """A fault word: its function, one line of `help`, what value it takes, its default and open bounds.

    The default of a level is a fraction of the peak. `timed`: ``@TIME`` may say when it begins.
    """

    apply: Callable[[Scene, float], FloatArray]
    help: str
    quantity: Quantity
    default: float | None = None
    low: float = -math.inf
    high: float = math.inf
    modes: tuple[str, ...] = ()
    timed: bool = False
    accelerometers_only: bool = False

    @property
    def unit(self) -> str:
        """What value the word takes, in words."""
        return UNITS[self.quantity]


FAULTS: Final[dict[str, FaultKind]] = {
    "gain": FaultKind(faults.gain, "sensitivity off by a relative amount", "fraction", 0.10),
    "zero_shift": FaultKind(faults.zero_shift, "zero jumps at the event, or at @TIME", "level", 0.05, timed=True),
    "drift": FaultKind(faults.drift, "zero wanders in a straight line, this far at the end", "level", 0.05, timed=True),
    "polarity": FaultKind(faults.polarity, "sign reversed", "nothing"),
    "swap": FaultKind(faults.swap, "connected as the other channel, and that as this", "channel"),
    "unit": FaultKind(faults.unit, "wrong unit: readings times a factor", "factor", 9.80665),
    "delay": FaultKind(faults.delay, "late by this time", "time", 1e-3),
    "clipping": FaultKind(faults.clipping, "flat above this part of its peak", "fraction", 0.5, low=0.0, high=1.0),
    "dropout": FaultKind(
        faults.dropout,
        "reads zero (hold, invalid) this long, about its peak or from @TIME",
        "time",
        5e-3,
        low=0.0,
        modes=("zero", "hold", "invalid"),
        timed=True,
    ),
    "stuck": FaultKind(
        faults.stuck,
        "frozen this long (to the end), from the event or @TIME",
        "time",
        math.inf,
        low=0.0,
        timed=True,
    ),
    "spikes": FaultKind(faults.spikes, "single samples off by this much, one in about 20 ms", "level", 1.0, timed=True),
    "noise": FaultKind(faults.noise, "white noise of this standard deviation added", "level", 0.05, low=0.0),
    "wrong_filter": FaultKind(faults.wrong_filter, "filtered with this class as well", "class", 60.0),
    "ac_coupled": FaultKind(faults.ac_coupled, "first-order high-pass, this corner", "frequency", 1.0, low=0.0),
    "cross_axis": FaultKind(faults.cross_axis, "this sensitivity to a direction across it", "fraction", 0.05),
    "position": FaultKind(
        faults.position,
        "seismic mass this far from its stated place",
        "length",
        5e-3,
        low=0.0,
        accelerometers_only=True,
    ),
    "missing": FaultKind(faults.missing, "no valid sample", "nothing"),
    "unknown": FaultKind(faults.unknown, "a smooth waveform with this largest excursion", "level", 0.2),
}


@dataclass(frozen=True)
class Fault:
    """One fault of one channel. `value` None: the default of its kind.

    `unit` None: `value` is a fraction, factor, s, Hz, or in the rig's unit; "peak": a fraction of the
    channel's own peak; otherwise the unit's name. `partner` of a swap; `at` s, when it happens; `mode` of a
    dropout.
    """

    channel: str
    kind: str
    value: float | None = None
    partner: str | None = None
    unit: str | None = None
    at: float | None = None
    mode: str | None = None

    def __str__(self) -> str:
        """The text that parse_fault reads."""
        at = "" if self.at is None else f"@{float(self.at)!r}"
        if self.partner is not None:
            return f"{self.channel}:{self.kind}={self.partner}{at}"
        number = None if self.value is None else f"{float(self.value)!r}{self.unit or ''}"
        if self.value is not None and self.unit == PEAK:
            number = f"{100 * self.value:.12g}%"
        given = ",".join(part for part in (number, self.mode) if part)
        return f"{self.channel}:{self.kind}{'=' + given if given else ''}{at}"


_FAULT = re.compile(r"(?P<channel>[^:=@]+):(?P<kind>[^:=@]+)(?:=(?P<given>[^@]*))?(?:@(?P<at>.+))?")
_NUMBER = re.compile(r"([-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?)\s*(.*)")
EXAMPLE: Final = "CHANNEL:FAULT[=VALUE][@TIME], such as a1y:clipping=0.5"


def parse_fault(text: str) -> Fault:
    """``CHANNEL:FAULT[=VALUE[,MODE]][@TIME]`` as a Fault; ConfigurationError says what is expected."""
    found = _FAULT.fullmatch(text.strip())
    if found is None:
        raise ConfigurationError("not a fault", place="--fault", found=text, expected=EXAMPLE)
    channel, name = found["channel"].strip(), found["kind"].strip().replace("-", "_").lower()
    kind = fault_kind(name, text)
    words = [] if found["given"] is None else [w.strip() for w in found["given"].split(",")]
    mode = words.pop() if words and words[-1] in kind.modes else None
    at = None if found["at"] is None else _time(found["at"], text)
    if len(words) > 1 or (words and kind.quantity == "nothing") or (kind.quantity == "channel" and not words):
        raise _bad_value(text, name, kind)
    if kind.quantity == "channel":
        return Fault(channel, name, partner=words[0], at=at)
    value, unit = _value(words[0], text, name, kind) if words else (None, None)
    return Fault(channel, name, value, unit=unit, at=at, mode=mode)


def fault_kind(name: str, text: str | None = None) -> FaultKind:
    """The kind of that name; ConfigurationError with the nearest."""
    if name in FAULTS:
        return FAULTS[name]
    raise unknown_name("unknown fault", name, FAULTS, text)


def unknown_name(what: str, name: str, known: Iterable[str], text: str | None = None) -> ConfigurationError:
    """An error that lists the known names and suggests the nearest."""
    names = list(known)
    near = get_close_matches(name, names, n=1, cutoff=0.5)
    advice = f"did you mean {near[0]}?" if near else None
    place = "--fault" if text is None else f"--fault {text}"
    return ConfigurationError(what, place=place, found=name, expected="one of " + ", ".join(names), advice=advice)


def _bad_value(text: str, name: str, kind: FaultKind) -> ConfigurationError:
    modes = f", then optionally {', '.join(kind.modes)}" if kind.modes else ""
    return ConfigurationError(f"bad value of {name}", place="--fault", found=text, expected=kind.unit + modes)


def _time(text: str, whole: str) -> float:
    number = _NUMBER.fullmatch(text.strip())
    if number is None:
        raise ConfigurationError("bad time of a fault", place="--fault", found=whole, expected=UNITS["time"])
    return float(number[1]) * factor(number[2] or "s", "time", place=f"--fault {whole}")


def _value(word: str, text: str, name: str, kind: FaultKind) -> tuple[float, str | None]:
    """Number and unit; fractions and times are brought to 1 and s, levels and lengths wait for the rig."""
    number = _NUMBER.fullmatch(word.upper().removeprefix("CFC") if kind.quantity == "class" else word)
    if number is None:
        raise _bad_value(text, name, kind)
    value, unit = float(number[1]), number[2].strip()
    if unit == "%" and kind.quantity in ("fraction", "level"):
        return value / 100.0, PEAK if kind.quantity == "level" else None
    if kind.quantity == "time":
        return value * factor(unit or "s", "time", place=f"--fault {text}"), None
    if kind.quantity == "frequency" and unit in ("", "Hz"):
        return value, None
    if unit and kind.quantity not in ("level", "length"):
        raise _bad_value(text, name, kind)
    return value, unit or None
