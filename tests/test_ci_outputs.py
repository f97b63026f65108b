"""What CI systems read: JUnit XML held to its schema, annotations and summary of any input, JSON lines as a stream."""

from __future__ import annotations

import gc
import json
import re
import weakref
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path

import junitparser
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from lxml import etree

from nineaudit import report
from nineaudit.checking import Files, Outcome, run
from nineaudit.engine import gate
from nineaudit.errors import ConfigurationError, RecordingError
from nineaudit.finding import Finding, Measure, Severity, Verdict
from nineaudit.report.ci import SUMMARY_BYTES
from report_example import Example, ambiguous, example, healthy

SCHEMA = etree.XMLSchema(etree.parse(str(Path(__file__).parent / "vendor" / "junit" / "junit-10.xsd")))
HOSTILE = [
    "<script>alert(1)</script>",
    "]]><testcase name='x'/>",
    "a\nb\r::error::c",
    "::stop-commands::x",
    "%0A::set-output name=a::b",
    "|`*_[x](y)~@everyone <img src=x>",
    "\x00\x1b[2J\u202e\ufffe\ud800",
]


def found(verdict: Verdict, severity: str = "error", rule: str = "RQ202", said: str = "41 samples > 0") -> Finding:
    measure = Measure(41.0, 0.0, "samples", 0.0, ("a1y",), (0.03, 0.04))
    return Finding(rule, verdict, Severity(severity), said, measure, ("a1y",))


def with_findings(*findings: Finding, path: str = "tests/T0001.blf") -> Example:
    return replace(example(201, path=path), findings=findings)


def results(audits: Sequence[Example], fail_on: str = "error") -> dict[str, list[str]]:
    """Name of each case -> what junitparser says became of it; the XML meets the schema."""
    text = report.junit(audits, None, fail_on)
    SCHEMA.assertValid(etree.fromstring(text.encode()))
    suites = junitparser.JUnitXml.fromroot(junitparser.junitparser.etree.fromstring(text.encode()))
    return {case.name: [type(r).__name__ for r in case.result] for suite in suites for case in suite}


@pytest.mark.parametrize("make", [example, healthy, ambiguous])
def test_junit_meets_the_schema_and_has_a_case_for_each_recording_and_family(make: object) -> None:
    audits = [make(), replace(make())]  # type: ignore[operator]
    text = report.junit(audits, {Path("lost.blf"): "empty"})
    SCHEMA.assertValid(etree.fromstring(text.encode()))
    families = {f.rule[:2] for f in audits[0].findings}
    assert text.count("<testcase ") == 2 * len(families) + 1


@pytest.mark.parametrize("hostile", HOSTILE)
def test_no_input_breaks_the_schema(hostile: str) -> None:
    audit = with_findings(found(Verdict.FAIL, said=hostile), path=f"runs/{hostile}.blf")
    root = etree.fromstring(report.junit([audit], {Path(hostile): hostile}).encode())
    SCHEMA.assertValid(root)
    assert [element.tag for element in root.iter()].count("testcase") == 2


def test_two_recordings_of_one_name_are_two_classes() -> None:
    audits = [with_findings(found(Verdict.PASS), path=f"{folder}/T1.csv") for folder in ("a", "b")]
    assert len(set(re.findall(r'classname="([^"]+)"', report.junit(audits)))) == 2


@pytest.mark.parametrize(
    ("verdicts", "wanted"),
    [
        (("pass", "not_applicable"), []),
        (("not_applicable",), ["Skipped"]),
        (("waived",), ["Skipped"]),
        (("pass", "waived", "warn"), ["Skipped"]),
        (("waived", "fail"), ["Failure"]),
        (("inconclusive", "fail"), ["Failure"]),
        (("waived", "inconclusive"), ["Error"]),
        (("pass", "not_evaluated"), ["Error"]),
    ],
)
def test_what_becomes_of_a_family(verdicts: tuple[str, ...], wanted: list[str]) -> None:
    audit = with_findings(*(found(Verdict(v)) for v in verdicts))
    assert results([audit]) == {"RQ Record quality": wanted}


def test_a_case_fails_where_the_gate_does() -> None:
    audit = with_findings(found(Verdict.WARN, "warning"))
    assert results([audit], "error") == results([audit], "never") == {"RQ Record quality": []}
    assert results([audit], "warning") == {"RQ Record quality": ["Failure"]}
    assert results([with_findings(found(Verdict.FAIL))], "never") == {"RQ Record quality": ["Failure"]}


@pytest.mark.parametrize("severity", ["error", "warning", "info"])
@pytest.mark.parametrize("verdict", [v for v in Verdict if v is not Verdict.FAIL])
@pytest.mark.parametrize("fail_on", ["error", "warning"])
def test_exit_code_and_junit_agree(verdict: Verdict, severity: str, fail_on: str) -> None:
    audit = with_findings(found(Verdict.PASS), found(verdict, severity))
    (tags,) = results([audit], fail_on).values()
    assert (set(tags) <= {"Skipped"}) is gate(audit.findings, fail_on)


