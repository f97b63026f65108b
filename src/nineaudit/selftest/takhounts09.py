"""Numbers of Takhounts et al. 2009: counter-example, clipping, the triangle of Fig 10, cross-axis error."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from nineaudit.array import Sensor, SensorArray, frozen
from nineaudit.physics import nap, rigid_body
from nineaudit.schemes import takhounts
from nineaudit.selftest.published import Published
from nineaudit.selftest.takhounts_misprints import SOURCE, relative

if TYPE_CHECKING:
    from nineaudit.auditing import Audit
    from nineaudit.simulate import Truth


def checks() -> list[Published]:
    """Counter-example (eqs 15–20), clipping, eq 37 row 2, and what 3 % cross-axis does to α."""
    return [*_counter_example(), *_clipping(), _planar(), *_triangle(), *_cross_axis()]


def _counter_example() -> list[Published]:
    """Every arm channel t m/s², the centre 0, at t = 1 s, arms 50, 60, 70 mm."""
    arms, time = np.array([0.05, 0.06, 0.07]), np.linspace(0.0, 1.0, 1001)
    readings = np.zeros((len(time), 9))
    readings[:, 3:] = time[:, None]
    alpha = nap.alpha(readings, arms)[-1]
    omega = nap.omega(readings, arms, time)[-1]
    from_omega = omega[[1, 2, 0]] * omega[[2, 0, 1]]
    told = nap.products(readings, arms)[-1]
    expected = (
        ("α, rad/s²", alpha, (1.1905, -2.8571, 1.6667), 5e-5),
        ("products of the integrated ω, rad²/s²", from_omega, (-1.1905, 0.4960, -0.8503), 5e-5),
        ("products of the constraints, rad²/s²", told, (15.476, 17.143, 18.333), 5e-4),
    )
    digit = "half a unit of the last digit"
    return [
        Published(SOURCE, f"eqs 15-20, t = 1 s: {name} {axis}", value, float(ours[i]), value, width, digit)
        for name, ours, values, width in expected
        for i, (axis, value) in enumerate(zip("xyz", values, strict=True))
    ]


def _clipped(channel: str, motion: str) -> tuple[Audit, Truth]:
    """The audit of a recording whose `channel` is clipped at half its amplitude: 0.3 g noise, no calibration error."""
    from nineaudit.auditing import audit
    from nineaudit.rig import parse_rig, preset_text
    from nineaudit.simulate import simulate

    rig = parse_rig(preset_text("naap-3222", [50.0, 55.0, 60.0]))
    certain = tuple(
        replace(s, u_gain=0.0, u_zero=0.0, u_alignment=0.0, u_position=0.0, u_timing=0.0) for s in rig.array.sensors
    )
    rig = replace(rig, array=SensorArray(certain))
    made = simulate(rig, motion, faults=[f"{channel}:clipping=0.5"], seed=0, imperfect=False)
    return audit(made.recording), made.truth


def _planar() -> Published:
    """METHODS 7.4 and 3: about y the twins a3x and a1z cannot be told apart, and both are reported."""
    found, _ = _clipped("a3x", "planar")
    reported = float(set(found.diagnosis.channels) == {"a3x", "a1z"})
    label = "clipped a3x, planar motion about y: the twins a3x and a1z reported (1 yes)"
    return Published(SOURCE, label, "not said", reported, 1.0, 0.5, "yes or no, half way between")


def _clipping() -> list[Published]:
    """METHODS 7.4: a1y in general motion."""
    found, truth = _clipped("a1y", "general")
    rig = found.recording.rig
    best, following = found.diagnosis.candidates[:2]
    columns, arms = nap.layout(rig.array) or ((), np.ones(3))
    before = found.recording.readings - found.case.zero
    after = before.copy()
    if found.reconstruction is not None:
        after[:, [rig.array.index(c) for c in found.reconstruction.channels]] = found.reconstruction.repaired
    peak = np.linalg.norm(truth.alpha, axis=1).max()
    errors = [100.0 * float(np.abs(nap.alpha(y[:, columns], arms) - truth.alpha).max() / peak) for y in (before, after)]
    named = float(found.diagnosis.channels == ("a1y",))
    size = "the spread over records that METHODS 7.4 gives"
    return [
        Published(
            SOURCE, "clipped a1y, general motion: named (1 yes)", 1.0, named, 1.0, 0.5, "yes or no, half way between"
        ),
        Published(SOURCE, "its χ²/dof", "1.05 to 1.14", best.statistic, 1.0, 0.14, f"{size}; expectation 1"),
        Published(
            SOURCE,
            "χ²/dof of the next hypothesis over it, at least 10 (log10)",
            "413 without slow noise in the fit",
            float(np.log10(following.statistic / best.statistic)),
            2.0,
            1.0,
            "an order of magnitude about 100; the fit here allows for slow noise",
        ),
        Published(
            SOURCE,
            "error of peak α before over after the repair",
            "54 to 100 % over 5 to 7 %",
            errors[0] / errors[1],
            14.0,
            6.0,
            size,
        ),
        Published(
            SOURCE,
            "error of peak α after the repair, %",
            "5 to 7",
            errors[1],
            5.0,
            5.0,
            "noise: four times σ/r, 0.3 g over 50 mm, is 235 rad/s², 8 to 10 % of the peak",
        ),
    ]


def _triangle() -> list[Published]:
    """Eq 37 put right, row by row, against the rigid body."""
    rng, rx, ry = np.random.default_rng(37), 0.06, 0.05
    omega, alpha, a1 = (s * rng.standard_normal((200, 3)) for s in (30.0, 3000.0, 500.0))
    ours = takhounts.triangle_corner(a1, alpha, omega, rx, ry)
    truth = rigid_body.acceleration_at(np.array([rx / 2.0, ry, 0.0]), a1, alpha, omega)
    wrong = ours[:, 1] + (alpha[:, 0] - alpha[:, 2]) * rx / 2.0
    words = (
        "right as printed",
        f"αx in place of αz, {100 * relative(wrong, truth[:, 1]):.2g} % off",
        "right as printed",
    )
    return [
        Published(
            SOURCE,
            f"eq 37 row {i + 1} put right, rms relative error on random motion",
            words[i],
            relative(ours[:, i], truth[:, i]),
            0.0,
            1e-12,
            "rounding of the sums",
        )
        for i in range(3)
    ]


def triangle(rx: float, ry: float) -> SensorArray:
    """Triaxes at the corners (0,0,0), (rx,0,0), (rx/2,ry,0), m: Fig 10."""
    corners = ((0.0, 0.0, 0.0), (rx, 0.0, 0.0), (rx / 2.0, ry, 0.0))
    return SensorArray(
        tuple(
            Sensor(f"a{i}{axis}", "accelerometer", frozen(place), frozen(np.eye(3)[j]), f"a{i}{axis}")
            for i, place in enumerate(corners, 1)
            for j, axis in enumerate("xyz")
        )
    )


def _cross_axis() -> list[Published]:
    """3 % of each axis in the others, ω = 0, equilateral triangle: δα = −0.03(αz, αz, (αx+αy)/2)."""
    side, c = 0.06, 0.03
    array = triangle(side, side * np.sqrt(0.75))
    alpha = np.array([1000.0, 2500.0, -700.0])
    error = takhounts.cross_axis_error(array, np.array([300.0, -200.0, 100.0]), alpha, c * (1.0 - np.eye(3)))
    expected = -c * np.array([alpha[2], alpha[2], (alpha[0] + alpha[1]) / 2.0])
    claim = "0 (optimisation is said to undo it)"
    return [
        Published(
            SOURCE,
            f"3 % cross-axis, ω = 0: error of α{a}, rad/s²",
            claim,
            float(e),
            float(x),
            1e-9,
            "rounding of the sums",
        )
        for a, e, x in zip("xyz", error, expected, strict=True)
    ]
