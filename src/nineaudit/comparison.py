"""Every scheme that a recording's sensors allow, side by side, as Martin98 compares his: curves, correlation, ISO 18571
rating, and differences against what the rig's uncertainties explain.

The budget of a difference is its standard deviation over draws of the instrument (JCGM 101): every draw changes all
readings by the calibration errors of calibration.columns, one standard deviation of each as the rig states it, and by
noise of the colour that the recording's class leaves, and every scheme runs on the same draw. So an error that two
schemes share does not count between them. Each recording has draws of its own: drawn alike for all, a budget that
comes out small by chance would be small for every recording of a rig.

    ratio = rms(curve − reference) / rms(u of the difference),   explained where ratio ≤ k = 2

All of α, ω and a0 go through one channel frequency class first, CFC180 unless another is asked for (Martin98: four
poles at 300 Hz): unfiltered, a derivative of ω is mostly noise. Points are worked out from the filtered curves (SAE
J211-1: filter before operations that are not linear).
"""

from __future__ import annotations

import zlib
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final

import numpy as np

from nineaudit import instrument_draws
from nineaudit.array import FloatArray
from nineaudit.case import Case
from nineaudit.curve_filter import CurveFilter
from nineaudit.errors import ConfigurationError, EstimationError
from nineaudit.estimate import calibration
from nineaudit.estimate.motion import Motion, bridge
from nineaudit.gaps import require_short
from nineaudit.physics import filters, rigid_body
from nineaudit.rig import Point
from nineaudit.scheme_runs import Scheme, remarks, schemes_of
from nineaudit.schemes import martin, rating
from nineaudit.schemes.requirements import require_readings

DRAWS: Final = 16
"""Draws of the instrument: the standard deviation of a budget is known to 1/√(2·15), 18 %."""
EXPLAINED: Final = 2.0
SEED: Final = 1998
CLASS: Final = 180.0
"""Channel frequency class of the curves, where the blocks are sampled ten times as fast."""
Curves = Mapping[str, FloatArray]


@dataclass(frozen=True)
class Row:
    """One curve of one scheme against the reference. SI `unit`.

    `pearson` correlation; `lowest` of its moving window of 2.5 ms where the reference is above a tenth of its peak
    (NaN where no window holds enough samples); `rating` None where the curve is flat; `peak` of the reference;
    `difference` largest; `u` rms standard uncertainty of the difference; `ratio` of the rms difference to it.
    """

    scheme: str
    quantity: str
    axis: str
    unit: str
    pearson: float
    lowest: float
    rating: rating.Rating | None
    peak: float
    difference: float
    u: float
    ratio: float

    @property
    def explained(self) -> bool:
        """Whether the budget explains the difference."""
        return self.ratio <= EXPLAINED


@dataclass(frozen=True, eq=False)
class Comparison:
    """`curves` by scheme and quantity, each (m,3) SI on `time` (m,) s; `methods` in words; `rows` against
    `reference`; `refused` schemes with the reason; `cfc` of all curves, None: another filter or none,
    which `filter` says in words. `draws` of the instrument
    behind the budgets. `remarks`: what the motion tells of the sensors besides."""

    time: FloatArray
    reference: str
    methods: Mapping[str, str]
    curves: Mapping[str, Curves]
    rows: tuple[Row, ...]
    refused: Mapping[str, str]
    cfc: float | None
    draws: int
    remarks: tuple[str, ...] = ()
    filter: str = "unfiltered"

    @property
    def rate(self) -> float:
        """Samples of the curves per second."""
        return _rate(self.time)


