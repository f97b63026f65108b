"""What the frames of a CAN log say of the bus itself: one row an identifier, and what concerns all of it."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Counter:
    """A signal that counts the frames of its message: steps it leapt over and frames that repeat a number."""

    signal: str
    missing: int
    repeated: int


@dataclass(frozen=True)
class Checksum:
    """A signal that the database names a checksum. `method` that most frames follow, None where none is known that
    they follow; `wrong` frames that do not follow it."""

    signal: str
    method: str | None
    wrong: int = 0


@dataclass(frozen=True)
class Outside:
    """Samples of a signal outside the range its database states, in its `unit`."""

    signal: str
    count: int
    low: float
    high: float
    worst: float
    unit: str


@dataclass(frozen=True)
class Identifier:
    """Data frames of one identifier on one bus. Times in s, of the log's clock.

    `name` of its message, None where no database knows it; `used` where the rig takes a signal from it. `interval` is
    the median time between frames, `jitter` its robust standard deviation, `longest` the longest; NaN below three
    frames. `cycle` is the database's. `length` is the message's, `longer` and `shorter` count frames that differ.
    `constant`: no byte ever changes. `unavailable`: (signal, frames) that say "not available" in place of a number.
    """

    key: int
    name: str | None
    bus: str
    used: bool
    frames: int
    first: float
    last: float
    interval: float
    jitter: float
    longest: float
    constant: bool
    cycle: float | None = None
    length: int | None = None
    longer: int = 0
    shorter: int = 0
    counters: tuple[Counter, ...] = ()
    checksums: tuple[Checksum, ...] = ()
    outside: tuple[Outside, ...] = ()
    unavailable: tuple[tuple[str, int], ...] = ()

    @property
    def number(self) -> str:
        """``0x24``, with three digits at most where it has 11 bits and eight where it has 29."""
        return f"0x{self.key & 0x1FFFFFFF:08X}" if self.key >> 31 else f"0x{self.key:X}"

    @property
    def label(self) -> str:
        """``0x24 KINEMATICS``."""
        return f"{self.number} {self.name}" if self.name else self.number


@dataclass(frozen=True)
class Load:
    """Bits that one bus carried, without and with all the stuff bits there can be: over the whole log of `duration` s,
    and in its busiest window of `window` s."""

    bus: str
    duration: float
    least: float
    most: float
    window: float
    peak_least: float
    peak_most: float


@dataclass(frozen=True)
class Bus:
    """All of a log. `absent`: messages with a cycle time, or that the rig uses, that never came; `restarts`: stamps
    that lie before the one before them in the log, bus by bus, and the first of those, s; `bit_rate` in bit/s where a
    database states it; `fd`: whether any frame is CAN FD."""

    identifiers: tuple[Identifier, ...]
    absent: tuple[str, ...]
    restarts: int
    first_restart: float | None
    loads: tuple[Load, ...]
    bit_rate: float | None
    fd: bool
