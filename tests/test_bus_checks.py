"""CB: what the reader counted in a CAN log, and silence about anything else."""

from __future__ import annotations

from dataclasses import replace

import pytest

from cases import recording_of
from nineaudit.case import Case
from nineaudit.checks.bus import error_frames, undecodable_frames
from nineaudit.finding import Measure, NotApplicable

RECORDING = recording_of({"motion": "drop", "duration": 0.02})


def case(**counts: float) -> Case:
    return Case(replace(RECORDING, source=replace(RECORDING.source, counts=counts)))


def test_a_recording_that_is_no_can_log_is_not_judged() -> None:
    for check in (error_frames, undecodable_frames):
        assert isinstance(check(case(), max_frames=0), NotApplicable)
        assert isinstance(check(case(messages=100, undecodable_messages=3), max_frames=0), NotApplicable)


@pytest.mark.parametrize("count", [0, 1, 14])
def test_error_frames_are_counted(count: int) -> None:
    measure = error_frames(case(frames=5000, error_frames=count), max_frames=3)
    assert isinstance(measure, Measure)
    assert (measure.value, measure.limit, measure.u) == (count, 3, 0)


def test_short_and_undecodable_frames_are_counted_together() -> None:
    measure = undecodable_frames(case(frames=5000, short_frames=3, undecodable_frames=2), max_frames=0)
    assert isinstance(measure, Measure)
    assert measure.value == 5
    assert measure.detail == "of 5000 frames, 2 not decodable and 3 too short:"
