"""CB: did each message of the CAN bus come as its database says? Counted by the reader, frame by frame (bus.py)."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from nineaudit.bus import Identifier
from nineaudit.case import Case
from nineaudit.checks.bus import NO_BUS, Answer
from nineaudit.finding import Measure, NotApplicable
from nineaudit.units import counted

_FEW = 3
"""Frames without which nothing is said of a message that stands still."""


def cycle_time(case: Case, *, max_part: float) -> Answer:
    """CB104: median interval against the database's cycle time."""

    def off(x: Identifier) -> float:
        return abs(x.interval / x.cycle - 1.0) if x.cycle else 0.0

    return _worst(
        case,
        lambda x: x.cycle is not None and x.interval == x.interval,
        off,
        max_part,
        "no message in this log has a cycle time in the database",
        lambda x: f"every {1e3 * x.interval:.4g} ms, cycle time {1e3 * (x.cycle or 0.0):g} ms, off by",
    )


def evenness(case: Case, *, max_part: float) -> Answer:
    """CB105: scatter of the intervals of messages that the rig uses."""
    return _worst(
        case,
        lambda x: x.used and x.interval > 0.0,
        lambda x: x.jitter / x.interval,
        max_part,
        "no message of the rig has three frames at different times",
        lambda x: f"every {1e3 * x.interval:.4g} ms, scattered by {1e3 * x.jitter:.3g} ms, part",
    )


def message_counters(case: Case, *, max_frames: int) -> Answer:
    """CB106: numbers that are missing or repeated."""
    return _total(
        case,
        lambda x: bool(x.counters),
        lambda x: sum(c.missing + c.repeated for c in x.counters),
        max_frames,
        "frames",
        "no signal that is named a counter counts the frames of its message",
        lambda x: ", ".join(f"{c.signal} misses {c.missing} and repeats {c.repeated}" for c in x.counters),
    )


def message_checksums(case: Case, *, max_frames: int) -> Answer:
    """CB107: frames that do not follow the checksum that the others follow."""
    return _total(
        case,
        lambda x: any(c.method for c in x.checksums),
        lambda x: sum(c.wrong for c in x.checksums),
        max_frames,
        "frames",
        "no signal is named a checksum, or none follows a known method",
        lambda x: ", ".join(
            f"{c.signal} ({c.method}) is wrong {counted(c.wrong, 'time')}" for c in x.checksums if c.method
        ),
    )


def lengths(case: Case, *, max_frames: int) -> Answer:
    """CB108: frames longer or shorter than their message."""
    return _total(
        case,
        lambda x: x.length is not None,
        lambda x: x.longer + x.shorter,
        max_frames,
        "frames",
        "the database knows no message of this log",
        lambda x: f"{x.longer} longer and {x.shorter} shorter than {x.length} bytes",
    )


def ranges(case: Case, *, max_samples: int) -> Answer:
    """CB109: values that the database calls impossible."""
    return _total(
        case,
        lambda x: x.length is not None,
        lambda x: sum(o.count for o in x.outside),
        max_samples,
        "samples",
        "the database knows no message of this log",
        lambda x: ", ".join(
            f"{o.signal} reads {o.worst:.6g}, range {o.low:g} to {o.high:g} {o.unit}" for o in x.outside
        ),
    )


def no_value(case: Case, *, max_samples: int) -> Answer:
    """CB110: codes for "not available" among the messages that the rig uses."""
    return _total(
        case,
        lambda x: x.used,
        lambda x: sum(n for _, n in x.unavailable),
        max_samples,
        "samples",
        "the rig takes no message from this log",
        lambda x: ", ".join(f"{name} has no value in {n}" for name, n in x.unavailable),
    )


def standing_still(case: Case, *, max_messages: int) -> Answer:
    """CB111: messages that the rig uses whose data never change."""
    return _total(
        case,
        lambda x: x.used and x.frames >= _FEW,
        lambda x: int(x.constant),
        max_messages,
        "messages",
        f"no message of the rig has {_FEW} frames",
        lambda x: f"all {x.frames} frames are equal",
    )


def _named(x: Identifier, case: Case) -> str:
    """The message, with its bus where the log has several."""
    buses = {y.bus for y in case.recording.bus.identifiers} if case.recording.bus else set()
    return f"{x.label} on bus {x.bus}" if len(buses) > 1 else x.label


def _held(
    case: Case,
    whose: Callable[[Identifier], bool],
    unless: str,
    size: Callable[[Identifier], float],
    measured: Callable[[Sequence[Identifier], Identifier], Measure],
) -> Answer:
    """What is `measured` of the messages concerned and of the largest of them."""
    bus = case.recording.bus
    if bus is None:
        return NO_BUS
    found = [x for x in bus.identifiers if whose(x)]
    return measured(found, max(found, key=size)) if found else NotApplicable(unless)


def _worst(
    case: Case,
    whose: Callable[[Identifier], bool],
    value: Callable[[Identifier], float],
    limit: float,
    unless: str,
    told: Callable[[Identifier], str],
) -> Answer:
    """The largest value of a message; how many others are beyond the limit is said."""

    def measured(found: Sequence[Identifier], worst: Identifier) -> Measure:
        beyond = sum(value(x) > limit for x in found)
        others = f" ({beyond} of {len(found)} messages beyond)" if beyond > 1 else ""
        return Measure(value(worst), limit, "1", detail=f"{_named(worst, case)}{others}: {told(worst)}")

    return _held(case, whose, unless, value, measured)


def _total(
    case: Case,
    whose: Callable[[Identifier], bool],
    count: Callable[[Identifier], int],
    limit: int,
    unit: str,
    unless: str,
    told: Callable[[Identifier], str],
) -> Answer:
    """Sum over the messages; the one with most is said."""

    def measured(found: Sequence[Identifier], worst: Identifier) -> Measure:
        total, others = sum(map(count, found)), sum(count(x) > 0 for x in found) - 1
        more = f", and {counted(others, 'more message')}" if others > 0 else ""
        said = f"{_named(worst, case)}: {told(worst)}{more}; in all" if total else f"{counted(len(found), 'message')},"
        return Measure(float(total), float(limit), unit, detail=said)

    return _held(case, whose, unless, count, measured)


CHECKS: dict[str, Callable[..., Answer]] = {
    "CB104": cycle_time,
    "CB105": evenness,
    "CB106": message_counters,
    "CB107": message_checksums,
    "CB108": lengths,
    "CB109": ranges,
    "CB110": no_value,
    "CB111": standing_still,
}
