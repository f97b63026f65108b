"""Fields of a decoded message by path: linear_acceleration.x, samples.0.value. JSON values and ROS messages alike."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any, Final

MISSING: Final = object()


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
    if isinstance(message, Sequence) and not isinstance(message, (str, bytes)):
        return message[int(name)] if name.isdecimal() and int(name) < len(message) else MISSING
    return getattr(message, name, MISSING) if name in _names(message) else MISSING


def _names(message: Any) -> Sequence[str]:
    """Fields of a ROS message: the decoder keeps them in slots."""
    return tuple(getattr(type(message), "__slots__", ())) or tuple(getattr(message, "__dict__", ()))


def leaves(message: Any, prefix: str = "") -> Iterator[str]:
    """Paths of the numbers in a message."""
    if isinstance(message, bool) or message is None or isinstance(message, (str, bytes)):
        return
    if isinstance(message, (int, float)):
        yield prefix
        return
    if isinstance(message, Mapping):
        names: Sequence[str] = tuple(message)
    elif isinstance(message, Sequence):
        names = tuple(map(str, range(len(message))))
    else:
        names = _names(message)
    for name in names:
        yield from leaves(_step(message, name), f"{prefix}.{name}" if prefix else name)
