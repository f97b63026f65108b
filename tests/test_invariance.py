"""What a diagnosis must not depend on: order of channels, body frame, units, clock. And its limits."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from nineaudit.array import SensorArray
from nineaudit.case import Case
from nineaudit.diagnose import Diagnosis, Status, diagnose
from nineaudit.readers.clocks.assemble import assemble
from nineaudit.readers.contents import Contents
from nineaudit.recording import Recording, Source, Trace
from nineaudit.rig import parse_rig, preset_text
from nineaudit.simulate import simulate
from nineaudit.units import G0

CASES = {
    "closed forms": ("naap-3222", "general", "a2x:gain=25%", 8),
    "closed forms, a group": ("naap-3222", "planar", "a3x:clipping=0.5", 3),
    "search, one": ("naap-gyro", "drop", "a3x:gain=-20%", 11),
    "search, a group": ("coplanar-3-gyro", "drop", "a1z:unknown=1.5", 11),
    "search, healthy": ("triax-4", "drop", None, 1),
}

SLOW = ("search, a group",)
ALL = [pytest.param(c, marks=pytest.mark.slow) if c in SLOW else c for c in CASES]
OF_SEARCH = [c for c in ALL if c not in ("closed forms", "closed forms, a group")]


@cache
def recorded(case: str) -> Recording:
    preset, motion, fault, seed = CASES[case]
    return simulate(parse_rig(preset_text(preset)), motion, faults=[fault] if fault else [], seed=seed).recording


def diagnosed(recording: Recording) -> Diagnosis:
    case = Case(recording)
    return diagnose(case, {e.channel: e.fault for e in case.evidence if e.fault})


@cache
def answer(case: str) -> Diagnosis:
    return diagnosed(recorded(case))


def with_sensors(recording: Recording, array: SensorArray) -> Recording:
    return replace(recording, rig=replace(recording.rig, array=array))


def same(one: Diagnosis, other: Diagnosis, tolerance: float = 1e-5, shift: float = 0.0) -> None:
    """The same answer to `tolerance`, which is rounding amplified by fits that stop when a step gains 1e-4 of the cost;
    times `shift` s later in the other."""
    assert other.status is one.status
    assert set(other.channels) == set(one.channels)
    assert other.healthy_statistic == pytest.approx(one.healthy_statistic, rel=tolerance)
    assert other.limit == one.limit
    for name in ("smallest_detectable", "smallest_isolable"):
        sizes, others = getattr(one, name), getattr(other, name)
        assert set(sizes) == set(others)
        assert [others[c] for c in sizes] == pytest.approx(list(sizes.values()), rel=10 * tolerance)
    likely, others = ({c.channels: c for c in d.candidates if c.probability > 1e-6} for d in (one, other))
    assert {frozenset(c) for c in likely} == {frozenset(c) for c in others}
    for channels, candidate in likely.items():
        match = others.get(channels) or others[channels[::-1]]
        assert match.fault == candidate.fault
        assert match.probability == pytest.approx(candidate.probability, abs=100 * tolerance)
        assert match.statistic == pytest.approx(candidate.statistic, rel=tolerance)
        for key, value in candidate.parameters.items():
            late = shift if key == "at" and candidate.fault in ("zero_shift", "drift") else 0.0
            assert match.parameters[key] == pytest.approx(value + late, rel=100 * tolerance)
    if one.interval is not None:
        assert other.interval == pytest.approx([t + shift for t in one.interval], abs=1e-9)


def test_cases_are_what_they_are_called() -> None:
    for case, (_, _, fault, _) in CASES.items():
        found = answer(case)
        expected = Status.HEALTHY if fault is None else Status.AMBIGUOUS if "group" in case else Status.ISOLATED
        assert found.status is expected, (case, found.reason)
        assert fault is None or fault.split(":")[0] in found.channels


# --- order --------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("case", ALL)
def test_order_of_the_channels_permutes_the_answer(case: str) -> None:
    """Statuses, names, probabilities, sizes: everything, channel by channel."""
    found = recorded(case)
    order = np.random.default_rng(5).permutation(len(found.rig.array))
    shuffled = replace(
        with_sensors(found, found.rig.array.select(order)),
        readings=found.readings[:, order],
        valid=found.valid[:, order],
        native=tuple(found.native[i] for i in order),
        clocks=tuple(found.clocks[i] for i in order),
    )
    same(answer(case), diagnosed(shuffled))


# --- frame --------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("case", OF_SEARCH)
def test_the_body_frame_may_be_turned(case: str) -> None:
    """Layouts without closed forms, which know no frame but their own: sensors turned together, the same readings."""
    turn = Rotation.from_rotvec([0.4, -1.1, 2.0]).as_matrix()
    found = recorded(case)
    sensors = (replace(s, position=turn @ s.position, axis=turn @ s.axis) for s in found.rig.array.sensors)
    same(answer(case), diagnosed(with_sensors(found, SensorArray(tuple(sensors)))))


@pytest.mark.parametrize("case", ["search, one", "search, healthy"])
def test_the_origin_may_be_moved(case: str) -> None:
    found = recorded(case)
    sensors = (replace(s, position=s.position + np.array([0.03, -0.02, 0.05])) for s in found.rig.array.sensors)
    same(answer(case), diagnosed(with_sensors(found, SensorArray(tuple(sensors)))))


@pytest.mark.parametrize("case", ALL)
def test_axes_may_change_places(case: str) -> None:
    """x → y → z → x is a turn that the closed forms know too: the same package with other names of its axes."""
    found = recorded(case)
    sensors = (replace(s, position=np.roll(s.position, 1), axis=np.roll(s.axis, 1)) for s in found.rig.array.sensors)
    same(answer(case), diagnosed(with_sensors(found, SensorArray(tuple(sensors)))))


# --- units --------------------------------------------------------------------------------------------------------

OTHER_UNITS = (
    ('length = "mm"', 'length = "m"'),
    ('acceleration = "g_0"', 'acceleration = "m/s^2"'),
    ('angular_rate = "rad/s"', 'angular_rate = "deg/s"'),
    ("[50.0, 50.0, 50.0]", "[0.05, 0.05, 0.05]"),
    ("[50.0, 50.0]", "[0.05, 0.05]"),
    ("zero = 0.1 ", f"zero = {0.1 * G0!r} "),
    ("noise = 0.3 ", f"noise = {0.3 * G0!r} "),
    ("zero_rate = 0.01 ", f"zero_rate = {float(np.degrees(0.01))!r} "),
    ("noise_rate = 0.05 ", f"noise_rate = {float(np.degrees(0.05))!r} "),
    ("position = 0.5 ", "position = 0.0005 "),
    ("range = 500.0", f"range = {500.0 * G0!r}"),
    ("range = 100.0", f"range = {float(np.degrees(100.0))!r}"),
)


def in_units(text: str, found: Recording, acceleration: float, rate: float) -> Recording:
    """The recording as a file without units would hold it, read with the rig of `text`."""
    kinds = found.rig.array.is_accelerometer
    traces = tuple(
        Trace(t.channel, t.signal, t.time, t.values / (acceleration if held else rate))
        for t, held in zip(found.native, kinds, strict=True)
    )
    return assemble(Contents(traces), parse_rig(text), Source(Path("test"), "test", "", 0))


@pytest.mark.parametrize("case", ALL)
def test_units_do_not_matter(case: str) -> None:
    """A rig file in mm, g and rad/s, and one in m, m/s² and deg/s, each with a recording in its units."""
    text, found = preset_text(CASES[case][0]), recorded(case)
    other = text
    for old, new in OTHER_UNITS:
        other = other.replace(old, new)
    assert other != text
    same(diagnosed(in_units(text, found, G0, 1.0)), diagnosed(in_units(other, found, 1.0, np.pi / 180.0)))


@pytest.mark.parametrize("case", OF_SEARCH)
def test_signs_of_all_axes_do_not_matter(case: str) -> None:
    """A sensor turned round and wired with the other sign is the same sensor."""
    found = recorded(case)
    flip = np.where(np.arange(len(found.rig.array)) % 2, 1.0, -1.0)
    sensors = tuple(replace(s, axis=f * s.axis) for s, f in zip(found.rig.array.sensors, flip, strict=True))
    native = tuple(replace(t, values=f * t.values) for t, f in zip(found.native, flip, strict=True))
    turned = replace(with_sensors(found, SensorArray(sensors)), readings=found.readings * flip, native=native)
    same(answer(case), diagnosed(turned))


# --- clock --------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("case", ALL)
def test_the_clock_may_start_anywhere(case: str) -> None:
    """Half an hour later, and the rig's word on when the body rested with it. Stamps then keep 2e-13 s."""
    found, late = recorded(case), 2048.0
    rest = found.rig.pre_trigger
    assert rest is not None
    later = replace(
        found,
        time=found.time + late,
        native=tuple(replace(t, time=t.time + late) for t in found.native),
        rig=replace(found.rig, pre_trigger=(rest[0] + late, rest[1] + late)),
    )
    same(answer(case), diagnosed(later), shift=late)


