"""Every rule answers its cases as they say; adding a case needs no Python (tests/cases.py tells the keys)."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import pytest

from cases import FOLDER, all_cases, findings_of
from nineaudit.checks import CHECKS
from nineaudit.engine import ENGINE_CODES
from nineaudit.finding import Verdict
from nineaudit.rulebook import load_rulebook

CASES = list(all_cases())


@pytest.mark.parametrize(("code", "case"), CASES, ids=[f"{code}: {case['name']}" for code, case in CASES])
def test_the_rule_answers_as_the_case_says(code: str, case: Mapping[str, Any]) -> None:
    found = findings_of(code, case)
    told = {f.verdict: f.reason for f in found}
    wanted = Verdict(case["verdict"])
    assert wanted in told, told
    if "channels" in case:
        assert {c for f in found if f.verdict is wanted for c in f.channels} == set(case["channels"])
        assert all(f.verdict in (wanted, Verdict.PASS) for f in found), told
    elif wanted in (Verdict.PASS, Verdict.NOT_APPLICABLE, Verdict.NOT_EVALUATED):
        assert set(told) == {wanted}, told


def test_sheets_functions_and_cases_are_the_same_set() -> None:
    sheets = set(load_rulebook().codes)
    assert sheets == set(CHECKS) | ENGINE_CODES
    assert sheets == {path.stem for path in FOLDER.glob("*.toml")}


@pytest.mark.parametrize("code", sorted({code for code, _ in CASES}))
def test_each_rule_has_a_case_that_violates_and_one_that_does_not(code: str) -> None:
    verdicts = {Verdict(case["verdict"]) for c, case in CASES if c == code}
    assert verdicts & {Verdict.FAIL, Verdict.WARN}
    assert verdicts & {Verdict.PASS, Verdict.NOT_APPLICABLE}
