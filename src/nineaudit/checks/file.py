"""RQ106-107: could the file be read from its first byte to its last, and is what it holds measured?"""

from __future__ import annotations

from collections.abc import Callable, Sequence

from nineaudit.case import Case
from nineaudit.finding import Measure
from nineaudit.provenance import Remade


def whole(case: Case, *, max_places: int) -> Sequence[Measure]:
    """RQ106: one answer for each kind of damage, with the place of the first and what is lost."""
    damage = case.recording.source.damage
    if not damage:
        return [Measure(0.0, float(max_places), "places", detail="damaged:")]
    return [Measure(float(x.count), float(max_places), "places", detail=f"{x};") for x in damage]


def measured(case: Case, *, max_samples: int) -> Sequence[Measure]:
    """RQ107: one answer for each channel that a repair made, or one that none did."""
    if not case.recording.remade:
        return [Measure(0.0, float(max_samples), "samples", detail="reconstructed:")]
    return [
        Measure(
            value=float(made.samples),
            limit=float(max_samples),
            unit="samples",
            channels=(made.channel,),
            interval=(made.stretches[0][0], made.stretches[-1][1]) if made.stretches else None,
            detail=_said(made),
        )
        for made in case.recording.remade
    ]


def _said(made: Remade) -> str:
    how = "made of the other channels, so that it agrees with them is no evidence" if made.from_others else made.method
    return f"reconstructed, not measured ({how}):"


CHECKS: dict[str, Callable[..., Sequence[Measure]]] = {"RQ106": whole, "RQ107": measured}
