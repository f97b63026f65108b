"""One finding per subject whatever a check does; the guard band; the gate; waivers."""

from __future__ import annotations

import datetime as dt
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest

from cases import recording_of
from nineaudit import engine
from nineaudit.auditing import AuditVerdict, judge
from nineaudit.case import Case
from nineaudit.engine import gate, run
from nineaudit.errors import ConfigurationError, EstimationError
from nineaudit.finding import Finding, Measure, NotApplicable, Severity, Verdict
from nineaudit.rig import Units
from nineaudit.rulebook import Rule, Rulebook, load_rulebook
from nineaudit.units import display
from nineaudit.waivers import Waiver, apply_waivers, judge_waivers, load_waivers, parse_waivers, waivers_schema

G = 9.80665
CASE = Case(recording_of({"motion": "drop", "duration": 0.02}))
TODAY = dt.date(2026, 6, 1)


def answer(monkeypatch: pytest.MonkeyPatch, check: Callable[[Case], object], severity: str = "error") -> Finding:
    """The only finding of a book with one rule."""
    monkeypatch.setattr(engine, "all_checks", lambda: {"XX001": check})
    rule = Rule("XX001", "t", Severity(severity), "w", "e", "v", "c", {})
    (finding,) = run(CASE, Rulebook((rule,), "0"))
    return finding


def measured(value: float, u: float = 0.0, limit: float = 3.0 * G) -> Callable[[Case], Measure]:
    return lambda _: Measure(value, limit, "m/s^2", u, ("a1y",), (0.0312, 0.0312), "residual")


@pytest.mark.parametrize(
    ("value", "u", "severity", "verdict"),
    [
        (2.0 * G, 0.0, "error", "pass"),
        (3.0 * G, 0.0, "error", "pass"),
        (3.1 * G, 0.0, "error", "fail"),
        (3.1 * G, 0.0, "warning", "warn"),
        (3.1 * G, 0.0, "info", "pass"),
        (3.1 * G, 0.2 * G, "error", "inconclusive"),
        (2.9 * G, 0.2 * G, "warning", "inconclusive"),
        (4.0 * G, 0.2 * G, "error", "fail"),
        (2.5 * G, 0.2 * G, "error", "pass"),
        (float("nan"), 0.0, "error", "not_evaluated"),
        (float("inf"), 0.0, "error", "fail"),
        (1.0, float("nan"), "error", "not_evaluated"),
    ],
)
def test_the_verdict_has_a_guard_band_and_no_number_is_no_verdict(
    monkeypatch: pytest.MonkeyPatch, value: float, u: float, severity: str, verdict: str
) -> None:
    assert answer(monkeypatch, measured(value, u), severity).verdict == verdict


def test_the_reason_speaks_in_the_units_of_the_rig(monkeypatch: pytest.MonkeyPatch) -> None:
    reason = answer(monkeypatch, measured(12.4 * G, 0.4 * G, 3.1 * G)).reason
    assert reason == "residual 12.4 g > 3.1 g (U 0.8 g, k=2)"


def test_value_and_limit_that_round_alike_get_more_digits(monkeypatch: pytest.MonkeyPatch) -> None:
    assert answer(monkeypatch, measured(3.1004 * G, limit=3.1 * G)).reason == "residual 3.1004 g > 3.1 g"


def test_no_check_can_vanish(monkeypatch: pytest.MonkeyPatch) -> None:
    assert answer(monkeypatch, lambda _: NotApplicable("no bus")).verdict is Verdict.NOT_APPLICABLE
    assert answer(monkeypatch, lambda _: ()).verdict is Verdict.NOT_APPLICABLE

    def fails(_: Case) -> Measure:
        raise EstimationError("singular geometry")

    finding = answer(monkeypatch, fails)
    assert (finding.verdict, finding.reason) == (Verdict.NOT_EVALUATED, "singular geometry")

    def broken(_: Case) -> Measure:
        raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError):
        answer(monkeypatch, broken)


def test_every_rule_of_the_book_is_in_the_findings() -> None:
    book = load_rulebook()
    assert {f.rule for f in run(CASE, book)} == set(book.codes)


def finding(verdict: str, severity: str) -> Finding:
    return Finding("RQ202", Verdict(verdict), Severity(severity), "r", Measure(20.0, 0.0, "samples"), ("a1y",))


@pytest.mark.parametrize(
    ("verdict", "severity", "error", "warning"),
    [
        ("pass", "error", True, True),
        ("not_applicable", "error", True, True),
        ("waived", "error", True, True),
        ("fail", "error", False, False),
        ("warn", "warning", True, False),
        ("inconclusive", "error", False, False),
        ("inconclusive", "warning", True, False),
        ("not_evaluated", "error", False, False),
        ("not_evaluated", "warning", True, False),
        ("not_evaluated", "info", True, True),
    ],
)
def test_the_gate(verdict: str, severity: str, error: bool, warning: bool) -> None:
    found = [finding("pass", "error"), finding(verdict, severity)]
    assert (gate(found, "error"), gate(found, "warning"), gate(found, "never")) == (error, warning, True)
    assert (judge(found) is AuditVerdict.PASS) is error


def test_an_unknown_gate_is_an_error() -> None:
    with pytest.raises(ConfigurationError, match="--fail-on: bad gate; found 'fatal'"):
        gate([], "fatal")


WAIVER = Waiver("RQ202", "T*.blf", "spare", "A. Engineer", dt.date(2026, 1, 1), TODAY, ("a1y",), 20.0)
T1 = Path("tests/T0001.blf")


