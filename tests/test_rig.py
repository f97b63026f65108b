"""Rig files: what they mean in SI, and the sentence a user gets when one is wrong."""

from __future__ import annotations

import hashlib
import math
import subprocess
import sys
import tomllib
from pathlib import Path

import jsonschema
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from nineaudit.array import SensorArray
from nineaudit.errors import ConfigurationError
from nineaudit.rig import PRESETS, Rig, Units, load_rig, parse_rig, preset_text, rig_schema
from nineaudit.units import G0

INTERFACE_EXAMPLE = """\
[rig]
name = "head, NAAP 3-2-2-2"
preset = "naap-3222"
arms = [50.0, 50.0, 50.0]

[units]
length = "mm"
acceleration = "g_0"
angular_rate = "rad/s"

[recording]
time = "time_s"
dbc = ["rig.dbc"]
pre_trigger = [-0.02, -0.001]
filter_class = "CFC1000"

[uncertainty]
gain = 0.005
zero = 0.1
alignment_deg = 0.5
position = 0.5
noise = 0.3
timing_s = 1e-5

[[sensor]]
channel = "a0x"
kind = "accelerometer"
position = [0.0, 0.0, 0.0]
axis = [1.0, 0.0, 0.0]
range = 500.0
signal = "NAAP_A.A0X"
serial = "4711"

[[point]]
name = "CG"
position = [10.0, 0.0, -5.0]
"""

PLAIN = """\
[units]
length = "mm"
acceleration = "m/s^2"

[[sensor]]
channel = "ax"
kind = "accelerometer"
position = [10.0, 20.0, 30.0]
axis = [1.0, 0.0, 0.0]

[[sensor]]
channel = "wz"
kind = "gyroscope"
axis = [0.0, 0.0, 2.0]
range = 35.0
"""

SI_VALUES = ("full_scale", "u_gain", "u_zero", "u_alignment", "u_position", "u_timing", "noise")


def complaint(text: str, path: Path | None = None) -> str:
    """The sentence a wrong rig file earns."""
    with pytest.raises(ConfigurationError) as caught:
        parse_rig(text, path)
    sentence = str(caught.value)
    assert caught.value.exit_code == 2
    assert "\n" not in sentence
    return sentence


def outcome_of(text: str) -> Rig | ConfigurationError:
    try:
        return parse_rig(text)
    except ConfigurationError as error:
        return error


def assert_same_array(a: SensorArray, b: SensorArray) -> None:
    assert a.channels == b.channels
    np.testing.assert_allclose(a.positions, b.positions, rtol=1e-14)
    np.testing.assert_allclose(a.axes, b.axes, rtol=1e-14)
    for name in SI_VALUES:
        np.testing.assert_allclose(a.values(name), b.values(name), rtol=1e-14, err_msg=name)


# --- what a rig file means -------------------------------------------------------------------------


def test_interface_example_loads(tmp_path: Path) -> None:
    (tmp_path / "rig.dbc").touch()
    file = tmp_path / "rig.toml"
    file.write_text(INTERFACE_EXAMPLE, encoding="utf-8")
    rig = load_rig(file)
    a0x = rig.array["a0x"]
    assert (rig.name, rig.preset, rig.path, rig.text) == (
        "head, NAAP 3-2-2-2",
        "naap-3222",
        file,
        INTERFACE_EXAMPLE,
    )
    assert rig.sha256 == hashlib.sha256(file.read_bytes()).hexdigest()
    assert rig.dbc == (tmp_path / "rig.dbc",)
    assert rig.pre_trigger == (-0.02, -0.001)
    assert (rig.filter_class, rig.cfc) == ("CFC1000", 1000.0)
    assert rig.time_signal == "time_s"
    assert (a0x.signal, a0x.serial, a0x.full_scale) == ("NAAP_A.A0X", "4711", pytest.approx(500 * 9.80665))
    assert (a0x.unit, a0x.to_si) == ("g_0", G0)
    assert a0x.u_alignment == pytest.approx(math.radians(0.5))
    assert (a0x.u_gain, a0x.u_position, a0x.u_timing) == (0.005, 0.5e-3, 1e-5)
    assert (a0x.u_zero, a0x.noise) == (pytest.approx(0.980665), pytest.approx(2.941995))
    np.testing.assert_allclose(rig.points[0].position, [0.010, 0, -0.005])
    np.testing.assert_allclose(rig.array["a2z"].position, [0, 0.050, 0])


