"""CAN logs that python-can reads for us, with what it passes over found out: PEAK .trc, its own .csv and .db.

python-can stops at the first line that it cannot read and skips others without a word. So every line is handed to it
by us: it goes on behind a bad one, and lines that gave no frame are looked at again. Stamps are taken from the text,
not from its floating-point seconds. A .db is read by sqlite itself, read-only.
"""

from __future__ import annotations

import base64
import binascii
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any, Final

from nineaudit.errors import RecordingError
from nineaudit.readers.can import text_log
from nineaudit.readers.can.frames import SENT, SHORT, Frames
from nineaudit.readers.can.python_can_db import read_database
from nineaudit.readers.can.python_can_lines import Fed, messages, quiet
from nineaudit.readers.can.python_can_rows import SIZES, WRONG, Rows, exact, key_of, kind_of, known_key, put
from nineaudit.readers.can.text_layouts import LONGEST
from nineaudit.readers.can.text_log import NOT_READ, Account

_CSV_HEADER: Final = "timestamp,arbitration_id,extended,remote,error,dlc,data"
_STATUS: Final = re.compile(r"\s*\d+\)?\s+[\d.]+\s+(?:\d+\s+)?(ST|ER|EC|EV|Error|Warng|Event)\b|.*\sFFFFFFFF\s")
"""Lines of a .trc that are no frames: status, error counters and events, "bus info" of version 1.0."""


def read_by_python_can(path: Path) -> Frames:
    """All frames of a .trc (versions 1.0 to 2.1), a .csv of can.CSVWriter or a .db of can.SqliteWriter.

    Time in ns: of a .trc since the start of the measurement, of the others as written (since 1970). Damage: lines or
    rows that are no frames, lengths that do not fit the bytes, a last line without line end. Raises RecordingError
    where there is not one frame.
    """
    suffix = path.suffix.lower()
    account = Account("row" if suffix == ".db" else "line")
    rows = Rows()
    if suffix == ".db":
        notes = read_database(path, rows, account)
    else:
        notes = (_csv if suffix == ".csv" else _trc)(_lines(path, account), rows, account)
    if not rows.time:
        raise _nothing(path, account)
    return rows.frames(account, notes)


def _lines(path: Path, account: Account) -> Iterator[tuple[int, str]]:
    """(number, text) of the lines that are not blank."""
    number = 0
    for block in text_log.blocks(path):
        if text_log.cut_off(block, number + 1, account):
            return
        for line in block.split(b"\n")[:-1]:
            number += 1
            if len(line) > LONGEST and not line.startswith(b";"):
                account.damaged(f"a line of more than {LONGEST} characters", number, line)
            elif line.strip():
                yield number, line.decode("utf-8", errors="replace").rstrip("\r")


def _trc(lines: Iterator[tuple[int, str]], rows: Rows, account: Account) -> tuple[str, ...]:
    """PEAK's format (PEAK CAN TRC File Format): lines of ; are the header, then one line a message."""
    import can

    notes: list[str] = []

    def passed_over(number: int, text: str) -> None:
        if text.lstrip().startswith(";"):
            notes.extend(_trc_header(text))
            account.counts["header_lines"] += 1
        elif _STATUS.match(text):
            account.counts["status_lines"] += 1
        else:
            account.damaged(NOT_READ, number, text.encode())

    fed = Fed(lines, passed_over)
    reader = can.TRCReader(fed)  # type: ignore[arg-type]
    with quiet("can.io.trc"):
        for number, text, message in messages(fed, reader, []):
            _trc_frame(message, text, reader.columns.get("O", 1), rows, account, number)
    return tuple(notes[:1])


def _trc_header(text: str) -> tuple[str, ...]:
    found = re.match(r"\s*;\s*Start time:\s*(.+?)\s*$", text)
    if not found:
        return ()
    return (f"time counts from the start of the measurement, {found[1][:40]} (no time zone is stated)",)


def _trc_frame(message: Any, text: str, column: int, rows: Rows, account: Account, number: int) -> None:
    """Its length is that of its bytes: python-can gives the data length code of FD frames in its place."""
    words = text.split()
    time = exact(words[column], 10**6) if column < len(words) else None
    code, data = message.dlc, bytes(message.data)
    size = (SIZES[code] if message.is_fd else min(code, SHORT)) if 0 <= code < len(SIZES) else -1
    if time is None or not known_key(message) or not rows.knows(str(message.channel)):
        account.damaged(NOT_READ, number, text.encode())
    elif size < 0 or (not message.is_remote_frame and len(data) != size):
        account.damaged(WRONG, number, text.encode())
    else:
        kind = kind_of(message) | (0 if message.is_rx else SENT)
        rows.add(time, key_of(message), str(message.channel), kind, size, data)


def _csv(lines: Iterator[tuple[int, str]], rows: Rows, account: Account) -> tuple[str, ...]:
    """timestamp,arbitration_id,extended,remote,error,dlc,data with bytes in base64."""
    import can

    def passed_over(number: int, text: str) -> None:
        if text.strip().lower() == _CSV_HEADER:
            account.counts["header_lines"] += 1
        else:
            account.damaged(NOT_READ, number, text.encode())

    fed = Fed(lines, passed_over)
    for number, text, message in messages(fed, can.CSVReader(fed), [_CSV_HEADER]):  # type: ignore[arg-type]
        words = [word.strip() for word in text.split(",")]
        flags = all(word in ("0", "1") for word in words[2:5])
        time = exact(words[0], 10**9) if flags else None
        put(message, time, _base64(words[6]), rows, account, number, text)
    return ()


def _base64(word: str) -> bytes | None:
    """Bytes of a word; None where python-can passes over characters that do not belong there."""
    try:
        return base64.b64decode(word, validate=True)
    except binascii.Error:
        return None


def _nothing(path: Path, account: Account) -> RecordingError:
    first = next(iter(account.lines.items()), None)
    return RecordingError(
        "no CAN frames in this log",
        file=path,
        place=f"{account.unit} {first[1].line}" if first else None,
        found=(first[1].text.strip("'\"") or first[0]) if first else "nothing but its header",
        expected={".trc": "a PEAK TRC log", ".csv": "a CSV log of python-can"}.get(
            path.suffix.lower(), "a .db of can.SqliteWriter"
        ),
    )