def test_a_waived_violation_stays_in_the_text_of_its_case() -> None:
    text = report.junit([with_findings(found(Verdict.WAIVED, said="r; waived by A. Example"), found(Verdict.PASS))])
    assert ">waived RQ202 a1y 0.0300 s: r; waived by A. Example</skipped>" in text


# ---- annotations and summary ----------------------------------------------------------------------------------


@settings(max_examples=60, deadline=None)
@given(path=st.text(min_size=1, max_size=40), said=st.text(max_size=80))
def test_an_annotation_is_one_command_whatever_the_names(path: str, said: str) -> None:
    """The runner's grammar: ``::name key=value,key=value::data``, one to a line; values hold no bare % : , CR LF."""
    (line,) = report.github([], {Path(path.replace("\x00", "")): said}).splitlines()
    got = re.fullmatch(r"::error file=([^:,\r\n]*),title=not audited::([^\r\n]*)", line)
    assert got is not None
    assert all(not re.search("%(?!25|0D|0A|3A|2C)", part) for part in got.groups())


@pytest.mark.parametrize("hostile", HOSTILE)
def test_no_input_adds_a_command(hostile: str) -> None:
    audit = with_findings(found(Verdict.FAIL, said=hostile), path=f"runs/{hostile}.blf")
    lines = report.github([audit], {Path(hostile): hostile}).split("\n")
    assert [line[:8] for line in lines] == ["::error ", "::error ", ""]


def test_the_ten_worst_are_those_of_the_greatest_weight() -> None:
    few = [with_findings(found(Verdict.WARN, "warning"), path=f"w{i}.csv") for i in range(20)]
    lines = report.github([*few, with_findings(found(Verdict.FAIL), path="bad.csv")]).splitlines()
    assert len(lines) == 10
    assert lines[0].startswith("::error file=bad.csv,title=RQ202 a1y::error RQ202 a1y 0.0300 s: ")
    assert all(line.startswith("::warning file=w") for line in lines[1:])


@pytest.mark.parametrize("size", [10, 10_000, 300_000])
@pytest.mark.parametrize("mark", ["|", "x", "\U0001f600", "\n"])
def test_a_summary_is_below_one_mebibyte_whatever_the_input(size: int, mark: str) -> None:
    audits = [
        with_findings(found(Verdict.FAIL, said=mark * size), path=f"{mark * min(size, 9000)}{i}.csv") for i in range(12)
    ]
    text = report.markdown(audits, {Path(f"{i}{mark}.blf"): mark * min(size, 20_000) for i in range(800)})
    assert len(text.encode()) < SUMMARY_BYTES
    assert text.startswith("## nineaudit\n")
    assert len(report.github(audits).encode()) < 10 * 64 * 1024


def test_a_message_that_is_cut_says_by_how_much() -> None:
    text = report.markdown([with_findings(found(Verdict.FAIL, said="x" * 5000))])
    assert re.search(r"x… \(\d{4} more characters\)", text)


def test_outputs_of_all_recordings_keep_no_audit(tmp_path: Path) -> None:
    """Each audit can be let go once its recording is written: none but the last is alive when the next one comes."""
    alive: list[weakref.ref[Example]] = []

    def outcomes() -> Iterator[Outcome]:
        for i in range(5):
            gc.collect()
            assert not [x for x in alive[:-1] if x() is not None]
            made = with_findings(found(Verdict.FAIL, said=f"number {i}"), path=f"T{i}.csv")
            alive.append(weakref.ref(made))
            yield Outcome(Path(f"T{i}.csv"), audit=made)
            del made
        yield Outcome(Path("lost.csv"), error=RecordingError("the file is empty"))

    for style in ("json", "junit", "github"):
        shown: list[str] = []
        files = Files(json_list=tmp_path / "l.json", junit=tmp_path / "j.xml", summary=tmp_path / "s.md")
        code = run(outcomes(), files, style=style, fail_on="error", many=True, show=shown.append, say=lambda _: None)
        assert code == 3
        if style != "github":
            same = tmp_path / {"json": "l.json", "junit": "j.xml"}[style]
            assert "".join(shown) == same.read_text(encoding="utf-8")
    assert [d["recording"]["path"] for d in json.loads((tmp_path / "l.json").read_text(encoding="utf-8"))] == [
        *(f"T{i}.csv" for i in range(5)),
        "lost.csv",
    ]
    assert len(etree.parse(tmp_path / "j.xml").getroot()) == 6
    summary = (tmp_path / "s.md").read_text(encoding="utf-8")
    assert [f"number {i}" in summary for i in range(5)] == [True] * 5


def test_a_list_that_is_not_finished_leaves_what_was_there(tmp_path: Path) -> None:
    def outcomes() -> Iterator[Outcome]:
        yield Outcome(Path("lost.csv"), error=RecordingError("the file is empty"))
        raise ConfigurationError("a limit is wrong")

    place = tmp_path / "l.json"
    place.write_text("before", encoding="utf-8")
    with pytest.raises(ConfigurationError, match="a limit is wrong"):
        run(
            outcomes(),
            Files(json_list=place),
            style="text",
            fail_on="error",
            many=True,
            show=lambda _: None,
            say=lambda _: None,
        )
    assert place.read_text(encoding="utf-8") == "before"
    assert [p.name for p in tmp_path.iterdir()] == ["l.json"]