def test_absent_uncertainty_takes_the_example_s_values() -> None:
    ax, wz = parse_rig(PLAIN).array.sensors
    for s in (ax, wz):
        assert (s.u_gain, s.u_position, s.u_timing) == (0.005, 0.5e-3, 1e-5)
        assert s.u_alignment == pytest.approx(math.radians(0.5))
        assert s.noise is None
    assert (ax.u_zero, wz.u_zero) == (pytest.approx(0.1 * G0), 0.1)


def test_axis_is_normalised_and_values_are_read_only() -> None:
    array = parse_rig(PLAIN.replace("axis = [1.0, 0.0, 0.0]", "axis = [3e200, 0, -4e200]")).array
    np.testing.assert_allclose(array.axes, [[0.6, 0, -0.8], [0, 0, 1]], rtol=1e-15)
    with pytest.raises(ValueError, match="read-only"):
        array["ax"].position[0] = 1.0


def test_rate_sensors_have_their_own_zero_and_noise() -> None:
    stated = "[uncertainty]\nzero = 0.2\nnoise = 0.3\n"
    ax, wz = parse_rig(stated + PLAIN).array.sensors
    assert (ax.u_zero, ax.noise, wz.u_zero, wz.noise) == (0.2, 0.3, 0.2, 0.3)
    ax, wz = parse_rig(stated + "zero_rate = 0.02\nnoise_rate = 0.03\n" + PLAIN).array.sensors
    assert (ax.u_zero, ax.noise, wz.u_zero, wz.noise) == (0.2, 0.3, 0.02, 0.03)


def test_a_sensor_s_own_uncertainty_overrides_the_default() -> None:
    own = "gain = 0.02\nzero = 3\nalignment_deg = 2\nposition_u = 1\nnoise = 4\ntiming_s = 1e-3\n"
    ax, wz = parse_rig("[uncertainty]\ngain = 0.01\nnoise_rate = 7\n" + PLAIN + own).array.sensors
    assert (ax.u_gain, ax.noise) == (0.01, None)
    assert (wz.u_gain, wz.u_zero, wz.u_position, wz.noise, wz.u_timing) == (0.02, 3, 1e-3, 4, 1e-3)
    assert wz.u_alignment == pytest.approx(math.radians(2))


def test_millivolts_are_converted_by_the_sensitivity() -> None:
    # 2 mV per g_0: one mV is half a g_0. 5 mV per deg/s: one mV is 0.2 deg/s.
    text = (
        '[units]\nacceleration = "mV"\nangular_rate = "mV"\n'
        '[[sensor]]\nchannel="a"\nkind="accelerometer"\nposition=[0,0,0]\naxis=[0,0,1]\nsensitivity=2\nrange=1000\n'
        '[[sensor]]\nchannel="g"\nkind="gyroscope"\naxis=[0,0,1]\nsensitivity=5\nzero=10\n'
    )
    a, g = parse_rig(text).array.sensors
    assert (a.unit, a.to_si, a.full_scale) == ("mV", pytest.approx(G0 / 2), pytest.approx(500 * G0))
    assert (g.to_si, g.u_zero) == (pytest.approx(math.radians(0.2)), pytest.approx(math.radians(2)))
    assert a.u_zero == pytest.approx(0.1 * G0), "the default does not depend on the unit"


def test_filter_class_and_csv_options_and_defaults() -> None:
    assert parse_rig('[recording]\nfilter_class = "cfc180"\n' + PLAIN).cfc == 180.0
    rig = parse_rig('[recording]\ntime_unit = "ms"\nseparator = ";"\ndecimal = ","\n' + PLAIN)
    assert (rig.time_unit, rig.separator, rig.decimal) == ("ms", ";", ",")
    assert (rig.filter_class, rig.cfc, rig.preset, rig.path) == ("none", None, None, None)
    assert (rig.units, rig.pre_trigger, rig.name) == (Units("mm", "m/s^2", "rad/s"), None, "rig")
    assert parse_rig(PLAIN, Path("bench.toml")).name == "bench"


