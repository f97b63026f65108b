"""`campaign health`, `campaign rig` and the sensors on the index page, as a user calls them."""

from __future__ import annotations

import json
import re
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from campaign_entries import EDITION, lake_of
from health_campaigns import Plan, drawn
from nineaudit import cli
from nineaudit.campaign.health.assess import assess, assess_records
from nineaudit.campaign.health.page import section
from nineaudit.campaign.index.index_page import render
from nineaudit.campaign.index.index_rows import Index
from nineaudit.estimate.hypotheses import healthy_fit
from nineaudit.files import sealed
from nineaudit.report.sensors import _text, unpacked
from nineaudit.rig import load_rig, parse_rig, preset_text
from nineaudit.simulate import simulate

BENCHMARKS = Path(__file__).parents[1] / "benchmarks"
TEXT = preset_text("naap-3222")
HOSTILE = "<script>alert(1)</script>"


def called(capsys: pytest.CaptureFixture[str], *arguments: object) -> tuple[int, str, str]:
    with pytest.raises(SystemExit) as ended:
        cli.main([str(argument) for argument in arguments])
    shown = capsys.readouterr()
    return int(ended.value.code or 0), shown.out, shown.err


def surer(entry: dict[str, Any], times: float, number: int) -> dict[str, Any]:
    """The entry as if so many equal tests spoke, of a recording of its own."""
    block = entry["result"]["sensors"]
    told = block["information"]
    eta, matrix = unpacked(told)
    more = {"eta": _text(times * eta), "matrix": _text(times * matrix[np.triu_indices(len(eta))])}
    source = entry["result"]["recording"] | {"sha256": f"{number:064x}"}
    sensors = block | {"information": told | more}
    return entry | {"result": sealed(entry["result"] | {"recording": source, "sensors": sensors})}


@pytest.fixture(scope="module")
def one() -> dict[str, Any]:
    """An audited test of a rig whose instrument is a little off."""
    import nineaudit as na
    from nineaudit.report.machine import result_document

    recording = simulate(parse_rig(TEXT), "general", seed=11, rate_hz=4000.0).recording
    made = {"schema": "nineaudit/lake-entry/1", "uri": "T1.csv", "key": "0" * 32, "edition": EDITION}
    return made | {"test": {"number": "T1", "date": "2026-03-01"}, "result": result_document(na.audit(recording))}


@pytest.fixture
def lake(one: dict[str, Any], tmp_path: Path) -> Path:
    tests = [
        surer(one, 300.0, i) | {"uri": f"T{i}.csv", "key": f"{i:032x}", "test": {"date": f"2026-03-{i + 1:02d}"}}
        for i in range(8)
    ]
    lake_of(tmp_path / "lake", tests)
    return tmp_path / "lake"


def test_health_is_a_table_and_a_document(lake: Path, capsys: pytest.CaptureFixture[str]) -> None:
    code, text, said = called(capsys, "campaign", "health", lake)
    assert (code, said) == (0, "")
    assert "9 sensors in 8 tests: 9 in control" in text
    code, text, _ = called(capsys, "campaign", "health", lake, "--json")
    document = json.loads(text)
    assert (code, document["schema"], document["action"]) == (0, "nineaudit/sensor-health/1", False)
    assert {s["state"] for s in document["sensors"]} == {"in control"}


def test_a_tolerance_that_is_none_is_refused(lake: Path, capsys: pytest.CaptureFixture[str]) -> None:
    code, _, said = called(capsys, "campaign", "health", lake, "--tolerance", "1.5")
    assert code == 2
    assert "--tolerance" in said


