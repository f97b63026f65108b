"""The ambiguity groups of METHODS.md 3 come out by themselves, for every layout and motion.

What a free waveform in one channel leaves of another's fault, λ_{k|j} = ‖(I − Π_k) S_j e‖²: from the fit's own normal
equations, and from a dense problem written down once more from the equations, which knows nothing of the package.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from functools import cache
from itertools import pairwise

import numpy as np
import pytest

from nineaudit.array import FloatArray, SensorArray
from nineaudit.case import Case
from nineaudit.diagnose import Diagnosis, Status, diagnose
from nineaudit.estimate import calibration, trajectory
from nineaudit.estimate.model import Data
from nineaudit.estimate.separation import step_sds
from nineaudit.physics import rigid_body
from nineaudit.rig import parse_rig, preset_text
from nineaudit.simulate import simulate

SAMPLES, STEP = 16, 80e-3 / 16
RATE_NOISE = 0.05
"""rad/s, noise of the rate sensors beside accelerometers of 1 m/s²."""
SEEN = 1e-6
"""Part of Σ e²/σ² above which a fault counts as seen: rounding leaves 1e-12 at most, the faintest sight is 1e-5."""
MOTIONS = {"rest": (0, 0, 0), "x": (1, 0, 0), "y": (0, 1, 0), "z": (0, 0, 1), "general": (1, 1, 1)}

# The table of METHODS.md 3, a row a layout: pairs that nothing separates, by motion, and faults that nothing shows.
NAAP = {"rest": "a1y-a2x a1z-a3x a2z-a3y", "x": "a2z-a3y", "y": "a1z-a3x", "z": "a1y-a2x", "general": ""}
AXES = {"rest": "a1y-a2x a1z-a3x a2z-a3y", "x": "", "y": "", "z": "", "general": ""}
NONE = dict.fromkeys(MOTIONS, "")
COPLANAR = {
    # "about in-plane axes: some twins" are these; at rest the two arms' in-plane channels are twins as in a NAAP
    "rest": "a1y-a2x",
    "x": "a1y-a1z a1y-a2x a1z-a2x a2y-a2z",
    "y": "a1x-a1z a1y-a2x a1y-a2z a2x-a2z",
    "z": "",
    "general": "",
}
ALWAYS = "a0x-a3x a0y-a1y a0z-a2z"
SIX = {
    "rest": f"{ALWAYS} a0z-gx a2z-gx a0x-gy a3x-gy a0y-gz a1y-gz",
    "x": f"{ALWAYS} a0z-gx a2z-gx",
    "y": f"{ALWAYS} a0x-gy a3x-gy",
    "z": f"{ALWAYS} a0y-gz a1y-gz",
    "general": ALWAYS,
}
TABLE: Mapping[str, Mapping[str, str]] = {
    "naap-3222": NAAP,
    "triax-3": AXES,
    "triax-4": AXES,
    "coplanar-3": COPLANAR,
    "coplanar-3-gyro": NONE | {"rest": "a1z-gy a2z-gx"},
    "6aw": SIX,
    "naap-gyro": NONE,
    "3-2-1": NONE,
    "rgla": NONE,
    "compact-cube": NONE,
}
HIDDEN = {
    **{("coplanar-3", motion): "a0z a1z a2z" for motion in ("rest", "z")},
    **{("3-2-1", motion): "a0x a0y a0z a1z a2x a2z" for motion in MOTIONS},
    **{("rgla", motion): "a0x a0y a0z gx gy gz" for motion in MOTIONS},
    **{("compact-cube", motion): "a1x a1y a1z gx gy gz" for motion in MOTIONS},
}
EVERY = [(preset, motion) for preset in TABLE for motion in MOTIONS]


@cache
def array_of(preset: str, arms: tuple[float, ...] | None = None) -> SensorArray:
    return parse_rig(preset_text(preset, arms)).array


def noise_of(array: SensorArray) -> FloatArray:
    return np.where(array.is_accelerometer, 1.0, RATE_NOISE)


def rates(motion: str, amplitude: float = 20.0) -> FloatArray:
    """(n+1,3) rad/s at the nodes, from rest, about the motion's axes, out of step."""
    s = np.arange(SAMPLES + 1) * STEP
    shapes = [
        np.sin(np.pi * s / 0.09) ** 2 * (1 + 0.2 * np.sin(40 * s)),
        0.9 * np.sin(np.pi * s / 0.08),
        np.sin(np.pi * s / 0.075) * (1 - 3.75 * s),
    ]
    return amplitude * np.stack(shapes, axis=1) * MOTIONS[motion]


