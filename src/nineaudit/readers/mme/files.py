"""The files of an ISO-MME test: a folder or a ZIP archive with a .mme file, and beside or below it a .chn index and one
file a channel (.001, .002, ...). ISO/TS 13499 clause 5, RED A (directory structure).

Nothing is unpacked to disk; of no member are more than `LARGEST` bytes read, whatever the archive says of its size.
"""

from __future__ import annotations

import hashlib
import mmap
import re
import struct
import zipfile
import zlib
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path, PurePosixPath
from typing import BinaryIO, Final

from nineaudit.errors import RecordingError
from nineaudit.readers.contents import cut_short
from nineaudit.recording import Damage
from nineaudit.units import counted

LARGEST: Final = 128 * 2**20
"""Bytes of a channel that are read."""
MOST_CHANNELS: Final = 5000
_STEP: Final = 2**20
_CHANNEL: Final = re.compile(r"\.\d{3,}$")
BROKEN: Final = (zipfile.BadZipFile, NotImplementedError, ValueError, OverflowError, struct.error, EOFError)
"""What zipfile raises of the directory of a damaged archive."""

Reader = Callable[[str, int], tuple[bytes, tuple[Damage, ...]]]
"""(name, most bytes) -> what could be read of a file, and what could not."""


@dataclass(frozen=True, eq=False)
class Store:
    """`names` of the files of a folder or an archive, and how one is read."""

    names: tuple[str, ...]
    read: Reader
    damage: tuple[Damage, ...] = ()


@dataclass(frozen=True, eq=False)
class Test:
    """A test among the files of a store: names of its header, its index and its channels, in their order."""

    store: Store
    header: str | None
    index: str | None
    channels: tuple[str, ...]


def open_test(path: Path) -> Test:
    """The test in a folder, in a ZIP archive, or of a .mme file.

    Raises RecordingError: the archive has no directory that can be read, no channel files, or several tests.
    """
    if path.is_dir():
        return _test_in(_folder(path), path, None)
    if path.suffix.lower() == ".mme":
        return _test_in(_folder(path.parent), path, path.name)
    return _test_in(_archive(path), path, None)


def is_test(path: Path) -> bool:
    """Whether a path is a folder with a .mme file or a folder Channel in it, or a .mme file."""
    if not path.is_dir():
        return path.suffix.lower() == ".mme"
    return any(p.suffix.lower() == ".mme" or p.name.lower() == "channel" for p in path.iterdir())


def fingerprint(path: Path) -> tuple[int, str]:
    """(bytes, SHA-256) of the files of the test in a folder or of a .mme file: of their names and contents."""
    test = open_test(path)
    folder = path if path.is_dir() else path.parent
    total, digest = 0, hashlib.sha256()
    for name in sorted(name for name in (test.header, test.index, *test.channels) if name):
        with (folder / name).open("rb") as file:
            content = hashlib.file_digest(file, "sha256").hexdigest()
            total += file.tell()
        digest.update(f"{name}\0{content}\n".encode(errors="surrogateescape"))
    return total, digest.hexdigest()


def _folder(folder: Path) -> Store:
    """The files of a folder and of those in it that are called Channel."""
    places = [folder, *(p for p in folder.iterdir() if p.is_dir() and p.name.lower() == "channel")]
    names = sorted(p.relative_to(folder).as_posix() for place in places for p in place.iterdir() if p.is_file())

    def read(name: str, most: int) -> tuple[bytes, tuple[Damage, ...]]:
        place = folder / name
        with place.open("rb") as file:
            return file.read(most), _too_large(name, most, place.stat().st_size)

    return Store(tuple(names), read)


def _archive(path: Path) -> Store:
    infos, damage = _directory(path)

    def read(name: str, most: int) -> tuple[bytes, tuple[Damage, ...]]:
        with path.open("rb") as file:
            data, fault = _unpacked(file, infos[name], most)
        if not fault:
            return data, _too_large(name, most, infos[name].file_size)
        return data, (
            Damage(f"a file of the archive is damaged: {fault}", name, lost=f"all after {counted(len(data), 'byte')}"),
        )

    return Store(tuple(name for name in infos if name and not name.endswith("/")), read, damage)


def _directory(path: Path) -> tuple[dict[str, zipfile.ZipInfo], tuple[Damage, ...]]:
    """The files of an archive by name; where its directory is cut off or damaged, those whose headers are found."""
    try:
        with zipfile.ZipFile(path) as archive:
            return {info.filename: info for info in archive.infolist()}, ()
    except BROKEN as error:
        infos = {info.filename: info for info in _salvaged(path)}
        what = f"the directory of the archive cannot be read ({error})"
        if not infos:
            raise cut_short(path, what, "no file") from error
    return infos, (Damage(what, path.name, lost=f"without it, {counted(len(infos), 'file')} found"),)


