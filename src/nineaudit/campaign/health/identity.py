"""Which recordings of a campaign count, and what its rigs and sensors are called.

**Recordings.** ln L adds up over recordings because their noise is independent. Of the same readings n times it is not:
n ln L makes every Z and 1/U larger by √n, and nothing more is known. So what is of the same bytes (SHA-256), or of what
a repair made of them (SHA-256 of the original), counts once for each channel.

**Rigs.** A seat is a place in one piece of hardware. That is known by the name of the rig, and where tests of one name
are on several items that last, by the item's serial number too.

**Sensors.** A gain is that of one channel. A serial number that stands on several channels (a triaxial block, an IMU)
is so many sensors, told apart by their kind and their place among those of the kind.
"""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Final

from nineaudit.identity import is_date
from nineaudit.rig import Rig
from nineaudit.units import counted

LASTING: Final = 6
"""Recordings an item, on the average: of fewer the item is what is tested, not what the rig sits in."""
LISTED: Final = 5
"""Names in a note; of more it is said how many."""


@dataclass(frozen=True, eq=False)
class Told:
    """A recording that tells a calibration: what is `known` of its test, its `uri`, name and SHA-256 of its rig file,
    and its block `sensors`."""

    known: Mapping[str, Any]
    uri: str
    rig_name: str
    rig_sha256: str
    block: Mapping[str, Any]
    files: tuple[str, ...]
    """SHA-256 of each of its files."""
    originals: tuple[str, ...]
    """SHA-256 of the recordings that it was made from by repairs."""

    @property
    def item(self) -> str:
        """Serial number of the item; "" where it is not stated."""
        return str(self.known.get("item_serial") or "").strip()


@dataclass(frozen=True, eq=False)
class Names:
    """What rigs and sensors are called: `divided`, names of rigs that stand for several, one an item; `shared`, most
    channels of a (serial number, kind) in a recording, of serial numbers that stand for several sensors."""

    divided: frozenset[str] = frozenset()
    shared: Mapping[tuple[str, str], int] = field(default_factory=dict)

    def rig(self, name: str, item: str) -> str:
        """The rig of this name that sits in an item."""
        return f"{name} [{item}]" if item and name in self.divided else name

    def sensors(self, rig: str, channels: Iterable[Mapping[str, Any]]) -> dict[str, str]:
        """Channel -> its sensor, of all `channels` of a recording or rig (keys channel, serial, kind), in order."""
        listed = list(channels)
        number, all_ = Counter[tuple[str, str]](), _counts(listed)
        out = {}
        for one in listed:
            channel, serial, kind = _who(one)
            number[serial, kind] += 1
            of = number[serial, kind], all_[serial, kind]
            out[channel] = self._sensor(serial, kind, *of) if serial else f"{rig}/{channel}"
        return out

    def _sensor(self, serial: str, kind: str, number: int, count: int) -> str:
        most = self.shared.get((serial, kind))
        if most is None:
            return serial
        if most == 1:
            return f"{serial} {kind}"
        # where only some of its channels are, nobody says which: those are sensors of their own
        return f"{serial} {kind} {number}" + (f" of {count}" if count < most else "")


def of_rig_file(names: Names, rig: Rig) -> tuple[str, dict[str, str]]:
    """What a campaign calls a rig, as its file states it, and channel -> sensor."""
    item = next((one.value for one in rig.test if one.key == "item_serial"), "")
    called = names.rig(rig.name, item)
    channels = ({"channel": s.channel, "serial": s.serial, "kind": s.kind} for s in rig.array.sensors)
    return called, names.sensors(called, channels)


def tellers(entries: Iterable[Mapping[str, Any]]) -> tuple[list[Told], list[str]]:
    """Those of `entries` that tell a calibration, the same readings once, and notes on the others."""
    found: list[Told] = []
    why = Counter[str]()
    for entry in entries:
        block = (entry.get("result") or {}).get("sensors") or {}
        if (block.get("information") or {}).get("parameters"):
            found.append(_told(entry, block))
        else:
            why[_silent(block)] += 1
    notes = [f"no calibration from {counted(count, 'recording')}: {reason}" for reason, count in sorted(why.items())]
    kept, doubles = _once(found)
    return kept, [*notes, *doubles, *_alike(kept)]


def names_of(found: Sequence[Told]) -> tuple[Names, list[str]]:
    """What the rigs and sensors of these recordings are called, and notes on what is taken for what."""
    divided, notes = _divided(found)
    shared = _shared(found)
    names = Names(divided, shared)
    if shared:
        notes.append(
            "on several channels, each of which is taken as a sensor of its own, by kind in the order of the rig's "
            f"channels: {_some(sorted({serial for serial, _ in shared}))}"
        )
    return names, [*notes, *_one_name(found, names)]


