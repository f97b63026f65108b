"""Recordings to be diagnosed: motion × imperfect array × fault × severity × noise × rate, from a name and a seed.

A recording is called KIND/NUMBER, as in gain/7. All that is random in it comes from the seed, the kind and the number,
so that any one can be drawn again alone. Severities and motions are dealt in turn (each kind begins with another
motion), the rest is drawn: noise 0.05 to 0.4 g_0 (its logarithm uniform) stated in the rig, 10 or 20 kHz, arms of 45 to
65 mm, and the instrument from the uncertainties of the preset: 0.5 % gain, 0.5° alignment, 0.5 mm, 0.1 g_0 zero, 10 µs.

The fault goes into a channel that has something to measure: one whose peak is a quarter (``least_signal``) of the
array's largest at least. A swap is of two channels that differ by as much. ``white`` is a perfect instrument in white
noise, for the ratio of a reconstruction to its Cramér–Rao bound.
"""

from __future__ import annotations

import zlib
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from nineaudit.array import FloatArray, SensorArray
from nineaudit.rig import PRESETS, Rig, parse_rig, preset_text
from nineaudit.simulate import Fault, Simulation, simulate
from nineaudit.units import G0

HEALTHY, WHITE = "healthy", "white"
MOTIONS = ("general", "planar", "sled", "drop", "oblique")
PLANES = ("planar", "planar-x", "planar-z")
NOISE_G, RATES, ARM_MM = (0.05, 0.4), (10_000.0, 20_000.0), (45.0, 65.0)
CERTAIN = dict.fromkeys(("u_gain", "u_zero", "u_alignment", "u_position", "u_timing"), 0.0)


@dataclass(frozen=True)
class Severity:
    """Values from `low` to `high` of a fault word, of either sign where `signed`; `unit` as in Fault."""

    label: str
    low: float = 0.0
    high: float = 0.0
    signed: bool = False
    unit: str | None = None


def _levels(unit: str | None, *bands: tuple[float, float], signed: bool = True) -> tuple[Severity, ...]:
    """Bands of a fraction, or with `unit` of a part of the channel's peak."""
    of = " of peak" if unit else ""
    sign = "±" if signed else ""
    return tuple(Severity(f"{sign}{100 * a:g} to {100 * b:g} %{of}", a, b, signed, unit) for a, b in bands)


def _spans(unit: str, scale: float, *bands: tuple[float, float]) -> tuple[Severity, ...]:
    return tuple(Severity(f"{a:g} to {b:g} {unit}", a * scale, b * scale) for a, b in bands)


SEVERITIES: dict[str, tuple[Severity, ...]] = {
    "clipping": tuple(
        Severity(f"at {100 * a:g} to {100 * b:g} %", a, b) for a, b in ((0.75, 0.85), (0.6, 0.75), (0.5, 0.6))
    ),
    "gain": _levels(None, (0.06, 0.10), (0.10, 0.16), (0.16, 0.25)),
    "zero_shift": _levels("peak", (0.04, 0.07), (0.07, 0.11), (0.11, 0.15)),
    "dropout": _spans("ms", 1e-3, (2, 4), (4, 7), (7, 10)),
    "delay": _spans("ms", 1e-3, (0.3, 0.5), (0.5, 0.8), (0.8, 1.2)),
    "polarity": (Severity("reversed"),),
    "swap": (Severity("exchanged"),),
    "unit": (Severity("times 0.1 to 10"),),
    "drift": _levels("peak", (0.05, 0.10), (0.10, 0.25)),
    "stuck": (*_spans("ms", 1e-3, (3, 10), (10, 30)), Severity("to the end")),
    "spikes": _levels("peak", (0.10, 0.30), (0.30, 1.00), signed=False),
    "noise": _levels("peak", (0.03, 0.06), (0.06, 0.12), signed=False),
    "wrong_filter": (Severity("CFC180", 180.0, 180.0), Severity("CFC60", 60.0, 60.0)),
    "ac_coupled": _spans("Hz", 1.0, (0.5, 2), (2, 5)),
    "cross_axis": _levels(None, (0.05, 0.10), (0.10, 0.20)),
    "position": _spans("mm", 1.0, (3, 6), (6, 12)),
}
LISTED = ("clipping", "gain", "zero_shift", "dropout", "delay", "polarity", "swap", "unit")
UNIT_FACTORS = (9.80665, 1 / 9.80665, 10.0, 0.1)


@dataclass(frozen=True, eq=False)
class Draw:
    """One recording: what it is called, what is wrong with it (`fault` None: nothing) and how it was simulated."""

    name: str
    kind: str
    severity: str
    motion: str
    noise_g: float
    fault: Fault | None
    simulation: Simulation
    own: FloatArray
    """(n,k) what the drawn instrument, free of noise and fault, would have read, SI."""

    @property
    def culprits(self) -> tuple[str, ...]:
        """The faulty channels, two for a swap."""
        if self.fault is None:
            return ()
        return (self.fault.channel,) if self.fault.partner is None else (self.fault.channel, self.fault.partner)


