"""Text CAN logs: python-can as the oracle, lines by hand, logs that are damaged."""

# ruff: noqa: E501  (lines of logs stand as they are)

from __future__ import annotations

import tracemalloc
from collections.abc import Callable
from pathlib import Path
from typing import Any

import can
import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from nineaudit.can_database import EXTENDED
from nineaudit.errors import RecordingError
from nineaudit.readers.can import text_log
from nineaudit.readers.can.asc import read_asc
from nineaudit.readers.can.by_python_can import read_by_python_can
from nineaudit.readers.can.candump import read_candump
from nineaudit.readers.can.frames import ERROR, ERROR_STATE, FD, OVERLOAD, RATE_SWITCH, REMOTE, SENT, Frames

SIZES = (*range(9), 12, 16, 20, 24, 32, 48, 64)
LAWS = settings(
    max_examples=15,
    deadline=None,
    derandomize=True,
    database=None,
    suppress_health_check=[HealthCheck.function_scoped_fixture],
)
Row = tuple[int, int, str, int, int, bytes]
"""(ns, key, bus, kind, length, data)"""


def rows_of(log: Frames) -> list[Row]:
    """Frames as tuples; the bytes are taken as the decoder takes them, from `payload`."""
    everything = log.payload(np.arange(len(log)))
    found = []
    for i in range(len(log)):
        length = int(log.length[i])
        data = everything[i].tobytes()
        there = data[: 0 if log.kind[i] & (REMOTE | ERROR) else length]
        assert not any(data[length:])
        assert log.data[i].tobytes() == data[:8]
        found.append((int(log.time[i]), int(log.key[i]), log.buses[log.bus[i]], int(log.kind[i]), length, there))
    return found


def row_of(message: can.Message, *, time: float | None = None, bus: str | None = None, way: bool = True) -> Row:
    """What python-can's message is as a row."""
    error, remote = message.is_error_frame, message.is_remote_frame
    kind = (ERROR if error else 0) | (REMOTE if remote else 0) | (FD if message.is_fd else 0)
    kind |= (RATE_SWITCH if message.bitrate_switch else 0) | (ERROR_STATE if message.error_state_indicator else 0)
    kind |= SENT if way and not message.is_rx and not error else 0
    key = message.arbitration_id | (EXTENDED if message.is_extended_id else 0)
    stamp = round((message.timestamp if time is None else time) * 1e6) * 1000
    name = str(message.channel) if bus is None else bus
    length = min(message.dlc, 8) if remote else len(message.data)
    return stamp, 0 if error else key, name, kind, length, b"" if error or remote else bytes(message.data)


@st.composite
def messages(draw: Any, *, flexible: bool = True, bare: bool = True) -> can.Message:
    """A random frame; `flexible`: perhaps CAN FD; `bare`: perhaps a remote or an error frame."""
    kinds = ["data", "data"] + ["fd"] * flexible + ["remote", "error"] * bare
    kind, extended = draw(st.sampled_from(kinds)), draw(st.booleans())
    size = draw(st.sampled_from(SIZES if kind == "fd" else SIZES[:9]))
    return can.Message(
        arbitration_id=draw(st.integers(0, 0x1FFFFFFF if extended else 0x7FF)),
        is_extended_id=extended,
        is_remote_frame=kind == "remote",
        is_error_frame=kind == "error",
        is_fd=kind == "fd",
        bitrate_switch=kind == "fd" and draw(st.booleans()),
        error_state_indicator=kind == "fd" and draw(st.booleans()),
        is_rx=draw(st.booleans()),
        channel=draw(st.integers(0, 2)),
        dlc=size if kind != "error" else 0,
        data=draw(st.binary(min_size=size, max_size=size)) if kind in ("data", "fd") else None,
    )


def written(path: Path, writer: Any, log: list[can.Message], start: float = 1_700_000_000.0) -> list[can.Message]:
    for i, message in enumerate(log):
        message.timestamp = start + 1e-4 * i
    path.unlink(missing_ok=True)
    with writer(str(path)) as out:
        for message in log:
            out.on_message_received(message)
    with can.LogReader(str(path)) as reader:
        return list(reader)


@LAWS
@given(log=st.lists(messages(), min_size=1, max_size=60))
def test_candump_against_python_can(tmp_path: Path, log: list[can.Message]) -> None:
    path = tmp_path / "t.log"
    expected = [
        row_of(m, bus="can" + str(log[i].channel)) for i, m in enumerate(written(path, can.CanutilsLogWriter, log))
    ]
    found = read_candump(path)
    assert rows_of(found) == expected
    assert (found.damage, found.notes, found.counts) == ((), (), {})