def test_byte_order_mark_and_windows_line_ends_load(tmp_path: Path) -> None:
    file = tmp_path / "rig.toml"
    file.write_bytes(b"\xef\xbb\xbf" + PLAIN.replace("\n", "\r\n").encode())
    assert_same_array(load_rig(file).array, parse_rig(PLAIN).array)


def test_real_rig_file_loads(shared_data: Path) -> None:
    rig = load_rig(shared_data / "mimu-array" / "rig.toml")
    assert len(rig.array) == 48
    assert rig.array.is_accelerometer.sum() == 24
    np.testing.assert_allclose(rig.array["imu1_ax"].position, [-9.45e-3, 9.45e-3, 1e-3])
    assert rig.array["imu8_wz"].full_scale == 34.9
    assert rig.array["imu3_wy"].u_zero == 0.03


# --- laws ------------------------------------------------------------------------------------------

LENGTHS = {"mm": 1e-3, "m": 1.0, "in": 0.0254, "cm": 1e-2}
ACCELERATIONS = {"m/s^2": 1.0, "g_0": 9.80665}
RATES = {"rad/s": 1.0, "deg/s": math.pi / 180}


def _in_units(length: str, acceleration: str, rate: str, arms: tuple[float, float, float]) -> Rig:
    """The same physical rig, its numbers written in the units named; `arms` in m."""
    per_length, per_a, per_w = 1 / LENGTHS[length], 1 / ACCELERATIONS[acceleration], 1 / RATES[rate]
    r = [float(arm * per_length) for arm in arms]
    return parse_rig(
        f'[rig]\npreset = "naap-gyro"\narms = {r}\n'
        f'[units]\nlength = "{length}"\nacceleration = "{acceleration}"\nangular_rate = "{rate}"\n'
        f"[uncertainty]\nzero = {1.5 * per_a}\nnoise = {2.5 * per_a}\nposition = {4e-4 * per_length}\n"
        f"zero_rate = {0.02 * per_w}\nnoise_rate = {0.03 * per_w}\n"
        f'[[sensor]]\nchannel = "a1y"\nrange = {4000 * per_a}\nposition_u = {1e-3 * per_length}\n'
        f'[[sensor]]\nchannel = "gz"\nrange = {40 * per_w}\nzero = {0.5 * per_w}\n'
        f'[[point]]\nname = "CG"\nposition = {[0.01 * per_length] * 3}\n'
    )


@given(
    st.sampled_from(list(LENGTHS)),
    st.sampled_from(list(ACCELERATIONS)),
    st.sampled_from(list(RATES)),
    st.tuples(*[st.floats(1e-3, 1.0)] * 3),
)
@settings(max_examples=30, deadline=None)
def test_units_do_not_change_the_array(
    length: str, acceleration: str, rate: str, arms: tuple[float, float, float]
) -> None:
    si, other = _in_units("m", "m/s^2", "rad/s", arms), _in_units(length, acceleration, rate, arms)
    assert_same_array(si.array, other.array)
    np.testing.assert_allclose(si.points[0].position, other.points[0].position, rtol=1e-14)
    np.testing.assert_allclose(other.array.values("to_si")[[0, -1]], [ACCELERATIONS[acceleration], RATES[rate]])


@given(st.permutations(range(9)))
@settings(max_examples=20, deadline=None)
def test_permuting_the_tables_permutes_the_array(order: list[int]) -> None:
    tables = [
        f'[[sensor]]\nchannel = "{s.channel}"\nkind = "{s.kind}"\nposition = {list(s.position)}\n'
        f"axis = {list(s.axis)}\nrange = {100 + i}\n"
        for i, s in enumerate(PRESETS["naap-3222"].sensors([40, 50, 60]))
    ]
    plain, permuted = parse_rig("".join(tables)).array, parse_rig("".join(tables[i] for i in order)).array
    assert permuted.channels == tuple(plain.channels[i] for i in order)
    np.testing.assert_array_equal(permuted.positions, plain.positions[order])
    np.testing.assert_array_equal(permuted.axes, plain.axes[order])
    np.testing.assert_array_equal(permuted.values("full_scale"), plain.values("full_scale")[order])