FAULTS = {
    "pulse": np.exp(-0.5 * (((np.arange(SAMPLES) + 0.5) * STEP - 0.03) / 0.01) ** 2),
    "shift": np.ones(SAMPLES),
    "noise": np.random.default_rng(0).standard_normal(SAMPLES),
}


def dense(array: SensorArray, omega: FloatArray) -> FloatArray:
    """(n,k,u) what each sample's readings, over their noise, change by with a0 at every sample and ω at every node
    but the first, which is known:  n·a0 ∓ (r×n)·δω/h + ½ (n·(r·ω) + (n·ω) r − 2 (n·r) ω)·δω, or ½ n·δω."""
    out = np.zeros((SAMPLES, len(array), 3 * SAMPLES + 3 * SAMPLES))
    for t in range(SAMPLES):
        w = (omega[t] + omega[t + 1]) / 2
        for i, sensor in enumerate(array.sensors):
            n, r = sensor.axis, sensor.position
            held = sensor.kind == "accelerometer"
            turn = ((r @ w) * n + (n @ w) * r - 2 * (n @ r) * w if held else n) / 2
            lever = np.cross(r, n) / STEP if held else np.zeros(3)
            if held:
                out[t, i, 3 * t : 3 * t + 3] = n
            for node, by in ((t, turn - lever), (t + 1, turn + lever)):
                if node:
                    out[t, i, 3 * (SAMPLES + node - 1) : 3 * (SAMPLES + node)] = by
    return out / noise_of(array)[:, None]


def span(columns: FloatArray) -> FloatArray:
    """Orthonormal basis of the columns, each scaled to 1 first."""
    size = np.linalg.norm(columns, axis=0)
    basis, singular, _ = np.linalg.svd(columns[:, size > 0] / size[size > 0], full_matrices=False)
    return basis[:, singular > 1e-9 * singular[0]]


def separations(array: SensorArray, omega: FloatArray, e: FloatArray, free: int | None = None) -> FloatArray:
    """(k,) λ_{free|j} over Σ e²/σ² of the fault `e` (n,) in each channel j, from the dense problem."""
    kept = [i for i in range(len(array)) if i != free]
    basis = span(dense(array, omega)[:, kept].reshape(SAMPLES * len(kept), -1))
    out = np.zeros(len(array))
    for place, j in enumerate(kept):
        fault = np.zeros((SAMPLES, len(kept)))
        fault[:, place] = e
        left = fault.ravel() - basis @ (basis.T @ fault.ravel())
        out[j] = left @ left / (e @ e)
    return out


def groups(array: SensorArray, omega: FloatArray, e: FloatArray) -> tuple[set[str], set[str]]:
    """Names of the channels whose fault nothing shows, and the pairs that nothing separates, one way at least."""
    names = array.channels
    seen = separations(array, omega, e)
    apart = np.stack([separations(array, omega, e, free=k) for k in range(len(array))])
    hidden = {names[j] for j in np.flatnonzero(seen < SEEN)}
    return hidden, pairs_of(names, hidden, apart < SEEN)


def pairs_of(names: tuple[str, ...], hidden: set[str], tied: FloatArray) -> set[str]:
    return {
        "-".join(sorted((names[j], names[k])))
        for k, j in zip(*np.nonzero(tied), strict=True)
        if k != j and not {names[j], names[k]} & hidden
    }


# --- information ------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("preset", "motion"), EVERY)
@pytest.mark.parametrize("fault", ["pulse", *(pytest.param(f, marks=pytest.mark.slow) for f in ("shift", "noise"))])
def test_table_of_ambiguity(preset: str, motion: str, fault: str) -> None:
    """The dense problem has the groups of METHODS.md 3 and no others."""
    hidden, pairs = groups(array_of(preset), rates(motion), FAULTS[fault])
    assert hidden == set(HIDDEN.get((preset, motion), "").split())
    assert pairs == set(TABLE[preset][motion].split())


@pytest.mark.parametrize("preset", ["naap-3222", "triax-3", "triax-4", "6aw", "naap-gyro"])
@pytest.mark.parametrize("motion", sorted(MOTIONS))
def test_groups_do_not_depend_on_the_arms(preset: str, motion: str) -> None:
    hidden, pairs = groups(array_of(preset, (50.0, 60.0, 70.0)), rates(motion), FAULTS["pulse"])
    assert not hidden
    assert pairs == set(TABLE[preset][motion].split())


@pytest.mark.parametrize(
    ("preset", "axes", "pairs"),
    [
        ("naap-3222", (1, 1, 0), ""),
        ("naap-3222", (0, 1, 1), ""),
        ("6aw", (1, 0, 1), ALWAYS),
        ("coplanar-3", (1, 1, 0), ""),
    ],
)
def test_two_axes_are_general(preset: str, axes: tuple[int, int, int], pairs: str) -> None:
    assert groups(array_of(preset), rates("general") * axes, FAULTS["pulse"]) == (set(), set(pairs.split()))


