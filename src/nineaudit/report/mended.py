"""What was done to a channel, in words: rebuilt from the others, a fault undone, or two channels exchanged back."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from nineaudit.report.text import fault_word, joined
from nineaudit.units import counted

if TYPE_CHECKING:
    from nineaudit.auditing import Audit
    from nineaudit.reconstruct import Reconstruction
    from nineaudit.recording import Recording

_STAYS = "The original recording is not altered."


def words(new: Reconstruction) -> dict[str, Any]:
    """`title` of the section, its `lead`, the word for the channel after it (`now`), and what the others were for."""
    if new.fault is None:
        what = "The rebuilt channel is" if new.replaced.all() else "The samples that were replaced are"
        lead = f"{_STAYS} {what} an estimate from the other channels, valid within the stated uncertainty."
        return {"title": "Rebuilt channel", "lead": lead, "now": "rebuilt", "donors": "Rebuilt from"}
    if new.fault == "swap":
        lead = f"{_STAYS} Nothing was estimated: each of the two is what was recorded as the other."
        return {"title": "Channels exchanged back", "lead": lead, "now": "exchanged", "donors": "Exchanged"}
    lead = (
        f"{_STAYS} The channel was not rebuilt: its own readings stay, with their noise, and only the "
        f"{fault_word(new.fault)} was undone. How large it was follows from the other channels."
    )
    return {"title": "Corrected channel", "lead": lead, "now": "corrected", "donors": "Held against"}


def done(new: Reconstruction) -> str:
    """What was done, as the beginning of a sentence."""
    channels, size = (
        joined(new.channels),
        f"{int(new.replaced.any(axis=1).sum())} of {counted(len(new.replaced), 'sample')}",
    )
    if new.fault is None:
        return f"{channels} was rebuilt from the other channels at {size}"
    if new.fault == "swap":
        return f"{channels} were exchanged back"
    return f"in {channels} the {fault_word(new.fault)} was undone at {size}, its readings otherwise as measured"


def sentences(audit: Audit) -> list[str]:
    """For the verdict: what of the recording was made by an earlier repair, and what this audit proposes."""
    said = _earlier(audit.recording)
    new = audit.reconstruction
    if new is not None:
        text = done(new)
        said.append(f"Repair: {text}. The verdict is on the recording as it was read, without that.")
    return said


def _earlier(recording: Recording) -> list[str]:
    names = tuple(dict.fromkeys(made.channel for made in recording.remade))
    if not names:
        return []
    return [f"Not as measured in this recording: {', '.join(names)}, by an earlier repair."]