@LAWS
@given(log=st.lists(messages(), min_size=1, max_size=60))
def test_asc_against_python_can(tmp_path: Path, log: list[can.Message]) -> None:
    """Where they differ python-can is wrong: it takes an FD frame without bytes for a remote frame."""
    path = tmp_path / "t.asc"
    read = written(path, can.ASCWriter, log)
    for message, original in zip(read, log, strict=True):
        if original.is_fd and not original.data:
            assert message.is_remote_frame
            message.is_remote_frame = False
        if original.is_error_frame:
            message.channel = original.channel
    expected = [row_of(m, bus=str(int(m.channel) + 1)) for m in read]
    found = read_asc(path)
    assert rows_of(found) == expected
    assert found.damage == ()
    assert found.counts == {"header_lines": 5, "event_lines": 1}


@LAWS
@given(log=st.lists(messages(flexible=False, bare=False), min_size=1, max_size=40))
def test_trc_against_python_can(tmp_path: Path, log: list[can.Message]) -> None:
    path = tmp_path / "t.trc"
    read = written(path, can.TRCWriter, log)
    found = read_by_python_can(path)
    assert rows_of(found) == [row_of(m, time=i * 1e-4) for i, m in enumerate(read)]
    assert found.damage == ()
    assert any("2023-11-14 22:13:20" in note for note in found.notes)


@pytest.mark.parametrize(("suffix", "writer"), [(".csv", can.CSVWriter), (".db", can.SqliteWriter)])
def test_python_cans_own_formats(tmp_path: Path, suffix: str, writer: Any) -> None:
    rng = np.random.default_rng(3)
    log = []
    for i in range(50):
        size, extended = int(rng.choice(SIZES)), i % 3 == 0
        identifier = int(rng.integers(0, 0x1FFFFFFF if extended else 0x7FF))
        data = rng.integers(0, 256, size, dtype=np.uint8).tobytes()
        log.append(can.Message(arbitration_id=identifier, is_extended_id=extended, is_fd=size > 8, data=data))
    path = tmp_path / f"t{suffix}"
    read = written(path, writer, log)
    before = path.read_bytes()
    found = read_by_python_can(path)
    assert path.read_bytes() == before
    for message in read:
        message.is_fd = message.dlc > 8
    assert [row[1:] for row in rows_of(found)] == [row_of(m, bus="")[1:] for m in read]
    np.testing.assert_allclose(found.time, [m.timestamp * 1e9 for m in read], rtol=0, atol=300)
    assert found.damage == ()


def test_a_database_with_a_journal_or_bad_rows_is_damage(tmp_path: Path) -> None:
    import sqlite3

    path = tmp_path / "t.db"
    log = [can.Message(arbitration_id=i, is_extended_id=False, data=[i]) for i in range(3)]
    written(path, can.SqliteWriter, log)
    with sqlite3.connect(path) as base:
        base.execute("INSERT INTO messages VALUES (1.0, 'x', 0, 0, 0, 1, x'11')")
        base.execute("INSERT INTO messages VALUES (1.0, 5, 0, 0, 0, 3, x'11')")
        base.execute("INSERT INTO messages VALUES (1e300, 5, 0, 0, 0, 1, x'11')")
    base.close()
    (tmp_path / "t.db-wal").write_bytes(b"not merged")
    found = read_by_python_can(path)
    assert [row[5] for row in rows_of(found)] == [b"\0", b"\1", b"\2"]
    assert [(d.place, d.count) for d in found.damage] == [("row 1", 1), ("row 4", 2), ("row 5", 1)]
    (tmp_path / "t.db-wal").unlink()
    path.write_bytes(path.read_bytes()[:4096])
    with pytest.raises(RecordingError, match=r"row 1: no CAN frames.*cannot be read any further"):
        read_by_python_can(path)


def test_a_real_log_against_python_can(shared_data: Path) -> None:
    path = shared_data / "rav4-can" / "drive-10s.log"
    with can.LogReader(path) as reader:
        expected = [row_of(m) for m in reader]
    found = read_candump(path)
    assert rows_of(found) == expected
    assert (len(found), found.damage, found.counts) == (8977, (), {})


# --- lines by hand ------------------------------------------------------------------------------------------------


def candump(tmp_path: Path, *lines: str) -> Frames:
    return read_candump(put(tmp_path / "t.log", *lines))


def asc(tmp_path: Path, *lines: str, base: str = "base hex  timestamps absolute") -> Frames:
    return read_asc(put(tmp_path / "t.asc", *([base] if base else []), *lines))


def put(path: Path, *lines: str) -> Path:
    path.write_bytes("".join(f"{line}\n" for line in lines).encode("cp1252"))
    return path


BYTES = bytes.fromhex("1122334455667788")
SIXTY_FOUR = bytes(range(64))


