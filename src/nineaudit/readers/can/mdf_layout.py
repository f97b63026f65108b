"""Where the fields of a CAN frame stand in the records of an MF4 channel group (ASAM MDF bus logging)."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from nineaudit.readers.can.frames import ERROR_STATE, FD, RATE_SWITCH

FLAGS: Final = (("EDL", FD), ("BRS", RATE_SWITCH), ("ESI", ERROR_STATE))
_NUMBERS: Final = ("ID", "IDE", "BusChannel", "Dir", "DLC", "DataLength", *(name for name, _ in FLAGS))
_VALUE, _STORED, _MASTER, _LIMITED = 0, 1, 2, 5
"""Types of channels: a value in the record, its place in the signal data, time, a value of at most so many bytes."""
_UNSIGNED, _REAL, _BYTES = 0, 4, 10
"""Types of data: unsigned integer and floating point, both little-endian; bytes."""
_ALL_INVALID, _MAY_BE_INVALID = 1, 2
_REMOTE_MASTER: Final = 1 << 3
_WORDS: Final = (1, 2, 4, 8)


@dataclass(frozen=True)
class Field:
    """Bits of a record: `shift` and `mask` of the number of `dtype` at byte `at`; mask 0: all of its bits."""

    at: int
    dtype: np.dtype[Any]
    shift: int = 0
    mask: int = 0

    def of(self, data: Any, record: int, first: int, count: int) -> NDArray[Any]:
        """(count,) values in records of `record` bytes, from record `first` on."""
        at = first * record + self.at
        found: NDArray[Any] = np.ndarray((count,), self.dtype, buffer=data, offset=at, strides=(record,))
        if self.shift:
            found = found >> self.dtype.type(self.shift)
        return found & self.dtype.type(self.mask) if self.mask else found


@dataclass(frozen=True)
class Layout:
    """Records of `record` bytes: the `clock`, its `conversion` to seconds (asammdf's), `numbers` by their names.

    Data of frames: `width` bytes in the record at `at`; or else `stored`, their place in the signal data of the channel
    with the number `stored_in`. `marks`: bits that are set where a frame is not valid; `all_marked`: none is.
    """

    record: int
    clock: Field
    conversion: Any
    numbers: Mapping[str, Field]
    at: int = 0
    width: int = 0
    stored: Field | None = None
    stored_in: int = -1
    marks: tuple[Field, ...] = ()
    all_marked: bool = False


def layout(mdf: Any, index: int, name: str) -> Layout | None:
    """Of the frames `name` in group `index` of a file that asammdf has open; None where something is not as usual:
    column by column, no plain clock, big-endian or signed fields, a field that is not in the record."""
    group, master = mdf.groups[index], mdf.masters_db.get(index)
    about = group.channel_group
    if group.uses_ld or master is None or about.flags & _REMOTE_MASTER:
        return None
    size = about.samples_byte_nr
    clock = _clock(group.channels[master], size)
    channels = {channel.name: (i, channel) for i, channel in enumerate(group.channels)}
    numbers = {what: number(channels[f"{name}.{what}"][1], size) for what in _NUMBERS if f"{name}.{what}" in channels}
    payload = _payload(group, channels.get(f"{name}.DataBytes"), size)
    if clock is None or payload is None or None in numbers.values() or len(channels) != len(group.channels):
        return None
    told = [channels[full][1] for full in _whole(name) if full in channels]
    return Layout(
        size + about.invalidation_bytes_nr,
        clock,
        group.channels[master].conversion,
        {what: field for what, field in numbers.items() if field is not None},
        **payload,
        marks=tuple(_mark(c, size) for c in told if c.flags & _MAY_BE_INVALID and about.invalidation_bytes_nr),
        all_marked=any(c.flags & _ALL_INVALID for c in told),
    )


def _whole(name: str) -> tuple[str, ...]:
    """Channels without which there is no frame."""
    return (name, f"{name}.ID", f"{name}.DataLength", f"{name}.DataBytes")


def number(channel: Any, size: int) -> Field | None:
    """An unsigned little-endian channel in a record of `size` bytes."""
    needed = -(-(channel.bit_offset + channel.bit_count) // 8)
    word = next((w for w in _WORDS if w >= needed), 0)
    plain = channel.channel_type == _VALUE and channel.data_type == _UNSIGNED and channel.bit_count
    if not plain or not word or word > size or channel.byte_offset + needed > size:
        return None
    at = min(channel.byte_offset, size - word)
    shift = channel.bit_offset + 8 * (channel.byte_offset - at)
    mask = (1 << channel.bit_count) - 1 if channel.bit_count < 8 * word else 0
    return Field(at, np.dtype(f"<u{word}"), shift, mask)


def _clock(channel: Any, size: int) -> Field | None:
    if channel.channel_type != _MASTER or channel.bit_offset or channel.byte_offset + channel.bit_count // 8 > size:
        return None
    kind = {_UNSIGNED: "u", _REAL: "f"}.get(channel.data_type)
    usual = kind and channel.bit_count in ((8, 16, 32, 64) if kind == "u" else (32, 64))
    return Field(channel.byte_offset, np.dtype(f"<{kind}{channel.bit_count // 8}")) if usual else None


def _payload(group: Any, found: tuple[int, Any] | None, size: int) -> dict[str, Any] | None:
    """Of Layout what it says of the data of frames."""
    if found is None:
        return {}
    index, channel = found
    if channel.data_type != _BYTES or channel.bit_offset or channel.bit_count % 8 or not channel.bit_count:
        return None
    width = channel.bit_count // 8
    if channel.byte_offset + width > size or group.channel_dependencies[index]:
        return None
    if channel.channel_type == _STORED and width in _WORDS:
        return {"stored": Field(channel.byte_offset, np.dtype(f"<u{width}")), "stored_in": index}
    return {"at": channel.byte_offset, "width": width} if channel.channel_type in (_VALUE, _LIMITED) else None


def _mark(channel: Any, size: int) -> Field:
    """The bit that is set where a channel is not valid: they stand behind the values."""
    place = int(channel.pos_invalidation_bit)
    return Field(size + place // 8, np.dtype("u1"), place % 8, 1)
