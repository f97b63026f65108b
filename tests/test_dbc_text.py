"""DBC files that are cut: wherever they end, other than right behind a statement, it is said."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from nineaudit.can_database import read_databases
from nineaudit.dbc_text import faults

WHOLE = """VERSION "made by hand"

NS_ :
	CM_
	BA_DEF_
	SIG_VALTYPE_

BS_:
BU_: ECU LOGGER
BO_ 16 IMU: 8 ECU
 SG_ A m1 : 0|16@1- (0.01,0) [-100|100] "m/s^2; really" LOGGER,ECU
 SG_ PAGE M : 16|4@1+ (1,0) [0|15] "" Vector__XXX

BO_ 2566834709 TIME: 8 ECU
 SG_ T : 7|32@0- (1E-06,-1.5) [0|0] "s" LOGGER
BO_ 17 EMPTY: 0 ECU
CM_ "a text; of \\"several\\"
BO_ 99 lines";
CM_ BO_ 16 "first";
CM_ SG_ 2566834709 T "of // start";
CM_ BU_ ECU "the sensor";
BA_DEF_ BO_ "GenMsgCycleTime" INT 0 65535;
BA_DEF_ "BusType" STRING;
BA_DEF_DEF_ "GenMsgCycleTime" 0;
BA_DEF_DEF_ "BusType" "";
BA_ "GenMsgCycleTime" BO_ 16 10;
BA_ "BusType" "CAN";
VAL_ 16 A -32768 "SNA" 1 "one; more" ;
SIG_VALTYPE_ 2566834709 T : 1;
"""
STATEMENTS = [m.start() for m in re.finditer(r"^ *(BO_ \d+ \w+:|SG_|CM_ |BA_|VAL_|SIG_VALTYPE_ )", WHOLE, re.M)]


def complete(end: int) -> bool:
    """Whether what is before `end` is whole statements, and blanks."""
    start = max(at for at in STATEMENTS if at < end)
    after = next((at for at in STATEMENTS if at > start), len(WHOLE))
    statement = WHOLE[start:after].rstrip()
    return end >= start + len(statement) + (not statement.endswith(";")) or not WHOLE[start:end].strip()


def test_a_whole_file_has_no_faults() -> None:
    assert faults(WHOLE) == faults(WHOLE.replace("\n", "\r\n")) == faults(WHOLE.rstrip()) == faults("") == ()


def test_real_databases_have_no_faults(shared_data: Path) -> None:
    for name in ("rav4-can/toyota_2017.dbc", "canmod-imu/canmod-gps.dbc"):
        assert faults((shared_data / name).read_text("cp1252")) == ()


@settings(derandomize=True, max_examples=300, deadline=None)
@given(st.integers(WHOLE.index("BO_ 16") + 8, len(WHOLE) - 2))
def test_wherever_a_file_ends_but_behind_a_statement_it_is_said(end: int) -> None:
    found = faults(WHOLE[:end])
    if complete(end):
        assert not any("ends inside" in f.what for f in found)
    else:
        assert len(found) == 1
        assert "ends inside a statement" in found[0].what
        assert found[0].line <= WHOLE[:end].count("\n") + 1


@pytest.mark.parametrize(
    ("text", "says", "line", "count"),
    [
        (WHOLE[: WHOLE.index(" SG_ T")], "behind the head of a message", 14, 1),
        (WHOLE.replace("BO_ 16 IMU: 8 ECU\n", "").replace(' SG_ A m1 : 0|16@1- (0.01,0) [-100|100] "m/s^2; really" '
         "LOGGER,ECU\n", ""), "message 16 that is not in it", 17, 3),
        (WHOLE.replace(" SG_ T ", " SG_ U "), "message 2566834709, signal T, that is not in it", 20, 2),
    ],
)  # fmt: skip
def test_what_is_missing_inside(text: str, says: str, line: int, count: int) -> None:
    (found,) = faults(text)
    assert says in found.what
    assert (found.line, found.count) == (line, count)


def test_databases_are_named_with_their_hash(tmp_path: Path) -> None:
    path = tmp_path / "a.dbc"
    path.write_bytes(WHOLE.encode("cp1252"))
    found = read_databases([path])
    assert found.notes[0].startswith("CAN database a.dbc: 3 messages, 3 signals, SHA-256 ")
    assert found.faults == ()