@pytest.mark.parametrize(
    ("line", "row"),
    [
        ("(1.5) can0 123#1122", (1_500_000_000, 0x123, "can0", 0, 2, b"\x11\x22")),
        ("(1436509052.249713) vcan0 044#2a366C2BBA", (1436509052249713000, 0x44, "vcan0", 0, 5, b"\x2a\x36\x6c\x2b\xba")),
        ("(1.123456789) can0 00000123#", (1_123_456_789, EXTENDED | 0x123, "can0", 0, 0, b"")),
        ("(0.1234567891) can0 123#", (123_456_789, 0x123, "can0", 0, 0, b"")),
        ("(1,5) can0 123#11\r", (1_500_000_000, 0x123, "can0", 0, 1, b"\x11")),
        ("(1.5) can0 123#11 T", (1_500_000_000, 0x123, "can0", SENT, 1, b"\x11")),
        ("(1.5) can0 123#R8", (1_500_000_000, 0x123, "can0", REMOTE, 8, b"")),
        ("(1.5) can0 123#R R", (1_500_000_000, 0x123, "can0", REMOTE, 0, b"")),
        ("(1.5) can0 123#R8_E T", (1_500_000_000, 0x123, "can0", REMOTE | SENT, 8, b"")),
        ("(1.5) can0 123#1122334455667788_9", (1_500_000_000, 0x123, "can0", 0, 8, BYTES)),
        ("(1.5) can0 123##5" + SIXTY_FOUR.hex(), (1_500_000_000, 0x123, "can0", FD | RATE_SWITCH, 64, SIXTY_FOUR)),
        ("(1.5) can0 123##2" + SIXTY_FOUR[:12].hex(), (1_500_000_000, 0x123, "can0", FD | ERROR_STATE, 12, SIXTY_FOUR[:12])),
        ("(1.5) can0 123##0 R", (1_500_000_000, 0x123, "can0", FD, 0, b"")),
        ("(1.5) can0 20000080#0000000000000000", (1_500_000_000, 0, "can0", ERROR, 8, b"")),
        ("(1.5) can0 20000004#0004000000000000", (1_500_000_000, 0, "can0", ERROR, 8, b"")),
        (" (1.5)  can0  123   [2]  11 22", (1_500_000_000, 0x123, "can0", 0, 2, b"\x11\x22")),
        (" (1.5)  can0  123   [2]  11 22   '.\"'", (1_500_000_000, 0x123, "can0", 0, 2, b"\x11\x22")),
        (" (1.5)  can0  TX B E  12345678  [08]  11 22 33 44 55 66 77 88",
         (1_500_000_000, EXTENDED | 0x12345678, "can0", FD | SENT | RATE_SWITCH | ERROR_STATE, 8, BYTES)),
        (" (1.5)  can0  RX - -  123   [0]", (1_500_000_000, 0x123, "can0", 0, 0, b"")),
        (" (1.5)  can0  123   [8]  remote request", (1_500_000_000, 0x123, "can0", REMOTE, 8, b"")),
        (" (1.5)  can0  20000004   [8]  00 04 00 00 00 00 00 00   ERRORFRAME", (1_500_000_000, 0, "can0", ERROR, 8, b"")),
    ],
)  # fmt: skip
def test_lines_of_candump(tmp_path: Path, line: str, row: Row) -> None:
    found = candump(tmp_path, line)
    assert rows_of(found) == [row]
    assert found.damage == ()
    assert bool(found.notes) == ("[" in line)


@pytest.mark.parametrize(
    "line",
    [
        "(1.5) can0 123#112", "(1.5) can0 123#112233445566778899", "(1.5) can0 800#11", "(1.5) can0 1234#11",
        "(1.5) can0 40000000#11", "(1.5) can0 123##0112233445566778899", "(1.5) can0 123#11_9", "(1.5) can0 123#R9",
        "(1.5) can0 123#1G", "(1.5) can0 123#11 X", "(1.x) can0 123#11", "(9999999999.5) can0 123#11", "1.5 can0 123#11",
        "(1.5) can0 123", "(1.5) " + "c" * 17 + " 123#11", "(1.5)  can0  123   [3]  11 22", "(1.5)  can0  123   [1]  11 22",
        "(1.5)  can0  123   [9]  11 22 33 44 55 66 77 88 99", "\0" * 300, "(1.5) can0 123#11\0",
        "(1.5) can0 123#" + "11" * 600_000,
    ],
    ids=lambda line: repr(line[:30]),
)  # fmt: skip
def test_lines_that_are_no_frames_of_candump(tmp_path: Path, line: str) -> None:
    found = candump(tmp_path, "(1.0) can0 123#11", line, "(2.0) can0 123#22", line)
    assert found.time.tolist() == [1_000_000_000, 2_000_000_000]
    (damage,) = found.damage
    assert (damage.place, damage.count, damage.lost) == ("line 2", 2, "it is left out")
    assert len(damage.what) < 350


def test_other_lines_of_candump_are_counted(tmp_path: Path) -> None:
    found = candump(
        tmp_path,
        "# by hand",
        " (1.5)  can0  20000004   [8]  00 04 00 00 00 00 00 00   ERRORFRAME",
        "\tcontroller-problem{rx-overflow}",
        "",
        "(1.6) can0 00123#81:00:12345678#112233",
        "(1.7) can1 123#11",
    )
    assert found.counts == {"comment_lines": 1, "error_detail_lines": 1, "xl_frames": 1}
    assert (len(found), found.damage, sorted(found.buses)) == (2, (), ["can0", "can1"])


