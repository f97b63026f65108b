"""One is counted as one: in answers, in errors, on the page."""

from __future__ import annotations

from datetime import UTC, datetime
from pathlib import Path

import numpy as np
import pytest

from nineaudit import audit_log, verify
from nineaudit.calibrating.sheet import read_sheet
from nineaudit.checking import tally
from nineaudit.commands import rig_lines
from nineaudit.errors import EstimationError, RecordingError
from nineaudit.physics import filters
from nineaudit.rig import parse_rig, preset_text


def test_a_log_of_one_line(tmp_path: Path) -> None:
    log = tmp_path / "audit.jsonl"
    audit_log.append(log, [{"recording": "T1.csv"}], datetime(2026, 3, 1, tzinfo=UTC))
    assert [answer.said for answer in verify.verify([log])] == ["1 line, each with the hash of the one before"]
    audit_log.append(log, [{"recording": "T2.csv"}], datetime(2026, 3, 1, tzinfo=UTC))
    assert [answer.said for answer in verify.verify([log])] == ["2 lines, each with the hash of the one before"]


def test_a_campaign_of_one_recording() -> None:
    assert tally({"pass": 1}) == "1 recording: 1 pass"
    assert tally({"pass": 1, "fail": 1}).startswith("2 recordings: ")


def test_a_rig_with_one_rate_sensor() -> None:
    text = (
        preset_text("naap-3222")
        + '\n[[sensor]]\nchannel = "wx"\nkind = "gyroscope"\naxis = [1.0, 0.0, 0.0]\nrange = 50.0\n'
    )
    assert "9 accelerometers, 1 rate sensor, filter class" in rig_lines(parse_rig(text))[0]


def test_a_signal_of_one_sample() -> None:
    with pytest.raises(EstimationError, match="found '1 sample, 0 of them not finite"):
        filters.cfc(np.zeros(1), 1e4, 1000.0)


def test_a_table_of_calibration_of_one_line(tmp_path: Path) -> None:
    (tmp_path / "runs.csv").write_text("run,rate\n", encoding="utf-8")
    with pytest.raises(RecordingError, match="found '1 line'"):
        read_sheet(tmp_path / "runs.csv")
