"""Recordings of others (../shared/data): counts, rates and rails that are really there."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from nineaudit.readers import read
from nineaudit.recording import Recording
from nineaudit.rig import load_rig, parse_rig

RIGS = Path(__file__).parents[1] / "fixtures" / "rigs"


def rav4(data: Path, name: str) -> Recording:
    rig = load_rig(RIGS / "rav4-kinematics.toml")
    return read(data / "rav4-can" / name, rig, dbc=[data / "rav4-can" / "toyota_2017.dbc"])


def canmod(data: Path, name: str) -> Recording:
    rig = load_rig(RIGS / "canmod-imu.toml")
    return read(data / "canmod-imu" / name, rig, dbc=[data / "canmod-imu" / "canmod-gps.dbc"])


def test_mimu_array(shared_data: Path) -> None:
    """108 s at 62.5 Hz, 48 channels; numbers as numpy's own text reader has them, on the stated board clock."""
    path = shared_data / "mimu-array" / "recording.csv"
    found = read(path, load_rig(shared_data / "mimu-array" / "rig.toml"))
    table = np.loadtxt(path, delimiter=",", skiprows=1)
    np.testing.assert_array_equal(found.time, table[:, 0])
    np.testing.assert_array_equal(found.readings, table[:, 1:])
    assert found.readings.shape == (6734, 48)
    assert found.clocks[0].rate == pytest.approx(62.5, rel=1e-6)
    assert found.time[-1] - found.time[0] == pytest.approx(108, abs=0.5)
    assert found.valid.all()
    rates = np.array([s.kind == "gyroscope" for s in found.rig.array.sensors])
    assert 34.8 < np.abs(found.readings[:, rates]).max() < 35.0  # 2000 deg/s


def test_rav4_blf_against_the_reference_decoder(shared_data: Path) -> None:
    import can
    from cantools.database import load_file

    found = rav4(shared_data, "drive-60s.blf")
    counts = found.source.counts
    assert (counts["frames"], counts["error_frames"], counts["short_frames"]) == (53_800, 0, 0)
    assert found.valid.all()
    message = load_file(shared_data / "rav4-can" / "toyota_2017.dbc", strict=False).get_message_by_name("KINEMATICS")
    with can.BLFReader(shared_data / "rav4-can" / "drive-60s.blf") as log:
        frames = [(m.timestamp, message.decode(m.data)) for m in log if m.arbitration_id == 0x24]
    assert found.time.size == len(frames)
    for channel, signal, factor in (("ax", "ACCEL_X", 1.0), ("ay", "ACCEL_Y", 1.0), ("wz", "YAW_RATE", np.pi / 180)):
        np.testing.assert_allclose(found.column(channel), [f[signal] * factor for _, f in frames], rtol=1e-14)
    stamps = np.array([t for t, _ in frames])
    np.testing.assert_allclose(found.time, stamps - stamps[0], atol=2.4e-7)  # a date in floating-point seconds


def test_rav4_clock_is_called_unsteady_not_lossy(shared_data: Path) -> None:
    """83 frames a second all through, stamped in batches: intervals of 0.1 ms to 29 ms, no frame lost."""
    clock = rav4(shared_data, "drive-60s.blf").clocks[0]
    assert clock.rate == pytest.approx(4973 / 60, rel=0.01)
    assert 1e-3 < clock.jitter < 6e-3
    assert (clock.lost, clock.duplicates, clock.backward) == (0, 0, 0)


def test_rav4_candump_is_the_start_of_the_blf(shared_data: Path) -> None:
    short, long = rav4(shared_data, "drive-10s.log"), rav4(shared_data, "drive-60s.blf")
    n = short.time.size
    assert short.source.counts["frames"] == 8_977
    np.testing.assert_array_equal(short.readings, long.readings[:n])
    np.testing.assert_allclose(short.time, long.time[:n], atol=1e-6, rtol=0)


def test_rav4_acceleration_against_the_device_on_the_windscreen(shared_data: Path) -> None:
    """DATA.md: the forward acceleration of the car is really of the opposite sign (r = −0.996)."""
    found = rav4(shared_data, "drive-60s.blf")
    device = np.loadtxt(shared_data / "rav4-can" / "device-imu.csv", delimiter=",", skiprows=1)
    smooth = np.ones(40) / 40
    forward = np.convolve(np.interp(found.time, device[:, 0], device[:, 1]), smooth, "valid")
    own = np.convolve(found.column("ax"), smooth, "valid")
    assert np.corrcoef(forward, own)[0, 1] < -0.98


