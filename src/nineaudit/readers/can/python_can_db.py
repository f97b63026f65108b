"""Databases of can.SqliteWriter, read by sqlite itself: read-only, where python-can opens them for writing."""

from __future__ import annotations

import sqlite3
from pathlib import Path
from typing import Final

from nineaudit.errors import RecordingError
from nineaudit.readers.can.python_can_rows import Rows, put
from nineaudit.readers.can.text_log import NOT_READ, Account

_MOST_S: Final = 4.6e9
"""Seconds from 1970 (to 2115, or before) of which all differences are int64 ns."""


def read_database(path: Path, rows: Rows, account: Account) -> tuple[str, ...]:
    """Table messages: ts, arbitration_id, extended, remote, error, dlc, data."""
    import can

    try:
        base = sqlite3.connect(f"{path.absolute().as_uri()}?mode=ro&immutable=1", uri=True)
    except sqlite3.Error as error:
        raise RecordingError(f"not a database that can be read: {error}", file=path) from error
    for beside in (path.with_name(f"{path.name}-wal"), path.with_name(f"{path.name}-journal")):
        if beside.exists() and beside.stat().st_size:
            account.damaged(
                "a journal stands beside the database: its writer was broken off", 1, beside.name.encode(), ""
            )
    number = 0
    try:
        for row in base.execute("SELECT ts, arbitration_id, extended, remote, error, dlc, data FROM messages"):
            number += 1
            stamp, data = row[0], row[6] if isinstance(row[6], bytes) else b"" if row[6] is None else None
            if not isinstance(stamp, (int, float)) or data is None or not all(isinstance(x, int) for x in row[1:6]):
                account.damaged(NOT_READ, number, repr(row).encode())
                continue
            message = can.Message(
                arbitration_id=row[1],
                is_extended_id=bool(row[2]),
                is_remote_frame=bool(row[3]),
                is_error_frame=bool(row[4]),
                dlc=row[5],
            )
            time = round(stamp * 1e9) if abs(stamp) < _MOST_S else None
            put(message, time, data, rows, account, number, repr(row))
    except (sqlite3.Error, OverflowError) as error:
        account.damaged(
            f"the database cannot be read any further ({error})", number + 1, b"", "what follows is missing"
        )
    finally:
        base.close()
    return ("stamps are floating-point seconds, which resolve about 0.2 µs of a date",)
