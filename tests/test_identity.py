"""Which test a recording is of: rig file, header, option; what is not known; what contradicts."""

from __future__ import annotations

import re
import zipfile
from dataclasses import replace
from datetime import UTC, datetime
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory
from xml.etree import ElementTree as ET

import pytest
from jsonschema import Draft202012Validator

from nineaudit.auditing import Audit, audit
from nineaudit.checking import audit_each, load_book
from nineaudit.errors import ConfigurationError
from nineaudit.identity import KEYS, Identity, Stated, from_options, identify, is_date, moment, stated
from nineaudit.readers import read
from nineaudit.readers.can.asc import read_asc
from nineaudit.report import junit, markdown, result_document, result_schema, to_json
from nineaudit.report.page import render
from nineaudit.report.result_page import render_result
from nineaudit.rig import load_rig, parse_rig
from nineaudit.simulate import simulate
from nineaudit.writers import write_recording
from recordings import array_rig, database, motion, write_any

RIG = '[rig]\npreset = "naap-3222"\n'
TEST = """
[test]
number = "T0001"
item = "head form"
date = 2026-01-31
laboratory = "Hall 3"
"""


def test_later_statements_take_the_place_of_earlier_ones_and_a_remark_says_so() -> None:
    rig = stated({"item": "head form", "laboratory": "Hall 3"}, "rig file a.toml")
    header = stated({"item": "torso", "number": "T1", "laboratory": "Hall 3"}, "header T1.mme")
    found = identify(rig, header, stated({"number": "T2"}, "option --test"))
    assert (found.item, found.number, found.laboratory, found.date) == ("torso", "T2", "Hall 3", "")
    assert found.sources == {"number": "option --test", "item": "header T1.mme", "laboratory": "header T1.mme"}
    assert found.remarks == (
        "Test item: 'torso' (header T1.mme) is taken, not 'head form' (rig file a.toml)",
        "Test number: 'T2' (option --test) is taken, not 'T1' (header T1.mme)",
    )


def test_what_is_stated_twice_and_differently_in_one_place_is_not_known() -> None:
    parts = [Stated("number", "T1", "header a.mme"), Stated("number", "T2", "header b.mme")]
    found = identify([], parts)
    assert found.number == ""
    assert "number" not in found.document()
    assert found.remarks == (
        "Test number: 'T1' (header a.mme), 'T2' (header b.mme): they contradict each other, and none is taken",
    )
    assert identify([], parts, [Stated("number", "T3", "option --test")]).number == "T3"
    assert identify([], [parts[0], replace(parts[0], source="header b.mme")]).number == "T1"


@pytest.mark.parametrize("text", ["31.01.2026", "2026-02-30", "20260131", "2026-1-31", "2026-W05-6", "٢٠٢٦-٠١-٣١", ""])
def test_only_days_of_the_calendar_are_dates(text: str) -> None:
    assert not is_date(text)
    found = identify([Stated("date", text, "header T.mme")])
    assert found.date == ""
    assert found.remarks == (f"Date of the test: {text!r} (header T.mme) is no date YYYY-MM-DD and is not used",)


def test_a_recording_started_on_another_day_is_remarked_time_zones_aside() -> None:
    def on(started: str) -> tuple[str, ...]:
        return identify([Stated("date", "2026-01-31", "rig file"), Stated("started", started, "log")]).remarks

    assert on("2026-02-01T00:30:00.000") == ()
    assert on("2026-02-03T09:00:00.000Z") == ("the recording was started on 2026-02-03, the test is dated 2026-01-31",)


def test_moments_have_a_zone_where_there_is_one() -> None:
    assert moment(1436509052.249713, True) == "2015-07-10T06:17:32.249Z"
    assert moment(1436509052.0, False) == "2015-07-10T06:17:32.000"
    assert moment(1e300, True) == ""


def test_long_statements_are_cut_and_blanks_are_tidied() -> None:
    assert stated({"item": "  head \n form "}, "x")[0].value == "head form"
    assert len(stated({"notes": "a" * 5000}, "x")[0].value) == 501
    assert stated({"item": " "}, "x") == ()