def compare(
    case: Case,
    reference: str | None = None,
    draws: int = DRAWS,
    seed: int = SEED,
    cfc: float | None = None,
    other: CurveFilter | None = None,
) -> Comparison:
    """Run every scheme on the block means of `case` and compare each with `reference`, by default the whole-record fit,
    or else the first that runs. `cfc` of the curves: None is CLASS, unfiltered where that is too fast; 0 unfiltered;
    or the `other` filter in its place.

    Raises ConfigurationError for a reference that is no scheme or does not run, or fewer than two draws;
    EstimationError where fewer than two schemes run, or the blocks are too slow for a class that is asked for; also
    ConfigurationError for a class that the recording has been through.
    """
    if draws < 2:
        raise ConfigurationError("too few draws", place="--draws", found=draws, expected="2 or more")
    require_readings(case.array, case.recording.readings, each=True)
    require_short(case.recording)
    used = _filter(case, cfc, other)
    schemes = {name: _filtered(scheme, case, used) for name, scheme in schemes_of(case).items()}
    readings = bridge(case.condensed.readings, case.condensed.time)
    motions, refused = _run(schemes, readings)
    chosen = _reference(reference, tuple(schemes), motions, refused)
    sample, failed = _drawn(case, {name: schemes[name] for name in motions}, motions[chosen], readings, draws, seed)
    motions, refused = {name: motions[name] for name in motions if name not in failed}, refused | failed
    chosen = _reference(reference, tuple(schemes), motions, refused)
    points = case.recording.rig.points
    curves = {name: outputs(motion, points) for name, motion in motions.items()}
    spread = [{name: outputs(m, points) for name, m in drawn.items()} for drawn in sample]
    rows = [
        _row(name, quantity, axis, case.condensed.time, curves, chosen, spread)
        for name in curves
        if name != chosen
        for quantity in curves[name]
        for axis in range(3)
    ]
    methods = {name: motion.method for name, motion in motions.items()}
    told = remarks(case, curves[chosen]["omega"])
    class_ = used.value if used and used.kind == "cfc" else None
    said = str(used or "unfiltered")
    at = case.condensed.time
    return Comparison(at, chosen, methods, curves, tuple(rows), refused, class_, len(spread), told, said)


def outputs(motion: Motion, points: tuple[Point, ...]) -> dict[str, FloatArray]:
    """α, ω, a at the origin and at every point, each (n,3) SI."""
    at = {f"a({p.name})": rigid_body.acceleration_at(p.position, motion.a0, motion.alpha, motion.omega) for p in points}
    return {"alpha": motion.alpha, "omega": motion.omega, "a0": motion.a0, **at}


def unit_of(quantity: str) -> str:
    """SI unit of a quantity of `outputs`."""
    return {"alpha": "rad/s^2", "omega": "rad/s"}.get(quantity, "m/s^2")


def _filter(case: Case, cfc: float | None, other: CurveFilter | None) -> CurveFilter | None:
    """The filter of the curves: what is asked for, else CLASS where the samples are fast enough and a filter as
    recorded leaves room for it."""
    rate, already = _rate(case.condensed.time), case.recording.rig.cfc
    if cfc is None and other is None:
        room = filters.fast_enough(rate, CLASS) and (already is None or already > CLASS)
        return CurveFilter("cfc", CLASS) if room else None
    if cfc == 0.0:
        return None
    asked = other or CurveFilter("cfc", cfc or CLASS)
    asked.require(rate, case.recording.rate, already)
    return asked


def _filtered(scheme: Scheme, case: Case, used: CurveFilter | None) -> Scheme:
    """The scheme with its curves through a filter that the recording has not been through."""
    if used is None:
        return scheme
    rate, already = _rate(case.condensed.time), case.recording.rig.cfc

    def run(readings: FloatArray) -> Motion:
        found = scheme(readings)
        omega, alpha, a0 = (used(v, rate, already) for v in (found.omega, found.alpha, found.a0))
        return Motion(omega, alpha, a0, found.method)

    return run


def _rate(time: FloatArray) -> float:
    return (len(time) - 1) / float(time[-1] - time[0])