def _told(entry: Mapping[str, Any], block: Mapping[str, Any]) -> Told:
    result = entry["result"]
    rig, source = result["rig"], result.get("recording") or {}
    files = [part["sha256"] for part in source.get("parts") or [source] if part.get("sha256")]
    made = dict.fromkeys(one["original_sha256"] for one in source.get("reconstructed", ()))
    return Told(
        known={**(result.get("test") or {}), **(entry.get("test") or {})},
        uri=entry["uri"],
        rig_name=str(rig["name"]),
        rig_sha256=str(rig.get("sha256") or ""),
        block=block,
        files=tuple(files),
        originals=tuple(one for one in made if one),
    )


def _silent(block: Mapping[str, Any]) -> str:
    if block.get("information") is not None:
        return "its rig leaves no error open"
    return block.get("fit") or "audited by a version that did not say it, or not audited"


def _once(found: Sequence[Told]) -> tuple[list[Told], list[str]]:
    """Each reading once: that which was repaired least, then one whose date is known, then the first by name."""
    owner: dict[tuple[str, str], Told] = {}
    double: dict[Told, str] = {}
    for one in sorted(found, key=lambda t: (len(t.originals), not is_date(str(t.known.get("date"))[:10]), t.uri)):
        channels = [str(c["channel"]) for c in one.block["channels"]]
        whole = ["+".join(sorted(one.files))] if one.files else []
        keys = [(content, channel) for content in (*whole, *one.originals) for channel in channels]
        same = next((owner[key] for key in keys if key in owner), None)
        if same is not None:
            how = "the bytes of" if same.files == one.files else "repaired, the readings of"
            double[one] = f"{one.uri} ({how} {same.uri})"
        for key in (*keys, *((content, channel) for content in one.files[:1] for channel in channels)):
            owner.setdefault(key, same or one)  # the record of a repair names the first file
    count = counted(len(double), "recording")
    notes = [f"left out, for their readings are counted already: {count}: {_some(list(double.values()))}"]
    return [one for one in found if one not in double], notes if double else []


def _alike(found: Sequence[Told]) -> list[str]:
    """A note on recordings that may be the same test in other bytes: of one number, date and rig."""
    tests: dict[tuple[str, ...], list[str]] = defaultdict(list)
    for one in found:
        if one.known.get("number"):
            tests[str(one.known["number"]), str(one.known.get("date") or "no date"), one.rig_name].append(one.uri)
    said = [f"{', '.join(test)} ({_some(uris)})" for test, uris in sorted(tests.items()) if len(uris) > 1]
    if not said:
        return []
    advice = "where they are one recording in several files (formats, repairs), keep one of them"
    return [f"of the same test, rig and date, each counted as another recording: {_some(said)}; {advice}"]


def _divided(found: Sequence[Told]) -> tuple[frozenset[str], list[str]]:
    """Names of rigs that are of several items, and a note on those whose items do not last."""
    items: dict[str, list[str]] = defaultdict(list)
    for one in found:
        if one.item:
            items[one.rig_name].append(one.item)
    several = {name: (len(on), len(set(on))) for name, on in sorted(items.items()) if len(set(on)) > 1}
    lasting = frozenset(name for name, (tests, count) in several.items() if tests >= LASTING * count)
    left = [
        f"{name} ({counted(tests, 'test')} of {counted(count, 'item')})"
        for name, (tests, count) in several.items()
        if name not in lasting
    ]
    return lasting, [f"taken as one rig, for the item is another in most tests: {_some(left)}"] if left else []


def _shared(found: Sequence[Told]) -> dict[tuple[str, str], int]:
    """Most channels of a recording by serial number and kind, of serial numbers that are more than one sensor."""
    most: dict[tuple[str, str], int] = {}
    for one in found:
        for key, count in _counts(one.block["channels"]).items():
            most[key] = max(most.get(key, 0), count)
    kinds = Counter(serial for serial, _ in most)
    return {key: count for key, count in most.items() if key[0] and (count > 1 or kinds[key[0]] > 1)}


def _one_name(found: Sequence[Told], names: Names) -> list[str]:
    """Notes on rigs of several rig files, and on what is left where others of the name are divided."""
    files: dict[str, set[str]] = defaultdict(set)
    for one in found:
        files[names.rig(one.rig_name, one.item)] |= {one.rig_sha256} - {""}
    said = [f"{rig} ({len(of)} rig files)" for rig, of in sorted(files.items()) if len(of) > 1]
    advice = "where they are several, name them apart ([rig] name, or item_serial of [test])"
    notes = [f"taken as one rig that was stated anew: {_some(said)}; {advice}"] if said else []
    rest = sorted(names.divided & files.keys())
    return [*notes, f"a rig of its own, for want of the item's serial number: {_some(rest)}"] if rest else notes


def _counts(channels: Iterable[Mapping[str, Any]]) -> Counter[tuple[str, str]]:
    return Counter((serial, kind) for _, serial, kind in map(_who, channels))


def _who(channel: Mapping[str, Any]) -> tuple[str, str, str]:
    return str(channel["channel"]), str(channel["serial"] or ""), str(channel["kind"])


def _some(names: Sequence[str]) -> str:
    more = len(names) - LISTED
    return ", ".join(names[:LISTED]) + (f" and {more} more" if more > 0 else "")