def test_a_rig_file_states_what_all_tests_have_in_common(tmp_path: Path) -> None:
    file = tmp_path / "rig.toml"
    file.write_text(RIG + TEST)
    made = simulate(load_rig(file), "general", seed=1).recording
    assert made.test.known == {
        "number": "T0001", "item": "head form", "date": "2026-01-31", "laboratory": "Hall 3"
    }  # fmt: skip
    assert set(made.test.sources.values()) == {"rig file rig.toml"}
    assert simulate(parse_rig(RIG), "general", seed=1).recording.test == Identity()


@pytest.mark.parametrize("value", ['"31.01.2026"', "2026-01-31T10:00:00", "2026", '"2026-02-30"'])
def test_a_rig_file_with_a_bad_date_is_refused(value: str) -> None:
    with pytest.raises(
        ConfigurationError, match=r"\[test\] date: wrong value; found .*; expected a date as YYYY-MM-DD"
    ):
        parse_rig(f"{RIG}[test]\ndate = {value}\n")


def test_an_unknown_key_of_the_table_is_refused() -> None:
    with pytest.raises(ConfigurationError, match=r"\[test\]: unknown key; found 'nummer'; .*did you mean 'number'"):
        parse_rig(f'{RIG}[test]\nnummer = "T1"\n')


def test_options_state_what_they_can() -> None:
    found = from_options(["number=T=1", "item-serial=4711"])
    assert [(s.key, s.value) for s in found] == [("number", "T=1"), ("item_serial", "4711")]


@pytest.mark.parametrize(
    ("given", "said"),
    [
        (["T0001"], "no statement about the test; found 'T0001'; expected KEY=VALUE, KEY one of number"),
        (["nummer=1"], "no statement about the test; found 'nummer=1'"),
        (["number=1", "number=2"], "number is stated twice"),
        (["item= "], "item without a value"),
        (["date=31.1.2026"], "no date; found '31.1.2026'; expected a day as YYYY-MM-DD"),
        (["started=2026-01-31"], "no statement about the test"),
    ],
)
def test_options_that_state_nothing_are_refused(given: list[str], said: str) -> None:
    with pytest.raises(ConfigurationError) as caught:
        from_options(given)
    assert said in str(caught.value)


def test_every_key_is_in_identity_schema_and_rig_table() -> None:
    from nineaudit.rig_schema import TestTable

    block = result_schema()["properties"]["test"]["properties"]
    assert set(KEYS) | {"started", "sources", "remarks"} == set(block) == set(Identity.__dataclass_fields__)
    assert set(KEYS) == set(TestTable.model_fields)


@pytest.fixture
def mme(tmp_path: Path) -> Path:
    path = tmp_path / "T9.zip"
    write_recording(simulate(parse_rig(RIG), "general", seed=1).recording, path)
    return path


def _with_header(path: Path, text: str) -> Path:
    """The archive with another header of the test."""
    out = path.with_name("other.zip")
    with zipfile.ZipFile(path) as old, zipfile.ZipFile(out, "w") as new:
        for name in old.namelist():
            new.writestr(name, text if name.endswith(".mme") else old.read(name))
    return out


HEADER = """\
Laboratory name             :Hall 3
Customer name               :NOVALUE
Title                       :sled, 50 km/h
Laboratory test ref. number :S-17
Date of the test            :2026-01-31
Number of test objects      :2
Name of test object 1       :head form
Ref. number of test object 1:4711
Name of test object 2       :barrier
"""


def test_the_header_of_a_test_is_read(mme: Path) -> None:
    found = read(_with_header(mme, HEADER), parse_rig(RIG)).test
    assert found.known == {
        "number": "S-17", "title": "sled, 50 km/h", "item": "head form", "item_serial": "4711",
        "date": "2026-01-31", "laboratory": "Hall 3",
    }  # fmt: skip
    assert set(found.sources.values()) == {"header T9.mme"}


def test_a_header_with_another_kind_of_date_gives_no_date_and_a_remark(mme: Path) -> None:
    found = read(_with_header(mme, HEADER.replace("2026-01-31", "31-JAN-2026")), parse_rig(RIG + TEST)).test
    assert found.date == "2026-01-31"
    assert found.sources["date"] == "rig file"
    assert "Date of the test: '31-JAN-2026' (header T9.mme) is no date YYYY-MM-DD and is not used" in found.remarks