FD_TAIL = "  130000 130 {flags} 46500250 460a0250 20011736 20010205"


@pytest.mark.parametrize(
    ("line", "row"),
    [
        ("   0.015991 1  1A0             Rx   d 2 11 22", (15_991_000, 0x1A0, "1", 0, 2, b"\x11\x22")),
        ("   0,015991 1  1A0             Rx   d 2 11 22", (15_991_000, 0x1A0, "1", 0, 2, b"\x11\x22")),
        ("0.000000001 12 1A0 Tx d 0\r", (1, 0x1A0, "12", SENT, 0, b"")),
        ("0.1 1 1A0 Rx d 8 11 22 33 44 55 66 77 88  Length = 240000 BitCount = 124 ID = 416", (10**8, 0x1A0, "1", 0, 8, BYTES)),
        ("0.1 1 18FEF100x Rx d f 11 22 33 44 55 66 77 88", (10**8, EXTENDED | 0x18FEF100, "1", 0, 8, BYTES)),
        ("0.1 1  64   Rx   r", (10**8, 0x64, "1", REMOTE, 0, b"")),
        ("0.1 1  64   Tx   r 8", (10**8, 0x64, "1", REMOTE | SENT, 8, b"")),
        ("0.1 1  64   Rx   r  Length = 0 BitCount = 64 ID = 100", (10**8, 0x64, "1", REMOTE, 0, b"")),
        ("0.1 1  64x  Rx   r 2  Length = 0 BitCount = 64 ID = 100x", (10**8, EXTENDED | 0x64, "1", REMOTE, 2, b"")),
        ("2.501 1 ErrorFrame", (2_501_000_000, 0, "1", ERROR, 0, b"")),
        ("2.501 1 ErrorFrame ECC: 10100010", (2_501_000_000, 0, "1", ERROR, 0, b"")),
        ("2.501 2 ErrorFrame Flags = 0xe CodeExt = 0x20a2 Code = 0x82 ID = 0", (2_501_000_000, 0, "2", ERROR, 0, b"")),
        ("2.501 2 OverloadFrame", (2_501_000_000, 0, "2", OVERLOAD, 0, b"")),
        ("2.5 CANFD   1 Rx ErrorFrame  Not Acknowledge error, dominant error flag fffe c7 31ca Arb. 556 44",
         (2_500_000_000, 0, "1", ERROR, 0, b"")),
        ("2.5 CANFD 1 Rx 1A0  EngineData  1 0 9 12 11 22 33 44 55 66 77 88 99 AA BB CC" + FD_TAIL.format(flags="303000"),
         (2_500_000_000, 0x1A0, "1", FD | RATE_SWITCH, 12, bytes.fromhex("112233445566778899AABBCC"))),
        ("2.5 CANFD 1 Tx 1A0x    0 1 2 2 11 22" + FD_TAIL.format(flags="305000"),
         (2_500_000_000, EXTENDED | 0x1A0, "1", FD | SENT | ERROR_STATE, 2, b"\x11\x22")),
        ("2.5 CANFD 1 Rx 1A0    0 0 2 2 11 22" + FD_TAIL.format(flags="0"), (2_500_000_000, 0x1A0, "1", 0, 2, b"\x11\x22")),
        ("2.5 CANFD 1 Rx 1A0    0 0 2 2 11 22", (2_500_000_000, 0x1A0, "1", FD, 2, b"\x11\x22")),
        ("2.5 CANFD 1 Rx 1A0    0 0 8 0" + FD_TAIL.format(flags="10"), (2_500_000_000, 0x1A0, "1", REMOTE, 8, b"")),
        ("2.5 CANFD 1 Rx 1A0  N  0 0 0 0" + FD_TAIL.format(flags="1000"), (2_500_000_000, 0x1A0, "1", FD, 0, b"")),
        ("2.5 CANFD 1 Rx 1A0    0 0 f 64 " + SIXTY_FOUR.hex(" ") + FD_TAIL.format(flags="1000"),
         (2_500_000_000, 0x1A0, "1", FD, 64, SIXTY_FOUR)),
    ],
)  # fmt: skip
def test_lines_of_asc(tmp_path: Path, line: str, row: Row) -> None:
    found = asc(tmp_path, line)
    assert rows_of(found) == [row]
    assert found.damage == ()
    assert any("decimal commas" in note for note in found.notes) == ("," in line.split()[0])


