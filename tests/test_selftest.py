"""The validation record: every published number comes out, a miss shows, and the record says what computed it."""

from __future__ import annotations

import json
import math
from importlib import import_module
from pathlib import Path

import numpy as np
import pytest

from nineaudit import cli, selftest
from nineaudit.selftest import Published, all_checks, constants, filters, injury, record

MODULES = sorted(
    path.stem
    for path in Path(selftest.__file__).parent.glob("[!_]*.py")
    if "\ndef checks()" in path.read_text(encoding="utf-8")
)


@pytest.mark.parametrize("module", MODULES)
def test_published_numbers_come_out(module: str) -> None:
    checks = import_module(f"nineaudit.selftest.{module}").checks()
    assert checks
    assert [f"{c.source}: {c.quantity}: {c.ours} for {c.expected}" for c in checks if not c.passed] == []


def test_every_module_is_in_the_record() -> None:
    assert sorted(part.__name__.rpartition(".")[2] for part in selftest.PARTS) == MODULES


def test_every_number_has_a_tolerance_and_its_reason() -> None:
    checks = all_checks()
    assert len({(c.source, c.quantity) for c in checks}) == len(checks)
    for check in checks:
        assert check.tolerance > 0, check
        assert math.isfinite(check.expected), check
        assert len(check.why) >= 8, check


def one(ours: float) -> Published:
    return Published("source", "quantity", "√2", ours, 1.414, 5e-4, "half of the last printed digit")


@pytest.mark.parametrize(("ours", "passed"), [(1.4144, True), (1.4146, False), (float("nan"), False)])
def test_a_number_passes_within_its_tolerance_and_never_when_it_is_none(ours: float, passed: bool) -> None:
    assert one(ours).passed is passed


def test_the_record_names_what_was_missed() -> None:
    lines = record.lines([one(1.414), one(2.0)], "2026-01-31")
    assert "2026-01-31" in lines[0]
    assert "numpy" in lines[1]
    assert [line.split()[-1] for line in lines if line.startswith("  quantity ") and "printed" not in line] == [
        "pass",
        "MISS",
    ]
    assert any("half of the last printed digit" in line for line in lines)
    assert record.summary([one(1.414), one(2.0)]).startswith("1 of 2")


def test_command_prints_the_record_and_writes_it(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(selftest, "all_checks", injury.checks)
    with pytest.raises(SystemExit) as ended:
        cli.main(["selftest", "--date", "2026-01-31", "--json", str(tmp_path / "record.json")])
    shown = capsys.readouterr().out
    assert ended.value.code == 0
    assert "414.6" in shown
    written = json.loads((tmp_path / "record.json").read_text(encoding="utf-8"))
    assert written["passed"] is True
    assert written["date"] == "2026-01-31"
    assert len(written["checks"]) == len(injury.checks())


def test_command_fails_when_a_number_is_missed(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """The filter's design factor changed in its third digit: the record shows it."""
    from nineaudit.physics import filters as cfc

    monkeypatch.setitem(cfc._DESIGN_FACTOR, "J211", 2.0875)
    monkeypatch.setattr(selftest, "all_checks", filters.checks)
    with pytest.raises(SystemExit) as ended:
        cli.main(["selftest"])
    assert ended.value.code == 1
    assert "MISS" in capsys.readouterr().out


def test_the_record_for_machines_holds_numpy_numbers_too() -> None:
    written = json.loads(json.dumps(record.document([one(np.float64(1.414)), one(np.float64(2.0))], "2026-01-31")))
    assert [check["passed"] for check in written["checks"]] == [True, False]
    assert written["checks"][1]["ours"] == 2.0


def test_a_wrong_date_is_a_sentence(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as ended:
        cli.main(["selftest", "--date", "31.1.2026"])
    assert ended.value.code == 2
    assert "--date" in capsys.readouterr().err


def test_growth_of_a_scheme_without_feedback_is_none() -> None:
    """What the record says of Padgaonkar's α holds for other rows too: K of least squares grows, √2/3 a rad."""
    where = constants._of_preset("naap-3222")
    assert constants.growth(where) == pytest.approx(math.sqrt(2) / 3, abs=4 * math.pi / 20_000)
