"""CAN databases (DBC, ARXML, KCD, SYM through cantools): which bits of which message are a signal.

Bits are taken from, and put into, whole columns of payloads at once. Bit numbers as in a DBC file: bit b of byte
B is 8B + b; a little-endian (Intel) signal starts at its lowest bit, a big-endian (Motorola) one at its highest.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from nineaudit.array import FloatArray
from nineaudit.errors import ConfigurationError
from nineaudit.signals import suggestion

ByteMatrix = NDArray[np.uint8]
EXTENDED = 1 << 31
"""Flag of a 29-bit identifier in a frame's key, as in a DBC file."""


@dataclass(frozen=True)
class BusSignal:
    """One signal of one message of a database. `message` and `signal` are cantools' objects."""

    message: Any
    signal: Any

    @property
    def name(self) -> str:
        return f"{self.message.name}.{self.signal.name}"

    @property
    def key(self) -> int:
        """Identifier of the frames that carry it, with the EXTENDED flag."""
        return int(self.message.frame_id) | (EXTENDED if self.message.is_extended_frame else 0)

    @property
    def plain(self) -> bool:
        """True where the signal is in every frame of its message (it is not multiplexed)."""
        return self.signal.multiplexer_ids is None


def load_databases(paths: Sequence[Path]) -> tuple[Any, ...]:
    """Messages of all databases. Raises ConfigurationError where one cannot be read, or where there is none."""
    from cantools.database import load_file
    from cantools.database.errors import Error

    if not paths:
        raise ConfigurationError(
            "a CAN log needs a database to decode it, and none is given",
            advice="name it in the rig file ([recording] dbc = [...]) or with --dbc",
        )
    messages: list[Any] = []
    for path in paths:
        try:
            # Not strict: databases in use have overlapping signals in messages that do not matter here.
            messages += getattr(load_file(path, strict=False), "messages", [])
        except OSError as error:
            raise ConfigurationError(f"cannot read the CAN database: {error.strerror or error}", file=path) from error
        except (Error, ValueError) as error:
            raise ConfigurationError(
                f"not a CAN database that can be used: {_first_line(error)}",
                file=path,
                expected="a .dbc, .arxml, .kcd or .sym file",
            ) from error
    return tuple(messages)


def _first_line(error: Exception) -> str:
    return next(iter(str(error).splitlines()), type(error).__name__)


def find_signal(messages: Iterable[Any], spec: str) -> BusSignal:
    """The signal that `spec` (Message.Signal, or Signal alone where only one message has it) names.

    Raises ConfigurationError that suggests the nearest name, or lists the messages to choose from.
    """
    messages = list(messages)
    wanted_message, _, wanted = spec.rpartition(".")
    hits = [
        BusSignal(m, s)
        for m in messages
        if not wanted_message or m.name == wanted_message
        for s in m.signals
        if s.name == wanted
    ]
    if len({(hit.key, hit.signal.start, hit.signal.length) for hit in hits}) == 1:
        return hits[0]
    if hits:
        raise ConfigurationError(
            "more than one message of the CAN database has this signal",
            place=f"signal {spec}",
            expected="Message.Signal, one of " + ", ".join(f"{hit.name} (0x{hit.message.frame_id:X})" for hit in hits),
        )
    raise _not_found(messages, spec, wanted_message, wanted)


def _not_found(messages: list[Any], spec: str, message: str, signal: str) -> ConfigurationError:
    names = {m.name: [s.name for s in m.signals] for m in messages}
    if message in names:
        what, near = f"message {message} of the CAN database has no signal {signal}", names[message]
        advice = suggestion(signal, near)
    elif message:
        what, advice = f"the CAN database has no message {message}", suggestion(message, names)
    else:
        what = f"the CAN database has no signal {signal}"
        advice = suggestion(signal, (name for signals in names.values() for name in signals))
    return ConfigurationError(what, place=f"signal {spec}", advice=advice)


def bits(signal: Any) -> NDArray[np.intp]:
    """(length,) places of a signal's bits, lowest first, in a payload unpacked with the lowest bit of a byte first."""
    if signal.byte_order == "little_endian":
        return np.asarray(signal.start + np.arange(signal.length), dtype=np.intp)
    first = 8 * (signal.start // 8) + 7 - signal.start % 8  # counted with the highest bit of a byte first
    falling = first + np.arange(signal.length)
    return np.asarray(8 * (falling // 8) + 7 - falling % 8, dtype=np.intp)[::-1]


def bytes_needed(signal: Any) -> int:
    """Length of the shortest payload that holds the whole signal."""
    return int(bits(signal).max()) // 8 + 1


def decode(signal: Any, payload: ByteMatrix) -> FloatArray:
    """(n,) physical values, in the database's unit, of a signal in (n, bytes) payloads: raw·scale + offset."""
    weights = np.uint64(1) << np.arange(signal.length, dtype=np.uint64)
    unpacked = np.unpackbits(payload, axis=1, bitorder="little")[:, bits(signal)]
    raw = unpacked.astype(np.uint64) @ weights
    if signal.is_float:
        numbers = raw.astype(f"u{signal.length // 8}").view(f"f{signal.length // 8}").astype(np.float64)
    elif signal.is_signed:  # two's complement: carry the sign bit up to bit 63 and shift back
        spare = np.uint64(64 - signal.length)
        numbers = ((raw << spare).view(np.int64) >> np.int64(spare)).astype(np.float64)
    else:
        numbers = raw.astype(np.float64)
    return np.asarray(numbers * signal.scale + signal.offset, dtype=np.float64)


def raw_limits(signal: Any) -> tuple[int, int]:
    """Smallest and largest raw integer a signal's bits can hold."""
    if signal.is_signed:
        return -(1 << (signal.length - 1)), (1 << (signal.length - 1)) - 1
    return 0, (1 << signal.length) - 1


def encode(signal: Any, values: FloatArray, payload: ByteMatrix) -> None:
    """Put (n,) physical values into the bits of (n, bytes) payloads, rounded to the nearest raw value.

    The caller has checked that the values fit (``raw_limits``): what does not is cut off here.
    """
    scaled = (values - signal.offset) / signal.scale
    if signal.is_float:
        width = signal.length // 8
        raw = scaled.astype(f"f{width}").view(f"u{width}").astype(np.uint64)
    else:
        low, high = raw_limits(signal)
        whole = np.clip(np.rint(scaled), low, high)  # half a step beyond the last value belongs to it
        raw = whole.astype(np.int64 if low < 0 else np.uint64).view(np.uint64)
    unpacked = np.unpackbits(payload, axis=1, bitorder="little")
    places = np.arange(signal.length, dtype=np.uint64)
    unpacked[:, bits(signal)] = (raw[:, None] >> places) & np.uint64(1)
    payload[:] = np.packbits(unpacked, axis=1, bitorder="little")