_VALUES = [
    "inf", "nan", "-1", "0", "1e400", "9" * 400, '""', '"x"', '" x"', "[]", "[1]", "[1, 2, 3]", "[0, 0, 0]",
    "true", "0x" + "f" * 5000, "1979-05-27", "{a = 1}", "[[1]]", '["x"]', "[nan, 0, 1]",
]  # fmt: skip


@given(st.integers(0, len(INTERFACE_EXAMPLE.splitlines()) - 1), st.sampled_from(_VALUES))
@settings(max_examples=200, deadline=None)
def test_any_wrong_value_is_one_sentence_and_nothing_else(line: int, value: str) -> None:
    lines = INTERFACE_EXAMPLE.replace('dbc = ["rig.dbc"]', "dbc = []").splitlines()
    key, equals, _ = lines[line].partition(" = ")
    lines[line] = f"{key} = {value}" if equals else lines[line]
    outcome = outcome_of("\n".join(lines))
    if isinstance(outcome, ConfigurationError):
        assert "\n" not in str(outcome)
        assert len(str(outcome)) < 600
    else:
        np.testing.assert_allclose(np.linalg.norm(outcome.array.axes, axis=1), 1.0, rtol=1e-14)
        assert np.isfinite(outcome.array.positions).all()


# --- presets ---------------------------------------------------------------------------------------


def parity_rows(array: SensorArray) -> int:
    """Channels beyond the unknowns a0, alpha (accelerometers) and omega (rate sensors) of one instant."""
    n, r = array.axes, array.positions
    is_a = array.is_accelerometer
    h = np.hstack([n, np.cross(r, n)])[is_a]
    rates = n[~is_a]
    return len(array) - int(np.linalg.matrix_rank(h)) - (int(np.linalg.matrix_rank(rates)) if len(rates) else 0)


@pytest.mark.parametrize(
    ("name", "accelerometers", "gyros", "redundancy"),
    [
        ("naap-3222", 9, 0, 3),
        ("naap-gyro", 9, 3, 3),
        ("triax-3", 9, 0, 3),
        ("triax-4", 12, 0, 6),
        ("coplanar-3", 9, 0, 3),
        ("coplanar-3-gyro", 9, 3, 3),
        ("6aw", 6, 3, 0),
        ("3-2-1", 6, 0, 0),
        ("rgla", 3, 3, 0),
        ("compact-cube", 3, 3, 0),
    ],
)
def test_every_layout_has_the_channels_of_its_name(name: str, accelerometers: int, gyros: int, redundancy: int) -> None:
    """Instantaneous redundancy, METHODS.md 3; the derivative of omega adds to it where alpha is measured."""
    array = parse_rig(preset_text(name)).array
    assert array.is_accelerometer.sum() == accelerometers
    assert (~array.is_accelerometer).sum() == gyros
    assert parity_rows(array) == redundancy
    assert set(PRESETS) >= {name}


def test_naap_closed_form_geometry() -> None:
    """METHODS.md 1.1: point 1 on +x, 2 on +y, 3 on +z; axis by the letter."""
    array = parse_rig(preset_text("naap-3222", (30, 40, 60))).array
    assert array.channels == ("a0x", "a0y", "a0z", "a1y", "a1z", "a2x", "a2z", "a3x", "a3y")
    expected = {"0": [0, 0, 0], "1": [0.03, 0, 0], "2": [0, 0.04, 0], "3": [0, 0, 0.06]}
    for channel in array.channels:
        np.testing.assert_allclose(array[channel].position, expected[channel[1]], rtol=1e-14)
        np.testing.assert_array_equal(array[channel].axis, np.eye(3)["xyz".index(channel[2])])


