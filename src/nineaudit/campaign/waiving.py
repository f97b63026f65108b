"""Waivers in a campaign: a recording has a name, which need not be a path, and may be audited as a copy elsewhere."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import fields
from fnmatch import fnmatchcase
from pathlib import Path

from nineaudit.campaign.places import is_local, local_path, name_of
from nineaudit.waivers import Waiver


class _Fitting(Waiver):
    """A waiver that is known to be for the recording that is audited, wherever that lies."""

    def fits(self, recording: Path) -> bool:  # noqa: ARG002
        return True


def fits(waiver: Waiver, uri: str) -> bool:
    """Whether a waiver is for a recording, by its file name, its whole name, or its path where it is local."""
    named = fnmatchcase(name_of(uri), waiver.recordings) or fnmatchcase(uri, waiver.recordings)
    return named or (is_local(uri) and waiver.fits(local_path(uri)))


def for_this(waivers: Sequence[Waiver], uri: str) -> tuple[Waiver, ...]:
    """The waivers for a recording, whatever the path of its copy."""
    return tuple(_Fitting(**{one.name: getattr(w, one.name) for one in fields(w)}) for w in waivers if fits(w, uri))


def unmatched(waivers: Sequence[Waiver], uris: Collection[str]) -> tuple[Waiver, ...]:
    """The waivers that are for none of the recordings of a campaign."""
    return tuple(waiver for waiver in waivers if not any(fits(waiver, uri) for uri in uris))