# PKWARE APPNOTE 4.3.7, local file header: signature, version, flags, method, time, date, CRC-32, packed size, size,
# lengths of the name and of the extra field, which follow; then the data.
_LOCAL: Final = struct.Struct("<4s5H3L2H")
_SIGNATURE: Final = b"PK\x03\x04"
_UNSIZED: Final = 8
"""Flag: sizes and checksum come behind the data."""
_MOST: Final = 10_000


def _salvaged(path: Path) -> Iterator[zipfile.ZipInfo]:
    """The files of an archive by the headers before their data."""
    if not path.stat().st_size:
        return
    with path.open("rb") as file, mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as data:
        at, count = data.find(_SIGNATURE), 0
        while 0 <= at <= len(data) - _LOCAL.size and count < _MOST:
            _, _, flags, method, _, _, crc, packed, size, length, _ = _LOCAL.unpack_from(data, at)
            name = data[at + _LOCAL.size : at + _LOCAL.size + length].decode("utf-8", "replace")
            info = zipfile.ZipInfo(name)
            info.header_offset, info.flag_bits, info.compress_type, info.CRC = at, flags, method, crc
            info.compress_size, info.file_size = (len(data), -1) if flags & _UNSIZED else (packed, size)
            yield info
            at, count = data.find(_SIGNATURE, at + _LOCAL.size), count + 1


def _unpacked(file: BinaryIO, info: zipfile.ZipInfo, most: int) -> tuple[bytes, str]:
    """Up to `most` bytes of a file of an archive, and what is wrong with it (""). What comes before a fault is kept,
    as zipfile does not."""
    if info.flag_bits & 1 or info.compress_type not in (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED):
        return b"", "it is encrypted, or packed in another way than by deflate"
    file.seek(max(info.header_offset, 0))
    local = file.read(_LOCAL.size)
    if len(local) < _LOCAL.size or not local.startswith(_SIGNATURE):
        return b"", "its header is not where the directory says"
    file.seek(sum(_LOCAL.unpack(local)[-2:]), 1)
    if info.compress_type == zipfile.ZIP_STORED:
        data, fault = file.read(min(info.compress_size, most)), ""
    else:
        data, fault = _inflated(file, info.compress_size, most)
    if fault or len(data) == most or info.file_size < 0:
        return data, fault
    if len(data) != info.file_size:
        return data, f"{counted(len(data), 'byte')} for the {info.file_size} stated"
    return data, "" if zlib.crc32(data) == info.CRC else "its checksum (CRC-32) is wrong"


def _inflated(file: BinaryIO, left: int, most: int) -> tuple[bytes, str]:
    inflater, out = zlib.decompressobj(-zlib.MAX_WBITS), bytearray()
    try:
        while len(out) < most and not inflater.eof:
            packed = inflater.unconsumed_tail or file.read(min(_STEP, left))
            if not packed:
                break
            left -= 0 if inflater.unconsumed_tail else len(packed)
            out += inflater.decompress(packed, most - len(out))
    except zlib.error as error:
        return bytes(out), str(error)
    return bytes(out), ""


def _too_large(name: str, most: int, size: int) -> tuple[Damage, ...]:
    if most < LARGEST or size <= LARGEST:
        return ()
    return (Damage(f"more than {LARGEST} bytes in a file", name, lost="the rest is not read"),)


def _test_in(store: Store, path: Path, chosen: str | None) -> Test:
    headers = [name for name in store.names if PurePosixPath(name).suffix.lower() == ".mme"]
    if chosen is None and len(headers) > 1:
        raise RecordingError(
            "holds more than one test",
            file=path,
            found=", ".join(headers[:5]),
            expected="one .mme file",
            advice="name the .mme file of the test",
        )
    header = chosen or next(iter(headers), None)
    near = [name for name in store.names if header is None or _belongs(name, header)]
    channels = _of_stem([name for name in near if _CHANNEL.search(name)], header)
    index = next(iter(_of_stem([name for name in near if name.lower().endswith(".chn")], header)), None)
    if len(channels) > MOST_CHANNELS:
        raise RecordingError("too many channels", file=path, found=len(channels), expected=f"up to {MOST_CHANNELS}")
    if not channels:
        raise RecordingError(
            "no channel files of an ISO-MME test",
            file=path,
            found=", ".join(store.names[:5]) or "nothing",
            expected="files .001, .002, ... beside the .mme file or in its folder Channel",
        )
    return Test(store, header, index, tuple(sorted(channels, key=_number)))


def _belongs(name: str, header: str) -> bool:
    """Whether a file is beside the header, or in the folder Channel beside it."""
    place, home = PurePosixPath(name).parent, PurePosixPath(header).parent
    return place == home or (place.parent == home and place.name.lower() == "channel")


def _of_stem(names: Sequence[str], header: str | None) -> list[str]:
    """Those that are called as the header, if there are such; else all."""
    if header is None:
        return list(names)
    stem = PurePosixPath(header).stem.lower()
    return [name for name in names if PurePosixPath(name).stem.lower() == stem] or list(names)


def _number(name: str) -> tuple[int, str]:
    return int(PurePosixPath(name).suffix[1:]), name