def test_6aw_pairs_sense_the_same_axis() -> None:
    array = parse_rig(preset_text("6aw")).array
    for one, other in (("a0z", "a2z"), ("a0x", "a3x"), ("a0y", "a1y")):
        np.testing.assert_array_equal(array[one].axis, array[other].axis)
        assert float(array[other].position @ array[other].axis) == 0.0


def test_default_arms_are_50_mm_in_any_unit() -> None:
    for unit in LENGTHS:
        array = parse_rig(f'[rig]\npreset = "3-2-1"\n[units]\nlength = "{unit}"\n').array
        np.testing.assert_allclose(array["a2z"].position, [0, 0.05, 0], rtol=1e-14)
        np.testing.assert_allclose(array["a1z"].position, [0.05, 0, 0], rtol=1e-14)


def test_override_changes_only_what_it_states_and_keeps_the_order() -> None:
    head = '[rig]\npreset = "naap-3222"\n'
    plain = parse_rig(head).array
    array = parse_rig(
        head + '[[sensor]]\nchannel = "a2x"\nposition = [1, 51, 0]\nserial = "7"\n'
        '[[sensor]]\nchannel = "gz"\nkind = "gyroscope"\naxis = [0, 0, 1]\n'
        '[[sensor]]\nchannel = "a1y"\nrange = 100\n'
    ).array
    assert array.channels == (*plain.channels, "gz")
    np.testing.assert_allclose(array["a2x"].position, [0.001, 0.051, 0])
    np.testing.assert_array_equal(array["a2x"].axis, plain["a2x"].axis)
    assert (array["a2x"].serial, array["a1y"].full_scale) == ("7", pytest.approx(100 * G0))
    np.testing.assert_array_equal(array["a1y"].position, plain["a1y"].position)


# --- the schema ------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def validator() -> jsonschema.Draft202012Validator:
    schema = rig_schema()
    jsonschema.Draft202012Validator.check_schema(schema)
    return jsonschema.Draft202012Validator(schema)


@pytest.mark.parametrize("text", [INTERFACE_EXAMPLE, PLAIN, *map(preset_text, PRESETS)])
def test_rig_files_follow_the_schema(validator: jsonschema.Draft202012Validator, text: str) -> None:
    assert list(validator.iter_errors(tomllib.loads(text))) == []


def test_real_rig_file_follows_the_schema(validator: jsonschema.Draft202012Validator, shared_data: Path) -> None:
    text = (shared_data / "mimu-array" / "rig.toml").read_text(encoding="utf-8")
    assert list(validator.iter_errors(tomllib.loads(text))) == []


@pytest.mark.parametrize(
    "text",
    [
        "",
        "[sensors]\n",
        PLAIN.replace("axis = [1.0, 0.0, 0.0]\n", ""),
        PLAIN.replace("position = [10.0, 20.0, 30.0]\n", ""),
        PLAIN.replace('"m/s^2"', '"furlong"'),
        "[rig]\narms = [1.0]\n" + PLAIN,
        '[recording]\nfilter_class = "CFC61"\n' + PLAIN,
    ],
)
def test_schema_and_loader_refuse_the_same(validator: jsonschema.Draft202012Validator, text: str) -> None:
    assert not validator.is_valid(tomllib.loads(text))
    complaint(text)


def test_every_key_of_the_schema_is_described(validator: jsonschema.Draft202012Validator) -> None:
    schema = validator.schema
    assert isinstance(schema, dict)
    for table in schema["$defs"].values():
        assert table["description"]
        assert [key for key, value in table["properties"].items() if "description" not in value] == []


# --- errors ----------------------------------------------------------------------------------------

AX = PLAIN[PLAIN.index("[[sensor]]") : PLAIN.index('[[sensor]]\nchannel = "wz"')]