def at(preset: str, motion: str) -> trajectory.Fit:
    """The fit of exact readings of a perfect instrument at the true motion."""
    array, omega = array_of(preset), rates(motion)
    mean, alpha = (omega[1:] + omega[:-1]) / 2, np.diff(omega, axis=0) / STEP
    a0 = np.zeros((SAMPLES, 3))
    y = rigid_body.predict(array.positions, array.axes, array.is_accelerometer, a0, alpha, mean)
    still = np.zeros(SAMPLES + 1)
    still[0] = 1e8
    weight = np.broadcast_to(1 / noise_of(array), y.shape).copy()
    data = Data(array, (np.arange(SAMPLES) + 0.5) * STEP, y, weight, np.zeros((len(array), 8)), still)
    return trajectory.fit(data, omega)


@pytest.mark.parametrize(("preset", "motion"), [(p, m) for p, m in EVERY if (p, "general") not in HIDDEN])
def test_the_fit_has_the_same_information(preset: str, motion: str) -> None:
    """1/sd² of a step, from the fit's normal equations with one channel free, is λ of the dense problem for every pair,
    and the groups are the table's."""
    found, array = at(preset, motion), array_of(preset)
    onset = 6
    step = (np.arange(SAMPLES) >= onset).astype(float)
    size = (SAMPLES - onset) / noise_of(array) ** 2
    hidden_in, names = HIDDEN.get((preset, motion), "").split(), array.channels
    tied = np.zeros((len(array), len(array)), dtype=np.bool_)
    for k in [None, *range(len(array))]:
        if k is not None and preset == "coplanar-3" and names[k] in ("a0z", "a1z", "a2z"):
            continue  # without a normal channel the fit does not tell α: test_channels_that_cannot_be_left_out
        expected = separations(array, rates(motion), step, free=k)
        seen = 1 / step_sds(found, found.data.time[onset], free=k) ** 2 / size
        assert seen == pytest.approx(expected, rel=1e-5, abs=1e-8)
        if k is not None:
            tied[k] = seen < SEEN
    pairs = pairs_of(names, set(hidden_in), tied)
    assert pairs == set(TABLE[preset][motion].split())


@pytest.mark.parametrize("preset", ["3-2-1", "rgla", "compact-cube"])
@pytest.mark.parametrize("motion", sorted(MOTIONS))
def test_a_step_is_never_known_where_nothing_is_redundant(preset: str, motion: str) -> None:
    assert np.isinf(step_sds(at(preset, motion), 6 * STEP)).all()


@pytest.mark.parametrize("preset", ["naap-3222", "coplanar-3-gyro", "6aw", "naap-gyro"])
@pytest.mark.parametrize("motion", ["rest", "y", "general"])
def test_uncertain_calibration_only_hides(preset: str, motion: str) -> None:
    """λ falls, never rises, as calibration errors get wider priors, and what was tied stays tied."""
    array, found = array_of(preset), at(preset, motion)
    for k in (None, 0, array.index("a3x") if "a3x" in array.channels else 3):
        narrow = np.zeros(len(array))
        for part in (0.0, 0.1, 1.0):
            data = replace(found.data, prior_sd=part * calibration.prior_sds(array))
            wide = step_sds(trajectory.fit(data, found.omega), 6 * STEP, free=k)
            assert (wide >= narrow * (1 - 1e-6)).all()
            narrow = wide


# --- beyond the linear limit ------------------------------------------------------------------------------------


def misfit(preset: str, faulty: str, free: str, size: float) -> float:
    """Cost of a fault, `size` noises high, in one channel at rest, with another free to explain it."""
    found, array = at(preset, "rest"), array_of(preset)
    readings, weight = found.data.readings.copy(), found.data.weight.copy()
    j = array.index(faulty)
    readings[:, j] += size * FAULTS["pulse"] * noise_of(array)[j]
    weight[:, array.index(free)] = 0.0
    start = found.omega
    for part in (0.25, 0.5, 0.75, *[1.0] * 6):  # followed from the linear limit; every fit goes a step further
        between = found.data.readings + part * (readings - found.data.readings)
        done = trajectory.fit(replace(found.data, readings=between, weight=weight), start)
        start = done.omega
    return done.cost


