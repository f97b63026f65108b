"""CB: did the CAN bus deliver what was sent? Counted by the reader, frame by frame."""

from __future__ import annotations

from nineaudit.case import Case
from nineaudit.finding import Measure, NotApplicable

NO_BUS = NotApplicable("the recording is not a CAN log")


def error_frames(case: Case, *, max_frames: int) -> Measure | NotApplicable:
    """CB101: error frames in the log."""
    counts = case.recording.source.counts
    if "frames" not in counts:
        return NO_BUS
    return Measure(
        value=float(counts.get("error_frames", 0.0)),
        limit=float(max_frames),
        unit="frames",
        detail=f"of {counts['frames']:.0f} frames, error frames:",
    )


def undecodable_frames(case: Case, *, max_frames: int) -> Measure | NotApplicable:
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


CHECKS = {"CB101": error_frames, "CB102": undecodable_frames}