def waived(waiver: Waiver, found: Finding, path: Path = T1, today: dt.date = TODAY) -> tuple[Verdict, str]:
    """Verdict after the waiver, and what WV001 says of it."""
    (after,) = apply_waivers([found], [waiver], path, Units(), today)
    (judged,) = judge_waivers([found], [waiver], Severity.WARNING, path, Units(), today)
    return after.verdict, f"{judged.verdict}: {judged.reason}"


def test_a_waived_finding_stays_visible_with_both_reasons() -> None:
    (after,) = apply_waivers([finding("fail", "error")], [WAIVER], T1, Units(), TODAY)
    assert after.verdict is Verdict.WAIVED
    assert after.measure is not None
    assert after.reason == "r; waived by A. Engineer on 2026-01-01 until 2026-06-01: spare"


def test_a_waiver_holds_to_its_last_day_and_up_to_its_ceiling() -> None:
    failed = finding("fail", "error")
    assert waived(WAIVER, failed)[0] is Verdict.WAIVED
    verdict, said = waived(WAIVER, failed, today=TODAY + dt.timedelta(days=1))
    assert (verdict, "expired on 2026-06-01" in said) == (Verdict.FAIL, True)
    verdict, said = waived(replace(WAIVER, max_value=19.0), failed)
    assert verdict is Verdict.FAIL
    assert said.endswith("ends at 19, the value is 20 samples")


@pytest.mark.parametrize(
    "other", [replace(WAIVER, rule="RQ203"), replace(WAIVER, channels=("a2x",))], ids=["rule", "channel"]
)
def test_a_waiver_that_finds_nothing_is_a_finding(other: Waiver) -> None:
    verdict, said = waived(other, finding("fail", "error"))
    assert verdict is Verdict.FAIL
    assert said.startswith("warn: waiver of")
    assert said.endswith("has no finding to waive")


def test_a_passed_finding_needs_no_waiver() -> None:
    verdict, said = waived(WAIVER, finding("pass", "error"))
    assert verdict is Verdict.PASS
    assert "has no finding to waive" in said


def test_a_waiver_for_another_recording_is_silent() -> None:
    verdict, said = waived(WAIVER, finding("fail", "error"), Path("U0001.blf"))
    assert (verdict, said.split(":")[0]) == (Verdict.FAIL, "not_applicable")


def test_the_ceiling_is_in_the_units_of_the_report() -> None:
    found = replace(finding("fail", "error"), measure=Measure(19.0 * G, 1.0, "m/s^2"))
    assert waived(WAIVER, found)[0] is Verdict.WAIVED
    assert waived(WAIVER, replace(found, measure=Measure(21.0 * G, 1.0, "m/s^2")))[0] is Verdict.FAIL


ENTRY = """[[waiver]]
rule = "RQ202"
recordings = "T*"
reason = "spare"
approved_by = "A. Engineer"
approved_on = 2026-01-01
expires = 2026-06-01
"""


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("reason", "reasons", "[[waiver]] 1: unknown key; found 'reasons'; did you mean 'reason'?"),
        ('reason = "spare"\n', "", "[[waiver]] 1 reason: missing key"),
        ("2026-06-01", '"2026-06-01"', "expires: wrong type; found '2026-06-01'; expected a date"),
        ("2026-06-01", "2025-06-01", "ends before it begins"),
        ('"RQ202"', '"RQ209"', "rule: no such rule; found 'RQ209'; did you mean 'RQ20"),
        ("[[waiver]]", "[waiver]", "expected [[waiver]]"),
        ("[[waiver]]", "[[waivers]]", "unknown key; found 'waivers'"),
    ],
)
def test_a_bad_waiver_earns_one_sentence(tmp_path: Path, old: str, new: str, said: str) -> None:
    path = tmp_path / "w.toml"
    path.write_text(ENTRY.replace(old, new), encoding="utf-8")
    with pytest.raises(ConfigurationError) as error:
        load_waivers(path, load_rulebook().codes)
    assert str(error.value).startswith(str(path))
    assert said in str(error.value)


def test_a_missing_waiver_file_is_a_configuration_error(tmp_path: Path) -> None:
    with pytest.raises(ConfigurationError, match="cannot be read"):
        load_waivers(tmp_path / "none.toml")


def test_a_good_waiver_file_is_read(tmp_path: Path) -> None:
    path = tmp_path / "w.toml"
    path.write_text(ENTRY + 'channels = ["a1y"]\nmax_value = 20\n', encoding="utf-8")
    (waiver,) = load_waivers(path)
    assert (waiver.channels, waiver.max_value, waiver.expires) == (("a1y",), 20, TODAY)
    assert parse_waivers({}) == ()
    assert "waiver" in waivers_schema()["properties"]


@pytest.mark.parametrize(
    ("value", "unit", "units", "text"),
    [
        (12.4 * G, "m/s^2", Units(), "12.4 g"),
        (12.4, "m/s^2", Units(acceleration="m/s^2"), "12.4 m/s²"),
        (1.0, "rad/s", Units(angular_rate="deg/s"), "57.3 deg/s"),
        (0.0005, "m", Units(), "0.5 mm"),
        (3.0 * G, "m/s^2", Units(acceleration="mV"), "3 g"),
        (13.0, "samples", Units(), "13 samples"),
        (1.0, "samples", Units(), "1 sample"),
        (0.1234, "1", Units(), "0.123"),
        (12345.6, "1", Units(), "12346"),
    ],
)
def test_numbers_are_shown_as_the_rig_speaks(value: float, unit: str, units: Units, text: str) -> None:
    assert display(value, unit, units) == text