@pytest.mark.parametrize("pair", [("a1y", "a2x"), ("a3x", "a1z"), ("a2z", "a3y")], ids="-".join)
def test_a_naap_at_rest_never_separates_twins(pair: tuple[str, str]) -> None:
    """The body that the wrong twin feigns turns about their axis, where they are twins as well."""
    for size in (1.0, 10.0, 100.0):
        assert misfit("naap-3222", *pair, size) < 1e-6 * size**2


@pytest.mark.parametrize(
    ("preset", "pair"),
    [("triax-3", ("a1y", "a2x")), ("triax-4", ("a3x", "a1z")), ("coplanar-3-gyro", ("a1z", "gy"))],
)
def test_twins_at_rest_of_other_arrays_are_so_for_small_faults_only(preset: str, pair: tuple[str, str]) -> None:
    """The feigned turning pulls at the channels along the arms with ω² r, ω in proportion to the fault: the cost grows
    as its fourth power. So a large fault at rest is rightly named where the table has a group."""
    costs = [misfit(preset, *pair, size) for size in (0.5, 1.0, 2.0)]
    for small, large in pairwise(costs):
        assert large / small == pytest.approx(2.0**4, rel=0.05)


# --- the diagnosis ------------------------------------------------------------------------------------------------


def told(preset: str, motion: str, fault: str, seed: int = 3) -> Diagnosis:
    case = Case(simulate(parse_rig(preset_text(preset)), motion, faults=[fault], seed=seed).recording)
    return diagnose(case, {e.channel: e.fault for e in case.evidence if e.fault})


AXIS = {"rest": "rest", "planar-x": "x", "planar": "y", "planar-z": "z"}
QUICK = [("rest", "a1y"), ("rest", "a3x"), ("rest", "a2z"), ("planar-x", "a3y"), ("planar", "a1z"), ("planar-z", "a2x")]
SLOW = [(m, c) for m in AXIS for c in ("a1y", "a2x", "a1z", "a3x", "a2z", "a3y") if (m, c) not in QUICK]


@pytest.mark.parametrize(("motion", "channel"), [*QUICK, *(pytest.param(*one, marks=pytest.mark.slow) for one in SLOW)])
def test_diagnosis_of_a_naap_reports_the_groups(motion: str, channel: str) -> None:
    """At rest each arm channel with its twin, in a plane the twins about its normal. Other twins are told apart only as
    far as the motion and the size of the fault allow; nobody else is ever in the group."""
    twins = next(set(p.split("-")) for p in NAAP["rest"].split() if channel in p)
    found = told("naap-3222", motion, f"{channel}:unknown=5")
    assert channel in found.channels, found.reason
    assert set(found.channels) <= twins
    if any(channel in p for p in NAAP[AXIS[motion]].split()):
        assert found.status is Status.AMBIGUOUS
        assert set(found.channels) == twins


# --- groups that a search can miss ---------------------------------------------------------------------------------


@pytest.mark.parametrize(("channel", "group"), [("a0z", {"a0z", "a2z"}), ("a3x", {"a0x", "a3x"})])
def test_diagnosis_of_6aw_reports_its_pairs(channel: str, group: set[str]) -> None:
    """The last row of METHODS.md 3 that has groups: pairs that no motion separates, and yet a fault is seen."""
    found = told("6aw", "drop", f"{channel}:zero_shift=3")
    assert found.status is Status.AMBIGUOUS
    assert group <= set(found.channels)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("motion", "channel"), [("rest", "a0z"), ("planar-z", "a1z"), ("planar-x", "a2z"), ("planar-x", "a1z")]
)
def test_channels_that_cannot_be_left_out_are_not_put_on_others(motion: str, channel: str) -> None:
    """Normal channels of three coplanar triaxes: without one of them ω is only told by its own square. Until that is
    fitted, such a channel stays in every group, or nobody is accused."""
    found = told("coplanar-3", motion, f"{channel}:unknown=3")
    assert channel in found.channels or not found.channels, found.reason


@pytest.mark.slow
@pytest.mark.parametrize(
    ("preset", "fault"), [("coplanar-3-gyro", "gy:zero_shift=3"), ("triax-3", "a1y:zero_shift=30")]
)
def test_a_large_shift_at_the_event_is_told(preset: str, fault: str) -> None:
    found = told(preset, "rest", fault)
    assert fault.split(":")[0] in found.channels, found.reason


@pytest.mark.slow
def test_a_kind_of_fault_does_not_name_a_channel_whose_rival_explains_as_much() -> None:
    """A smooth error of 1 rad/s in gy, far under its smallest isolable size: to name the twin alone is worse than the
    group (METHODS.md 3)."""
    found = told("coplanar-3-gyro", "drop", "gy:unknown=1", seed=11)
    assert "gy" in found.channels, found.reason