@pytest.mark.parametrize(("name", "frames", "samples"), [("drive-45s", 5_477, 4_518), ("by-hand-115s", 57_849, 11_358)])
def test_canmod_mf4(shared_data: Path, name: str, frames: int, samples: int) -> None:
    pytest.importorskip("asammdf")
    found = canmod(shared_data, f"{name}.mf4")
    assert found.source.counts["frames"] == frames
    assert found.readings.shape == (samples, 6)
    assert found.valid.all()
    assert found.clocks[0].rate == pytest.approx(100, rel=0.015)
    assert found.resampled == ()
    if name.startswith("drive"):  # the car's weight on z, or the module mounted askew: 1 g in all
        assert np.linalg.norm(np.median(found.readings[:, :3], axis=0)) == pytest.approx(9.81, abs=0.3)


def test_canmod_against_extract_bus_logging(shared_data: Path) -> None:
    """asammdf's own decoding of the same frames."""
    asammdf = pytest.importorskip("asammdf")
    folder = shared_data / "canmod-imu"
    found = canmod(shared_data, "drive-45s.mf4")
    with (
        asammdf.MDF(folder / "drive-45s.mf4") as log,
        log.extract_bus_logging({"CAN": [(folder / "canmod-gps.dbc", 0)]}) as decoded,
    ):
        for channel, signal, factor in (("ax", "AccelerationX", 1.0), ("wz", "AngularRateZ", np.pi / 180)):
            reference = decoded.get(signal)
            np.testing.assert_allclose(found.time, reference.timestamps, rtol=3e-16)  # ours counts whole nanoseconds
            np.testing.assert_allclose(found.column(channel), reference.samples * factor, rtol=1e-12)


def test_canmod_rates_are_at_their_rail(shared_data: Path) -> None:
    """Turned by hand beyond 250 deg/s about x and z: readings pile up on the last values of the module's range."""
    pytest.importorskip("asammdf")
    found = canmod(shared_data, "by-hand-115s.mf4")
    x, y, z = (np.degrees(found.column(c)) for c in ("wx", "wy", "wz"))
    assert (x.min(), x.max(), z.max()) == pytest.approx((-250.0, 249.75, 249.75))
    assert np.count_nonzero(x < -249.9) > 5 * np.count_nonzero(abs(x + 249.75) < 0.1)
    assert np.count_nonzero(z > 249.6) > 2 * np.count_nonzero(abs(z - 249.5) < 0.1)
    assert np.abs(y).max() < 200


def test_canmod_hole_is_found(shared_data: Path) -> None:
    pytest.importorskip("asammdf")
    clock = canmod(shared_data, "by-hand-115s.mf4").clocks[0]
    start, end = max(clock.gaps, key=lambda gap: gap[1] - gap[0])
    assert (start, end) == pytest.approx((13.76665, 14.2692), abs=1e-5)
    assert clock.lost >= 49


@pytest.mark.parametrize("part", [0.3, 0.8])
def test_of_a_cut_drive_what_is_there_is_read(shared_data: Path, tmp_path: Path, part: float) -> None:
    data = (shared_data / "rav4-can" / "drive-60s.blf").read_bytes()
    path = tmp_path / "cut.blf"
    path.write_bytes(data[: int(part * len(data))])
    rig = load_rig(RIGS / "rav4-kinematics.toml")
    whole, found = (
        read(file, rig, dbc=[shared_data / "rav4-can" / "toyota_2017.dbc"])
        for file in (shared_data / "rav4-can" / "drive-60s.blf", path)
    )
    assert found.source.damage
    n = found.time.size
    assert 0.9 * part < n / whole.time.size < part + 0.05
    np.testing.assert_array_equal(found.readings, whole.readings[:n])


@pytest.mark.parametrize(
    ("name", "channels", "rate"),
    [
        ("6mps_sphere_1_acc100g_impact.csv", ("X_(100g)", "Y_(100g)", "Z_(100g)"), 20_000),
        ("6mps_sphere_1_gyro_impact.csv", ("X", "Y", "Z"), 3_200),
    ],
)
def test_impactor_tables(shared_data: Path, name: str, channels: tuple[str, ...], rate: float) -> None:
    """Stamps have five decimals: single intervals of 312.5 µs are off by up to 10 µs, the rate is not."""
    sensors = "".join(
        f'[[sensor]]\nchannel="c{i}"\nsignal="{c}"\nkind="accelerometer"\nposition=[0,0,0]\naxis=[1,0,0]\n'
        for i, c in enumerate(channels)
    )
    rig = parse_rig(f'[rig]\nname="i"\n[recording]\ntime="t_s"\n{sensors}')
    found = read(shared_data / "impactor-clipping" / name, rig)
    assert found.clocks[0].rate == pytest.approx(rate, rel=0.01)
    assert found.valid.all()