def names(count: int, kinds: Sequence[str] | None = None) -> list[str]:
    """`count` recordings: a fifth healthy, a twentieth white, the rest dealt to the faults; or dealt to `kinds`."""
    if kinds:
        return [f"{kinds[i % len(kinds)]}/{i // len(kinds)}" for i in range(count)]
    healthy, white = round(count / 5), round(count / 20)
    faults = tuple(SEVERITIES)
    dealt = [f"{faults[i % len(faults)]}/{i // len(faults)}" for i in range(count - healthy - white)]
    return [f"{HEALTHY}/{i}" for i in range(healthy)] + [f"{WHITE}/{i}" for i in range(white)] + dealt


def draw(name: str, seed: int = 0, preset: str = "naap-3222", least_signal: float = 0.25) -> Draw:
    """The recording called KIND/NUMBER."""
    kind, number = name.split("/")[0], int(name.split("/")[1])
    rng = np.random.default_rng([seed, zlib.crc32(kind.encode()), number])
    white = kind == WHITE
    motions = ("general", "oblique") if white else MOTIONS
    motion = motions[(number + len(kind)) % len(motions)]
    severities = SEVERITIES.get(kind, (Severity(motion),))
    severity = severities[number % len(severities)]
    motion = str(rng.choice(PLANES)) if motion == "planar" else motion
    noise_g = float(np.exp(rng.uniform(*np.log(NOISE_G))))
    rig = _rig(preset, rng.uniform(*ARM_MM, len(PRESETS[preset].arms)).round(1).tolist(), noise_g, white)
    rate, own_seed = float(rng.choice(RATES)), int(rng.integers(2**31))
    healthy = simulate(rig, motion, seed=own_seed, rate_hz=rate)
    own = simulate(rig, motion, seed=own_seed, rate_hz=rate, noise=False).healthy
    if kind == HEALTHY:
        return Draw(name, kind, severity.label, motion, noise_g, None, healthy, own)
    fault = _white_fault(healthy, rng) if white else _fault(kind, severity, healthy, rng, least_signal)
    found = simulate(rig, motion, seed=own_seed, rate_hz=rate, faults=[fault])
    return Draw(name, kind, severity.label, motion, noise_g, fault, found, own)


def _rig(preset: str, arms: list[float], noise_g: float, white: bool) -> Rig:
    """The preset as it is printed, with other arms and noise; or certain of all but its unfiltered noise."""
    rig = parse_rig(preset_text(preset, arms=arms))
    told = [replace(s, noise=noise_g * G0) if s.kind == "accelerometer" else s for s in rig.array.sensors]
    if white:
        return replace(rig, array=SensorArray(tuple(replace(s, **CERTAIN) for s in told)), filter_class="none")
    return replace(rig, array=SensorArray(tuple(told)))


def _peaks(simulation: Simulation) -> FloatArray:
    """(k,) largest ideal reading in units of the largest of the channels of the same kind."""
    peaks, kinds = np.abs(simulation.ideal).max(axis=0), simulation.recording.rig.array.is_accelerometer
    return np.asarray(peaks / np.where(kinds, peaks[kinds].max(), np.max(peaks[~kinds], initial=1e-9)))


def _fault(kind: str, severity: Severity, healthy: Simulation, rng: np.random.Generator, least: float) -> Fault:
    array = healthy.recording.rig.array
    allowed = _peaks(healthy) >= least
    if kind in ("swap", "position"):
        allowed &= array.is_accelerometer
    column = int(rng.choice(np.flatnonzero(allowed)))
    channel = array.channels[column]
    if kind == "swap":
        return Fault(channel, kind, partner=array.channels[_partner(healthy, column, rng, least)])
    value = rng.uniform(severity.low, severity.high) * (rng.choice([-1.0, 1.0]) if severity.signed else 1.0)
    value = float(rng.choice(UNIT_FACTORS)) if kind == "unit" else float(value)
    if kind == "polarity":
        return Fault(channel, kind)
    if kind == "stuck":
        return _stuck(healthy, column, value)
    mode = str(rng.choice(["zero", "hold"])) if kind == "dropout" else None
    unit = "mm" if kind == "position" else severity.unit
    return Fault(channel, kind, value, unit=unit, mode=mode)


def _partner(healthy: Simulation, column: int, rng: np.random.Generator, least: float) -> int:
    """Another accelerometer that reads something else; else the one that differs most."""
    ideal, kinds = healthy.ideal, healthy.recording.rig.array.is_accelerometer
    apart = np.where(kinds, np.abs(ideal - ideal[:, [column]]).max(axis=0), 0.0) / np.abs(ideal[:, kinds]).max()
    far = np.flatnonzero(apart >= least)
    return int(rng.choice(far)) if len(far) else int(np.argmax(apart))


def _stuck(healthy: Simulation, column: int, duration: float) -> Fault:
    """Frozen about its peak; to the end, from a quarter before it where no duration is given."""
    time = healthy.truth.time
    peak = float(time[np.argmax(np.abs(healthy.ideal[:, column]))])
    start = max(0.0, peak - duration / 2 if duration else 0.75 * peak)
    return Fault(healthy.recording.channels[column], "stuck", duration or None, at=start)


def _white_fault(healthy: Simulation, rng: np.random.Generator) -> Fault:
    """A free waveform in one of the accelerometers, so that all of the channel must be rebuilt."""
    array = healthy.recording.rig.array
    column = rng.choice(np.flatnonzero(array.is_accelerometer))
    largest = float(np.abs(healthy.ideal[:, array.is_accelerometer]).max()) / G0
    return Fault(array.channels[column], "unknown", largest * float(rng.uniform(0.3, 0.8)), unit="g_0")
