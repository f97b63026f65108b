"""ISO-MME (ISO/TS 13499), the exchange format of crash tests: a folder, its .mme file, or a ZIP archive of it.

A rig's signal names a channel by its channel code (`?` for any character), by the laboratory's or the customer's code,
or by the name of the channel.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Final

import numpy as np

from nineaudit.array import FloatArray, frozen
from nineaudit.errors import RecordingError
from nineaudit.readers.contents import Contents
from nineaudit.readers.mme import channel as mme_channel
from nineaudit.readers.mme.channel import CODE, FILTER_CLASSES, Channel, parse_header, parse_keys
from nineaudit.readers.mme.files import LARGEST, Test, open_test
from nineaudit.readers.mme.header import statements
from nineaudit.recording import Damage, Trace
from nineaudit.signals import suggestion
from nineaudit.units import counted, factor

if TYPE_CHECKING:
    from nineaudit.rig import Rig

_NAMES: Final = ("channel code", "laboratory channel code", "customer channel code", "name of the channel")
_INDEX: Final = 2**20
"""Bytes of an index that are read: more than its thousands of channels need."""
_SOUND: Final = ("", "ok")
_TREATED: Final = ("scaling factor applied", "linearised data", "linearized data")
_UNITS: Final = {"g": "g_0", "m/(s*s)": "m/s^2", "mm/(s*s)": "mm/s^2", "ft/(s*s)": "ft/s^2", "1": None, "": None}


@dataclass(frozen=True, eq=False)
class _Read:
    """Samples of a channel on its clock."""

    channel: Channel
    time: FloatArray
    values: FloatArray
    missing: int
    damage: tuple[Damage, ...]


def read_mme(path: Path, rig: Rig) -> Contents:
    """Signals of an ISO-MME test: each with its own clock and the unit of its header.

    Samples that are missing are NaN; a status other than ok, a wrong number of samples and files that are damaged are
    Damage. Raises RecordingError: no test, several tests, a missing or doubled channel, a channel without a clock.
    """
    test = open_test(path)
    heads = [parse_header(name, test.store.read(name, mme_channel.HEADER)[0]) for name in test.channels]
    heads, damage = _indexed(test, heads)
    found = [_find(heads, s.signal, s.channel, path) for s in rig.array.sensors]
    read = {name: _read(test, heads, head, path) for name, head in {head.name: head for head in found}.items()}
    longest = max(read.values(), key=lambda r: r.time.size)
    traces = tuple(
        _trace(sensor.channel, sensor.signal, read[head.name], longest)
        for sensor, head in zip(rig.array.sensors, found, strict=True)
    )
    counts = {
        "channels": len(heads),
        "channels_used": len(read),
        "samples": sum(r.values.size for r in read.values()),
        "invalid_samples": sum(r.missing for r in read.values()),
    }
    return Contents(
        traces,
        counts,
        tuple(_notes(found, rig)),
        (*test.store.damage, *damage, *(d for r in read.values() for d in r.damage)),
        stated=statements(test, found),
    )


def _indexed(test: Test, heads: list[Channel]) -> tuple[list[Channel], list[Damage]]:
    """Channels with the code that the index gives where their file has none; and where the two disagree."""
    if test.index is None:
        return heads, [Damage("no index of channels (.chn)", test.header or "the test", lost="the files are read")]
    data, damage = test.store.read(test.index, _INDEX)
    keys = parse_keys(data)
    listed = {int(k[16:]): v for k, v in keys.items() if k.startswith("name of channel ") and k[16:].isdecimal()}
    numbers = {int(head.short.rpartition(".")[2]): head for head in heads}
    absent = sorted(set(listed) - set(numbers))
    out = list(damage)
    if absent:
        out.append(Damage("a channel of the index without a file", f"channel {absent[0]:03d}", len(absent)))
    merged = [_with_code(head, listed.get(i, "")) for i, head in numbers.items()]
    wrong = [head for i, head in numbers.items() if i in listed and head.code not in ("", _code(listed[i]))]
    if wrong:
        what = "another channel code than in the index"
        out.append(Damage(what, wrong[0].short, len(wrong), "that of the file is taken"))
    return merged, out


def _with_code(head: Channel, listed: str) -> Channel:
    if head.code or not listed:
        return head
    return replace(head, keys={**head.keys, "channel code": _code(listed)})


def _code(listed: str) -> str:
    """`11HEAD0000H3ACXA / Head acceleration x` -> the code."""
    return listed.partition("/")[0].strip()


def _find(heads: Sequence[Channel], signal: str, channel: str, path: Path) -> Channel:
    for key in _NAMES:
        hits = [head for head in heads if signal and head.get(key) == signal]
        if key == "channel code" and not hits and CODE.fullmatch(signal):
            hits = [head for head in heads if _matches(head.code, signal)]
        if len(hits) == 1:
            return hits[0]
        if hits:
            raise RecordingError(
                f"channel {channel!r}: {key} {signal!r} is there {len(hits)} times",
                file=path,
                found=", ".join(head.short for head in hits[:8]),
                expected="one",
                advice="name it by another code in the rig file (signal)",
            )
    known = [name for head in heads for name in dict.fromkeys(head.get(key) for key in _NAMES) if name]
    raise RecordingError(
        f"missing channel {channel!r}",
        file=path,
        expected=f"a channel with the code or name {signal!r}",
        advice=suggestion(signal, known),
    )


def _matches(code: str, pattern: str) -> bool:
    return len(code) == len(pattern) and all(p in ("?", c) for c, p in zip(code, pattern, strict=True))


def _read(test: Test, heads: Sequence[Channel], head: Channel, path: Path) -> _Read:
    data, damage = test.store.read(head.name, LARGEST)
    values, missing, more = mme_channel.samples(head, data)
    time, late = _time(test, heads, head, values.size, path)
    size = min(time.size, values.size)
    return _Read(head, time[:size], values[:size], missing, (*head.damage, *damage, *more, *late, *_status(head)))


def _time(
    test: Test, heads: Sequence[Channel], head: Channel, count: int, path: Path
) -> tuple[FloatArray, tuple[Damage, ...]]:
    """(count,) s: by the sampling interval, or as another channel has it (then perhaps fewer)."""
    if head.get("reference channel").lower() == "explicit":
        return _explicit(test, heads, head, count, path)
    step, start = head.number("sampling interval"), head.number("time of first sample")
    if not step > 0:
        raise RecordingError(
            "a channel without a clock",
            file=path,
            place=head.short,
            found=head.keys.get("sampling interval", "no sampling interval"),
            expected="a sampling interval in s, or an explicit reference channel",
        )
    return np.asarray((0.0 if np.isnan(start) else start) + step * np.arange(count), dtype=np.float64), ()


def _explicit(
    test: Test, heads: Sequence[Channel], head: Channel, count: int, path: Path
) -> tuple[FloatArray, tuple[Damage, ...]]:
    clock = _find(heads, head.get("reference channel name"), f"time of {head.code}", path)
    data, damage = test.store.read(clock.name, LARGEST)
    time, _, more = mme_channel.samples(clock, data)
    if time.size != count:
        lost = "what has no partner is left out"
        more.append(Damage(f"{counted(count, 'sample')} for {time.size} times of {clock.short}", head.short, lost=lost))
    place = f"the unit of {clock.short}"
    return time * factor(clock.get("unit") or "s", "time", place=place), (*damage, *more)


def _status(head: Channel) -> tuple[Damage, ...]:
    status = head.get("data status").lower()
    if status in _SOUND + _TREATED:
        return ()
    return (Damage(f"the laboratory's status of the channel is {status!r}", head.short, lost="it is read as it is"),)


def _trace(channel: str, signal: str, read: _Read, longest: _Read) -> Trace:
    """A channel without samples has the clock of the longest, and no reading on it."""
    placed = np.isfinite(read.time)
    time, values = read.time[placed], read.values[placed]
    if not time.size:
        time = longest.time[np.isfinite(longest.time)]
        values = np.full(time.size, np.nan)
    unit = read.channel.get("unit")
    return Trace(channel, signal, frozen(time), frozen(values), _UNITS.get(unit, unit))


def _notes(found: Sequence[Channel], rig: Rig) -> list[str]:
    """What the codes say that the rig does not, or otherwise: filter class, polarity; what was done to the data."""
    notes = []
    pairs = list(zip(rig.array.channels, found, strict=True))
    classes: dict[str, list[str]] = {}
    for channel, head in pairs:
        classes.setdefault(_filter_class(head), []).append(channel)
    for name, channels in classes.items():
        if name not in ("", rig.filter_class):
            notes.append(f"filter class {name} by the header of {', '.join(channels)} (rig: {rig.filter_class})")
    turned = [channel for channel, head in pairs if CODE.fullmatch(head.code) and head.code[14] in "123"]
    if turned:
        notes.append(f"polarity stated as other than that of SAE J211, values taken as they are: {', '.join(turned)}")
    treated = [channel for channel, head in pairs if head.get("data status").lower() in _TREATED]
    if treated:
        notes.append(f"scaled or linearised by the laboratory: {', '.join(treated)}")
    unset = [c for c, head in pairs if _implicit(head) and np.isnan(head.number("time of first sample"))]
    if unset:
        notes.append(f"no time of first sample, taken as 0: {', '.join(unset)}")
    return notes


def _implicit(head: Channel) -> bool:
    return head.get("reference channel").lower() != "explicit"


def _filter_class(head: Channel) -> str:
    """By the header's own entry, else by the last character of the code; "" where neither says."""
    stated = head.get("channel frequency class").upper().removeprefix("CFC").strip()
    if stated.isdecimal():
        return f"CFC{stated}"
    letter = stated or (head.code[15] if CODE.fullmatch(head.code) else "")
    return FILTER_CLASSES.get(letter, "")
