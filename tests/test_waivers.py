"""Waivers as a user meets them: through the command line, in the exit code, and in every output."""

from __future__ import annotations

import datetime as dt
import json
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from nineaudit import cli

TODAY = dt.date.today()
DAY = dt.timedelta(days=1)
RULES = "RB301,RB302,RB303,RQ202,WV001"
WAIVER = {
    "recordings": "T*.csv",
    "reason": "overload <known> since the sled test",
    "approved_by": "A. Engineer",
    "approved_on": TODAY - 30 * DAY,
    "expires": TODAY + 30 * DAY,
}
Check = Callable[..., dict[str, Any]]


def waiver(rule: str, **changes: Any) -> str:
    """One ``[[waiver]]`` of a file; a value of None leaves the key out."""
    keys = {"rule": rule, **WAIVER, **changes}
    lines = [f"{k} = {v if isinstance(v, dt.date) else json.dumps(v)}\n" for k, v in keys.items() if v is not None]
    return "[[waiver]]\n" + "".join(lines)


CLIPPED_TOO = "".join(waiver(rule) for rule in ("RB301", "RB302", "RB303"))
"""What else is violated when a1y clips."""


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A rig file, a recording with one clipped channel (T0001.csv) and a healthy one (healthy.csv)."""
    from nineaudit.commands import simulated
    from nineaudit.rig import load_rig, preset_text
    from nineaudit.writers import write_recording

    folder = tmp_path_factory.mktemp("waivers")
    (folder / "rig.toml").write_text(preset_text("naap-3222"), encoding="utf-8")
    rig = load_rig(folder / "rig.toml")
    write_recording(simulated(rig, "general", ("a1y:clipping=0.5",)), folder / "T0001.csv")
    write_recording(simulated(rig, "general", ()), folder / "healthy.csv")
    return folder


@pytest.fixture
def check(folder: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Check:
    """Checks recordings with the waivers of a text; what came of it, by name."""
    monkeypatch.chdir(folder)

    def call(text: str, *more: str, recordings: tuple[str, ...] = ("T0001.csv",)) -> dict[str, Any]:
        Path("w.toml").write_text(text, encoding="utf-8")
        outputs = ("--html", "out/", "--json", "out/", "--junit", "out/all.xml", "--summary", "out/all.md")
        with pytest.raises(SystemExit) as ended:
            cli.main(
                ["check", *recordings, "--rig", "rig.toml", "--waivers", "w.toml", "--select", RULES, *outputs, *more]
            )
        shown = capsys.readouterr()
        said = {"code": ended.value.code or 0, "text": shown.out, "stderr": shown.err}
        if said["code"] < 2:
            documents = [json.loads(Path(f"out/{Path(r).stem}.json").read_text(encoding="utf-8")) for r in recordings]
            said |= {"documents": documents, "findings": documents[0]["findings"]}
            said |= {kind: Path(f"out/all.{kind}").read_text(encoding="utf-8") for kind in ("xml", "md")}
            said["html"] = Path(f"out/{Path(recordings[0]).stem}.html").read_text(encoding="utf-8")
        return said

    return call


def verdicts(findings: list[dict[str, Any]], rule: str) -> set[str]:
    return {f["verdict"] for f in findings if f["rule"] == rule}


def test_a_waived_finding_passes_the_gate_and_stays_visible_in_every_output(check: Check) -> None:
    done = check(CLIPPED_TOO + waiver("RQ202", channels=["a1y"], max_value=600))
    assert done["code"] == 0
    assert done["documents"][0]["verdict"] == "pass"
    (found,) = [f for f in done["findings"] if f["verdict"] == "waived" and f["rule"] == "RQ202"]
    assert (found["value"], found["limit"], found["channels"]) == (570.0, 0.0, ["a1y"])
    said = f"waived by A. Engineer on {WAIVER['approved_on']} until {WAIVER['expires']}: {WAIVER['reason']}"
    assert found["reason"].endswith(said)
    assert f"T0001.csv: waived RQ202 a1y 0.0344 s: {found['reason'].split(';')[0]}" in done["text"]
    assert "a1y is at fault: clipping" in done["text"]
    escaped = said.replace("<", "&lt;").replace(">", "&gt;")
    assert escaped in done["html"]
    assert "<known>" not in done["html"]
    assert escaped in done["xml"]
    assert re.findall(r'name="(R\w) .*?">\s*<(\w+)', done["xml"]) == [("RB", "skipped"), ("RQ", "skipped")]
    assert verdicts(done["findings"], "WV001") == {"pass"}


def test_a_waiver_above_its_ceiling_fails(check: Check) -> None:
    done = check(CLIPPED_TOO + waiver("RQ202", max_value=569.5))
    assert done["code"] == 1
    assert "error RQ202 a1y" in done["text"]
    assert "ends at 569.5, the value is 570 samples" in done["text"]
    assert verdicts(done["findings"], "WV001") == {"warn"}
    assert "waived by" not in next(f["reason"] for f in done["findings"] if f["rule"] == "RQ202")
    assert '<failure message="error RQ202' in done["xml"]


def test_a_ceiling_is_in_the_unit_of_the_report(check: Check) -> None:
    """RB302: 11.1 g in the rig's g_0, which is 109 m/s²."""
    rest = "".join(waiver(rule) for rule in ("RQ202", "RB301", "RB303"))
    assert check(rest + waiver("RB302", max_value=11.5))["code"] == 0
    assert check(rest + waiver("RB302", max_value=10.5))["code"] == 1


