"""Messages of python-can as columns, each looked at before it is believed."""

from __future__ import annotations

import re
from array import array
from typing import Any, Final

import numpy as np

from nineaudit.can_database import EXTENDED
from nineaudit.readers.can import frames as can_frames
from nineaudit.readers.can.frames import ERROR, ERROR_STATE, FD, LONG, RATE_SWITCH, REMOTE, SHORT, Frames
from nineaudit.readers.can.text_layouts import MOST_BUSES
from nineaudit.readers.can.text_log import NOT_READ, Account

SIZES: Final = (*range(9), 12, 16, 20, 24, 32, 48, 64)
"""Bytes of an FD frame by data length code, ISO 11898-1."""
WRONG: Final = "a frame whose bytes do not fit its length"
_DECIMAL: Final = re.compile(r"(\d{1,13})(?:\.(\d*))?")


class Rows:
    """Frames one after the other, packed as in the columns that they become."""

    def __init__(self) -> None:
        self.time = array("q")
        self._key, self._bus, self._kind, self._length = array("I"), array("H"), array("B"), array("B")
        self._data, self._long = bytearray(), bytearray()
        self._long_rows = array("q")
        self._buses: dict[str, int] = {}

    def knows(self, bus: str) -> bool:
        """Whether there is room for that bus in the table."""
        return bus in self._buses or len(self._buses) < MOST_BUSES

    def add(self, time: int, key: int, bus: str, kind: int, length: int, data: bytes) -> None:
        """One more frame; an error frame has no identifier."""
        if len(data) > SHORT:
            self._long_rows.append(len(self.time))
            self._long += data.ljust(LONG, b"\0")
        self.time.append(time)
        self._key.append(0 if kind & ERROR else key)
        self._bus.append(self._buses.setdefault(bus, len(self._buses)))
        self._kind.append(kind)
        self._length.append(length)
        self._data += data[:SHORT].ljust(SHORT, b"\0")

    def frames(self, account: Account, notes: tuple[str, ...]) -> Frames:
        """All of them as columns."""
        return can_frames.frames(
            np.array(self.time),
            np.array(self._key),
            np.array(self._bus),
            np.array(self._kind),
            np.array(self._length),
            np.frombuffer(self._data, dtype=np.uint8).reshape(-1, SHORT),
            np.array(self._long_rows),
            np.frombuffer(self._long, dtype=np.uint8).reshape(-1, LONG),
            buses=tuple(self._buses),
            counts=dict(account.counts),
            damage=account.damage,
            notes=notes,
        )


def put(
    message: Any, time: int | None, data: bytes | None, rows: Rows, account: Account, number: int, text: str
) -> None:
    """A frame whose length is stated in bytes; more than 8 of them make it an FD frame."""
    bare = message.is_remote_frame or message.is_error_frame
    if time is None or data is None or not known_key(message):
        account.damaged(NOT_READ, number, text.encode())
    elif message.dlc not in SIZES or (len(data) != message.dlc and not (bare and not data)):
        account.damaged(WRONG, number, text.encode())
    else:
        kind = kind_of(message) | (FD if len(data) > SHORT else 0)
        rows.add(time, key_of(message), "", kind, message.dlc, data)


def exact(text: str, unit: int) -> int | None:
    """ns of a decimal number of seconds (`unit` 10⁹) or milliseconds (10⁶), None where it is none."""
    found = _DECIMAL.fullmatch(text)
    if found is None:
        return None
    places = len(str(unit)) - 1
    time = int(found[1]) * unit + int((found[2] or "")[:places].ljust(places, "0"))
    return time if time < 2**63 else None


def known_key(message: Any) -> bool:
    return 0 <= int(message.arbitration_id) <= (0x1FFFFFFF if message.is_extended_id else 0x7FF)


def key_of(message: Any) -> int:
    return int(message.arbitration_id) | (EXTENDED if message.is_extended_id else 0)


def kind_of(message: Any) -> int:
    kind = (REMOTE if message.is_remote_frame else 0) | (ERROR if message.is_error_frame else 0)
    kind |= (FD if message.is_fd else 0) | (RATE_SWITCH if message.bitrate_switch else 0)
    return kind | (ERROR_STATE if message.error_state_indicator else 0)