@pytest.mark.parametrize(
    "line",
    [
        "0.1 1 1A0 Rx d 2 11", "0.1 1 1A0 Rx d 2 11 22 33", "0.1 1 1A0 Rx d 2 11 2", "0.1 1 1A0 Rx d 2 11 2G", "0.1 1 1A0 Rx d",
        "0.1 1 8A0 Rx d 0", "0.1 1 2000000F1x Rx d 0", "0.1 1 1A0 Qx d 0", "0.1 1 1G0 Rx d 0", "0.1 1 1A0 Rx q 0",
        "0.1x 1 1A0 Rx d 0", "9999999999.0 1 1A0 Rx d 0", "0.1 1 1A0", "0.1", "Rx d 0", "\0" * 5000,
        "0.1 CANFD 1 Rx 1A0 0 0 9 11 11 22 33 44 55 66 77 88 99 AA BB 1 1 1000",
        "0.1 CANFD 1 Rx 1A0 0 0 2 2 11 22 33", "0.1 CANFD 1 Rx 1A0 0 0 2 3 11 22 33 1 1 1000",
        "0.1 CANFD 1 Rx 1A0 0 2 2 2 11 22 1 1 1000", "0.1 CANFD 1 Rx 1A0 0 0 2 2 11 22 1 1 10Q0", "0.1 CANFE 1 Rx 1A0 0 0 0 0",
        "0.1 CANFD 1 Rx 1A0 \x02 0 0 2 2 11 22 1 1 1000", "0.1 CANFD 1 Rx 1A0 0 0 9 9 11 22 33 44 55 66 77 88 99 1 1 0",
    ],
    ids=lambda line: repr(line[:50]),
)  # fmt: skip
def test_lines_that_are_no_frames_of_asc(tmp_path: Path, line: str) -> None:
    found = asc(tmp_path, "0.1 1 1A0 Rx d 1 11", line, "0.2 1 1A0 Rx d 1 22", line)
    assert found.time.tolist() == [10**8, 2 * 10**8]
    (damage,) = found.damage
    assert (damage.place, damage.count) == ("line 3", 2)


def test_other_lines_of_asc_are_counted(tmp_path: Path) -> None:
    found = asc(
        tmp_path,
        "internal events logged",
        "// version 9.0.0",
        "//0.000000 previous log file: x.asc",
        "   0.000000 Start of measurement",
        "   0.015991 CAN 1 Status:chip status error passive - TxErr: 132 RxErr: 0",
        "   1.015991 1  Statistic: D 0 R 0 XD 0 XR 0 E 0 O 0 B 0.00%",
        "   1.100000 1  64              TxRq   d 2 11 22",
        "   1.100001 1  64              Tx   d 2 11 22",
        "   2.610006 Li 1 Rx 2 11 22",
        "   2.610007 ETH 1 Rx 2 11 22",
        "   2.610007 J1939TP FEE3p 6 0 0 - Rx d 23 A0 0F",
        "   2.610007 SV: 2 0 1 ::a = 3",
    )
    assert found.counts == {
        "header_lines": 2, "comment_lines": 2, "event_lines": 2, "status_lines": 1, "statistics_lines": 1,
        "tx_requests": 1, "lin_lines": 1, "ethernet_lines": 1, "j1939_lines": 1,
    }  # fmt: skip
    assert (len(found), found.damage) == (1, ())
    assert any("TxRq" in note for note in found.notes)


def test_decimal_identifiers_and_bytes(tmp_path: Path) -> None:
    lines = ["0.1 1 100 Rx d 3  1  17 255", "0.2 1 2048x Rx d 10 0 1 2 3 4 5 6 7", "0.3 1 2047 Rx r 2", "0.4 1 2048 Rx d 0",
             "0.5 CANFD 1 Rx 300 Name 1 0 9 12 0 1 2 3 4 5 6 7 8 9 10 11 1 1 3000", "0.6 1 100 Rx d 1 256"]  # fmt: skip
    found = asc(tmp_path, *lines, base="base dec timestamps absolute")
    assert rows_of(found) == [
        (10**8, 100, "1", 0, 3, b"\x01\x11\xff"),
        (2 * 10**8, EXTENDED | 2048, "1", 0, 8, bytes(range(8))),
        (3 * 10**8, 2047, "1", REMOTE, 2, b""),
        (5 * 10**8, 300, "1", FD | RATE_SWITCH, 12, bytes(range(12))),
    ]
    (damage,) = found.damage
    assert (damage.place, damage.count) == ("line 5", 2)


def test_stamps_from_line_to_line_are_added_up_exactly(tmp_path: Path) -> None:
    lines = ["0.1 1 1A0 Rx d 0", "0.1 1  Statistic: D 0"] * 500 + ["0.1 1 1A0 Rx d 3 1"]
    found = asc(tmp_path, *lines, "0.1 1 1A0 Rx d 0", base="base hex timestamps relative")
    assert found.time.tolist() == [*range(10**8, 10**11, 2 * 10**8), 10**11 + 2 * 10**8]
    assert any("added up" in note for note in found.notes)
    with pytest.raises(RecordingError, match="more than 285 years"):
        asc(tmp_path, *["999999999.9 1 1A0 Rx d 0"] * 10, base="base hex timestamps relative")


