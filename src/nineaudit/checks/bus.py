"""CB: did the CAN bus deliver what was sent? Counted by the reader, frame by frame (bus.py)."""

from __future__ import annotations

from nineaudit.case import Case
from nineaudit.finding import Measure, NotApplicable

NO_BUS = NotApplicable("the recording is not a CAN log")
Answer = Measure | NotApplicable


def error_frames(case: Case, *, max_frames: int) -> Answer:
    """CB101: error and overload frames in the log."""
    counts = case.recording.source.counts
    if "frames" not in counts:
        return NO_BUS
    errors, overload = counts.get("error_frames", 0.0), counts.get("overload_frames", 0.0)
    return Measure(
        value=float(errors + overload),
        limit=float(max_frames),
        unit="frames",
        detail=f"of {counts['frames']:.0f} frames, error{' and overload' if overload else ''} frames:",
    )


def undecodable_frames(case: Case, *, max_frames: int) -> Answer:
    """CB102: frames of a message that the database knows, which it could not decode: too short, or out of form."""
    counts = case.recording.source.counts
    if "frames" not in counts:
        return NO_BUS
    bad, short = counts.get("undecodable_frames", 0.0), counts.get("short_frames", 0.0)
    return Measure(
        value=float(bad + short),
        limit=float(max_frames),
        unit="frames",
        detail=f"of {counts['frames']:.0f} frames, {bad:.0f} not decodable and {short:.0f} too short:",
    )


def load(case: Case, *, max_load: float, bit_rate: float) -> Answer:
    """CB103: the busiest window of the busiest bus. u: how many stuff bits there were is not known."""
    bus = case.recording.bus
    if bus is None or not bus.loads:
        return NO_BUS
    rate = bit_rate or bus.bit_rate
    if not rate:
        return NotApplicable("neither the database (attribute Baudrate) nor the rule (bit_rate) states a bit rate")
    if bus.fd:
        return NotApplicable("the log holds CAN FD frames, whose bits have two rates")
    busiest = max(bus.loads, key=lambda x: x.peak_most)
    low, high = (bits / (rate * busiest.window) for bits in (busiest.peak_least, busiest.peak_most))
    return Measure(
        value=0.5 * (low + high),
        limit=max_load,
        unit="1",
        u=(high - low) / 12**0.5,
        detail=f"bus {busiest.bus}, busiest {busiest.window:g} s, at {rate / 1e3:g} kbit/s, load",
    )


def unknown(case: Case, *, max_part: float) -> Answer:
    """CB112: identifiers that no database knows."""
    bus = case.recording.bus
    if bus is None or not bus.identifiers:
        return NO_BUS
    keys = {x.key: x.name for x in bus.identifiers}
    strange = [key for key, name in keys.items() if name is None]
    detail = f"{len(strange)} of {len(keys)} identifiers are in no database, part"
    return Measure(value=len(strange) / len(keys), limit=max_part, unit="1", detail=detail)


def restarts(case: Case, *, max_restarts: int) -> Answer:
    """CB113: stamps that go back."""
    bus = case.recording.bus
    if bus is None:
        return NO_BUS
    at = "" if bus.first_restart is None else f" first to {bus.first_restart:.6g} s,"
    return Measure(float(bus.restarts), float(max_restarts), "steps", detail=f"time goes back,{at}")


def absent(case: Case, *, max_messages: int) -> Answer:
    """CB114: cyclic messages that never came."""
    bus = case.recording.bus
    if bus is None:
        return NO_BUS
    if not bus.absent and not any(x.cycle for x in bus.identifiers):
        return NotApplicable("the database states no cycle times")
    shown = ", ".join(bus.absent[:5]) + (" and others" if len(bus.absent) > 5 else "")
    detail = f"{shown} never came:" if shown else "messages that never came:"
    return Measure(float(len(bus.absent)), float(max_messages), "messages", detail=detail)


CHECKS = {
    "CB101": error_frames,
    "CB102": undecodable_frames,
    "CB103": load,
    "CB112": unknown,
    "CB113": restarts,
    "CB114": absent,
}
