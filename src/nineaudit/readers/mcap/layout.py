"""Where values of ROS types stand, as far as the type alone tells: sizes, alignments, paths to numbers.

Source: CDR alignment, DDS-XTypes 1.3 section 7.4.3: a number is aligned to its size, at most to that of the encoding.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import lru_cache

from nineaudit.readers.mcap.ros import Array, Number, Struct, Text, Type


def is_number(kind: Type, path: str) -> bool:
    """Whether there is a number at a path."""
    if isinstance(kind, Number):
        return not path and kind.dtype != "b1"
    head, _, rest = path.partition(".")
    if isinstance(kind, Array):
        return head.isdecimal() and (kind.count is None or int(head) < kind.count) and is_number(kind.item, rest)
    return isinstance(kind, Struct) and any(name == head and is_number(t, rest) for name, t in kind.fields)


def leaves(kind: Type, prefix: str = "", depth: int = 0) -> Iterator[str]:
    """Paths of numbers, of arrays the first item's."""
    inner = [("0", kind.item)] if isinstance(kind, Array) else kind.fields if isinstance(kind, Struct) else ()
    if isinstance(kind, Number) and kind.dtype != "b1":
        yield prefix
    for name, part in inner if depth < 8 else ():
        yield from leaves(part, f"{prefix}.{name}" if prefix else name, depth + 1)


@lru_cache(maxsize=4096)
def span(kind: Type, phase: int, most: int) -> int | None:
    """Bytes from a place `phase` bytes behind a multiple of 8 to the end of a value of fixed layout, else None."""
    if isinstance(kind, Text) or (isinstance(kind, Array) and kind.count is None):
        return None
    if isinstance(kind, Number):
        return kind.size + -phase % min(kind.size, most)
    if isinstance(kind, Array):
        return items_span(kind.item, kind.count or 0, phase, most)
    at = phase
    for _, part in kind.fields:
        size = span(part, at % 8, most)
        if size is None:
            return None
        at += size
    return at - phase


def items_span(item: Type, count: int, phase: int, most: int) -> int | None:
    """The same of `count` items: behind the first, all begin at one phase of the largest alignment among them."""
    first = span(item, phase, most) if count else 0
    if first is None or count < 2:
        return first
    second = span(item, (phase + first) % 8, most) or 0
    third = span(item, (phase + first + second) % 8, most) or 0
    return first + second + (count - 2) * third if second == third else None


@lru_cache(maxsize=4096)
def least(kind: Type) -> int:
    """The fewest bytes of a value."""
    if isinstance(kind, Number):
        return kind.size
    if isinstance(kind, Struct):
        return sum(least(part) for _, part in kind.fields)
    return 4 if isinstance(kind, Text) or kind.count is None else kind.count * least(kind.item)


@lru_cache(maxsize=4096)
def alignment(kind: Type) -> int:
    """The largest alignment in a value."""
    if isinstance(kind, Number):
        return kind.size
    if isinstance(kind, Struct):
        return max((alignment(part) for _, part in kind.fields), default=1)
    return 4 if isinstance(kind, Text) else max(4 if kind.count is None else 1, alignment(kind.item))
