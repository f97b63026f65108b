"""Outputs for machines and terminals: the result document against its schema, JUnit, annotations, summary."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import junitparser
import numpy as np
import pytest
from jsonschema import Draft202012Validator, ValidationError

from bus_logs import bus_from
from nineaudit import report
from nineaudit.errors import RecordingError
from nineaudit.finding import Finding, Measure, Severity, Verdict
from nineaudit.report.numbers import digits, instant, plain, printable, probability, spelled, told_apart
from nineaudit.report.sensors import unpacked
from nineaudit.rig import parse_rig, preset_text
from nineaudit.units import G0
from report_example import ambiguous, example, healthy


@pytest.fixture(scope="module")
def validator() -> Draft202012Validator:
    schema = report.result_schema()
    Draft202012Validator.check_schema(schema)
    return Draft202012Validator(schema)


@pytest.mark.parametrize("make", [example, healthy, ambiguous])
def test_document_meets_its_schema(make: Any, validator: Draft202012Validator) -> None:
    document = json.loads(report.to_json(report.result_document(make())))
    validator.validate(document)
    assert document["schema"] == "nineaudit/result/1"


def test_what_the_data_say_of_the_sensors_is_packed_and_comes_back() -> None:
    document = report.result_document(example())["sensors"]
    eta, matrix = unpacked(document["information"])
    assert eta.tolist() == [1.0, -2.0]
    assert matrix.tolist() == [[3.0, 0.0], [0.0, 3.0]]
    assert document["information"]["parameters"] == [["a0x", "gain"], ["a0y", "gain"]]
    assert report.result_document(healthy())["sensors"]["information"] is None


def test_a_bus_is_in_the_document_identifier_by_identifier(validator: Draft202012Validator) -> None:
    audit = example()
    bus = bus_from(
        {"send": [{"id": 16, "cycle": 0.01, "frames": 100, "skip": [50]}, {"id": 99, "cycle": 1.0, "frames": 2}]}
    )
    document = report.result_document(replace(audit, recording=replace(audit.recording, bus=bus)))
    validator.validate(json.loads(report.to_json(document)))
    imu, other = document["bus"]["identifiers"]
    assert (imu["id"], imu["name"], imu["frames"], imu["cycle"]) == ("0x10", "IMU", 99, 0.01)
    assert imu["counters"] == [{"signal": "COUNTER", "missing": 1, "repeated": 0}]
    assert (other["name"], other["interval"]) == (None, None)


def test_failure_document_meets_the_schema(validator: Draft202012Validator) -> None:
    error = RecordingError("the file is empty", file="runs/T0002.blf", advice="record it again")
    document = report.failure_document(Path("runs/T0002.blf"), error, {"version": "0.1.0"})
    validator.validate(document)
    assert document["verdict"] == "not_audited"
    assert "record it again" in document["reason"]


@pytest.mark.parametrize(
    ("place", "value"),
    [
        (("verdict",), "compliant"),
        (("findings", 0, "verdict"), "ok"),
        (("findings", 0, "rule"), "301"),
        (("findings", 0, "U"), -1.0),
        (("findings", 0, "k"), 3),
        (("diagnosis", "candidates", 0, "fault"), "broken"),
        (("diagnosis", "candidates", 0, "probability"), 1.2),
        (("diagnosis", "status"), "healthy"),  # with a culprit named
        (("recording", "sha256"), "abc"),
        (("recording", "colour"), "red"),
        (("findings",), []),
    ],
)
def test_schema_refuses(place: tuple[Any, ...], value: Any, validator: Draft202012Validator) -> None:
    document = report.result_document(example(201))
    parent: Any = document
    for key in place[:-1]:
        parent = parent[key]
    parent[place[-1]] = value
    with pytest.raises(ValidationError):
        validator.validate(document)


def test_every_finding_is_listed_in_order() -> None:
    audit = example(201)
    listed = [(f["rule"], f["verdict"]) for f in report.result_document(audit)["findings"]]
    assert listed == [(f.rule, str(f.verdict)) for f in audit.findings]


@pytest.mark.parametrize(("unit", "one"), [("g_0", G0), ("m/s^2", 1.0), ("ft/s^2", 0.3048)])
def test_numbers_are_in_the_rigs_unit(unit: str, one: float) -> None:
    text = preset_text("naap-3222").replace('acceleration = "g_0"', f'acceleration = "{unit}"')
    audit = example(201, rig_text=text)
    document = report.result_document(audit)
    found = next(f for f in document["findings"] if f["rule"] == "RB301")
    assert found["unit"] == document["diagnosis"]["unit"] == document["reconstruction"]["unit"] == unit
    assert found["value"] == pytest.approx(12.4 * G0 / one, rel=1e-5)
    assert found["U"] == pytest.approx(0.8 * G0 / one, rel=1e-5)
    assert document["diagnosis"]["smallest_detectable"]["a0x"] == pytest.approx(0.4 * G0 / one, rel=1e-5)
    assert document["findings"][1]["unit"] == "samples"  # not an SI unit: left alone
    assert document["findings"][1]["value"] == 41.0


def test_rate_sensors_speak_in_the_angular_rate_unit() -> None:
    text = '[units]\nangular_rate = "deg/s"\n' + "".join(
        f'[[sensor]]\nchannel = "{c}"\nkind = "gyroscope"\naxis = {a}\n'
        for c, a in [("gx", "[1,0,0]"), ("gy", "[0,1,0]"), ("gz", "[0,0,1]")]
    )
    audit = healthy(201)
    rig = parse_rig(text)
    diagnosis = replace(audit.diagnosis, smallest_detectable={"gy": np.pi})
    recording = replace(audit.recording, rig=rig, readings=audit.recording.readings[:, :3])
    sensors = replace(audit.sensors, peaks=np.full(3, np.pi))
    document = report.result_document(replace(audit, diagnosis=diagnosis, recording=recording, sensors=sensors))
    assert [(c["peak"], c["unit"], c["shock"]) for c in document["sensors"]["channels"]] == [(180.0, "deg/s", None)] * 3
    assert document["diagnosis"]["smallest_detectable"] == {"gy": pytest.approx(180.0)}
    assert document["diagnosis"]["angular_rate_unit"] == "deg/s"


def test_not_finite_becomes_null() -> None:
    audit = example(201)
    odd = Measure(float("inf"), float("nan"), "m/s^2", float("nan"), ("a0x",), (float("nan"), 1.0))
    finding = Finding("RB301", Verdict.NOT_EVALUATED, Severity.ERROR, "no number", odd)
    document = report.result_document(replace(audit, findings=(finding,)))
    only = document["findings"][0]
    assert [only[k] for k in ("value", "limit", "U", "t_start", "t_end")] == [None, None, None, None, 1.0]
    assert document["diagnosis"]["smallest_isolable"]["a2z"] is None  # infinite in the example
    assert "NaN" not in report.to_json(document)
    assert "Infinity" not in report.to_json(document)


def test_same_audit_same_bytes() -> None:
    assert report.to_json(report.result_document(example(201))) == report.to_json(report.result_document(example(201)))


def test_jsonl_is_the_same_document_on_one_line() -> None:
    document = report.result_document(example(201))
    line = report.to_jsonl(document)
    assert line.count("\n") == 1
    assert line.endswith("\n")
    assert json.loads(line) == document


def test_bus_counts_only_of_can_logs() -> None:
    audit = example(201)
    assert report.result_document(audit)["bus"] == {"frames": 18000.0, "error_frames": 2.0}
    table = replace(audit.recording.source, format="csv", counts={"rows": 201.0})
    other = replace(audit, recording=replace(audit.recording, source=table))
    assert report.result_document(other)["bus"] == {}


# ---- the terminal ---------------------------------------------------------------------------------------------


def test_line_of_the_interface() -> None:
    audit = example(2001)
    start = audit.diagnosis.interval[0]
    wanted = f"T0001.blf: error RB301 a1y {start:.4f} s: residual 12.4 g > 3.1 g (U 0.8 g, k=2)"
    assert wanted in report.lines(audit)


def test_lines_tell_the_worst_first_and_end_with_the_diagnosis() -> None:
    lines = report.lines(example(201))
    words = [line.split(": ", 1)[1].split(" ")[0] for line in lines[:-1]]
    assert words == ["error", "error", "not", "inconclusive", "warning", "waived"]
    assert lines[-1].startswith("T0001.blf: FAIL: a1y is at fault: clipping, probability 0.98 (")
    assert "8 pass" in lines[-1]


def test_last_line_of_a_group_and_of_a_healthy_recording() -> None:
    assert "the fault is in a1y or a2x, probability > 0.99; this motion cannot" in report.lines(ambiguous())[-1]
    assert report.lines(healthy())[-1].startswith("T0001.blf: PASS: no channel contradicts the others")


def test_terminal_escapes_in_names_do_nothing() -> None:
    lines = report.lines(example(201, path="runs/\x1b[2Jevil\n\u202e.blf"))
    assert all(c.isprintable() for line in lines for c in line)


# ---- CI -------------------------------------------------------------------------------------------------------


def test_junit_is_read_by_a_real_consumer(tmp_path: Path) -> None:
    file = tmp_path / "junit.xml"
    hostile = example(201, path='runs/<b>"&\x00.blf')
    file.write_text(report.junit([example(201), hostile], {Path("runs/T2.blf"): "no <data>"}), encoding="utf-8")
    suites = list(junitparser.JUnitXml.fromfile(str(file)))
    assert [s.name for s in suites] == ["tests/T0001.blf", 'runs/<b>"&\ufffd.blf', "runs/T2.blf"]
    kinds = {case.name[:2]: [type(r).__name__ for r in case.result] for case in suites[0]}
    assert kinds == {"RQ": ["Failure"], "CB": ["Skipped"], "ZO": [], "RB": ["Failure"], "UB": []}
    assert (suites[0].tests, suites[0].failures, suites[0].errors, suites[0].skipped) == (5, 2, 0, 1)
    assert suites[2].errors == 1


@pytest.mark.parametrize("verdict", [Verdict.INCONCLUSIVE, Verdict.NOT_EVALUATED])
def test_junit_never_passes_what_was_not_decided(verdict: Verdict) -> None:
    finding = Finding("RB301", verdict, Severity.ERROR, "too noisy")
    assert '<error message="' in report.junit([replace(example(201), findings=(finding,))])


def test_junit_skips_what_is_waived() -> None:
    finding = Finding("RB301", Verdict.WAIVED, Severity.ERROR, "waived by A. Example")
    text = report.junit([replace(example(201), findings=(finding,))])
    assert '<skipped message="waived RB301: waived by A. Example"' in text


def test_annotations_are_escaped_and_ten() -> None:
    audit = example(201, path="a:b,c%d.blf")
    first = report.github([audit]).splitlines()[0]
    assert first.startswith("::error file=a%3Ab%2Cc%25d.blf,title=RQ105 a1y::error RQ105 a1y")
    lines = report.github([audit] * 9, {Path("lost.blf"): "line one\nline two"}).splitlines()
    assert len(lines) == 10
    assert lines[0] == "::error file=lost.blf,title=not audited::line one%0Aline two"
    assert all(line.startswith("::") for line in lines)


def test_annotations_leave_out_what_is_waived_or_passes() -> None:
    text = report.github([example(201)])
    assert "RQ101" not in text
    assert report.github([healthy()]) == ""


def test_summary_is_small_and_harmless() -> None:
    evil = example(201, path="runs/a|b`<img src=x>[x](y).blf")
    text = report.markdown([evil])
    row = next(line for line in text.splitlines() if "**fail**" in line)
    assert row.count("|") == 4  # the table's own
    assert not set("`<[") & set(row)
    many = report.markdown([evil], {Path(f"runs/{i}.blf"): "x" * 1000 for i in range(1500)})
    assert len(many.encode()) < 1 << 20
    assert "Not shown: " in many


# ---- numbers --------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (12.44, "12.4"),
        (0.8, "0.8"),
        (1234.56, "1235"),
        (999.6, "1000"),
        (0.00123, "0.00123"),
        (0.0000123, "1.23 × 10⁻⁵"),
        (-1.5e7, "−1.5 × 10⁷"),
        (-3.0, "−3"),
        (0.0, "0"),
        (None, "–"),
        (float("nan"), "–"),
        (float("inf"), "∞"),
    ],
)
def test_digits(value: float | None, text: str) -> None:
    assert digits(value) == text


def test_value_and_limit_are_told_apart() -> None:
    assert told_apart(3.1004, 3.1001) == ("3.1004", "3.1001")
    assert told_apart(12.44, 3.1) == ("12.4", "3.1")


def test_probability_never_claims_certainty() -> None:
    assert [probability(p) for p in (1.0, 0.978, 0.0, float("nan"))] == ["> 0.99", "0.98", "< 0.01", "–"]


def test_units_as_people_write_them() -> None:
    assert [spelled(u) for u in ("g_0", "rad/s^2", "1", "Hz")] == ["g", "rad/s²", "", "Hz"]


def test_time_stamps_keep_their_microseconds_far_from_zero() -> None:
    assert instant(1_700_000_000.1234567) == pytest.approx(1_700_000_000.1234567, abs=3e-7)
    assert instant(float("nan")) is None


def test_plain_rounds_once_and_has_no_negative_zero() -> None:
    assert plain({"a": [1.23456789, np.float64(-0.0), np.int64(3), True, float("nan")]}) == {
        "a": [1.23457, 0.0, 3, True, None]
    }
    assert str(plain(-0.0)) == "0.0"


def test_printable() -> None:
    assert printable("a\nb\x1b[0m\u202ec\u00a0d") == "a b\ufffd[0m\ufffdc\u00a0d"