def test_logs_one_behind_the_other(tmp_path: Path) -> None:
    found = asc(tmp_path, "0.1 1 100 Rx d 1 11", "base dec timestamps relative", "0.1 1 100 Rx d 1 11", "0.1 1 100 Rx d 0",
                "base hex timestamps absolute", "0.5 1 100 Rx d 1 FF")  # fmt: skip
    assert found.key.tolist() == [0x100, 100, 100, 0x100]
    assert found.time.tolist() == [10**8, 10**8, 2 * 10**8, 5 * 10**8]
    assert any("3 logs" in note for note in found.notes)


@pytest.mark.parametrize(
    ("date", "said"),
    [
        ("Tue Nov 14 10:13:20.123 pm 2023", "2023-11-14 22:13:20.123"),
        ("Tue Nov 14 12:13:20 am 2023", "2023-11-14 00:13:20.000"),
        ("Tue Nov 14 22:13:20.123 2023", "2023-11-14 22:13:20.123"),
        ("Di Mär 14 22:13:20.123 2023", "2023-03-14 22:13:20.123"),
        ("Mit Dez 6 22:13:20 2023", "2023-12-06 22:13:20.000"),
        ("some day", "'some day'"),
        ("Tue Feb 30 22:13:20 2023", "'Tue Feb 30 22:13:20 2023'"),
    ],
)
def test_the_date_is_told_and_not_added(tmp_path: Path, date: str, said: str, monkeypatch: pytest.MonkeyPatch) -> None:
    times = []
    for zone in ("UTC", "Asia/Tokyo"):
        monkeypatch.setenv("TZ", zone)
        found = asc(
            tmp_path, "no internal events logged", f"Begin Triggerblock {date}", "0.1 1 1 Rx d 0", "End TriggerBlock"
        )
        assert any(said in note and "time zone" in note for note in found.notes)
        assert not any("broken off" in note for note in found.notes)
        times.append(found.time.tolist())
    assert times == [[10**8], [10**8]]
    assert found.damage == ()


def test_what_an_asc_log_lacks_is_noted(tmp_path: Path) -> None:
    found = asc(tmp_path, "Begin Triggerblock Tue Nov 14 22:13:20.123 2023", "0.1 1 1 Rx d 0", base="")
    assert any("End TriggerBlock" in note for note in found.notes)
    assert any("no line 'base'" in note for note in found.notes)


def test_the_origin_of_our_own_logs(tmp_path: Path) -> None:
    assert asc(tmp_path, "// nineaudit time origin -0.02 s", "0.1 1 1 Rx d 0").origin == -20_000_000


TRC = """;$FILEVERSION=2.1
;$STARTTIME=45244.5
;$COLUMNS=N,O,T,B,I,d,R,{length},D
;   Start time: 14.11.2023 12:00:00.000.0
"""
TRC_1 = ";$FILEVERSION=1.1\n;$STARTTIME=45244.5\n"


@pytest.mark.parametrize(("length", "code"), [("L", "9"), ("l", "12")])
def test_an_fd_frame_of_a_trc_has_the_length_of_its_bytes(tmp_path: Path, length: str, code: str) -> None:
    data = bytes(range(12))
    text = TRC.format(length=length) + f"1 1059.9001 FB 2 0300 Tx - {code} {data.hex(' ')}\n"
    (tmp_path / "t.trc").write_text(text)
    kind = FD | RATE_SWITCH | SENT
    assert rows_of(read_by_python_can(tmp_path / "t.trc")) == [(1_059_900_100, 0x300, "2", kind, 12, data)]


