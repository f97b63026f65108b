"""A cause that many channels share is not blamed on one of them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from nineaudit.array import SensorArray, frozen
from nineaudit.case import Case
from nineaudit.diagnose import Diagnosis, Status, diagnose
from nineaudit.estimate.causes import Cause, blocks, ratios
from nineaudit.estimate.common import as_noisy_as_at_rest, promised, tied
from nineaudit.estimate.separation import coarser
from nineaudit.recording import Recording
from nineaudit.rig import parse_rig, preset_text
from nineaudit.simulate import simulate
from nineaudit.units import G0


def recorded(preset: str, motion: str) -> Recording:
    return simulate(parse_rig(preset_text(preset)), motion, seed=300).recording


def scaled(found: Recording, columns: np.ndarray, factor: float) -> Recording:
    return replace(found, readings=np.where(columns, factor, 1.0) * found.readings)


def answer(found: Recording) -> Diagnosis:
    return diagnose(Case(found))


@pytest.mark.parametrize(
    ("preset", "motion", "factor", "said"),
    [
        ("naap-3222", "oblique", 1 / G0, "as g and not m/s²"),
        ("naap-3222", "general", 1 / G0, "as g and not m/s²"),
        ("naap-3222", "oblique", G0, "as m/s² and not g"),
        ("6aw", "oblique", 1 / G0, "as g and not m/s²"),
        ("naap-3222", "oblique", -1.0, "opposite sign"),
    ],
)
def test_all_accelerometers_in_another_unit(preset: str, motion: str, factor: float, said: str) -> None:
    found = recorded(preset, motion)
    held = found.rig.array.is_accelerometer
    result = answer(scaled(found, held, factor))
    assert (result.status, result.channels) == (Status.UNDIAGNOSED, ())
    assert said in result.reason
    assert result.candidates[0].channels == tuple(np.array(found.rig.array.channels)[held])
    assert result.candidates[0].fault == ("polarity" if factor < 0 else "unit")


def test_a_block_elsewhere_is_placed_where_it_is() -> None:
    """Arm 1 stated 10 mm too long: the block is found at 50 mm, within its three standard deviations of 0.5 mm and
    what the noise leaves (1 mm)."""
    found = recorded("naap-3222", "oblique")
    sensors = tuple(
        replace(s, position=frozen(s.position + np.array([0.01, 0, 0]))) if s.channel in ("a1y", "a1z") else s
        for s in found.rig.array.sensors
    )
    result = answer(replace(found, rig=replace(found.rig, array=SensorArray(sensors))))
    assert (result.status, result.channels) == (Status.UNDIAGNOSED, ())
    assert result.candidates[0].channels == ("a1y", "a1z")
    assert result.candidates[0].fault == "position"
    assert abs(result.candidates[0].parameters["size"] - 0.010) < 2.5e-3


def test_ratios_hold_the_units_of_the_trade() -> None:
    found = ratios({"g": G0, "m/s²": 1.0, "mm/s²": 1e-3})
    for wanted in (G0, 1 / G0, 1e3, 1e-3):
        assert min(abs(f / wanted - 1.0) for f in found) < 1e-9
    assert blocks(parse_rig(preset_text("naap-3222")).array) == [(0, 1, 2), (3, 4), (5, 6), (7, 8)]


def test_what_an_unsettled_fit_would_gain_by_itself_is_no_promise_of_a_cause() -> None:
    """A cause that changes no reading promises nothing, on a coarser record whose fit has yet to settle."""
    at = coarser(Case(recorded("naap-3222", "oblique")).healthy, 250)
    none = np.zeros((1, len(at.data.array), len(at.data.time)))
    nothing = Cause("unknown", (), lambda data: data, 0.0, "nothing", slope=lambda _: none)
    alone = tied(at, none[:0])
    assert alone[1] > 0.0
    assert abs(promised(at, nothing, alone)) < 1e-9 * max(1.0, alone[1])


@pytest.mark.parametrize("factor", [0.05, 1 / G0, G0])
def test_shrinking_a_record_gains_nothing_in_the_noise_at_rest(factor: float) -> None:
    """What its residuals weigh is the same in every unit."""
    found = recorded("naap-gyro", "oblique")
    held = found.rig.array.is_accelerometer
    whole, other = (as_noisy_as_at_rest(Case(x).fit_data) for x in (found, scaled(found, held, factor)))
    np.testing.assert_allclose(other.weight * other.readings, whole.weight * whole.readings, rtol=1e-6, atol=1e-9)