@pytest.mark.parametrize("case", ["closed forms", "search, healthy"])
def test_last_bits_of_the_rate_do_not_matter(case: str) -> None:
    """A clock of 10 kHz that is read from its stamps has 9999.999999999996 Hz, no slower than class 1000 needs."""
    found = recorded(case)
    assert found.rate == 10_000.0
    clocks = tuple(replace(c, rate=c.rate * (1.0 - 4e-16)) for c in found.clocks)
    same(answer(case), diagnosed(replace(found, clocks=clocks)))


# --- limits -------------------------------------------------------------------------------------------------------


def at_its_word(recording: Recording, part: float, noise: float = 1.0) -> Recording:
    """The recording of a rig whose calibration is uncertain by `part` of what it was, with `noise` times the noise."""
    sensors = tuple(
        replace(
            s,
            u_gain=part * s.u_gain,
            u_zero=part * s.u_zero,
            u_alignment=part * s.u_alignment,
            u_position=part * s.u_position,
            u_timing=part * s.u_timing,
            noise=None if s.noise is None else noise * s.noise,
        )
        for s in recording.rig.array.sensors
    )
    return with_sensors(recording, SensorArray(sensors))


@pytest.mark.parametrize("preset", ["naap-3222", "naap-gyro", "triax-4"])
def test_certain_calibration_is_the_limit_of_a_small_uncertainty(preset: str) -> None:
    """U → 0: no division by it, no jump; the white-noise answer."""
    drawn = simulate(parse_rig(preset_text(preset)), "drop", faults=["a3x:gain=-20%"], seed=2, imperfect=False)
    none = diagnosed(at_its_word(drawn.recording, 0.0))
    assert none.status is Status.ISOLATED
    assert none.channels == ("a3x",)
    same(none, diagnosed(at_its_word(drawn.recording, 1e-6)))


