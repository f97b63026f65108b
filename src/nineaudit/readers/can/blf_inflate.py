"""What a container of a BLF log holds: inflated, never further than is believed, and judged."""

from __future__ import annotations

import contextlib
import struct
import zlib
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from typing import Final

from nineaudit.readers.can.blf_chain import BASE, LARGEST, PADDING

_HEADER: Final = struct.Struct("<4xH10x")  # of every object (blf_chain.HEAD): the size of its header
_CONTAINER: Final = struct.Struct("<H6xL4x")  # method of compression, inflated size; then the content
_STORED, _DEFLATED = 0, 2
_DENSEST: Final = 1032
"""Bytes that one deflated byte can be at most: what is short enough can be inflated without a limit,"""
_AT_ONCE: Final = 5
"""so that it is at most this many times LARGEST: the usual 128 KiB are, however badly they deflate."""
NOTHING_BEGINS: Final = "no object where one must begin"
ENDS_IN_OBJECT: Final = "the file ends inside of an object"


@dataclass(frozen=True)
class Piece:
    """Objects of a container, or objects that stood `bare` in the file, which began at byte `at` of it.

    `fault`: why all of it is lost; `flaw`: what is wrong with it although it could be read, or though nothing of the
    log was in it; `stored`: bytes of it in the file; `again`: the fault is that of the piece before.
    """

    at: int
    content: bytes
    bare: bool = False
    fault: str | None = None
    flaw: str | None = None
    stored: int = 0
    again: bool = False


@dataclass(frozen=True)
class Item:
    """Bytes `begin` to `end` of a window: a container or another object, `whole` if the chain says so; else a gap,
    which may begin with a container, or what there is of an object that is `cut` by the end of the file. `again`: the
    gap goes on that the window before ends with."""

    begin: int
    end: int
    container: bool
    whole: bool = True
    cut: bool = False
    again: bool = False


@dataclass(frozen=True)
class Window:
    """Bytes of the file from `at` on, and what stands in them."""

    at: int
    data: bytes
    items: tuple[Item, ...]


def stated_size(data: bytes, item: Item) -> int:
    """Bytes that an item says it holds."""
    place = item.begin + BASE
    whole = item.container and place + _CONTAINER.size <= item.end
    return int(_CONTAINER.unpack_from(data, place)[1]) if whole else item.end - item.begin


def opened(window: Window, items: Iterable[Item]) -> list[Piece]:
    """Contents of containers, stretches of bare objects, and gaps."""
    out: list[Piece] = []
    view = memoryview(window.data)
    for item in _stretches(items):
        raw, at = view[item.begin : item.end], window.at + item.begin
        if item.container:
            out.append(_content(at, raw, item))
        else:
            out.append(Piece(at, bytes(raw), bare=True) if item.whole else _gap(at, len(raw), item))
    return out


def _stretches(items: Iterable[Item]) -> Iterator[Item]:
    """Items, where bare objects that follow each other are one."""
    held: Item | None = None
    for item in items:
        bare = item.whole and not item.container
        if held and bare and item.begin - held.end <= PADDING:
            held = replace(held, end=item.end)
            continue
        if held:
            yield held
        held = item if bare else None
        if not bare:
            yield item
    if held:
        yield held


def _gap(at: int, size: int, item: Item) -> Piece:
    """A gap: what is before and behind it may belong together only if no container can have been in it."""
    what = ENDS_IN_OBJECT if item.cut else NOTHING_BEGINS
    if size < BASE + _CONTAINER.size and not item.again:
        return Piece(at, b"", flaw=what, stored=size)
    return Piece(at, b"", fault=what, stored=size, again=item.again)


def _content(at: int, raw: memoryview, item: Item) -> Piece:
    header = _HEADER.unpack_from(raw)[0] if len(raw) >= BASE else BASE
    if len(raw) < header + _CONTAINER.size:
        return Piece(at, b"", fault="a container without content", stored=len(raw))
    method, stated = _CONTAINER.unpack_from(raw, header)
    body = raw[header + _CONTAINER.size :]
    if method not in (_STORED, _DEFLATED):
        return Piece(at, b"", fault="a container is compressed by a method that is not known", stored=len(raw))
    content, fault, ended = (_inflated if method == _DEFLATED else _stored)(body, stated)
    if fault is None and not ended and not item.cut:
        fault = "a container ends before its data"
    if fault is not None:
        return Piece(at, b"", fault=fault, stored=len(raw))
    return Piece(at, content, flaw=_flaw(len(content), stated, ended, item), stored=len(raw))


def _flaw(size: int, stated: int, ended: bool, item: Item) -> str | None:
    if not ended:
        return "the file ends inside of a container"
    if size != stated:
        return "a container holds other than the bytes it states"
    return None if item.whole else "the size of a container is wrong"


def _stored(body: memoryview, stated: int) -> tuple[bytes, str | None, bool]:
    """As _inflated. No checksum tells that the bytes are right: nothing is taken from a size that is not as stated."""
    if len(body) > stated + PADDING:
        return b"", "a container that is not compressed holds other than the bytes it states", True
    return bytes(body[:stated]), None, len(body) >= stated


def _inflated(body: memoryview, stated: int) -> tuple[bytes, str | None, bool]:
    """Content, why there is none, and whether it is all; never more than LARGEST bytes, whatever is stated."""
    if len(body) <= _AT_ONCE * LARGEST // _DENSEST and stated <= LARGEST:
        with contextlib.suppress(zlib.error):  # what is wrong is found below
            content = zlib.decompress(body, bufsize=stated or 1)
            return (content, None, True) if len(content) <= LARGEST else (b"", _too_large(), True)
    stream = zlib.decompressobj()
    try:
        content = stream.decompress(body, min(stated, LARGEST) + 1)
        while not stream.eof and len(content) <= LARGEST:
            more = stream.decompress(stream.unconsumed_tail, LARGEST + 1 - len(content))
            if not more:
                break
            content += more
    except zlib.error:
        return b"", "the deflated data of a container is damaged", True
    if len(content) > LARGEST:
        return b"", _too_large(), True
    return content, None, stream.eof


def _too_large() -> str:
    return f"a container inflates to more than {LARGEST} bytes"
