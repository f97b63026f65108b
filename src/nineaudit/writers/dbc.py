"""A CAN database for a rig, so that what is simulated can be written as a CAN log."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, Final

from nineaudit.array import Sensor
from nineaudit.errors import ConfigurationError

if TYPE_CHECKING:
    from nineaudit.rig import Rig

_FIRST_ID: Final = 0x100
_PER_MESSAGE: Final = 3  # signals without a message: three, of 21 bits each
_MOST: Final = 5  # signals of a message: 12 bits each
_HEADROOM: Final = 1.25  # over the full scale, so that a channel at its rail is not at that of its signal


def make_dbc(rig: Rig) -> str:
    """Text of a DBC file for a rig whose signals are Message.Signal, or Signal alone (messages are then made up).

    Eight-byte frames. A channel with a full scale is a signed integer with as many bits as its message has to give;
    without one it is a 32-bit float. Units are the rig's. Raises ConfigurationError: names that a DBC does not
    allow, or too many signals in a message.
    """
    lines = ['VERSION ""', "", "NS_ :", "", "BS_:", "", "BU_: RIG", ""]
    floats: list[str] = []
    for ident, (message, sensors) in enumerate(_messages(rig), _FIRST_ID):
        lines.append(f"BO_ {ident} {_checked(message)}: 8 RIG")
        width = 32 if any(s.full_scale is None for s in sensors) else min(32, 64 // len(sensors))
        if len(sensors) * width > 64 or len(sensors) > _MOST:
            raise ConfigurationError(
                "too many signals for a frame of 8 bytes",
                place=f"message {message}",
                found=len(sensors),
                expected=f"{min(64 // width, _MOST)} or fewer",
                advice="spread them over more messages in the rig file",
            )
        for i, sensor in enumerate(sensors):
            lines.append(_signal(sensor, i * width, width))
            if sensor.full_scale is None:
                floats.append(f"SIG_VALTYPE_ {ident} {_name(sensor)} : 1;")
        lines.append("")
    return "\n".join([*lines, *floats, ""])


def _messages(rig: Rig) -> Iterator[tuple[str, Sequence[Sensor]]]:
    named: dict[str, list[Sensor]] = {}
    alone: list[Sensor] = []
    for sensor in rig.array.sensors:
        message, dot, _ = sensor.signal.rpartition(".")
        (named.setdefault(message, []) if dot else alone).append(sensor)
    yield from named.items()
    number = _PER_MESSAGE if all(s.full_scale is not None for s in alone) else 2
    for i in range(0, len(alone), number):
        yield f"ARRAY_{i // number + 1}", alone[i : i + number]


def _signal(sensor: Sensor, start: int, width: int) -> str:
    name, unit = _name(sensor), sensor.unit
    if sensor.full_scale is None:
        return f' SG_ {name} : {start}|32@1- (1,0) [0|0] "{unit}" RIG'
    full = sensor.full_scale / sensor.to_si
    scale = float(f"{_HEADROOM * full / (2 ** (width - 1) - 1):.3g}")
    most = scale * (2 ** (width - 1) - 1)
    return f' SG_ {name} : {start}|{width}@1- ({scale!r},0) [{-most!r}|{most!r}] "{unit}" RIG'


def _name(sensor: Sensor) -> str:
    return _checked(sensor.signal.rpartition(".")[2])


def _checked(name: str) -> str:
    if re.fullmatch(r"[A-Za-z_]\w*", name, re.ASCII):
        return name
    raise ConfigurationError(
        "a name that a CAN database does not allow",
        found=name,
        expected="letters, digits and _, not a digit first",
        advice="name the signal Message.Signal in the rig file",
    )
