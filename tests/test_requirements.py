"""Arrays and readings that a scheme cannot use: one sentence with the quantity, what is expected and what to change."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from nineaudit.array import FloatArray, Sensor, SensorArray
from nineaudit.case import Case
from nineaudit.comparison import compare
from nineaudit.errors import EstimationError
from nineaudit.motion import motion_of
from nineaudit.recording import Recording
from nineaudit.rig import Rig, parse_rig, preset_text
from nineaudit.schemes.requirements import require_acceleration, require_alpha, require_readings
from nineaudit.simulate import simulate


def triaxes(*points: tuple[float, float, float]) -> SensorArray:
    """A triax at each point, mm."""
    return SensorArray(
        tuple(
            Sensor(f"a{i}{axis}", "accelerometer", np.array(point) * 1e-3, np.eye(3)[k], f"a{i}{axis}")
            for i, point in enumerate(points)
            for k, axis in enumerate("xyz")
        )
    )


def with_readings(recording: Recording, readings: FloatArray) -> Recording:
    return replace(recording, readings=readings, valid=np.isfinite(readings))


@pytest.fixture(scope="module")
def naap() -> Recording:
    return simulate(parse_rig(preset_text("naap-3222")), "oblique", seed=2, duration_s=0.06).recording


@pytest.mark.parametrize(
    ("array", "said"),
    [
        (triaxes((0, 0, 0), (50, 0, 0), (100, 0, 0)), "'9 accelerometers, H of rank 5, condition number infinite'"),
        (triaxes((0, 0, 0), (0, 0, 0)), "'6 accelerometers, H of rank 3, condition number infinite'"),
        (triaxes((0, 0, 0), (50, 0, 0)).select(range(5)), "'5 accelerometers, H of rank 4"),
        (SensorArray(()), "'0 accelerometers, H of rank 0"),
    ],
    ids=["collinear", "one point", "too few", "none"],
)
def test_an_array_that_does_not_tell_alpha_is_named_by_rank_and_condition(array: SensorArray, said: str) -> None:
    with pytest.raises(EstimationError, match=said) as raised:
        require_alpha(array)
    assert "expected rank 6" in str(raised.value)
    assert "not all along one axis nor at points on one line" in str(raised.value)
    require_alpha(triaxes((0, 0, 0), (50, 0, 0), (0, 50, 0)))


def test_the_condition_number_of_nearly_one_line_is_its_length_over_its_bend() -> None:
    """Scaled by the length L, a middle triax off the line by d turns about it by an arm of about d/L."""
    with pytest.raises(EstimationError) as raised:
        require_alpha(triaxes((0, 0, 0), (50, 0, 0), (100, 0.001, 0)))
    condition = float(str(raised.value).partition("condition number ")[2].partition("'")[0])
    assert 1e5 / 5 < condition < 1e5 * 5


def test_the_fit_and_the_comparison_give_the_same_reason() -> None:
    whole: Rig = parse_rig(preset_text("compact-cube"))
    rig = replace(whole, array=SensorArray(tuple(s for s in whole.array.sensors if s.kind == "accelerometer")))
    case = Case(simulate(rig, "oblique", seed=1, duration_s=0.06).recording)
    with pytest.raises(EstimationError, match="3 accelerometers, H of rank 3") as raised:
        motion_of(case)
    with pytest.raises(EstimationError, match="fewer than two schemes") as compared:
        compare(case, draws=2)
    assert f"map: {raised.value}" in str(compared.value)


def test_rate_sensors_alone_do_not_tell_accelerations() -> None:
    rig = parse_rig(preset_text("rgla"))
    gyros = replace(rig, array=SensorArray(tuple(s for s in rig.array.sensors if s.kind == "gyroscope")))
    with pytest.raises(EstimationError, match="found '0 accelerometers, axes of rank 0'; expected rank 3"):
        motion_of(Case(simulate(gyros, "oblique", seed=1, duration_s=0.06).recording), "rates")
    require_acceleration(rig.array)


def test_a_dead_channel_is_named_where_it_is_needed(naap: Recording) -> None:
    readings = naap.readings.copy()
    readings[:, naap.rig.array.index("a1y")] = np.nan
    case = Case(with_readings(naap, readings))
    for run in (lambda: motion_of(case, "padgaonkar"), lambda: compare(case, draws=2)):
        with pytest.raises(EstimationError, match=r"channel a1y without a valid sample.*take it out of the rig file"):
            run()
    with pytest.raises(EstimationError, match=r"channels a0x, .* without a valid sample.*are signal names and units"):
        motion_of(Case(with_readings(naap, np.full_like(readings, np.nan))))


def test_readings_beyond_any_sensor_ask_for_the_unit(naap: Recording) -> None:
    case = Case(with_readings(naap, naap.readings * 1e200))
    for run in (lambda: motion_of(case), lambda: motion_of(case, "ninacc"), lambda: compare(case, draws=2)):
        with pytest.raises(EstimationError, match=r"a reading that no sensor gives.*is its unit right"):
            run()
    require_readings(naap.rig.array, naap.readings, each=True)


def test_a_scheme_that_diverges_within_the_uncertainties_does_not_stop_the_others(naap: Recording) -> None:
    """Readings ten times too large, m/s² taken for g: ω fed back by ninacc or six accelerometers diverges somewhere."""
    longer = simulate(naap.rig, "sled", seed=0).recording
    found = compare(Case(with_readings(longer, longer.readings * 9.80665)), draws=3)
    assert {"map", "product-free"} <= set(found.curves)
    late = [why for why in found.refused.values() if why.startswith("on readings changed within the rig's uncertaint")]
    assert late
    assert all("diverges" in why for why in late)
    assert {row.scheme for row in found.rows} == set(found.curves) - {found.reference}
