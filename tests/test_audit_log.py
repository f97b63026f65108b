"""The log: every change to it shows, and two processes may write to it at once."""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Callable
from datetime import UTC, datetime
from pathlib import Path

import pytest

from nineaudit import audit_log
from nineaudit.errors import ConfigurationError

NOW = datetime(2026, 3, 1, 12, tzinfo=UTC)


@pytest.fixture
def log(tmp_path: Path) -> Path:
    """Six lines, in two goes."""
    path = tmp_path / "audit.jsonl"
    audit_log.append(path, [{"recording": f"T{i}.csv", "verdict": "pass"} for i in range(4)], NOW)
    audit_log.append(path, [{"recording": f"Ü{i}.csv", "verdict": "fail"} for i in range(2)], NOW)
    return path


def test_each_line_holds_the_hash_of_the_one_before(log: Path) -> None:
    import hashlib

    lines = log.read_bytes().splitlines()
    found = [json.loads(line) for line in lines]
    assert [entry["line"] for entry in found] == [1, 2, 3, 4, 5, 6]
    assert found[0]["previous"] == "0" * 64
    assert [e["previous"] for e in found[1:]] == [hashlib.sha256(line).hexdigest() for line in lines[:-1]]
    assert {e["utc"] for e in found} == {"2026-03-01T12:00:00+00:00"}
    assert audit_log.broken(log) == []
    assert audit_log.entries(log) == found


def lines_of(change: Callable[[list[bytes]], list[bytes]]) -> Callable[[bytes], bytes]:
    return lambda data: b"".join(line + b"\n" for line in change(data.splitlines()))


@pytest.mark.parametrize(
    ("change", "line"),
    [
        (lambda data: data.replace(b"T1.csv", b"T9.csv"), 2),
        (lambda data: data.replace(b'"\\u00dc1.csv","verdict":"fail"', b'"\\u00dc1.csv","verdict":"pass"'), 6),
        (lines_of(lambda lines: lines[:2] + lines[3:]), 2),
        (lines_of(lambda lines: lines[1:]), 1),
        (lines_of(lambda lines: lines[:5]), 0),
        (lines_of(lambda lines: lines[:0]), 0),
        (lines_of(lambda lines: [*lines[:3], lines[4], lines[3], lines[5]]), 3),
        (lines_of(lambda lines: [*lines[:3], lines[2], *lines[3:]]), 3),
        (lines_of(lambda lines: [*lines[:3], b"{}", *lines[3:]]), 4),
        (lambda data: data[:-1], 6),
        (lambda data: data[:-9], 6),
        (lambda data: data.replace(b",", b", ", 1), 1),
    ],
    ids=["word", "last", "out", "first", "end", "all", "order", "twice", "in", "line end", "cut", "space"],
)
def test_every_change_shows_at_its_line(log: Path, change: Callable[[bytes], bytes], line: int) -> None:
    before = log.read_bytes()
    log.write_bytes(change(before))
    assert log.read_bytes() != before
    assert line in [place.line for place in audit_log.broken(log)]


@pytest.mark.parametrize("bit", range(0, 1200, 97))
def test_any_bit(log: Path, bit: int) -> None:
    data = bytearray(log.read_bytes())
    data[bit * 7 % len(data)] ^= 1 << bit % 7
    log.write_bytes(bytes(data))
    assert audit_log.broken(log)


def test_a_log_that_was_cut_gets_no_new_line(log: Path) -> None:
    log.write_bytes(b"".join(line + b"\n" for line in log.read_bytes().splitlines()[:4]))
    before = log.read_bytes()
    with pytest.raises(ConfigurationError, match=r"lines 5 to 6 are missing at the end.*nineaudit verify") as caught:
        audit_log.append(log, [{"verdict": "pass"}], NOW)
    assert caught.value.exit_code == 2
    assert log.read_bytes() == before
    with pytest.raises(ConfigurationError):
        audit_log.require_whole(log)


def test_without_its_head_a_log_gets_no_new_line(log: Path) -> None:
    audit_log.head_of(log).unlink()
    with pytest.raises(ConfigurationError, match="head is not there"):
        audit_log.append(log, [{"verdict": "pass"}], NOW)


def test_a_head_that_is_a_line_behind_is_caught_up(log: Path) -> None:
    """The power failed between the line and the head."""
    old = audit_log.head_of(log).read_text()
    audit_log.append(log, [{"verdict": "pass"}], NOW)
    audit_log.head_of(log).write_text(old)
    assert audit_log.broken(log) == []
    audit_log.append(log, [{"verdict": "pass"}], NOW)
    assert len(audit_log.entries(log)) == 8
    assert audit_log.head_of(log).read_text().startswith("8 ")


def test_four_processes_at_once(tmp_path: Path) -> None:
    log = tmp_path / "audit.jsonl"
    code = (
        "import sys; from pathlib import Path; from nineaudit.audit_log import append\n"
        "for i in range(20): append(Path(sys.argv[1]), [{'by': sys.argv[2], 'i': i}])"
    )
    writers = [subprocess.Popen([sys.executable, "-c", code, str(log), str(k)]) for k in range(4)]
    assert [writer.wait(120) for writer in writers] == [0, 0, 0, 0]
    assert audit_log.broken(log) == []
    found = audit_log.entries(log)
    assert sorted((e["by"], e["i"]) for e in found) == sorted((str(k), i) for k in range(4) for i in range(20))
    assert [path.name for path in sorted(tmp_path.iterdir())] == ["audit.jsonl", "audit.jsonl.head"]


def test_a_place_that_cannot_be_written_to(tmp_path: Path) -> None:
    with pytest.raises(ConfigurationError, match="cannot be written"):
        audit_log.append(tmp_path / "none" / "audit.jsonl", [{"verdict": "pass"}], NOW)
