"""Fields of a decoded JSON message by path: linear_acceleration.x, samples.0.value."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any, Final

MISSING: Final = object()
_DEEPEST: Final = 32


def lookup(message: Any, path: str) -> Any:
    """The value at `path`, MISSING where the message has none. A key that holds points itself comes first."""
    if isinstance(message, Mapping) and path in message:
        return message[path]
    head, _, rest = path.partition(".")
    inner = _step(message, head)
    return inner if not rest or inner is MISSING else lookup(inner, rest)


def _step(message: Any, name: str) -> Any:
    if isinstance(message, Mapping):
        return message.get(name, MISSING)
    if isinstance(message, Sequence) and not isinstance(message, str):
        return message[int(name)] if name.isdecimal() and int(name) < len(message) else MISSING
    return MISSING


def leaves(message: Any, prefix: str = "", depth: int = 0) -> Iterator[str]:
    """Paths of the numbers in a message, those of more than 32 names left out."""
    if isinstance(message, (int, float)) and not isinstance(message, bool):
        yield prefix
    names = message if isinstance(message, Mapping) else range(len(message)) if isinstance(message, list) else ()
    for name in map(str, names) if depth < _DEEPEST else ():
        yield from leaves(_step(message, name), f"{prefix}.{name}" if prefix else name, depth + 1)
