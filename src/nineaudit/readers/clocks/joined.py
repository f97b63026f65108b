"""Several files, each with a clock of its own, as one recording (the rig's parts)."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

from nineaudit.array import frozen
from nineaudit.bus import Bus
from nineaudit.errors import RecordingError
from nineaudit.readers.clocks.offset import Offset, find_offset
from nineaudit.readers.contents import Contents
from nineaudit.recording import Source, Trace

if TYPE_CHECKING:
    from nineaudit.parts import Part
    from nineaudit.rig import Rig

ReadFile = Callable[[Path, "Rig"], tuple[Contents, Source]]


@dataclass(frozen=True)
class Joined:
    """What the files of a recording hold together: all their traces on the clock of the first, the `source` with every
    file in its parts, and the standard uncertainty, s, of the clock of each channel."""

    contents: Contents
    source: Source
    u_clock: dict[str, float]


def join(paths: Sequence[Path], rig: Rig, read_file: ReadFile) -> Joined:
    """The parts of a recording, `paths` in the order of ``rig.parts``.

    Stamps are taken at their word but for a stated offset, or one found by correlation where the rig asks for it.
    Raises RecordingError: as the reader of each file, a part that is not there, an offset that cannot be found.
    """
    for path, part in zip(paths, rig.parts, strict=True):
        if not path.exists():
            expected, advice = f"a file like {part.file}", f"channels {', '.join(part.channels)} are in it"
            raise RecordingError("a part of the recording is not there", file=path, expected=expected, advice=advice)
    read = [read_file(path, _seen_by(part, rig)) for path, part in zip(paths, rig.parts, strict=True)]
    offsets = [
        _offset(part, rig, found, read[0][0], source.path)
        for part, (found, source) in zip(rig.parts, read, strict=True)
    ]
    sources = [source for _, source in read]
    traces = [
        replace(_moved(t, o.value), message=f"{t.message} of {path.name}" if t.message else path.name)
        for path, (found, _), o in zip(paths, read, offsets, strict=True)
        for t in found.traces
    ]
    counts: Counter[str] = Counter()
    for source in sources:
        counts.update(source.counts)
    whole = replace(
        sources[0],
        format="+".join(dict.fromkeys(source.format for source in sources)),
        unchanged_after_read=all(source.unchanged_after_read for source in sources),
        counts=dict(counts),
        notes=(*_notes(sources, offsets), *(f"{s.path.name}: {note}" for s in sources for note in s.notes)),
        damage=tuple(replace(d, place=f"{s.path.name}: {d.place}") for s in sources for d in s.damage),
        parts=tuple(sources),
    )
    u = {c: o.u for part, o in zip(rig.parts, offsets, strict=True) for c in part.channels}
    buses = {path.name: found.bus for path, (found, _) in zip(paths, read, strict=True) if found.bus is not None}
    return Joined(Contents(tuple(traces), bus=_bus(buses)), whole, u)


def _bus(buses: Mapping[str, Bus]) -> Bus | None:
    """The bus of the log among the parts; of several logs all buses, each with its file before its name."""
    logs = list(buses.values())
    if len(logs) < 2:
        return logs[0] if logs else None
    starts = [bus.first_restart for bus in logs if bus.first_restart is not None]
    rates = {bus.bit_rate for bus in logs}
    return Bus(
        identifiers=tuple(replace(x, bus=f"{name} {x.bus}") for name, bus in buses.items() for x in bus.identifiers),
        absent=tuple(name for name in logs[0].absent if all(name in bus.absent for bus in logs)),
        restarts=sum(bus.restarts for bus in logs),
        first_restart=min(starts, default=None),
        loads=tuple(replace(x, bus=f"{name} {x.bus}") for name, bus in buses.items() for x in bus.loads),
        bit_rate=rates.pop() if len(rates) == 1 else None,
        fd=any(bus.fd for bus in logs),
    )


def _seen_by(part: Part, rig: Rig) -> Rig:
    """The rig as far as one file goes."""
    return replace(
        rig,
        array=rig.array.subset(part.channels),
        time_signal=part.time_signal or rig.time_signal,
        time_unit=part.time_unit or rig.time_unit,
        parts=(),
    )


def _offset(part: Part, rig: Rig, found: Contents, first: Contents, path: Path) -> Offset:
    if not part.correlate:
        return Offset(part.offset, part.u_offset, None)
    kinds = {rig.array[trace.channel].kind for trace in found.traces}
    alike = [t for t in first.traces if rig.array[t.channel].kind in kinds]
    kinds &= {rig.array[trace.channel].kind for trace in alike}
    return find_offset(alike, [t for t in found.traces if rig.array[t.channel].kind in kinds], path)


def _moved(trace: Trace, offset: float) -> Trace:
    return replace(trace, time=frozen(trace.time + offset)) if offset else trace


def _notes(sources: Sequence[Source], offsets: Sequence[Offset]) -> list[str]:
    said = [f"{len(sources)} files are one recording, on the clock of {sources[0].path.name}"]
    for source, offset in zip(sources[1:], offsets[1:], strict=True):
        if offset.explained is not None:
            how = f"found by correlation, which explains {offset.explained:.1%} of its variance"
        elif offset.value or offset.u:
            how = "as the rig states"
        else:
            said.append(f"{source.path.name}: its time stamps are taken at their word against that clock")
            continue
        said.append(f"{source.path.name}: {offset.value:+.9g} s added to its time stamps, ± {offset.u:.2g} s, {how}")
    return said
