"""`nineaudit motion`: methods against the truth, uncertainties against what happened, files, page, extra triax."""

from __future__ import annotations

import csv
import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from jsonschema import Draft202012Validator
from scipy.spatial.transform import Rotation

from nineaudit import cli
from nineaudit.array import FloatArray, SensorArray
from nineaudit.case import Case
from nineaudit.errors import ConfigurationError, EstimationError
from nineaudit.finding import Verdict
from nineaudit.motion import Kinematics, Start, motion_of
from nineaudit.motion_can import as_recording
from nineaudit.motion_command import with_points
from nineaudit.motion_files import FRAME_TRANSFORM, POSE_IN_FRAME, columns, write_motion
from nineaudit.motion_methods import METHODS
from nineaudit.motion_triax import Judged, check_triax
from nineaudit.physics import kinematics, laboratory, rigid_body
from nineaudit.presets import PRESETS, preset_text
from nineaudit.readers import read
from nineaudit.report.motion_page import render_motion
from nineaudit.rig import Point, Rig, parse_rig
from nineaudit.simulate import Simulation, simulate
from nineaudit.simulate.published import alem_path
from nineaudit.units import G0

POINT = np.array([0.01, 0.0, -0.005])


def rig_of(preset: str) -> Rig:
    return replace(parse_rig(preset_text(preset)), points=(Point("CG", POINT),))


def rig_for(method: str) -> Rig:
    """A rig whose sensors the method is made for."""
    if method in ("rgla-fourier", "rgla-lanczos"):  # they cut their series at the noise: an instrument that has none
        quiet = tuple(replace(sensor, noise=1e-6) for sensor in rig_of("rgla").array.sensors)
        return replace(rig_of("rgla"), array=SensorArray(quiet))
    if method != "periphery":
        made_for = {"six-accelerometers": "3-2-1", "co-planar": "coplanar-3-gyro"}
        return rig_of(made_for.get(method, method if method in PRESETS else "naap-gyro"))
    rig, gyros = rig_of("triax-3"), rig_of("rgla").array
    return replace(rig, array=SensorArray(rig.array.sensors + tuple(s for s in gyros.sensors if s.kind == "gyroscope")))


@pytest.fixture(scope="module")
def naap() -> Simulation:
    return simulate(rig_of("naap-gyro"), "general", seed=1)


@pytest.fixture(scope="module")
def found(naap: Simulation) -> Kinematics:
    return motion_of(Case(naap.recording))


def path_of(made: Simulation, point: FloatArray = POINT) -> laboratory.Path:
    """The path of a point in the true motion, from rest at the origin of the laboratory."""
    t = made.truth
    attitude = kinematics.orientation(t.omega, t.time)
    origin = laboratory.origin_path(t.time, t.a0, attitude, np.zeros(3), np.zeros(3))
    return laboratory.point_path(point, origin, t.alpha, t.omega, attitude)


# Methods


@pytest.mark.parametrize("method", METHODS)
def test_every_method_gives_the_motion_of_a_perfect_instrument(method: str) -> None:
    """No noise, no calibration errors: what is left is truncation, parts in a thousand at 10 kHz."""
    made = simulate(rig_for(method), "general", seed=2, imperfect=False, noise=False)
    got = motion_of(Case(made.recording), method, count=0)
    true = path_of(made)
    pairs = [(got.omega, made.truth.omega), (got.alpha, made.truth.alpha), (got.paths["CG"].a_body, true.a_body)]
    pairs += [(got.paths["CG"].v, true.v), (got.paths["CG"].x, true.x)]
    for one, other in pairs:
        assert np.abs(one - other).max() < 2e-3 * np.abs(other).max()
    assert not got.u


def test_table_1_through_the_whole_command_with_what_is_known_at_its_start() -> None:
    """Alem's motion moves at its first sample: ω, angles, velocity and position are stated; deviations as published."""
    made = simulate(rig_of("triax-3"), "alem", rate_hz=1600.0, duration_s=0.5, imperfect=False, noise=False)
    euler, shift = alem_path(1600.0, 0.5)
    start = Start(*(tuple(v) for v in (made.truth.omega[0], euler[0][0], shift[1][0], shift[0][0])))
    case = Case(replace(made.recording, rig=replace(made.recording.rig, pre_trigger=None, points=())))
    assert case.rest is None
    for method in ("ninacc", "map"):
        got = motion_of(case, method, start, count=0)
        path = got.paths["origin"]
        pairs = [(got.alpha, made.truth.alpha), (got.omega, made.truth.omega), (got.euler, euler[0])]
        pairs += [(path.a, shift[2]), (path.v, shift[1]), (path.x, shift[0])]
        for (one, other), percent in zip(pairs, (0.07, 0.10, 0.08, 0.07, 0.10, 0.10), strict=True):
            limit = percent if method == "ninacc" else 1.0  # the fit's midpoint rule is of second order in the step
            assert 100.0 * (np.abs(one - other).max(axis=0) / np.abs(other).max(axis=0)).max() <= limit