def _run(schemes: Mapping[str, Scheme], readings: FloatArray) -> tuple[dict[str, Motion], dict[str, str]]:
    motions, refused = {}, {}
    for name, scheme in schemes.items():
        try:
            found = scheme(readings)
        except EstimationError as error:
            refused[name] = str(error)
            continue
        if all(np.isfinite(v).all() for v in (found.omega, found.alpha, found.a0)):
            motions[name] = found
        else:
            refused[name] = "the sensors do not tell all of ω, α and a0"
    return motions, refused


def _reference(
    wanted: str | None, known: tuple[str, ...], motions: Mapping[str, Motion], refused: Mapping[str, str]
) -> str:
    if wanted is not None and wanted not in known:
        raise ConfigurationError(
            "no such scheme", place="--reference", found=wanted, expected="one of " + ", ".join(known)
        )
    if wanted is not None and wanted in refused:
        raise ConfigurationError(f"the scheme cannot run: {refused[wanted]}", place="--reference", found=wanted)
    if len(motions) < 2:
        first = "; ".join(f"{name}: {why}" for name, why in refused.items())
        raise EstimationError("fewer than two schemes can run", found=list(motions), expected="two", advice=first)
    return wanted or next(iter(motions))


def _drawn(
    case: Case, schemes: Mapping[str, Scheme], motion: Motion, readings: FloatArray, draws: int, seed: int
) -> tuple[list[dict[str, Motion]], dict[str, str]]:
    """Motions by scheme for each draw of calibration errors and noise added to the readings; and the schemes that fail
    in one of them, with the reason: their budget cannot be told."""
    columns = calibration.all_columns(case.array, readings, case.condensed.time, motion)
    rng = own_generator(case, seed)
    out: list[dict[str, Motion]] = []
    failed: dict[str, str] = {}
    for _ in range(draws):
        changed = readings + instrument_draws.errors(columns, rng) + instrument_draws.block_noise(case, rng)
        found, fails = _run({name: run for name, run in schemes.items() if name not in failed}, changed)
        failed |= {name: f"on readings changed within the rig's uncertainties: {why}" for name, why in fails.items()}
        out.append(found)
    return out, failed


def own_generator(case: Case, seed: int) -> np.random.Generator:
    """Random numbers of this recording: the same for the same readings, others for others."""
    return np.random.default_rng([seed, zlib.crc32(np.ascontiguousarray(case.recording.readings).tobytes())])


def _row(
    name: str,
    quantity: str,
    axis: int,
    time: FloatArray,
    curves: Mapping[str, Curves],
    reference: str,
    spread: list[dict[str, dict[str, FloatArray]]],
) -> Row:
    curve, against = (curves[n][quantity][:, axis] for n in (name, reference))
    shift = np.stack([(s[name][quantity] - s[reference][quantity])[:, axis] for s in spread]) - (curve - against)
    u = float(np.sqrt((shift**2).mean()))
    rms = float(np.sqrt(((curve - against) ** 2).mean()))
    flat = not (np.ptp(curve) > 0.0 and np.ptp(against) > 0.0)
    return Row(
        scheme=name,
        quantity=quantity,
        axis="xyz"[axis],
        unit=unit_of(quantity),
        pearson=float("nan") if flat else float(np.corrcoef(curve, against)[0, 1]),
        lowest=_lowest(curve, against, time),
        rating=None if flat else rating.rate(curve, against),
        peak=float(np.abs(against).max()),
        difference=float(np.abs(curve - against).max()),
        u=u,
        ratio=rms / u if u > 0.0 else (0.0 if rms == 0.0 else float("inf")),
    )


def _lowest(curve: FloatArray, against: FloatArray, time: FloatArray) -> float:
    """Lowest moving correlation where the reference is above a tenth of its peak; NaN where there is none."""
    per_second = _rate(time)
    if martin.WINDOW * per_second < 2.0:
        return float("nan")
    moving = martin.moving_correlation(curve, against, per_second)
    told = np.isfinite(moving) & (np.abs(against) > 0.1 * np.abs(against).max())
    return float(moving[told].min()) if told.any() else float("nan")
