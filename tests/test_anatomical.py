"""From the instrument's frame to an anatomical one: the same body, the same readings, other components."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from nineaudit import cli
from nineaudit.case import Case
from nineaudit.motion import Start, motion_of
from nineaudit.physics import rigid_body
from nineaudit.physics.laboratory import attitude_of, euler_of
from nineaudit.recording import Recording
from nineaudit.rig import Point, Rig, parse_rig, preset_text
from nineaudit.schemes.anatomical import in_frame
from nineaudit.simulate import simulate

ORIGIN, EULER = np.array([0.02, -0.01, 0.03]), np.radians([35.0, -20.0, 110.0])
TURN = attitude_of(EULER)


@pytest.fixture(scope="module")
def made() -> Recording:
    return simulate(parse_rig(preset_text("triax-3")), "sled", seed=2).recording


def with_rig(recording: Recording, rig: Rig) -> Case:
    return Case(replace(recording, rig=rig))


def test_readings_of_the_body_are_the_same_in_either_frame(made: Recording) -> None:
    """An accelerometer does not know what its place is called."""
    rig, rng = made.rig, np.random.default_rng(1)
    omega, alpha, a0 = (s * rng.standard_normal((50, 3)) for s in (30.0, 3000.0, 500.0))
    there = in_frame(rig, ORIGIN, EULER).array
    moved = rigid_body.acceleration_at(ORIGIN, a0, alpha, omega)
    every = rig.array.is_accelerometer
    one = rigid_body.predict(rig.array.positions, rig.array.axes, every, a0, alpha, omega)
    other = rigid_body.predict(there.positions, there.axes, every, *(v @ TURN for v in (moved, alpha, omega)))
    np.testing.assert_allclose(other, one, rtol=0, atol=1e-9)


@pytest.mark.parametrize("method", ["ninacc", "map"])
def test_motion_is_that_of_the_instrument_in_anatomical_components(made: Recording, method: str) -> None:
    """ω turned, the acceleration of the anatomical origin, and one laboratory path of a point, told in either."""
    start = Start(euler=(0.3, 0.1, -0.2))
    there_start = euler_of((attitude_of(np.array(start.euler)) @ TURN)[None])[0]
    there = in_frame(made.rig, ORIGIN, EULER)
    own = motion_of(with_rig(made, made.rig), method, start, count=0)
    found = motion_of(with_rig(made, there), method, Start(euler=tuple(there_start)), count=0)
    moved = rigid_body.acceleration_at(ORIGIN, own.a0, own.alpha, own.omega)
    fit = 2e-3 if method == "map" else 1e-9  # the fit stops at a part of its cost
    for got, expected in ((found.omega, own.omega), (found.alpha, own.alpha), (found.a0, moved)):
        np.testing.assert_allclose(got, expected @ TURN, rtol=0, atol=fit * np.abs(expected).max())
    (name,) = own.paths
    np.testing.assert_allclose(found.paths[name].a, own.paths[name].a, atol=fit * np.abs(own.paths[name].a).max())


def test_command_takes_a_frame(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    rig = tmp_path / "rig.toml"
    rig.write_text(preset_text("triax-3"), encoding="utf-8")
    record = tmp_path / "T.csv"
    for arguments in (
        ["simulate", str(rig), "--motion", "sled", "--output", str(record)],
        ["motion", str(record), "--rig", str(rig), "--method", "ninacc"],
        ["motion", str(record), "--rig", str(rig), "--method", "ninacc", "--frame", "0,0,0,90,0,0"],
    ):
        with pytest.raises(SystemExit) as ended:
            cli.main(arguments)
        assert ended.value.code == 0
    peaks = [line for line in capsys.readouterr().out.splitlines() if line.startswith("  peak ω")]
    values = [line.partition("  u ")[0] for line in peaks]  # u is that of instruments drawn in each frame anew
    assert len(values) == 2
    assert values[0] == values[1]


def test_a_frame_of_five_numbers_is_a_sentence(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    rig = tmp_path / "rig.toml"
    rig.write_text(preset_text("triax-3"), encoding="utf-8")
    with pytest.raises(SystemExit) as ended:
        cli.main(["motion", "none.csv", "--rig", str(rig), "--frame", "0,0,0,90,0"])
    assert ended.value.code == 2
    assert "--frame" in capsys.readouterr().err


def test_points_move_with_the_frame(made: Recording) -> None:
    rig = replace(made.rig, points=(Point("O", ORIGIN),))
    np.testing.assert_allclose(in_frame(rig, ORIGIN, EULER).points[0].position, 0.0, atol=1e-15)
