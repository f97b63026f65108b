"""Whether a channel-frequency-class filter has acted on a recording already, as a note to its budget."""

from __future__ import annotations

from nineaudit.case import Case
from nineaudit.physics import filters


def note(case: Case) -> str | None:
    """A sentence where the rig states a class or the noise at rest shows one; None where there is neither.

    What is seen in the noise and what is stated are told apart, and both warn of filtering once more.
    """
    recording, rest = case.recording, case.rest
    stated = recording.rig.cfc
    noise = None if rest is None else recording.readings[rest.samples]
    seen = None if noise is None else filters.class_of_noise(noise, recording.rate)
    if stated is None and seen is None:
        return None
    again = "do not filter to it again: twice is −6 dB at its corner"
    if seen is None:
        return f"the rig states CFC{stated:g}, which the noise at rest neither shows nor denies; {again}"
    if stated is None:
        return f"the rig states no filter, but the noise at rest looks like CFC{seen:g}; {again}"
    if seen < stated:
        return f"the rig states CFC{stated:g}, but the noise at rest looks like CFC{seen:g}; {again}"
    return f"the noise at rest shows the filter that the rig states, CFC{stated:g}; {again}"
