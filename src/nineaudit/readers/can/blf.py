"""Vector BLF logs: every object of the file, CAN frames as columns.

A BLF file is a header and a chain of objects, most of them containers of deflated objects; an object is the
signature LOBJ, its header's size, the header's version, its own size and its type. Reading goes through
blf_containers (file to contents), blf_chain and blf_stream (contents to objects), blf_objects (one type of object
each) and blf_frames (objects to columns).
"""

from __future__ import annotations

import os
from collections.abc import Iterator
from pathlib import Path

from nineaudit.errors import RecordingError
from nineaudit.readers.can.blf_columns import Columns
from nineaudit.readers.can.blf_containers import Header, pieces, read_header
from nineaudit.readers.can.blf_frames import BEYOND, Account, add_frames
from nineaudit.readers.can.blf_objects import TYPES
from nineaudit.readers.can.blf_stream import Stream
from nineaudit.readers.can.frames import Frames
from nineaudit.readers.can.losses import Losses
from nineaudit.units import counted

_RESTORE_POINT = 115
"""Objects that some writers do not count."""
_LEAST_OF_A_FRAME = 4
"""Bytes of the file below which a deflated frame is not expected to take, so that a count can be believed."""


def read_blf(path: Path, threads: int = 1) -> Frames:
    """All CAN frames of a BLF log in its order: data, remote, error and overload frames.

    Times are ns since 1970 where the header has the date of the measurement's start, which is taken for UTC as
    python-can does (the file does not say; so the analyst's time zone does not matter), else ns since the start.
    `buses` are the channels' numbers as the log has them, from 1. `threads`: with more than one, containers are
    inflated aside. Raises RecordingError if this is no BLF log, its header is not whole, or no frame can be read.
    """
    losses = Losses()
    with path.open("rb") as file:
        size = file.seek(0, os.SEEK_END)
        file.seek(0)
        header = read_header(file, path)
        account = Account(losses, header.start or 0)
        columns = Columns(min(header.objects, size // _LEAST_OF_A_FRAME))
        contents = pieces(file, header, threads, losses)
        for batch in Stream(losses).batches(contents):
            add_frames(columns, batch, account)
    _check_header(header, size, account)
    log = columns.frames(
        counts=_counts(header, size, account),
        notes=tuple(_notes(header, size, account)),
        damage=losses.damage(),
        origin=account.origin,
    )
    if not len(log):
        raise _empty(path, account)
    return log


def _empty(path: Path, account: Account) -> RecordingError:
    damage = account.losses.damage()
    others = sum(account.types.values())
    found = f"{others} other objects" if others else "no objects"
    return RecordingError("no CAN frames in this log", file=path, found="; ".join([found, *map(str, damage)]))


def _check_header(header: Header, size: int, account: Account) -> None:
    """What the header states against what is there: a log that was not closed states nothing, or too little."""
    losses, objects = account.losses, sum(account.types.values())
    if header.file_size > size:
        losses.add(f"the file has {size} of the {counted(header.file_size, 'byte')} its header states", f"byte {size}")
    if header.objects > objects:
        losses.add(f"{objects} of the {header.objects} objects that the header counts are there", "byte 32")
    if header.start is None:
        losses.add("the measurement's start is no date; times count from it", "byte 40")


def _notes(header: Header, size: int, account: Account) -> Iterator[str]:
    there = sum(account.types.values())
    if header.objects < there - account.types[_RESTORE_POINT]:
        objects = counted(header.objects, "object")
        yield f"the header counts {objects}, {there} are there: the log was not closed, or appended to"
    if header.file_size < size:
        yield f"the header states {counted(header.file_size, 'byte')}, the file has {size}"
    for what, count in sorted(account.odd.items()):
        if count:
            yield f"{count} {what}"


def _counts(header: Header, size: int, account: Account) -> dict[str, float]:
    others = {kind: count for kind, count in sorted(account.types.items()) if kind not in TYPES}
    return {
        "objects": sum(account.types.values()),
        "objects_in_header": header.objects,
        "bytes_of_file": size,
        "bytes_in_header": header.file_size,
        "other_objects": sum(others.values()),
        **{f"objects_of_type_{kind}{'_or_more' * (kind == BEYOND)}": count for kind, count in others.items()},
    }