@pytest.mark.parametrize(
    ("text", "parts"),
    [
        (
            "[units]\nlenght = 1\n" + PLAIN.split("\n\n", 1)[1],
            ["[units]", "lenght", "did you mean 'length'?"],
        ),
        ("[sensors]\n" + PLAIN, ["unknown table", "'sensors'", "did you mean 'sensor'?"]),
        (PLAIN + "axsi = 1\n", ["[[sensor]] 2 (wz)", "unknown key", "'axsi'", "did you mean 'axis'?"]),
        (
            PLAIN.replace("[0.0, 0.0, 2.0]", "[0, 0, 0]"),
            ["[[sensor]] 2 (wz) axis", "[0, 0, 0]", "non-zero length"],
        ),
        (PLAIN.replace("20.0", "nan"), ["[[sensor]] 1 (ax) position, number 2", "found nan", "finite"]),
        (PLAIN.replace("20.0", "inf"), ["[[sensor]] 1 (ax) position, number 2", "found inf", "finite"]),
        (PLAIN.replace("20.0", '"20"'), ["[[sensor]] 1 (ax) position, number 2", "found '20'", "a number"]),
        (PLAIN.replace("[10.0, 20.0, 30.0]", "[1, 2]"), ["(ax) position", "[1, 2]", "expected 3 numbers"]),
        (PLAIN.replace('"ax"', '"wz"'), ["[[sensor]] 2", "same channel as [[sensor]] 1", "'wz'"]),
        (PLAIN + 'signal = "ax"\n', ["channel wz", "same signal as channel ax", "'ax'"]),
        (
            PLAIN.replace("accelerometer", "acceleration"),
            ["(ax) kind", "'acceleration'", "'accelerometer' or"],
        ),
        (PLAIN.replace('kind = "gyroscope"\n', ""), ["[[sensor]] 2 (wz)", "missing key 'kind'", "gyroscope"]),
        (PLAIN.replace("axis = [0.0, 0.0, 2.0]\n", ""), ["[[sensor]] 2 (wz)", "missing key 'axis'"]),
        (
            PLAIN.replace("position = [10.0, 20.0, 30.0]\n", ""),
            ["[[sensor]] 1 (ax)", "missing key 'position'"],
        ),
        (PLAIN.replace('channel = "wz"\n', ""), ["[[sensor]] 2", "missing key 'channel'"]),
        (PLAIN + "gain = -0.1\n", ["[[sensor]] 2 (wz) gain", "found -0.1", "not less than 0"]),
        (PLAIN + "range = 1\n", ["line 16", "TOML"]),
        (PLAIN.replace("range = 35.0", "range = 0"), ["(wz) range", "found 0", "greater than 0"]),
        ("[uncertainty]\nzero = -1\n" + PLAIN, ["[uncertainty] zero", "found -1", "not less than 0"]),
        ("[uncertainty]\nnoise = 0\n" + PLAIN, ["[uncertainty] noise", "found 0", "greater than 0"]),
        (
            PLAIN.replace('"m/s^2"', '"g"'),
            ["[units] acceleration", "'g'", "m/s^2, g_0", "did you mean 'g_0'?"],
        ),
        (PLAIN.replace('"mm"', '"rad/s"'), ["[units] length", "'rad/s'", "expected one of m, mm, cm, in"]),
        (PLAIN.replace('"m/s^2"', '"mV"'), ["[[sensor]] 1 (ax)", "missing key 'sensitivity'", "mV per g_0"]),
        (
            '[rig]\npreset = "6aw"\n[units]\nangular_rate = "mV"\n',
            ["preset (gx)", "missing key 'sensitivity'"],
        ),
        ('[rig]\npreset = "naap-322"\n', ["[rig] preset", "'naap-322'", "compact-cube", "mean 'naap-3222'?"]),
        (
            '[rig]\npreset = "naap-3222"\narms = [50, 50]\n',
            ["[rig] arms", "[50.0, 50.0]", "3 positive lengths"],
        ),
        ('[rig]\npreset = "3-2-1"\narms = [50, -5]\n', ["[rig] arms", "-5.0", "2 positive lengths", "x, y"]),
        ('[rig]\npreset = "rgla"\narms = [50]\n', ["[rig] arms", "0 positive lengths"]),
        ("[rig]\narms = [50]\n" + PLAIN, ["[rig] arms", "without a preset"]),
        ("[recording]\npre_trigger = [0.1, 0.0]\n" + PLAIN, ["[recording] pre_trigger", "start before end"]),
        ("[recording]\npre_trigger = [0.1]\n" + PLAIN, ["[recording] pre_trigger", "expected 2 numbers"]),
        ('[recording]\ndbc = ["no.dbc"]\n' + PLAIN, ["[recording] dbc", "'no.dbc'", "a file relative to"]),
        ('[recording]\nfilter_class = "CFC61"\n' + PLAIN, ["filter_class", "'CFC61'", "CFC60, CFC180"]),
        ('[recording]\ntime_unit = "h"\n' + PLAIN, ["[recording] time_unit", "'h'", "s, ms, us, ns"]),
        ('[recording]\nseparator = ";;"\n' + PLAIN, ["[recording] separator", "single character"]),
        ('[recording]\ndecimal = ";"\n' + PLAIN, ["[recording] decimal", "'.' or ','"]),
        (
            '[recording]\ndecimal = ","\nseparator = ","\n' + PLAIN,
            ["[recording] decimal", "also the separator"],
        ),
        (
            '[[point]]\nname = "CG"\nposition = [0, 0, 0]\n' * 2 + PLAIN,
            ["[[point]] 2", "same name as [[point]] 1"],
        ),
        ('[[point]]\nname = "CG"\n' + PLAIN, ["[[point]] 1 (CG)", "missing key 'position'"]),
        (PLAIN.replace(AX, "").replace("[[sensor]]", "[sensor]"), ["[[sensor]]", "in double brackets"]),
        ("[[rig]]\n" + PLAIN, ["[rig]", "in single brackets"]),
        ("sensor = [1]\n", ["[[sensor]] 1", "in double brackets"]),
        ("", ["no sensors", "[[sensor]] tables, or a preset"]),
        ("[rig]\nname = \n", ["line 2", "not valid TOML"]),
        ("x = " + "9" * 5000, ["not readable TOML", "too long"]),
    ],
)
def test_the_sentence_names_place_value_and_expectation(text: str, parts: list[str]) -> None:
    sentence = complaint(text, Path("head.toml"))
    assert sentence.startswith("head.toml: ")
    missing = [part for part in parts if part not in sentence]
    assert missing == [], sentence


