"""An audit for the tests of the reports: values of the real classes, made here without running an audit.

Nine channels in general motion, a1y clipped at 55 % of its peak. `example(...)` varies what a test is about.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from datetime import date
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np

from nineaudit.bus import Bus, Checksum, Counter, Identifier, Load, Outside
from nineaudit.diagnose import Candidate, Diagnosis, Status
from nineaudit.engine import sentence
from nineaudit.estimate.budget import AlphaBudget
from nineaudit.estimate.calibrated import Calibrated
from nineaudit.estimate.information import Information
from nineaudit.finding import Finding, Measure, Severity, Verdict
from nineaudit.impact import Impact
from nineaudit.physics import kinematics, rigid_body
from nineaudit.reconstruct import Reconstruction
from nineaudit.recording import Clock, Damage, Recording, Source, Trace
from nineaudit.rig import Rig, Units, parse_rig, preset_text
from nineaudit.sensed import Sensed
from nineaudit.units import G0
from nineaudit.waivers import Waiver

SHA = "3f" * 32
NOISE = 0.3 * G0


@dataclass(frozen=True, eq=False)
class Example:
    """The fields of nineaudit.audit.Audit that reports use."""

    recording: Recording
    findings: tuple[Finding, ...]
    diagnosis: Diagnosis
    reconstruction: Reconstruction | None
    impact: Any
    verdict: str
    rulebook: Any
    tool: Any
    motion: Any = None
    constraints: Any = None
    constraints_u: Any = None
    parity: Any = None
    flagged: Any = None
    zero: Any = None
    rest: Any = (-0.02, -0.001)
    budget: Any = None
    calibration: Any = None
    sensors: Any = None
    apart: Any = None
    attitude: Any = None
    waivers: tuple[Waiver, ...] = ()
    command: str = ""


def pulses(time: np.ndarray, rows: list[list[tuple[float, float, float]]]) -> np.ndarray:
    """(n,3) sums of Gaussian pulses (size, centre, width) per axis."""
    return np.stack([sum(a * np.exp(-0.5 * ((time - c) / w) ** 2) for a, c, w in row) for row in rows], axis=1)


def body(n: int) -> SimpleNamespace:
    """A head impact of 0.2 s: α, its integral ω, a0."""
    time = np.linspace(-0.02, 0.18, n)
    alpha = pulses(
        time,
        [
            [(2600, 0.045, 0.007), (-2100, 0.075, 0.010)],
            [(-5200, 0.05, 0.008), (3600, 0.085, 0.011)],
            [(1900, 0.055, 0.009), (-1500, 0.1, 0.012)],
        ],
    )
    step = np.gradient(time)[:, None]
    omega = np.cumsum(alpha * step, axis=0)
    a0 = G0 * pulses(time, [[(92, 0.045, 0.008), (-20, 0.08, 0.02)], [(24, 0.05, 0.01)], [(-38, 0.06, 0.012)]])
    return SimpleNamespace(time=time, omega=omega, alpha=alpha, a0=a0, method="α of the 3-2-2-2 array, integrated")


DAMAGE = Damage("an object that does not begin with LOBJ", "byte 4711", 3, "about 12 frames")


def bus(name: str = "KINEMATICS", signal: str = "A0X", unit: str = "g") -> Bus:
    """Two messages, one of them in the rig and not as its database has it."""
    wrong = Identifier(
        0x24, name, "1", True, 2001, -0.02, 0.18, 1e-4, 2e-6, 3e-3, False, cycle=1e-4, length=8, longer=1,
        counters=(Counter(f"{signal}_CNT", 3, 1),), checksums=(Checksum(f"{signal}_CRC", "sum", 2),),
        outside=(Outside(signal, 4, -500.0, 500.0, 512.0, unit),), unavailable=((signal, 5),),
    )  # fmt: skip
    other = Identifier(0x80000123, None, "1", False, 1, 0.0, 0.0, np.nan, np.nan, np.nan, True)
    load = Load("1", 0.2, 12_000.0, 15_000.0, 0.01, 900.0, 1_100.0)
    return Bus((wrong, other), ("STATUS",), 2, 0.011, (load,), 500_000.0, False)


def told(k: int) -> tuple[AlphaBudget, Calibrated, np.ndarray]:
    """A budget, a calibration in which a1y was left out and a0x is far off, and a map with a pair of twins."""
    rows = {"gain": 52.0, "zero": 21.0, "alignment": 142.0, "position": 34.0, "timing": 3.0, "noise": 59.0,
            "quantisation": 0.0, "filters": 0.0, "integration": 0.0}  # fmt: skip
    uneven = np.sqrt(np.arange(1.0, k + 1.0) / (0.5 * k * (k + 1)))
    parts = {source: u * np.roll(uneven, i) for i, (source, u) in enumerate(rows.items()) if i < 7}
    rng = np.random.default_rng(9)
    prior = np.tile([0.005, 0.1 * G0, 0.009, 0.009, 5e-4, 5e-4, 5e-4, 1e-5], (k, 1))
    value, u = prior * rng.standard_normal((k, 8)), 0.7 * prior
    value[0, 0] = 3.0 * prior[0, 0]
    value[3], u[3], prior[3] = np.nan, np.nan, np.nan
    apart = 1.0 + 0.5 * rng.random((k, k))
    apart[4, 7] = apart[7, 4] = np.inf
    apart[np.arange(k), np.arange(k)] = np.nan
    return (
        AlphaBudget(5260.0, 400, rows, float(np.sqrt(sum(v**2 for v in rows.values()))), parts),
        Calibrated(value, u, prior),
        apart,
    )


WAIVER = Waiver(
    "RQ101", "T*.blf", "known gap of logger 7", "A. Example", date(2026, 1, 2), date(2030, 1, 1), ("a2z",), 0.02
)


def rig(text: str | None = None) -> Rig:
    return parse_rig(text or preset_text("naap-3222"), Path("rigs/head.toml"))


def recording(rig: Rig, motion: Any, path: str) -> tuple[Recording, np.ndarray, np.ndarray]:
    """The recording with a1y clipped, its ideal readings (n,9), and where it is clipped (n,)."""
    array = rig.array
    ideal = rigid_body.predict(
        array.positions, array.axes, array.is_accelerometer, motion.a0, motion.alpha, motion.omega
    )
    rng = np.random.default_rng(7)
    readings = ideal + NOISE * rng.standard_normal(ideal.shape)
    k = array.index(array.channels[3])
    rail = 0.55 * np.abs(ideal[:, k]).max()
    clipped = np.abs(readings[:, k]) > rail
    readings[:, k] = np.clip(readings[:, k], -rail, rail)
    gap = slice(int(0.8 * len(readings)), int(0.815 * len(readings)))
    readings[gap, 7] = np.nan
    traces = tuple(Trace(c, c, motion.time, readings[:, i], "m/s^2") for i, c in enumerate(array.channels))
    rate = (len(motion.time) - 1) / float(motion.time[-1] - motion.time[0])
    made = Recording(
        motion.time,
        readings,
        np.isfinite(readings),
        rig,
        Source(Path(path), "blf", SHA, 1_234_567, counts={"frames": 18000.0, "error_frames": 2.0}),
        traces,
        (Clock(rate, 1e-6),) * len(traces),
    )
    return made, ideal, clipped


TITLES = {
    "RQ101": "The recording is complete",
    "RQ105": "No channel is clipped",
    "CB201": "CAN counters and checksums are intact",
    "ZO301": "Zero before the event is within its uncertainty",
    "RB301": "Rigid-body constraints hold within the error budget",
    "RB305": "Same-axis channels agree at rest",
    "UB401": "The error budget is small enough for the verdict",
}


def judged(rule: str, verdict: Verdict, severity: Severity, measure: Measure) -> Finding:
    """A finding as the engine words it."""
    return Finding(rule, verdict, severity, sentence(measure, verdict, Units()), measure, measure.channels)


def findings(channels: tuple[str, ...], start: float, end: float) -> tuple[Finding, ...]:
    """Every verdict there is, at least once."""
    error, warning, info = Severity.ERROR, Severity.WARNING, Severity.INFO
    bad, quiet = channels[3], (-0.02, -0.001)
    zero = [
        judged("ZO301", Verdict.PASS, warning,
               Measure(0.02 * G0 * (i + 1), 0.3 * G0, "m/s^2", 0.02 * G0, (c,), quiet, "zero"))
        for i, c in enumerate(channels)
    ]  # fmt: skip
    off = Measure(0.61 * G0, 0.3 * G0, "m/s^2", 0.02 * G0, (channels[7],), quiet, "zero")
    zero[7] = judged("ZO301", Verdict.WARN, warning, off)
    gaps = Measure(0.015, 0.0, "1", 0.0, (channels[7],), (0.14, 0.143), "share of samples missing")
    flat = Measure(41.0, 2.0, "samples", 0.0, (bad,), (start, end), "flat top of")
    residual = Measure(12.4 * G0, 3.1 * G0, "m/s^2", 0.4 * G0, (bad,), (start, end), "residual")
    agreement = Measure(0.29 * G0, 0.3 * G0, "m/s^2", 0.04 * G0, channels[:2], quiet, "difference")
    missing = judged("RQ101", Verdict.FAIL, error, gaps)
    return (
        missing.with_verdict(Verdict.WAIVED, f"{missing.reason}; waived by A. Example until 2030-01-01: known gap"),
        judged("RQ105", Verdict.FAIL, error, flat),
        Finding("CB201", Verdict.NOT_APPLICABLE, error, "the database declares no counter and no checksum"),
        *zero,
        judged("RB301", Verdict.FAIL, error, residual),
        judged("RB305", Verdict.INCONCLUSIVE, error, agreement),
        Finding("UB401", Verdict.NOT_EVALUATED, info, "the normal matrix is singular"),
    )


def rulebook() -> SimpleNamespace:
    sheets = [
        SimpleNamespace(
            code=code, title=title, severity="error", why="What it means for the test engineer.",
            equation="ωxωy = (a1y−a0y)/2rx + (a2x−a0x)/2ry, Takhounts 2009 eq 14", clause="SAE J211-1",
            advice="Look at the cable of the channel.",
        )
        for code, title in TITLES.items()
    ]  # fmt: skip
    return SimpleNamespace(rules=tuple(sheets), sha256="ab" * 32)


def example(n: int = 2001, *, path: str = "tests/T0001.blf", rig_text: str | None = None) -> Example:
    """One clipped channel, named and rebuilt."""
    motion = body(n)
    instrument = rig(rig_text)
    made, ideal, clipped = recording(instrument, motion, path)
    channels = instrument.array.channels
    bad = channels[3]
    inside = motion.time[clipped]
    u = 0.8 * G0 + 0.02 * np.abs(ideal[:, [3]])
    rng = np.random.default_rng(8)
    rebuilt = Reconstruction(
        (bad,), (float(inside[0]), float(inside[-1])), made.readings[:, [3]],
        ideal[:, [3]] + 0.4 * G0 * np.sin(31.0 * motion.time)[:, None] + 1.1 * NOISE * rng.standard_normal((n, 1)),
        u, clipped[:, None], float(np.sqrt(np.mean(u[clipped] ** 2))), 1.07, "closed form from eight channels",
        tuple(c for c in channels if c != bad),
    )  # fmt: skip
    error = (made.readings[:, 3] - ideal[:, 3]) / 0.1
    constraints = np.stack([0.02 * error, -0.3 * error, error], axis=1)
    constraints_u = 60.0 + 0.05 * np.abs(motion.alpha[:, [1, 2, 0]]) + 0.0 * constraints
    diagnosis = Diagnosis(
        Status.ISOLATED, (bad,),
        tuple(
            Candidate((c,), f, p, s, v)
            for c, f, p, s, v in [
                (bad, "clipping", 0.978, 1.08, {"level": 412.0}),
                (channels[5], "unknown", 0.014, 413.0, {}),
                (channels[0], "zero_shift", 0.006, 577.2, {"size": -14.2}),
                (channels[1], "unknown", 0.002, 801.0, {}),
            ]
        ),
        f"only without {bad} do the constraints hold: 1.08 without, 913 with it (limit 1.31) per degree of freedom",
        {c: (0.4 + 0.05 * i) * G0 for i, c in enumerate(channels)},
        {c: np.inf if i == 6 else (0.9 + 0.1 * i) * G0 for i, c in enumerate(channels)},
        interval=(float(inside[0]), float(inside[-1])), healthy_statistic=913.0, limit=1.31,
    )  # fmt: skip
    budget, calibration, apart = told(len(channels))
    return Example(
        made, findings(channels, float(inside[0]), float(inside[-1])), diagnosis, rebuilt,
        {
            "peak α": Impact(8120.0, 5260.0, 140.0, "rad/s^2"),
            "HIC15": Impact(702.0, 694.3, 12.1, "g_0^2.5 s"),
            "BrIC": Impact(1.02, 0.871, 0.013, "1"),
            "peak a": Impact(94.1, 93.9, 0.8, "g_0"),
        },
        "fail", rulebook(), {"version": "0.1.0", "python": "3.11.9", "numpy": "2.4.6", "scipy": "1.17.1"},
        motion, constraints, constraints_u, None, {bad: clipped}, 0.05 * G0 * np.arange(len(channels)),
        budget=budget, calibration=calibration, apart=apart,
        attitude=kinematics.orientation(motion.omega, motion.time), waivers=(WAIVER,),
        command="nineaudit check tests/T0001.blf --rig rigs/head.toml", sensors=sensors(len(channels), calibration),
    )  # fmt: skip


def sensors(count: int, calibration: Calibrated) -> Sensed:
    """Gains of the first two channels, told a little."""
    gains = Information(np.arange(2), np.zeros(2, dtype=int), np.full(2, 0.005), np.array([1.0, -2.0]), 3.0 * np.eye(2))
    return Sensed(np.full(count, 500.0), "all channels", 1.02, calibration, gains)


def healthy(n: int = 401) -> Example:
    """Nothing wrong and no motion known: what is left out must be left out without a trace."""
    audit = example(n)
    size = audit.diagnosis.smallest_detectable
    diagnosis = Diagnosis(Status.HEALTHY, (), (), "the constraints hold within the budget", size)
    passed = tuple(f for f in audit.findings if f.verdict in (Verdict.PASS, Verdict.NOT_APPLICABLE))
    return replace(
        audit, findings=passed, diagnosis=diagnosis, reconstruction=None, impact={}, verdict="pass", motion=None,
        constraints=None, constraints_u=None, flagged={}, budget=None, calibration=None, apart=None, attitude=None,
        rest=None, waivers=(), command="", sensors=Sensed(audit.sensors.peaks, "no whole-record fit"),
    )  # fmt: skip


def on_a_bus(audit: Example) -> Example:
    """The same recording from a CAN log that is damaged."""
    source = replace(audit.recording.source, damage=(DAMAGE,))
    return replace(audit, recording=replace(audit.recording, bus=bus(), source=source))


def ambiguous() -> Example:
    """A group that the motion cannot separate."""
    audit = example(401)
    pair = audit.recording.channels[3], audit.recording.channels[5]
    diagnosis = replace(audit.diagnosis, status=Status.AMBIGUOUS, channels=pair)
    return replace(audit, diagnosis=diagnosis, reconstruction=None, impact={})