def test_the_result_says_which_test_it_is(mme: Path) -> None:
    from jsonschema import Draft202012Validator

    about = from_options(["number=T2", "item=<script>alert(1)</script>"])
    recording = read(_with_header(mme, HEADER), parse_rig(RIG), test=about)
    document = result_document(audit(recording))
    Draft202012Validator(result_schema()).validate(document)
    assert document["test"]["number"] == "T2"
    assert document["test"]["date"] == "2026-01-31"
    assert document["test"]["sources"]["number"] == "option --test"
    assert "customer" not in document["test"]


@pytest.mark.parametrize("suffix", [".mme", ".zip"])
def test_a_test_goes_to_iso_mme_and_comes_back(suffix: str, tmp_path: Path) -> None:
    about = from_options(["number=T7", "date=2026-01-31", "item=head form", "item_serial=4711", "customer=C: & Co"])
    made = simulate(parse_rig(RIG), "general", seed=1).recording
    written = write_recording(replace(made, test=identify(about)), tmp_path / f"out{suffix}")
    found = read(written.path, parse_rig(RIG)).test
    assert found.known == {
        "number": "T7", "item": "head form", "item_serial": "4711", "date": "2026-01-31", "customer": "C: & Co",
    }  # fmt: skip
    assert set(found.sources.values()) == {"header out.mme"}


def test_what_is_not_known_is_not_made_up_in_a_header(mme: Path) -> None:
    assert read(mme, parse_rig(RIG)).test == Identity()


def test_a_test_goes_to_mcap_and_comes_back(tmp_path: Path) -> None:
    made = simulate(parse_rig(RIG), "general", seed=1).recording
    about = identify(from_options(["number=T7", "notes=second try"]))
    write_recording(replace(made, test=about), tmp_path / "a.mcap")
    found = read(tmp_path / "a.mcap", parse_rig(RIG)).test
    assert found.known == {"number": "T7", "notes": "second try"}
    assert found.sources["number"] == "metadata of a.mcap"


BEGAN = 1_769_846_400.25
"""s since 1970 on that day, UTC; logs that python-can writes for these tests start at 1.7e9 s."""
DAY = "2026-01-31T08:00:00"


@pytest.mark.parametrize(
    ("suffix", "moment_said"),
    [(".mcap", f"{DAY}.250Z"), (".csv", f"{DAY}.250"), (".parquet", f"{DAY}.250")],
)
def test_stamps_that_are_dates_say_when_the_recording_was_started(
    suffix: str, moment_said: str, tmp_path: Path
) -> None:
    made = simulate(parse_rig(RIG), "general", seed=1).recording
    path = tmp_path / f"a{suffix}"
    write_recording(replace(made, time=made.time - made.time[0] + BEGAN), path)
    found = read(path, parse_rig(RIG)).test
    assert (found.started, found.date, found.sources) == (moment_said, "", {"started": f"a{suffix}"})


def test_stamps_since_power_on_are_no_date(tmp_path: Path) -> None:
    made = simulate(parse_rig(RIG), "general", seed=1).recording
    write_recording(replace(made, time=made.time - made.time[0] + 3e6), tmp_path / "a.csv")
    assert read(tmp_path / "a.csv", parse_rig(RIG)).test == Identity()


@pytest.mark.parametrize(("suffix", "said"), [(".log", "2023-11-14T22:13:20.000Z"), (".blf", f"{DAY}.250")])
def test_can_logs_with_dates_say_when_they_were_started(suffix: str, said: str, tmp_path: Path) -> None:
    rig = array_rig()
    made = motion(rig)
    path = write_any(replace(made, time=made.time - made.time[0] + BEGAN), tmp_path, suffix)
    found = read(path, rig, dbc=[database(rig, tmp_path)]).test
    assert found.started == said


@pytest.mark.parametrize(
    ("date", "said"),
    [(b"Sat Jan 31 08:00:00.250 am 2026", "2026-01-31T08:00:00.250"), (b"Sa 31.01.2026", "")],
)
def test_an_asc_log_says_when_it_was_started_if_its_date_can_be_read(date: bytes, said: str, tmp_path: Path) -> None:
    path = tmp_path / "a.asc"
    path.write_bytes(b"date " + date + b"\nbase hex  timestamps absolute\n   0.001 1  123  Rx   d 1 01\n")
    assert read_asc(path).started == said


