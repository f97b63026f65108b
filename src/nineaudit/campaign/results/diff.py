"""What changed between two editions of a lake, or two lakes: both are walked side by side in the order of the uris."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any, Final

from nineaudit.campaign.entries import Damaged, chosen, current_entries
from nineaudit.campaign.lake import Lake, open_lake
from nineaudit.campaign.results.rows import verdicts
from nineaudit.report.numbers import printable

SCHEMA: Final = "nineaudit/campaign-diff/1"
SAME, CHANGED, DAMAGED = 0, 1, 3
"""Exit codes."""
_SIDE = re.compile(r"(?P<lake>.+)@(?P<edition>[0-9a-f]{4,12})")


@dataclass(frozen=True)
class Said:
    """What an entry says of a recording, as far as two are compared; `rules`: code -> weightiest verdict."""

    uri: str
    verdict: str
    status: str | None
    culprits: tuple[str, ...]
    rules: Mapping[str, str]
    reason: str | None


@dataclass(frozen=True)
class Change:
    """A recording of which two sides say different things; None: a side does not have it."""

    base: Said | None
    head: Said | None

    @property
    def uri(self) -> str:
        one = self.base or self.head
        assert one is not None
        return one.uri

    @property
    def rules(self) -> dict[str, tuple[str | None, str | None]]:
        """Rules whose verdict changed: (before, after); None where there was no such rule."""
        before, after = (side.rules if side else {} for side in (self.base, self.head))
        codes = sorted({*before, *after})
        return {c: (before.get(c), after.get(c)) for c in codes if before.get(c) != after.get(c)}


@dataclass(frozen=True)
class Side:
    """One side of a comparison."""

    lake: Lake
    edition: str


@dataclass(frozen=True)
class Difference:
    """The changes between two sides, sorted by uri, of how many recordings that both have."""

    base: Side
    head: Side
    both: int
    changes: tuple[Change, ...]
    damaged: tuple[Damaged, ...]

    @property
    def exit_code(self) -> int:
        return DAMAGED if self.damaged else CHANGED if self.changes else SAME


def side(text: str) -> Side:
    """``LAKE`` or ``LAKE@EDITION``. ConfigurationError: no lake, no such edition."""
    found = _SIDE.fullmatch(text)
    lake = open_lake(found["lake"] if found else text)
    return Side(lake, chosen(lake, found["edition"] if found else None))


def difference(base: Side, head: Side) -> Difference:
    """Everything of which the two sides say different things."""
    damaged: list[Damaged] = []
    both, changes = 0, []
    sides = [map(said, current_entries(one.lake, one.edition, damaged)) for one in (base, head)]
    for before, after in paired(*sides):
        both += before is not None and after is not None
        if _told(before) != _told(after):
            changes.append(Change(before, after))
    return Difference(base, head, both, tuple(changes), tuple(damaged))


def said(entry: Mapping[str, Any]) -> Said:
    """What an entry says."""
    result = entry["result"]
    diagnosis = result.get("diagnosis") or {}
    return Said(
        entry["uri"],
        result["verdict"],
        diagnosis.get("status"),
        tuple(diagnosis.get("channels", ())),
        verdicts(result),
        result.get("reason"),
    )


def paired(base: Iterable[Said], head: Iterable[Said]) -> Iterator[tuple[Said | None, Said | None]]:
    """Two sorted streams as pairs of the same uri, with None where one has no such recording."""
    ones, others = iter(base), iter(head)
    one, other = next(ones, None), next(others, None)
    while one is not None or other is not None:
        if other is None or (one is not None and one.uri < other.uri):
            yield one, None
            one = next(ones, None)
        elif one is None or other.uri < one.uri:
            yield None, other
            other = next(others, None)
        else:
            yield one, other
            one, other = next(ones, None), next(others, None)


def _told(one: Said | None) -> tuple[Any, ...] | None:
    """What counts as a change; the words of a reason do not."""
    return None if one is None else (one.verdict, one.status, one.culprits, dict(one.rules))


def lines(found: Difference) -> list[str]:
    """The text: a line a recording, then what is damaged, then the sum."""
    told = [f"{printable(change.uri)}: {_line(change)}" for change in found.changes]
    told += [f"{printable(one.place)}: cannot be used: {printable(one.why)}" for one in found.damaged]
    moved = transitions(found)
    told += [f"{n} {pair}" for pair, n in moved.items()]
    counts = f"{_count(found, 'both')} of {found.both} changed"
    return [*told, f"{counts}, {_count(found, 'base')} only in the base, {_count(found, 'head')} only in the head"]


def document(found: Difference) -> dict[str, Any]:
    """The same for machines."""
    return {
        "schema": SCHEMA,
        "base": {"lake": found.base.lake.uri, "edition": found.base.edition},
        "head": {"lake": found.head.lake.uri, "edition": found.head.edition},
        "recordings": found.both,
        "verdicts": transitions(found),
        "changed": [
            {
                "uri": c.uri,
                "base": _summary(c.base),
                "head": _summary(c.head),
                "rules": {code: {"base": a, "head": b} for code, (a, b) in c.rules.items()},
            }
            for c in found.changes
            if c.base and c.head
        ],
        "only_base": [c.uri for c in found.changes if c.head is None],
        "only_head": [c.uri for c in found.changes if c.base is None],
        "damaged": [{"place": one.place, "why": one.why} for one in found.damaged],
    }


def transitions(found: Difference) -> dict[str, int]:
    """``pass -> fail``: how many, the most frequent first."""
    pairs = [(c.base.verdict, c.head.verdict) for c in found.changes if c.base and c.head]
    counts = Counter(f"{_spoken(a)} -> {_spoken(b)}" for a, b in pairs if a != b)
    return dict(sorted(counts.items(), key=lambda item: (-item[1], item[0])))


def _count(found: Difference, where: str) -> int:
    kinds = ["head" if c.base is None else "base" if c.head is None else "both" for c in found.changes]
    return kinds.count(where)


def _line(change: Change) -> str:
    before, after = change.base, change.head
    if before is None or after is None:
        only = before or after
        assert only is not None
        return f"only in the {'base' if before else 'head'}: {_spoken(only.verdict)}"
    parts = [f"{_spoken(before.verdict)} -> {_spoken(after.verdict)}"] if before.verdict != after.verdict else []
    if (before.status, before.culprits) != (after.status, after.culprits):
        parts.append(f"{_diagnosis(before)} -> {_diagnosis(after)}")
    parts += [f"{code} {_spoken(a)} -> {_spoken(b)}" for code, (a, b) in change.rules.items()]
    return "; ".join(parts)


def _diagnosis(one: Said) -> str:
    names = ", ".join(map(printable, one.culprits))
    return f"{one.status or 'no diagnosis'} ({names})" if names else one.status or "no diagnosis"


def _summary(one: Said | None) -> dict[str, Any] | None:
    if one is None:
        return None
    return {"verdict": one.verdict, "status": one.status, "channels": list(one.culprits), "reason": one.reason}


def _spoken(verdict: str | None) -> str:
    return "absent" if verdict is None else verdict.replace("_", " ")