def test_a_rig_file_gets_what_the_tests_found_and_keeps_the_rest(
    lake: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    rig, better = tmp_path / "rig.toml", tmp_path / "better.toml"
    rig.write_text(TEXT, encoding="utf-8")
    code, said, _ = called(capsys, "campaign", "rig", lake, rig, "--output", better)
    assert code == 0
    before, after = load_rig(rig), load_rig(better)
    for line in TEXT.splitlines():
        assert not line.startswith("#") or line in better.read_text(encoding="utf-8")
    proof = json.loads((tmp_path / "better.toml.evidence.json").read_text(encoding="utf-8"))
    assert proof["rig"]["sha256"] == before.sha256
    assert proof["lake"] == {"name": "lake", "edition": EDITION}
    changed = {row["channel"]: row for row in proof["channels"] if "scale" in row["changed"]}
    assert changed
    for channel, row in changed.items():
        gain = row["errors"]["gain"]
        assert after.array[channel].scale == pytest.approx(1.0 + gain["value"], rel=1e-5)
        assert after.array[channel].u_gain == pytest.approx(gain["u"], rel=1e-3)
        assert after.array[channel].u_gain < before.array[channel].u_gain
        assert abs(gain["value"]) > 2.0 * gain["u"] * 0.99
        assert f"{channel} (sensor" in said
    known = {s.name: s.level["gain"][0] for s in assess(lakes_entries(lake)).sensors}
    for channel, row in changed.items():
        assert row["errors"]["gain"]["value"] == pytest.approx(known[row["sensor"]], rel=1e-4), channel

    code, _, said = called(capsys, "campaign", "rig", lake, rig, "--output", better)
    assert (code, "exists" in said) == (2, True)
    assert called(capsys, "campaign", "rig", lake, rig, "--output", better, "--force")[0] == 0
    assert called(capsys, "campaign", "rig", lake, rig, "--output", rig, "--force")[0] == 2
    assert rig.read_text(encoding="utf-8") == TEXT


def lakes_entries(lake: Path) -> list[dict[str, Any]]:
    from nineaudit.campaign.lake import entries, open_lake

    return list(entries(open_lake(lake)))


def test_once_written_back_there_is_nothing_left_to_write(
    lake: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """What the lake found is in the rig file: against that, the same tests find it right."""
    rig, better, again = (tmp_path / name for name in ("rig.toml", "better.toml", "again.toml"))
    rig.write_text(TEXT, encoding="utf-8")
    assert called(capsys, "campaign", "rig", lake, rig, "--output", better)[0] == 0
    code, said, _ = called(capsys, "campaign", "rig", lake, better, "--output", again)
    assert code == 0
    assert "is not written" in said
    assert not again.exists()


def test_a_rig_that_no_test_is_of_is_refused(lake: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    rig = tmp_path / "other.toml"
    rig.write_text(re.sub(r"(?m)^name = .*$", 'name = "another"', TEXT, count=1), encoding="utf-8")
    assert load_rig(rig).name == "another"
    code, _, said = called(capsys, "campaign", "rig", lake, rig, "--output", tmp_path / "out.toml")
    assert code == 2
    assert "no test of the lake" in said


def test_exit_code_1_where_a_sensor_is_to_be_calibrated_and_a_chart_of_it() -> None:
    found = assess_records(drawn(Plan(rigs=1), 3, drift=4.0, culprit="S07").records)
    assert found.action
    part = section(found)
    assert part.rows[0][0].startswith("S07")
    assert part.rows[0][-1] == "recalibrate"
    assert [chart.key for chart in part.charts] == ["sensor-strip", "sensor-0"]
    assert "S07" in part.charts[1].title


def test_names_of_sensors_are_hostile_input() -> None:
    campaign = drawn(Plan(rigs=1, tests=60), 3, drift=6.0, culprit="S07").records
    rename = {r.sensor: f"{HOSTILE}{r.sensor}" for record in campaign.records for r in record.rows}
    for i, record in enumerate(campaign.records):
        rows = tuple(_renamed(row, rename[row.sensor]) for row in record.rows)
        campaign.records[i] = _with_rows(record, rows)
    page = render(
        Index(EDITION, (), {}, (), (), ()), "x", said={}, titles={}, sections=[section(assess_records(campaign))]
    )
    assert HOSTILE not in page
    assert "&lt;script&gt;alert(1)" in page


def _renamed(row: Any, name: str) -> Any:
    from dataclasses import replace

    return replace(row, sensor=name)


def _with_rows(record: Any, rows: Any) -> Any:
    from dataclasses import replace

    return replace(record, rows=rows)


@pytest.fixture(scope="module")
def campaign() -> Any:
    """75 real audits of 45 sensors in five rigs, one of which gains 2 %."""
    import sys

    sys.path.insert(0, str(BENCHMARKS))
    try:
        health = import_module("health")
        return health, list(health.entries(75, 5, 0.02))
    finally:
        sys.path.remove(str(BENCHMARKS))


@pytest.mark.slow
def test_a_drift_is_found_in_real_audits_by_its_serial_number(campaign: Any) -> None:
    health, entries = campaign
    found = assess(entries)
    (member,) = [m for m in (*found.sensors, *found.seats) if m.deviations]
    (change,) = member.deviations
    assert (member.name, str(member.state), change.parameter) == (health.planted(5), "recalibrate", "gain")
    assert abs(change.value - 0.02) < 1.5 * change.U < 0.015


@pytest.mark.slow
def test_the_improved_rig_fits_tests_that_it_has_not_seen(campaign: Any, tmp_path: Path) -> None:
    """Fit with the calibration at its word, no errors left open: cost per degree of freedom before and after."""
    from dataclasses import replace

    from nineaudit.array import frozen
    from nineaudit.calibrating.rig_text import calibrated
    from nineaudit.campaign.health.rig_file import improved
    from nineaudit.case import Case

    health, entries = campaign
    found = assess(entries)
    for which in range(health.RIGS):
        old = health.rig_of(which, tuple(health.seated(which, 74, 75, 2)))
        new = replace(parse_rig(calibrated(old, improved(found, old)[0], [], tmp_path / "r.toml")), name=old.name)
        ratio = np.array([n.scale / o.scale for n, o in zip(new.array.sensors, old.array.sensors, strict=True)])
        fresh = health.simulated(70 + which, 75, 5, 0.02, 2, again=1)
        cost = []
        for rig, readings in ((old, fresh.readings), (new, fresh.readings / ratio)):
            data = Case(replace(fresh, rig=rig, readings=frozen(readings))).fit_data
            cost.append(healthy_fit(replace(data, prior_sd=0.0 * data.prior_sd)).statistic)
        assert cost[1] < cost[0], (which, cost)