def test_what_python_can_passes_over_in_a_trc(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    lines = ["1 1.0 DT 1 0300 Rx - 2 11 22", "2 2.0 FB 1 0300 Tx - 9 11 22", "3 3.0 ST 1 - Rx - 4 00 00 00 00",
             "4 4.0 RR 1 0300 Rx - 4", "5 5.0 XX 1 0300 Rx - 4", "6 5.zz DT 1 0300 Rx - 2 11 22",
             "7 7.0 DT 1 0300 Rx - 2 11 2", "8 8.0 DT 1", "; a comment", "", "9 9.0 DT 1 0300 Rx - 1 99"]  # fmt: skip
    (tmp_path / "t.trc").write_text(TRC.format(length="L") + "\n".join(lines) + "\n")
    found = read_by_python_can(tmp_path / "t.trc")
    assert [(row[0], row[3], row[5]) for row in rows_of(found)] == [
        (10**6, 0, b"\x11\x22"),
        (4 * 10**6, REMOTE, b""),
        (9 * 10**6, 0, b"\x99"),
    ]
    assert found.counts == {"header_lines": 5, "status_lines": 1}
    assert [(d.place, d.count) for d in found.damage] == [("line 6", 1), ("line 9", 4)]
    assert caplog.records == []


def test_a_csv_of_python_can_with_bad_lines(tmp_path: Path) -> None:
    good = "1.5,0x123,0,0,0,2,ESI="
    bad = ["1.5,0x123,0,0,0,3,ESI=", "x,0x123,0,0,0,2,ESI=", "1.5,0x923,0,0,0,2,ESI=", "1.5,0x123,2,0,0,2,ESI=", "1.5,0x123",
           "1.5,0x123,0,0,0,2,E?SI="]  # fmt: skip
    text = "\n".join(["timestamp,arbitration_id,extended,remote,error,dlc,data", good, *bad, good, ""])
    (tmp_path / "t.csv").write_text(text)
    found = read_by_python_can(tmp_path / "t.csv")
    assert rows_of(found) == [(1_500_000_000, 0x123, "", 0, 2, b"\x11\x22")] * 2
    assert sum(d.count for d in found.damage) == len(bad)


# --- damage -------------------------------------------------------------------------------------------------------


def sample(rng: np.random.Generator, suffix: str) -> list[str]:
    """Lines of a log with different layouts."""
    lines = []
    for i in range(60):
        size, extended = int(rng.choice(SIZES[:10])), rng.random() < 0.3
        identifier = int(rng.integers(0, 0x1FFFFFFF if extended else 0x7FF))
        data = rng.integers(0, 256, size, dtype=np.uint8).tobytes()
        if suffix == ".log":
            name = f"{identifier:08X}" if extended else f"{identifier:03X}"
            lines.append(f"({1000 + i}.{i:06d}) can{i % 2} {name}{'##1' if size > 8 else '#'}{data.hex().upper()}")
        elif suffix == ".asc":
            name = f"{identifier:X}{'x' if extended else ''}"
            octets = data.hex(" ").upper()
            classic = f"{1000 + i:5d}.{i:06d} {1 + i % 2}  {name:<15} Rx   d {min(size, 8):x} {octets}"
            fd = f"{1000 + i:5d}.{i:06d} CANFD   1 Rx {name:>8}  {'':>32} 1 0 9 12 {octets} 0 0 3000 0 0 0 0 0"
            lines.append(fd if size > 8 else classic)
        else:
            code = min(size, 9)
            name = f"{identifier:08X}" if extended else f"{identifier:04X}"
            kind = "FD" if size > 8 else "DT"
            lines.append(f"{i + 1} {1_000_000 + i}.000 {kind} 1 {name} Rx - {code} {data.hex(' ')}")
    return lines


HEADS = {".log": "", ".asc": "base hex  timestamps absolute\n", ".trc": TRC.format(length="L")}
READ: dict[str, Callable[[Path], Frames]] = {".log": read_candump, ".asc": read_asc, ".trc": read_by_python_can}


@pytest.mark.parametrize("suffix", HEADS)
def test_frames_on_untouched_lines_survive_flipped_bytes(tmp_path: Path, suffix: str) -> None:
    rng = np.random.default_rng(11)
    path, head = tmp_path / f"t{suffix}", HEADS[suffix].encode()
    for _ in range(8):
        lines = [line.encode() + b"\n" for line in sample(rng, suffix)]
        path.write_bytes(head + b"".join(lines))
        whole = rows_of(READ[suffix](path))
        assert len(whole) == len(lines)
        body, ends = bytearray(b"".join(lines)), np.cumsum([len(line) for line in lines])
        places = rng.integers(0, len(body), int(rng.integers(1, 12)))
        touched = set()
        for place in places.tolist():
            row = int(np.searchsorted(ends, place, side="right"))
            touched |= {row, row + 1} if body[place] == ord("\n") else {row}
            body[place] ^= int(rng.integers(1, 256))
        path.write_bytes(head + body)
        found = READ[suffix](path)
        left = [row for i, row in enumerate(whole) if i not in touched]
        there = rows_of(found)
        assert all(row in there for row in left)
        assert len(there) <= len(lines) + len(places)
        lost = len(whole) - len([row for row in whole if row in there])
        assert len(there) >= len(whole) - lost
        assert found.damage or len(there) >= len(whole) - len(touched)


@pytest.mark.parametrize("suffix", HEADS)
def test_a_cut_log_keeps_its_whole_lines_and_says_so(tmp_path: Path, suffix: str) -> None:
    rng = np.random.default_rng(12)
    text = (HEADS[suffix] + "".join(f"{line}\n" for line in sample(rng, suffix))).encode()
    path = tmp_path / f"t{suffix}"
    path.write_bytes(text)
    whole = rows_of(READ[suffix](path))
    for cut in rng.integers(len(HEADS[suffix]) + 200, len(text), 25).tolist():
        path.write_bytes(text[:cut])
        found = READ[suffix](path)
        lines = text[len(HEADS[suffix]) : cut].count(b"\n")
        assert rows_of(found) == whole[:lines]
        assert [d.what.startswith("the last line has no line end") for d in found.damage] == [True] * (
            text[cut - 1] != 10
        )


@pytest.mark.parametrize("suffix", HEADS)
def test_anything_at_all_is_read_or_refused(tmp_path: Path, suffix: str) -> None:
    rng = np.random.default_rng(13)
    path = tmp_path / f"t{suffix}"
    words = [b"(1.5) can0 ", b"123#", b"##1", b"1122", b"\n", b"0.5 1 1A0 Rx d 2 ", b"11 22 ", b"CANFD 1 Rx 1 ", b"base dec\n", b"\0",
             b"base hex timestamps relative\n", b"9" * 30, b" ", b"\r\n", b"[8]", b"R8", b";$COLUMNS=N,O", b";$FILEVERSION=2.0\n",
             b";$COLUMNS=A,B\n", b"1 1.5 DT 1 0300 Rx - 2 ", b"\xff", b"Begin Triggerblock ", b"date Di 14\n", b"// nineaudit time origin 9 s\n"]  # fmt: skip
    outcomes = set()
    for _ in range(60):
        path.write_bytes(b"".join(words[i] for i in rng.integers(0, len(words), int(rng.integers(1, 60)))))
        try:
            outcomes.add(str(len(READ[suffix](path)) > 0))
        except RecordingError as error:
            outcomes.add(str(error).partition(": ")[0])
    assert outcomes <= {"True", str(path)}
    assert str(path) in outcomes


@pytest.mark.parametrize("suffix", HEADS)
@pytest.mark.parametrize("block", [200, 333])
def test_blocks_make_no_difference(tmp_path: Path, suffix: str, block: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """Read line by line, or all lines of a layout at once."""
    lines = sample(np.random.default_rng(14), suffix)
    lines[20:20] = ["neither this"]
    lines[40:40] = ["nor that", ""]
    path = tmp_path / f"t{suffix}"
    path.write_bytes(b"\xef\xbb\xbf" + (HEADS[suffix] + "".join(f"{line}\r\n" for line in lines)).encode())
    whole = READ[suffix](path)
    monkeypatch.setattr(text_log, "BLOCK", block)
    parts = READ[suffix](path)
    assert rows_of(parts) == rows_of(whole)
    assert (parts.damage, parts.counts, parts.notes) == (whole.damage, whole.counts, whole.notes)
    assert [(d.place, d.count) for d in whole.damage] == [(f"line {21 + HEADS[suffix].count(chr(10))}", 2)]


@pytest.mark.parametrize("suffix", HEADS)
def test_a_line_of_megabytes_is_bounded(tmp_path: Path, suffix: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(text_log, "BLOCK", 1 << 16)
    line = sample(np.random.default_rng(15), suffix)[0].encode() + b"\n"
    path = tmp_path / f"t{suffix}"
    path.write_bytes(HEADS[suffix].encode() + line + b"\0" * (8 << 20) + b"\n" + line)
    tracemalloc.start()
    found = READ[suffix](path)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert len(found) == 2
    (damage,) = found.damage
    assert damage.count == 1
    assert peak < 4 << 20


@pytest.mark.parametrize(
    ("name", "content", "says"),
    [
        ("t.log", b"Dear reader,\nthis is a letter.\n", r"line 1: no CAN frames.*Dear reader.*candump -L"),
        ("t.log", b" (2023-11-14 22:13:20.1)  can0  123   [1]  11\n", "dates in some time zone"),
        ("t.log", b"  can0  123   [2]  11 22\n", "no time stamps"),
        ("t.log", b"\n\n", "nothing but blank lines"),
        ("t.log", "(1.5) can0 123#11\n".encode("utf-16"), "UTF-16"),
        ("t.asc", b"Dear reader,\n", "line 1: no CAN frames.*Vector ASC"),
        ("t.asc", b"base hex timestamps absolute\n0.1 1 Statistic: D 0\n", "1 statistics lines"),
        ("t.trc", b"Dear reader,\n", "no CAN frames"),
        ("t.trc", b";$FILEVERSION=2.1\n1 1.0 DT 1 0300 Rx - 2 11 22\n", "no CAN frames"),
        ("t.csv", b"timestamp,arbitration_id,extended,remote,error,dlc,data\n", "nothing but its header"),
        ("t.db", b"no database at all" * 99, "no CAN frames.*not a database"),
        ("t.db", b"", "no CAN frames.*no such table"),
    ],
)
def test_logs_without_a_frame(tmp_path: Path, name: str, content: bytes, says: str) -> None:
    path = tmp_path / name
    path.write_bytes(content)
    read = {".log": read_candump, ".asc": read_asc}.get(path.suffix, read_by_python_can)
    with pytest.raises(RecordingError, match=says) as caught:
        read(path)
    assert str(caught.value).startswith(str(path))
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("suffix", [".log", ".asc"])
def test_memory_a_frame(tmp_path: Path, suffix: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """At most 160 bytes, the frames themselves included. (The blocks are small here, as the log is.)"""
    monkeypatch.setattr(text_log, "BLOCK", 1 << 18)
    line = {".log": "(1.5) can0 123#1122334455667788 R", ".asc": "   1.500000 1  1A0  Rx   d 8 11 22 33 44 55 66 77 88"}
    path = tmp_path / f"t{suffix}"
    path.write_text(HEADS[suffix] + f"{line[suffix]}\n" * 60_000)
    tracemalloc.start()
    found = READ[suffix](path)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak <= 160 * len(found)