def test_further_errors_are_counted_and_a_misspelt_key_comes_first() -> None:
    sentence = complaint(PLAIN.replace('channel = "wz"', 'chanel = "wz"').replace("20.0", "nan"))
    assert "did you mean 'channel'?" in sentence
    assert "(2 more errors in this file)" in sentence


@pytest.mark.parametrize(
    ("data", "parts"),
    [
        (None, ["cannot read", "No such file", "nineaudit rig presets"]),
        (b'[rig]\nname = "Pr\xfcfstand"\n', ["byte 16", "not UTF-8", "\\xfc", "save it again"]),
        (PLAIN.encode("utf-16"), ["byte 0", "not UTF-8"]),
    ],
)
def test_unreadable_files(tmp_path: Path, data: bytes | None, parts: list[str]) -> None:
    file = tmp_path / "rig.toml"
    if data is not None:
        file.write_bytes(data)
    with pytest.raises(ConfigurationError) as caught:
        load_rig(file)
    assert [part for part in (str(file), *parts) if part not in str(caught.value)] == []


@pytest.mark.parametrize(
    ("name", "arms", "parts"),
    [
        ("napp-3222", None, ["'napp-3222'", "did you mean 'naap-3222'?"]),
        ("triax-3", (50.0, 0.0, 50.0), ["wrong arms", "3 positive lengths"]),
        ("triax-3", (50.0, math.nan, 50.0), ["wrong arms", "nan"]),
    ],
)
def test_preset_text_refuses(name: str, arms: tuple[float, ...] | None, parts: list[str]) -> None:
    with pytest.raises(ConfigurationError) as caught:
        preset_text(name, arms)
    assert [part for part in parts if part not in str(caught.value)] == []


def test_the_values_load_without_pydantic() -> None:
    code = "import sys, nineaudit.rig; print('pydantic' in sys.modules)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "False"
