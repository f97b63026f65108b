"""RQ106: could the file be read from its first byte to its last?"""

from __future__ import annotations

from collections.abc import Sequence

from nineaudit.case import Case
from nineaudit.finding import Measure


def whole(case: Case, *, max_places: int) -> Sequence[Measure]:
    """RQ106: one answer for each kind of damage, with the place of the first and what is lost."""
    damage = case.recording.source.damage
    if not damage:
        return [Measure(0.0, float(max_places), "places", detail="damaged:")]
    return [Measure(float(x.count), float(max_places), "places", detail=f"{x};") for x in damage]


CHECKS = {"RQ106": whole}