@pytest.mark.parametrize(
    ("dates", "said"),
    [
        ({"expires": TODAY - DAY}, f"expired on {TODAY - DAY}"),
        ({"approved_on": TODAY + 2 * DAY}, f"is approved on {TODAY + 2 * DAY}, which is yet to come"),
    ],
)
def test_a_waiver_out_of_its_time_waives_nothing_and_is_a_finding(check: Check, dates: Any, said: str) -> None:
    done = check(CLIPPED_TOO + waiver("RQ202", **dates))
    assert done["code"] == 1
    assert f"warning WV001: waiver of RQ202 for T*.csv by A. Engineer {said}" in done["text"]
    assert said in done["html"]
    assert said in done["md"]
    assert verdicts(done["findings"], "RQ202") >= {"fail"}


def test_a_waiver_of_today_only_holds_today(check: Check) -> None:
    assert check(CLIPPED_TOO + waiver("RQ202", approved_on=TODAY, expires=TODAY))["code"] == 0


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"channels": ["a2x"]}, "waiver of RQ202 a2x for T*.csv by A. Engineer has no finding to waive"),
        ({"recordings": "U*.csv"}, "waiver of RQ202 for U*.csv by A. Engineer matches no recording of this run"),
    ],
)
def test_an_unmatched_waiver_is_a_finding(check: Check, changes: Any, said: str) -> None:
    done = check(waiver("RQ202", **changes), "--fail-on", "never")
    assert said in done["text"]
    assert verdicts(done["findings"], "WV001") == {"warn"}
    assert check(waiver("RQ202", **changes), "--select", "WV001", "--fail-on", "warning")["code"] == 1


def test_a_waiver_for_another_recording_of_the_run_is_silent(check: Check) -> None:
    done = check(waiver("RQ202"), "--fail-on", "never", recordings=("healthy.csv", "T0001.csv"))
    first, second = done["documents"]
    assert verdicts(first["findings"], "WV001") == {"not_applicable"}
    assert verdicts(second["findings"], "WV001") == {"pass"}


def test_a_lost_waiver_is_said_once_a_run(check: Check) -> None:
    done = check(waiver("RQ202", recordings="U*"), "--fail-on", "never", recordings=("healthy.csv", "T0001.csv"))
    assert done["text"].count("matches no recording") == 1


def test_a_waiver_cannot_be_waived(check: Check) -> None:
    done = check(waiver("RQ202", channels=["a2x"]) + waiver("WV001"), "--fail-on", "warning")
    assert done["code"] == 1
    assert done["text"].count("has no finding to waive") == 2


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (waiver("RQ202", approved_by=None), "w.toml: [[waiver]] 1 approved_by: missing key"),
        (waiver("RQ202", approved_by=""), "[[waiver]] 1 approved_by: wrong type; found ''"),
        (waiver("RQ202", reason=None), "reason: missing key"),
        (waiver("RQ202", expires=None), "expires: missing key"),
        (waiver("RQ202", expires="soon"), "expires: wrong type; found 'soon'; expected a date such as"),
        (waiver("RQ202", max_value="low"), "max_value: wrong type"),
        (waiver("RQ202", channels=[]), "channels: wrong type; found []; expected a list of texts"),
        (waiver("RQ202", chanels=["a1y"]), "unknown key; found 'chanels'; did you mean 'channels'?"),
        (waiver("RQ2O2"), "rule: no such rule; found 'RQ2O2'; did you mean 'RQ202'?"),
        (waiver("RQ202") + waiver("RQ202", expires=TODAY - 99 * DAY), "[[waiver]] 2 expires: ends before it begins"),
    ],
)
def test_a_wrong_waiver_file_is_one_sentence(check: Check, text: str, said: str) -> None:
    done = check(text)
    assert done["code"] == 2
    assert said in done["stderr"]
    assert done["stderr"].count("\n") == 1