def test_without_rest_and_without_omega_the_start_is_asked_for() -> None:
    made = simulate(rig_of("triax-3"), "alem", rate_hz=1600.0, duration_s=0.5)
    case = Case(replace(made.recording, rig=replace(made.recording.rig, pre_trigger=None)))
    with pytest.raises(EstimationError, match=r"--omega.*pre_trigger"):
        motion_of(case, "ninacc")


def test_a_method_that_the_array_does_not_allow_says_what_is_missing() -> None:
    case = Case(simulate(rig_of("triax-3"), "general").recording)
    for method, said in (
        ("padgaonkar", "no 3-2-2-2"),
        ("rates", "no rate sensors"),
        ("six-accelerometers", "expected 6"),
        ("product-free", "rank 9"),
    ):
        with pytest.raises(EstimationError, match=said):
            motion_of(case, method)
    with pytest.raises(ConfigurationError, match=r"did you mean ninacc\?"):
        motion_of(case, "nineacc")


def test_channels_that_contradict_one_another_are_not_passed_over() -> None:
    made = simulate(rig_of("naap-3222"), "general", faults=["a1y:clipping=0.5"], seed=1)
    assert any("nineaudit check" in note for note in motion_of(Case(made.recording), count=0).notes)


def test_a_dead_channel_does_not_cost_the_motion() -> None:
    """Of nine accelerometers and three rate sensors one has no sample: the others tell the motion as well, nearly."""
    made = simulate(rig_of("naap-gyro"), "general", seed=3)
    readings = made.recording.readings.copy()
    readings[:, 3] = np.nan
    case = Case(replace(made.recording, readings=readings, valid=np.isfinite(readings)))
    got = motion_of(case)
    error, size = got.paths["CG"].a_body - path_of(made).a_body, np.abs(path_of(made).a_body).max()
    assert np.sqrt((error**2).mean()) < 0.01 * size
    assert np.isfinite(got.u["CG a"]).all()
    with pytest.raises(EstimationError, match="channel a1y without a valid sample"):
        motion_of(case, "padgaonkar")


def test_eight_accelerometers_are_enough_for_least_squares() -> None:
    """A perfect 3-2-2-2 array less one channel: H has rank 6 still, and the feedback adds no error of its own."""
    made = simulate(rig_of("naap-3222"), "general", seed=2, imperfect=False, noise=False)
    readings = made.recording.readings.copy()
    readings[:, 3] = np.nan
    got = motion_of(Case(replace(made.recording, readings=readings, valid=np.isfinite(readings))), "ninacc")
    assert np.abs(got.omega - made.truth.omega).max() < 2e-3 * np.abs(made.truth.omega).max()


# Uncertainty


def test_errors_are_as_large_as_their_uncertainty_says(naap: Simulation, found: Kinematics) -> None:
    """Error over u, rms over the event and three axes: near 1; a record has few independent errors of ω, v and x."""
    true, path = path_of(naap), found.paths["CG"]
    attitude = kinematics.orientation(naap.truth.omega, naap.truth.time)
    turn = Rotation.from_matrix(np.einsum("nji,njk->nik", attitude, found.attitude)).as_rotvec()
    errors = {
        "omega": found.omega - naap.truth.omega,
        "alpha": found.alpha - naap.truth.alpha,
        "attitude": turn,
        "CG a": path.a_body - true.a_body,
        "CG v": path.v - true.v,
        "CG x": path.x - true.x,
    }
    assert set(errors) == set(found.u)
    event = naap.truth.time > 0.02
    for name, error in errors.items():
        ratio = np.sqrt(((error[event] / found.u[name][event]) ** 2).mean())
        assert 0.4 < ratio < 2.2, (name, ratio)