def test_an_mf4_file_says_when_it_was_started(tmp_path: Path) -> None:
    asammdf = pytest.importorskip("asammdf")
    made = simulate(parse_rig(RIG), "general", seed=1).recording
    with asammdf.MDF() as log:
        log.header.start_time = datetime(2026, 1, 31, 8, 0, 0, 250_000, tzinfo=UTC)
        log.append([asammdf.Signal(t.values, t.time, name=t.signal, unit="m/s^2") for t in made.native])
        log.save(tmp_path / "a.mf4")
    assert read(tmp_path / "a.mf4", parse_rig(RIG)).test.started == "2026-01-31T08:00:00.250+00:00"


HOSTILE = '"><script>alert(1)</script><img src=x onerror=alert(2)>|`*'


@cache
def _plain() -> Audit:
    return audit(simulate(parse_rig(RIG + "[recording]\npre_trigger = [-0.02, -0.001]\n"), "general", seed=1).recording)


def _of(test: Identity) -> Audit:
    """The audit of a healthy recording of that test."""
    return replace(_plain(), recording=replace(_plain().recording, test=test))


def _audited(*given: str) -> Audit:
    return _of(identify(from_options(given)))


@pytest.mark.parametrize("key", [key for key in KEYS if key != "date"])
def test_no_statement_about_a_test_becomes_markup(key: str) -> None:
    done = _audited(f"{key}={HOSTILE}")
    for page in (render(done), render_result_of(done)):
        assert "<script>alert" not in page
        assert "<img src=x" not in page
        assert "&lt;script&gt;alert(1)&lt;/script&gt;" in page
    assert "<script" not in markdown([done])
    ET.fromstring(junit([done]))


def render_result_of(done: Audit) -> str:
    with TemporaryDirectory() as folder:
        path = Path(folder) / "result.json"
        path.write_text(to_json(result_document(done)))
        return render_result(path)


def test_what_could_not_be_audited_has_what_rig_and_options_state(tmp_path: Path) -> None:
    (tmp_path / "T1.csv").write_bytes(b"")
    rig = parse_rig(RIG + '[test]\ncustomer = "C. Example"\n')
    outcome = next(iter(audit_each([tmp_path / "T1.csv"], rig, load_book(), test=from_options(["number=T7"]))))
    document = outcome.document()
    assert document["verdict"] == "not_audited"
    assert document["test"] == {
        "number": "T7",
        "customer": "C. Example",
        "sources": {"number": "option --test", "customer": rig.test[0].source},
    }
    Draft202012Validator(result_schema()).validate(document)
    bare = next(iter(audit_each([tmp_path / "T1.csv"], parse_rig(RIG), load_book()))).document()
    assert "test" not in bare


def test_the_report_shows_what_is_known_and_where_it_was_stated() -> None:
    done = _audited("number=T7", "item=head form", "item_serial=4711")
    for page in (render(done), render_result_of(done)):
        assert re.search(r"<dt>Test number</dt><dd>T7 <span class=\"source\">option --test</span>", page)
        assert "T7, head form ·" in page
    page = render(done)
    assert "Not stated: Date of the test, laboratory." in page
    assert '<input type="text" name="test" value="T7">' in page
    assert '<input type="text" name="item" value="head form, 4711">' in page
    assert '<input type="text" name="tested_on">' in page


def test_contradictions_stand_in_the_report() -> None:
    parts = [Stated("number", "T1", "header a.mme"), Stated("number", "T2", "header b.mme")]
    done = _of(identify(parts))
    said = "they contradict each other, and none is taken"
    assert render(done).count(said) == 2  # identification, deviations
    assert said in render_result_of(done)


def test_ci_outputs_name_the_test() -> None:
    known, unknown = _audited("number=T7", "item=head form"), _audited()
    suites = ET.fromstring(junit([known, unknown])).findall("testsuite")
    found = {p.get("name"): p.get("value") for p in suites[0].findall("properties/property")}
    assert found == {"test.number": "T7", "test.item": "head form"}
    assert suites[1].find("properties") is None
    assert suites[0].get("tests") == suites[1].get("tests") == str(len(suites[0].findall("testcase")))
    assert "| recording | test | verdict | diagnosis |\n|---|---|---|---|" in markdown([known])
    assert "| T7, head form | **" in markdown([known])
    assert "| recording | verdict | diagnosis |\n|---|---|---|" in markdown([unknown])
