"""Rule sheets: every mistake earns one sentence; the packaged ones fit their checks; the hash is of the content."""

from __future__ import annotations

from pathlib import Path

import jsonschema
import pytest

from nineaudit.engine import bind
from nineaudit.errors import ConfigurationError
from nineaudit.rulebook import default_directory, explain, load_rulebook, rules_schema
from nineaudit.tables import read_toml

SHEET = """code = "RQ202"
title = "No flat tops"
severity = "warning"
why = "An overload."
equation = "counted"
[limits]
max_samples = 0
[example]
violates = "thirteen equal samples"
conforms = "a smooth peak"
"""


def folder(tmp_path: Path, text: str, name: str = "RQ202.toml") -> Path:
    (tmp_path / name).write_text(text, encoding="utf-8")
    return tmp_path


def complaint(tmp_path: Path, text: str, name: str = "RQ202.toml") -> str:
    with pytest.raises(ConfigurationError) as error:
        bind(load_rulebook(folder(tmp_path, text, name)))
    assert str(tmp_path / name) in str(error.value)
    return str(error.value)


def test_every_packaged_sheet_fits_its_check_and_the_schema() -> None:
    book = load_rulebook()
    bind(book)
    for rule in book.rules:
        assert rule.path is not None
        jsonschema.validate(read_toml(rule.path), rules_schema())


def test_the_schema_is_a_valid_schema() -> None:
    jsonschema.Draft202012Validator.check_schema(rules_schema())


def test_an_extra_sheet_replaces_the_packaged_one(tmp_path: Path) -> None:
    before, after = load_rulebook(), load_rulebook(folder(tmp_path, SHEET))
    assert after.codes == before.codes
    assert (before["RQ202"].severity, after["RQ202"].severity) == ("error", "warning")
    assert after.sha256 != before.sha256


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("severity", "severty", "unknown key; found 'severty'; did you mean 'severity'?"),
        ('"warning"', '"fatal"', "severity: unknown value; found 'fatal'; expected one of error, warning, info"),
        ('why = "An overload."\n', "", "why: missing key; expected text in quotation marks"),
        ('title = "No flat tops"', "title = 3", "title: wrong type; found 3; expected text in quotation marks"),
        ('"RQ202"', '"RQ203"', "not named after its rule; found 'RQ203'; expected RQ202"),
        ('"RQ202"', '"rq2"', "bad code; found 'rq2'"),
        ("max_samples = 0", "max_sample = 0", "[limits] max_sample: unknown limit"),
        ("max_samples = 0", "max_sample = 0", "did you mean 'max_samples'?"),
        ("max_samples = 0", "", "[limits] max_samples: missing limit; expected a whole number"),
        ("max_samples = 0", "max_samples = 0.5", "wrong type; found 0.5; expected a whole number"),
        ("max_samples = 0", "max_samples = true", "wrong type; found True; expected a whole number"),
        ("conforms", "conform", "[example]: unknown key; found 'conform'; did you mean 'conforms'?"),
        ("[example]", "[example", "is not a TOML file"),
    ],
)
def test_a_bad_sheet_earns_one_sentence(tmp_path: Path, old: str, new: str, said: str) -> None:
    assert said in complaint(tmp_path, SHEET.replace(old, new))


def test_a_sheet_without_a_check_says_how_to_add_one(tmp_path: Path) -> None:
    said = complaint(tmp_path, SHEET.replace("RQ202", "XY123"), "XY123.toml")
    assert "no check of this code is installed" in said
    assert "nineaudit.checks" in said


def test_an_empty_folder_is_an_error(tmp_path: Path) -> None:
    with pytest.raises(ConfigurationError, match="no rule sheets"):
        load_rulebook(tmp_path)


def test_select_and_ignore_take_codes_and_their_beginnings() -> None:
    assert load_rulebook(select="RQ2").codes == tuple(f"RQ20{i}" for i in range(1, 8))
    assert load_rulebook(select=["RQ101", "CB10"], ignore=["CB102"]).codes == (
        *("CB101", *(f"CB10{i}" for i in range(3, 10))),
        "RQ101",
    )
    assert load_rulebook(select="RQ101, RQ102").codes == ("RQ101", "RQ102")


@pytest.mark.parametrize("option", ["select", "ignore"])
def test_a_code_that_fits_no_rule_is_an_error_with_the_nearest(option: str) -> None:
    with pytest.raises(ConfigurationError, match=rf"--{option}: no such rule; found 'RQ209'; did you mean 'RQ20"):
        load_rulebook(**{option: "RQ209"})


def test_nothing_left_is_an_error() -> None:
    with pytest.raises(ConfigurationError, match="no rule is left"):
        load_rulebook(select="CB", ignore="CB")


def test_the_hash_is_of_the_content_not_of_the_bytes(tmp_path: Path) -> None:
    (tmp_path / "a").mkdir()
    (tmp_path / "b").mkdir()
    plain = load_rulebook(folder(tmp_path / "a", SHEET), select="RQ202")
    head, limits = SHEET.split("[limits]")
    lines = "".join(reversed(head.splitlines(keepends=True)))
    other = f"# a comment\r\n{lines}[limits]{limits}".replace("\r\n", "\n").replace("\n", "\r\n")
    assert load_rulebook(folder(tmp_path / "b", other), select="RQ202").sha256 == plain.sha256
    changed = SHEET.replace("max_samples = 0", "max_samples = 1")
    assert load_rulebook(folder(tmp_path / "b", changed), select="RQ202").sha256 != plain.sha256


def test_a_rule_explains_itself() -> None:
    for rule in load_rulebook().rules:
        text = explain(rule)
        for part in (rule.code, rule.title, rule.why, rule.equation, rule.violates, rule.conforms, *rule.limits):
            assert part in text


def test_an_unknown_rule_is_named_with_the_nearest() -> None:
    with pytest.raises(ConfigurationError, match="did you mean 'RQ202'"):
        load_rulebook()["RQ2O2"]


def test_the_sheets_of_the_checkout_are_found() -> None:
    assert (default_directory() / "RQ202.toml").is_file()