def test_what_is_reported_carries_its_uncertainty(naap: Simulation, found: Kinematics) -> None:
    from nineaudit.physics import injury

    size = kinematics.resultant(path_of(naap).a_body)
    truths = {
        "HIC15": injury.hic(size, naap.truth.time, 0.015).value,
        "HIC36": injury.hic(size, naap.truth.time, 0.036).value,
        "GSI": injury.gsi(size, naap.truth.time),
        "a3ms": injury.a3ms(size, naap.truth.time) / G0,
        "BrIC": injury.bric(naap.truth.omega),
    }
    for name, true in truths.items():
        value = found.values[name]
        assert value.u is not None
        assert abs(value.value - true) < 4.0 * value.u, name
        assert 0.0 < value.u < 0.03 * true, name  # gains of 0.5 % in three or more channels, to the power of 2.5


# Laws


def test_velocity_and_position_are_integrals_and_body_and_laboratory_are_one_vector(found: Kinematics) -> None:
    path = found.paths["CG"]
    np.testing.assert_allclose(
        np.einsum("nij,nj->ni", found.attitude, path.a_body), path.a, atol=1e-9 * np.abs(path.a).max()
    )
    np.testing.assert_allclose(np.linalg.norm(path.v_body, axis=1), np.linalg.norm(path.v, axis=1), rtol=1e-9)
    origin = path.x - np.einsum("nij,j->ni", found.attitude, POINT)
    assert np.abs(origin[0]).max() < 1e-12
    x = kinematics.integrate(
        kinematics.integrate(np.einsum("nij,nj->ni", found.attitude, found.a0), found.time), found.time
    )
    np.testing.assert_allclose(origin, x, atol=1e-9)
    np.testing.assert_allclose(laboratory.attitude_of(found.euler), found.attitude, atol=1e-12)
    np.testing.assert_allclose(Rotation.from_quat(found.quaternion).as_matrix(), found.attitude, atol=1e-12)


@pytest.mark.parametrize("angles", [(0.0, 0.0, 0.0), (0.7, -0.4, 1.2)])
def test_the_start_turns_and_shifts_the_laboratory_and_not_the_body(
    naap: Simulation, angles: tuple[float, ...]
) -> None:
    case = Case(naap.recording)
    plain = motion_of(case, "padgaonkar")
    yaw, pitch, roll = angles
    moved = motion_of(case, "padgaonkar", Start(None, (yaw, pitch, roll), (1.0, 2.0, 3.0), (4.0, 5.0, 6.0)))
    turn = laboratory.attitude_of(np.array(angles))
    one, other = plain.paths["CG"], moved.paths["CG"]
    np.testing.assert_allclose(other.a_body, one.a_body, atol=1e-9)
    shifted = one.x @ turn.T + np.outer(plain.time - plain.time[0], [1.0, 2.0, 3.0]) + [4.0, 5.0, 6.0]
    np.testing.assert_allclose(other.x, shifted, atol=1e-9)
    assert {n: v.value for n, v in moved.values.items()} == pytest.approx({n: v.value for n, v in plain.values.items()})


def test_gravity_is_put_right_by_the_initial_orientation() -> None:
    """Sensors that feel gravity, zeroed at rest: with --gravity the motion comes back, else up to 2 g are left."""
    rig = rig_of("naap-gyro")
    still = simulate(rig, "general", seed=4, imperfect=False, noise=False)
    heavy = simulate(rig, "general", seed=4, imperfect=False, noise=False, gravity=True)
    case = Case(heavy.recording)
    right = motion_of(case, "rates", Start(gravity=True)).a0
    left = motion_of(case, "rates").a0
    size = np.abs(still.truth.a0).max()
    assert np.abs(right - still.truth.a0).max() < 1e-3 * size
    turned = kinematics.orientation(still.truth.omega, still.truth.time)
    gone = np.einsum("nij,i->nj", turned - turned[0], [0.0, 0.0, G0])
    np.testing.assert_allclose(left - still.truth.a0, -gone, atol=1e-3 * size)
    assert np.abs(gone).max() > 1.0


def test_the_order_of_the_sensors_does_not_matter(naap: Simulation, found: Kinematics) -> None:
    from nineaudit.motion_triax import _without

    order = np.random.default_rng(5).permutation(len(naap.recording.channels)).tolist()
    same = _without(naap.recording, [], POINT)
    shuffled = replace(
        same,
        rig=replace(naap.recording.rig, array=naap.recording.rig.array.select(order)),
        readings=same.readings[:, order],
        valid=same.valid[:, order],
        native=tuple(same.native[k] for k in order),
        clocks=tuple(same.clocks[k] for k in order),
    )
    got = motion_of(Case(shuffled), count=0)
    assert np.abs(got.omega - found.omega).max() < 1e-3 * np.abs(found.u["omega"]).max()  # where the fit settles


