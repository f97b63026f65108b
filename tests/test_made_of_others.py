"""Readings that a repair made of the other channels are no measurements: no rule, no diagnosis counts them as such."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest

from nineaudit.auditing import audit
from nineaudit.case import Case
from nineaudit.checks.rigid_body import array_parity, constraint_equations
from nineaudit.engine import run
from nineaudit.errors import EstimationError
from nineaudit.finding import Measure, Verdict
from nineaudit.provenance import Provenance
from nineaudit.recording import Recording
from nineaudit.rig import parse_rig, preset_text
from nineaudit.rulebook import load_rulebook
from nineaudit.simulate import simulate

EVENT = (0.0, 1.0)


def remade(recording: Recording, channels: Sequence[str], stretch: tuple[float, float] = EVENT) -> Recording:
    """The recording, with a record that says that channels were made of the others."""
    document = {
        "channels": list(channels),
        "stretches_s": {c: [list(stretch)] for c in channels},
        "samples_replaced": 1,
        "method": "a test",
        "original": {"sha256": ""},
    }
    return replace(recording, source=replace(recording.source, provenance=Provenance(document, "a test")))


def with_fault(recording: Recording, channel: str, size: float) -> Recording:
    """A pulse of `size` m/s² in a channel, from 30 to 80 ms."""
    readings = recording.readings.copy()
    pulse = (recording.time > 0.03) & (recording.time < 0.08)
    readings[pulse, recording.rig.array.index(channel)] += size
    return replace(recording, readings=readings)


def measures(recording: Recording) -> dict[str, Measure]:
    found = constraint_equations(Case(recording), false_alarm=1e-3)
    assert isinstance(found, tuple)
    return {m.detail.removeprefix("constraint "): m for m in found}


@pytest.fixture(scope="module")
def nine() -> Recording:
    return simulate(parse_rig(preset_text("naap-3222")), "general", seed=4).recording


@pytest.fixture(scope="module")
def twelve() -> Recording:
    return simulate(parse_rig(preset_text("naap-gyro")), "general", seed=4, rate_hz=2000.0).recording


@pytest.mark.parametrize(
    ("channels", "left"),
    [
        ([], {"ωyωz", "ωzωx", "ωxωy"}),
        (["a1y"], {"ωyωz", "ωzωx"}),  # a1y and a0y, a2x and a0x tell ωxωy [Takhounts09 eq 14]
        (["a0x"], {"ωyωz"}),
        (["a1y", "a2x"], {"ωyωz", "ωzωx"}),
    ],
)
def test_a_constraint_of_a_made_channel_is_not_tested(nine: Recording, channels: list[str], left: set[str]) -> None:
    found = measures(remade(nine, channels) if channels else nine)
    assert set(found) == left
    assert all(m.value <= m.limit for m in found.values())


def test_a_constraint_is_tested_where_its_channels_were_measured(nine: Recording) -> None:
    bad = with_fault(nine, "a1y", 500.0)
    assert measures(bad)["ωxωy"].value > measures(bad)["ωxωy"].limit
    inside = measures(remade(bad, ["a1y"], (0.03, 0.08)))["ωxωy"]
    assert inside.value <= inside.limit
    beside = measures(remade(bad, ["a1y"], (0.05, 0.08)))["ωxωy"]
    assert beside.value > beside.limit
    assert beside.interval is not None
    assert 0.03 <= beside.interval[0] <= 0.051


def test_what_is_measured_is_still_held_against_itself(nine: Recording) -> None:
    """A fault in a3x shows in ωzωx, whoever was made."""
    found = measures(remade(with_fault(nine, "a3x", 500.0), ["a1y"]))
    assert found["ωzωx"].value > found["ωzωx"].limit


def test_with_no_constraint_left_there_is_a_reason_and_no_pass(nine: Recording) -> None:
    bare = remade(nine, ["a1y", "a3x", "a2z"])
    found = {f.rule: f for f in run(Case(bare), load_rulebook(select="RB301,RB302"))}
    for rule in ("RB301", "RB302"):
        assert found[rule].verdict is Verdict.NOT_EVALUATED
        assert "a1y, a3x, a2z were made of the other channels" in found[rule].reason


def test_parity_does_not_look_at_made_readings(twelve: Recording) -> None:
    """Whatever they are: ω is that of the rate sensors."""
    one = array_parity(Case(remade(twelve, ["a1y"])), false_alarm=1e-3)
    other = array_parity(Case(remade(with_fault(twelve, "a1y", 300.0), ["a1y"])), false_alarm=1e-3)
    assert isinstance(one, Measure)
    assert isinstance(other, Measure)
    assert other.value == pytest.approx(one.value, rel=1e-6)
    assert other.value <= other.limit
    plain = array_parity(Case(with_fault(twelve, "a1y", 300.0)), false_alarm=1e-3)
    assert isinstance(plain, Measure)
    assert plain.value > plain.limit
    elsewhere = array_parity(Case(remade(with_fault(twelve, "a3x", 300.0), ["a1y"])), false_alarm=1e-3)
    assert isinstance(elsewhere, Measure)
    assert elsewhere.value > elsewhere.limit


def test_a_made_rate_does_not_tell_the_rotation(twelve: Recording) -> None:
    """Three rate sensors: without one ω is not known, and nothing is tested."""
    with pytest.raises(EstimationError, match="gx was made of the other channels"):
        array_parity(Case(remade(twelve, ["gx"])), false_alarm=1e-3)


def test_residuals_of_what_is_left_have_the_scatter_that_their_budget_says(twelve: Recording) -> None:
    """(n,k) against the array without the channel, from noise alone: a law of the projection."""
    case = Case(remade(twelve, ["a1y"]))
    made, parity = case.made_blocks, case.parity
    assert np.isnan(parity.value[made]).all()
    row = int(np.flatnonzero(made.any(axis=1))[0])
    rest = [c for c in case.array.channels if c != "a1y"]
    alone = Case(twelve.only([case.array.index(c) for c in rest]))
    columns = [case.array.index(c) for c in rest]
    np.testing.assert_allclose(parity.noise[row, columns][:8], alone.parity.noise[row][:8], rtol=1e-9)
    np.testing.assert_allclose(parity.value[row, columns][:8], alone.parity.value[row][:8], rtol=1e-6, atol=1e-9)


def test_a_made_trace_is_no_evidence_of_a_fault(nine: Recording) -> None:
    """A made stretch that is flat says nothing of the sensor; a made jolt is no witness of a spike."""
    readings = nine.readings.copy()
    column = nine.rig.array.index("a1y")
    inside = (nine.time > 0.03) & (nine.time < 0.08)
    readings[inside, column] = 0.0
    traces = tuple(replace(t, values=readings[:, column]) if t.channel == "a1y" else t for t in nine.native)
    flat = replace(nine, readings=readings, native=traces)
    assert audit(flat).diagnosis.channels == ("a1y",)
    assert audit(remade(flat, ["a1y"], (0.0299, 0.0801))).diagnosis.channels == ()


def test_a_jolt_that_was_made_of_a_spike_is_no_witness_of_it(nine: Recording) -> None:
    readings, at = nine.readings.copy(), 600
    for channel, size in (("a2x", 3000.0), ("a1y", 1500.0)):
        readings[at, nine.rig.array.index(channel)] += size
    traces = tuple(replace(t, values=readings[:, nine.rig.array.index(t.channel)]) for t in nine.native)
    hit = replace(nine, readings=readings, native=traces)
    column = nine.rig.array.index("a2x")
    assert not Case(hit).evidence[column].spikes
    assert Case(remade(hit, ["a1y"])).evidence[column].spikes