@pytest.mark.parametrize("preset", ["naap-gyro", "triax-4"])
def test_sizes_are_in_proportion_to_the_noise_of_a_certain_instrument(preset: str) -> None:
    """Nothing else limits it: a tenth of the noise shows and pins a fault of a tenth."""
    clean = simulate(parse_rig(preset_text(preset)), "drop", seed=2, imperfect=False, noise=False).recording
    sizes = [diagnosed(at_its_word(clean, 0.0, noise)) for noise in (1.0, 0.5)]
    for channel in clean.channels:
        for of in ("smallest_detectable", "smallest_isolable"):
            whole, half = (getattr(d, of)[channel] for d in sizes)
            assert half == pytest.approx(whole / 2, rel=1e-3)


@pytest.mark.parametrize("preset", ["naap-3222", "naap-gyro", "triax-4"])
def test_without_noise_and_errors_the_record_costs_nothing(preset: str) -> None:
    """What is left of the cost is the truncation of the quadrature: a small part of one unit per degree of freedom."""
    clean = simulate(parse_rig(preset_text(preset)), "drop", seed=2, imperfect=False, noise=False).recording
    found = diagnosed(at_its_word(clean, 0.0))
    assert found.status is Status.HEALTHY
    assert found.healthy_statistic is not None
    assert found.healthy_statistic < 0.05


def test_the_zero_of_a_channel_does_not_matter() -> None:
    """A constant that was there before the event is taken off with the zero (SAE J1727)."""
    found = recorded("search, one")
    off = 5.0 * np.random.default_rng(3).standard_normal(len(found.rig.array))
    moved = replace(
        found,
        readings=found.readings + off,
        native=tuple(replace(t, values=t.values + o) for t, o in zip(found.native, off, strict=True)),
    )
    same(answer("search, one"), diagnosed(moved))