@pytest.mark.parametrize("method", ["map", "ninacc"])
def test_other_body_axes_give_the_same_path_in_the_laboratory(method: str) -> None:
    """The same instrument described in turned body axes, the laboratory where it was. The fit stops within its
    tolerance, so its two answers are one within their uncertainty; the scheme has no tolerance."""
    turn = Rotation.from_euler("ZYX", [0.4, -0.7, 1.1])
    one = simulate(rig_of("triax-4"), "general", seed=5).recording
    sensors = [
        replace(s, position=turn.apply(np.array(s.position)), axis=turn.apply(np.array(s.axis)))
        for s in one.rig.array.sensors
    ]
    rig = replace(one.rig, array=SensorArray(tuple(sensors)), points=(Point("CG", turn.apply(POINT)),))
    yaw, pitch, roll = turn.inv().as_euler("ZYX")
    first = motion_of(Case(one), method)
    second = motion_of(Case(replace(one, rig=rig)), method, Start(euler=(yaw, pitch, roll)), count=0)
    for name in ("a", "v", "x"):
        ours, theirs = (getattr(found.paths["CG"], name) for found in (first, second))
        allowed = first.u[f"CG {name}"].max() if first.u else 1e-10 * np.abs(ours).max()
        assert np.abs(ours - theirs).max() < allowed, name
    for name, value in ((n, v) for n, v in first.values.items() if n != "BrIC"):  # which speaks of the head's own axes
        assert second.values[name].value == pytest.approx(value.value, abs=value.u or 1e-9 * value.value)


# The extra triax


def test_the_extra_triax_passes_when_perfect_fails_when_wrong_and_is_inconclusive_between() -> None:
    rig = replace(rig_of("triax-4"), points=())
    perfect = simulate(rig, "sled", seed=3, imperfect=False, noise=False).recording
    good = check_triax(Case(perfect), "a0")
    assert [one.verdict for one in good.judged] == [Verdict.PASS, Verdict.PASS]
    assert good.channels == ("a0x", "a0y", "a0z")
    wrong = perfect.readings.copy()
    wrong[:, :3] *= 1.2
    bad = check_triax(Case(replace(perfect, readings=wrong)), "a0")
    for one in bad.judged:
        assert 1.0 + one.deviation == pytest.approx(1.2**-2.5, rel=0.0029)  # the paper's tolerance
        assert one.verdict is Verdict.FAIL
    assert Judged("HIC36", 100.0, 101.0, 0.0029, 0.02).verdict is Verdict.INCONCLUSIVE
    assert Judged("HIC36", 100.0, 101.0, 0.0029, None).verdict is Verdict.INCONCLUSIVE


@pytest.mark.slow
def test_deviations_of_the_extra_triax_are_as_large_as_their_u_says() -> None:
    """Deviation over u of 12 healthy instruments: rms within the 99.9 % interval of χ² with 12 degrees of freedom."""
    rig, ratios = replace(rig_of("triax-4"), points=()), []
    for seed in range(12):
        found = check_triax(Case(simulate(rig, "sled", seed=seed).recording), "a0")
        ratios.append([2.0 * one.deviation / one.U for one in found.judged if one.U])
    rms = np.sqrt((np.array(ratios) ** 2).mean(axis=0))
    assert ((rms > np.sqrt(2.2 / 12)) & (rms < np.sqrt(32.9 / 12))).all(), rms


# Files and page


def read_mcap(path: Path) -> dict[str, list[tuple[int, str, dict[str, object]]]]:
    from mcap.reader import make_reader

    topics: dict[str, list[tuple[int, str, dict[str, object]]]] = {}
    with path.open("rb") as file:
        for schema, channel, message in make_reader(file).iter_messages():
            assert schema is not None
            Draft202012Validator(json.loads(schema.data)).validate(json.loads(message.data))
            topics.setdefault(channel.topic, []).append((message.log_time, schema.name, json.loads(message.data)))
    return topics


