"""CAN databases (DBC, ARXML, KCD, SYM through cantools): which message carries a signal. Its bits: can_bits.py."""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from nineaudit.dbc_text import Fault, faults
from nineaudit.errors import ConfigurationError
from nineaudit.signals import suggestion
from nineaudit.units import counted

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


@dataclass(frozen=True)
class Databases:
    """Messages of all databases, and the `bit_rate` (bit/s) of the bus where one states it (attribute Baudrate).

    `notes` say which files they are of, and what they hold; `faults` what is missing of which file.
    """

    messages: tuple[Any, ...]
    bit_rate: float | None
    notes: tuple[str, ...] = ()
    faults: tuple[tuple[Path, Fault], ...] = ()


def load_databases(paths: Sequence[Path]) -> tuple[Any, ...]:
    """Messages of all databases. Raises ConfigurationError where one cannot be read, or where there is none."""
    return read_databases(paths).messages


def read_databases(paths: Sequence[Path]) -> Databases:
    """All that is taken from databases. Raises ConfigurationError as load_databases does."""
    from cantools.database import load_file
    from cantools.database.errors import Error

    if not paths:
        raise ConfigurationError(
            "a CAN log needs a database to decode it, and none is given",
            advice="name it in the rig file ([recording] dbc = [...]) or with --dbc",
        )
    messages, rates, notes, found = list[Any](), list[float](), list[str](), list[tuple[Path, Fault]]()
    for path in paths:
        try:
            # Not strict: databases in use have overlapping signals in messages that do not matter here.
            database = load_file(path, strict=False)
            content = path.read_bytes()
        except OSError as error:
            raise ConfigurationError(f"cannot read the CAN database: {error.strerror or error}", file=path) from error
        except (Error, ValueError) as error:
            raise ConfigurationError(
                f"not a CAN database that can be used: {_first_line(error)}",
                file=path,
                expected="a .dbc, .arxml, .kcd or .sym file",
            ) from error
        messages += getattr(database, "messages", [])
        rates += _bit_rates(database)
        notes.append(_held(path, content, database))
        if getattr(database, "dbc", None):
            found += ((path, fault) for fault in faults(content.decode("cp1252", "replace")))
    return Databases(tuple(messages), rates[0] if len(set(rates)) == 1 else None, tuple(notes), tuple(found))


def _held(path: Path, content: bytes, database: Any) -> str:
    messages = getattr(database, "messages", [])
    size = f"{counted(len(messages), 'message')}, {counted(sum(len(m.signals) for m in messages), 'signal')}"
    return f"CAN database {path.name}: {size}, SHA-256 {hashlib.sha256(content).hexdigest()}"


def _bit_rates(database: Any) -> list[float]:
    """Baudrate, an attribute of a DBC file, in bit/s (0: not stated)."""
    attributes = getattr(getattr(database, "dbc", None), "attributes", None) or {}
    stated = getattr(attributes.get("Baudrate"), "value", None)
    return [float(stated)] if isinstance(stated, (int, float)) and stated > 0 else []


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