def test_csv_and_parquet_hold_every_digit_and_the_units_in_their_names(found: Kinematics, tmp_path: Path) -> None:
    import pyarrow.parquet as pq

    table = columns(found)
    assert {"time_s", "omega_x_rad_s", "CG_acceleration_body_z_m_s2", "yaw_rad", "CG_u_position_lab_x_m"} <= set(table)
    write_motion(found, tmp_path / "m.csv")
    write_motion(found, tmp_path / "m.parquet")
    with (tmp_path / "m.csv").open(encoding="utf-8", newline="") as file:
        rows = list(csv.reader(file))
    assert rows[0] == list(table)
    np.testing.assert_array_equal(np.array(rows[1:], dtype=float), np.column_stack(list(table.values())))
    back = pq.read_table(tmp_path / "m.parquet")
    assert back.column_names == list(table)
    np.testing.assert_array_equal(back["CG_position_lab_y_m"].to_numpy(), found.paths["CG"].x[:, 1])


def test_mcap_has_poses_that_foxglove_knows(found: Kinematics, tmp_path: Path) -> None:
    write_motion(found, tmp_path / "m.mcap")
    topics = read_mcap(tmp_path / "m.mcap")
    assert {topic: messages[0][1] for topic, messages in topics.items()} == {
        "/tf": "foxglove.FrameTransform",
        "/pose/CG": "foxglove.PoseInFrame",
        "/motion": "nineaudit.Motion",
        "/point/CG": "nineaudit.Point",
    }
    assert all(len(messages) == len(found.time) for messages in topics.values())
    assert set(POSE_IN_FRAME["properties"]) == {"timestamp", "frame_id", "pose"}
    assert set(FRAME_TRANSFORM["properties"]) == {
        "timestamp", "parent_frame_id", "child_frame_id", "translation", "rotation",
    }  # fmt: skip
    stamp, _, pose = topics["/pose/CG"][1000]
    assert stamp == round((found.time[1000] - found.time[0]) * 1e9)
    assert pose["timestamp"] == {"sec": stamp // 10**9, "nsec": stamp % 10**9}
    turn = Rotation.from_quat(list(pose["pose"]["orientation"].values()))  # type: ignore[index]
    np.testing.assert_allclose(turn.as_matrix(), found.attitude[1000], atol=1e-12)
    _, _, frame = topics["/tf"][1000]
    corner = np.array(list(frame["translation"].values())) + turn.apply(POINT)  # type: ignore[attr-defined]
    np.testing.assert_allclose(corner, list(pose["pose"]["position"].values()), atol=1e-12)  # type: ignore[index]


def test_mcap_says_by_how_much_its_times_are_shifted(found: Kinematics, tmp_path: Path) -> None:
    """A motion that starts before 0 cannot: log times are not negative."""
    from mcap.reader import make_reader

    write_motion(found, tmp_path / "m.mcap")
    with (tmp_path / "m.mcap").open("rb") as file:
        notes = {record.name: record.metadata for record in make_reader(file).iter_metadata()}
    assert int(notes["nineaudit"]["time_origin_ns"]) == round(found.time[0] * 1e9) < 0


def test_a_file_in_the_way_or_of_no_known_kind_is_refused(found: Kinematics, tmp_path: Path) -> None:
    (tmp_path / "m.csv").write_text("mine")
    with pytest.raises(ConfigurationError, match="--force"):
        write_motion(found, tmp_path / "m.csv")
    assert (tmp_path / "m.csv").read_text() == "mine"
    with pytest.raises(ConfigurationError, match=r"expected one of \.csv \.parquet \.mcap \.blf \.asc"):
        write_motion(found, tmp_path / "m.xlsx")


@pytest.mark.parametrize("suffix", [".blf", ".asc"])
def test_a_can_log_reads_back_within_half_a_bit_of_its_database(suffix: str, found: Kinematics, tmp_path: Path) -> None:
    """By the readers of recordings; a bit of a vector is 1.25·2/(2^21 − 2) of its largest value, rounded to 3 digits
    (quaternions 2^32)."""
    log = tmp_path / f"m{suffix}"
    write_motion(found, log)
    written = as_recording(found)
    back = read(log, written.rig, dbc=[tmp_path / "m.dbc"])
    np.testing.assert_allclose(back.time, found.time, rtol=0.0, atol=1e-9)
    for i, sensor in enumerate(written.rig.array.sensors):
        bits = 31 if sensor.signal.startswith("quaternion") else 20
        step = 1.25 * 1.005 * float(sensor.full_scale or 0.0) / (2**bits - 1)
        np.testing.assert_allclose(back.readings[:, i], written.readings[:, i], rtol=0.0, atol=0.5001 * step)


def test_a_can_log_holds_every_curve_with_its_unit_for_any_tool(found: Kinematics, tmp_path: Path) -> None:
    """Decoded by python-can and cantools alone."""
    import can
    import cantools

    write_motion(found, tmp_path / "m.blf")
    database = cantools.database.load_file(tmp_path / "m.dbc")
    units = {f"{m.name}.{s.name}": s.unit or "" for m in database.messages for s in m.signals}
    assert (units["alpha.alpha_z"], units["CG_velocity_lab.velocity_lab_x"]) == ("rad/s^2", "m/s")
    assert len(units) == len(columns(found)) - 1  # less the time
    assert all(len(word) <= 32 for name in units for word in name.split("."))
    with can.BLFReader(tmp_path / "m.blf") as frames:
        decoded = [(f.timestamp, database.decode_message(f.arbitration_id, f.data)) for f in frames if f.dlc]
    alpha = np.array([list(values.values()) for _, values in decoded if "alpha_x" in values])
    np.testing.assert_allclose(alpha, found.alpha, rtol=0.0, atol=2e-6 * np.abs(found.alpha).max())


def test_points_of_any_name_become_names_of_a_can_database(naap: Simulation, tmp_path: Path) -> None:
    names = ["1 top", "centre of the head", "centre of the hand", "Ω"]
    points = tuple(Point(name, 0.01 * i * POINT) for i, name in enumerate(names))
    recording = replace(naap.recording, rig=replace(naap.recording.rig, points=points))
    found = motion_of(Case(recording), "rates")
    write_motion(found, tmp_path / "m.asc")
    signals = [s.signal for s in as_recording(found).rig.array.sensors]
    assert len(set(signals)) == len(signals)
    assert read(tmp_path / "m.asc", as_recording(found).rig, dbc=[tmp_path / "m.dbc"]).readings.shape[1] == len(signals)


def test_a_database_in_the_way_is_not_overwritten(found: Kinematics, tmp_path: Path) -> None:
    (tmp_path / "m.dbc").write_text("mine")
    with pytest.raises(ConfigurationError, match=r"m\.dbc.*--force"):
        write_motion(found, tmp_path / "m.blf")
    assert [p.name for p in tmp_path.iterdir()] == ["m.dbc"]
    write_motion(found, tmp_path / "m.blf", force=True)
    assert (tmp_path / "m.dbc").read_text().startswith("VERSION")


def test_the_page_shows_values_and_curves_and_escapes_names(naap: Simulation, found: Kinematics) -> None:
    page = render_motion(found, naap.recording.rig, "<b>T1</b>.csv")
    assert "<b>T1" not in page
    assert page.count("<figure") == 6
    assert page.count('class="band"') >= 3 * 5
    assert "HIC15" in page
    assert page.count("<script") == 1  # that of the package


# The command


Run = Callable[..., tuple[int, str, str]]


@pytest.fixture
def run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Run:
    monkeypatch.chdir(tmp_path)
    Path("rig.toml").write_text(preset_text("triax-4"), encoding="utf-8")

    def call(*arguments: str) -> tuple[int, str, str]:
        with pytest.raises(SystemExit) as ended:
            cli.main(arguments)
        shown = capsys.readouterr()
        return int(ended.value.code or 0), shown.out, shown.err

    assert call("simulate", "rig.toml", "--motion", "sled", "--output", "T1.csv")[0] == 0
    return call


def test_the_command_writes_what_it_says_and_prints_a_summary(run: Run) -> None:
    code, out, err = run(
        "motion", "T1.csv", "--rig", "rig.toml", "--point", "CG=10,0,-5", "--output", "m.parquet", "--html", "m.html"
    )
    assert (code, err) == (0, "")
    assert out.startswith("T1.csv: -0.025 to 0.2 s, 2251 samples at 10000 Hz; whole-record fit")
    for said in ("HIC15", "HIC36", "GSI", "a3ms", "BrIC", "CG in the laboratory", "m.parquet: 2251 samples", "  u "):
        assert said in out
    assert "the filter that the rig states, CFC1000; do not filter to it again" in out
    assert "gravity left as the zero leaves it, up to 2 g when the body turns over (see --gravity)" in out
    assert "readings filtered to CFC180" in run("motion", "T1.csv", "--rig", "rig.toml", "--cfc", "180")[1]
    assert Path("m.parquet").stat().st_size > 0
    assert Path("m.html").read_text(encoding="utf-8").startswith("<!DOCTYPE html>")
    again = run("motion", "T1.csv", "--rig", "rig.toml", "--output", "m.parquet")
    assert again[0] == 2
    assert "--force" in again[2]
    code, out, err = run("motion", "T1.csv", "--rig", "rig.toml", "--method", "ninacc", "--output", "m.blf")
    assert (code, err) == (0, "")
    assert "m.dbc: its database" in out
    assert run("motion", "T1.csv", "--rig", "rig.toml", "--output", "m.asc")[0] == 2


def test_wrong_use_is_exit_code_2_and_says_where(run: Run) -> None:
    head = ("motion", "T1.csv", "--rig", "rig.toml")
    for options, said in (
        (("--method", "mapp"), "--method: unknown method"),
        (("--point", "1,2"), "--point: not three numbers"),
        (("--point", "1,2,x"), "--point: not a list of numbers"),
        (("--angles", "nan,0,0"), "--angles: not three numbers"),
        (("--output", "T1.csv", "--force"), "an input is never written to"),
        (("--output", "m.xls"), "no format to write a motion in"),
        (("--check-triax", "b"), "--check-triax: no triax by that name"),
        (("--cfc", "1000"), "filtered twice: CFC1000 after CFC1000"),
    ):
        code, _, err = run(*head, *options)
        assert (code, said in err) == (2, True), err


def test_an_array_that_does_not_give_the_motion_is_exit_code_3(run: Run) -> None:
    code, _, err = run("motion", "T1.csv", "--rig", "rig.toml", "--method", "rates")
    assert code == 3
    assert "no rate sensors on three axes" in err


def test_a_triax_that_is_wrong_is_exit_code_1(run: Run) -> None:
    made = ("simulate", "rig.toml", "--motion", "sled", "--output", "bad.csv")
    faults = [part for axis in "xyz" for part in ("--fault", f"a0{axis}:gain=1.3")]
    assert run(*made, *faults)[0] == 0
    code, out, _ = run("motion", "bad.csv", "--rig", "rig.toml", "--check-triax", "a0", "--method", "ninacc")
    assert code == 1
    assert "0.29 % in the paper: fail" in out


def test_points_are_in_the_rigs_length_unit_and_take_the_place_of_its_own() -> None:
    rig = with_points(rig_of("naap-3222"), ["10,0,-5", "top=0,0,-100"])
    assert [p.name for p in rig.points] == ["point 1", "top"]
    np.testing.assert_allclose(rig.points[1].position, [0.0, 0.0, -0.1])
    assert with_points(rig, []) is rig
    with pytest.raises(ConfigurationError, match="two points of one name"):
        with_points(rig, ["a=1,2,3", "a=4,5,6"])


def test_acceleration_of_a_point_is_that_of_the_rigid_body(found: Kinematics) -> None:
    expected = rigid_body.acceleration_at(POINT, found.a0, found.alpha, found.omega)
    np.testing.assert_allclose(found.paths["CG"].a_body, expected, atol=1e-9 * np.abs(expected).max())


def test_where_only_rate_sensors_tell_alpha_the_rates_are_smoothed_over_the_whole_record():
    """Three rate sensors and a triax: nodes of ω would zigzag unseen in a fit, and α with them (128,000 rad/s² for
    3,600). The smoother is no worse than the five points, whose noise is σ/(√10 h), 158 rad/s² here."""
    rig = parse_rig(preset_text("rgla"))
    made = simulate(rig, "general", seed=0)
    case, event = Case(made.recording), made.truth.time > 0.02
    error, before = (
        np.sqrt(((motion_of(case, m, count=0).alpha - made.truth.alpha)[event] ** 2).mean()) for m in ("map", "rgla")
    )
    assert error < before
    assert error < 0.1 * np.abs(made.truth.alpha).max()


def test_without_accelerometers_on_three_axes_the_smoother_says_so():
    one = simulate(parse_rig(preset_text("rgla")), "general", seed=0).recording
    with pytest.raises(EstimationError, match=r"2 accelerometers, axes of rank 2.*expected rank 3"):
        motion_of(Case(one.only([c for c, name in enumerate(one.channels) if name != "a0y"])))
