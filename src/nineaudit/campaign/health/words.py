"""The health of the sensors in words: sentences, the table of the terminal, the JSON document."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, Final

from nineaudit.campaign.health.assess import Health, Member, State
from nineaudit.campaign.health.deviations import Deviation, seat_name
from nineaudit.campaign.health.records import family
from nineaudit.report.numbers import plain, printable
from nineaudit.units import counted

SCHEMA: Final = "nineaudit/sensor-health/1"
_NAMES: Final = {
    "gain": "gain", "tilt_1": "tilt 1", "tilt_2": "tilt 2",
    "position_x": "position x", "position_y": "position y", "position_z": "position z",
}  # fmt: skip
_UNITS: Final = {"gain": (100.0, "%"), "tilt": (math.degrees(1.0), "°"), "position": (1e3, "mm")}
_SINCE: Final = {
    "step": "since {since}",
    "ramp": "growing since {since}",
    "count": "growing with the number of tests",
    "worst": "growing with the hardest shock before",
    "level": "against what its rig file states since {since}",
}
_ADVICE: Final = {
    State.RECALIBRATE: "recalibrate",
    State.INSPECT: "measure where and how it is mounted",
    State.WATCH: "watch",
}


def amount(parameter: str, value: float, U: float) -> str:
    """+2.1 % ± 0.3 %, with two digits of the uncertainty."""
    one, unit = _UNITS[family(parameter)]
    places = 2 if not U > 0 else min(max(1 - math.floor(math.log10(one * U)), 0), 4)
    return f"{one * value:+.{places}f} {unit} ± {one * U:.{places}f} {unit}".replace("-", "−")


def sentence(member: Member, found: Deviation) -> str:
    """4711 (a1y of head 1): gain +2.1 % ± 0.3 % (k = 2) since 2026-03-04: recalibrate."""
    when = _SINCE[found.shape].format(since=found.since)
    if found.shape in ("step", "ramp") and found.earliest != found.latest:
        when += f" (between {found.earliest} and {found.latest})"
    if found.now is not None:
        when += f", with its other changes {amount(found.parameter, *found.now)} now"
    what = f"{_NAMES[found.parameter]} {amount(found.parameter, found.value, found.U)} (k = 2) {when}"
    if found.restated:
        advice = f"restated since {found.restated}"
    elif found.rivals:
        advice = f"this or one of {', '.join(found.rivals)}: the tests do not tell which"
        advice += ", calibrate them" if found.beyond else ""
    else:
        advice = _ADVICE[(State.INSPECT if member.is_seat else State.RECALIBRATE) if found.beyond else State.WATCH]
    return printable(f"{called(member)}: {what}: {advice}")


def called(member: Member) -> str:
    """A sensor with its seats, a seat by itself."""
    if member.is_seat or not member.serial:
        return member.name
    shown = [seat_name(seat) for seat in member.seats[:3]] + ["..."] * (len(member.seats) > 3)
    return f"{member.name} ({', '.join(shown)})" if shown else member.name


def text_table(health: Health) -> str:
    """The table of the terminal: a row a sensor, seats that changed, sentences, notes."""
    rows = [("sensor", "tests", "gain now", "verdict"), *(_row(member) for member in health.sensors)]
    lines = _aligned(rows)
    told = [sentence(m, d) for m in (*health.sensors, *health.seats) for d in m.deviations]
    return "\n".join([*lines, *([""] if told else []), *told, "", *summary(health)])


def _row(member: Member) -> tuple[str, str, str, str]:
    level = member.level.get("gain")
    gain = "–" if level is None else amount("gain", *level)
    return printable(called(member)), str(member.tests), gain, str(member.state)


def _aligned(rows: Sequence[Sequence[str]]) -> list[str]:
    widths = [max(len(row[i]) for row in rows) for i in range(len(rows[0]))]
    return ["  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)).rstrip() for row in rows]


def summary(health: Health) -> list[str]:
    """How many of each verdict, what cannot be told, and what was left out."""
    lines = [_counted(health)]
    if health.sensors:
        lines.append(
            "gain: against what the rig file in force states, ± at k = 2; an error that all sensors of a rig share is "
            "not seen"
        )
    together = [m.name for m in health.sensors if not m.apart]
    if together:
        lines.append(
            f"{counted(len(together), 'sensor')} sat alone in a seat: what is their tilt and what their seat's "
            "cannot be told apart"
        )
    return [*lines, *(printable(f"note: {note}") for note in health.notes)]


def _counted(health: Health) -> str:
    counts = {state: sum(m.state is state for m in health.sensors) for state in State}
    said = ", ".join(f"{count} {state}" for state, count in counts.items() if count)
    return f"{counted(len(health.sensors), 'sensor')} in {counted(health.tests, 'test')}: {said or 'nothing to tell'}"


def document(health: Health) -> dict[str, Any]:
    """nineaudit/sensor-health/1: values in SI, U at k = 2. The same lake gives the same bytes."""
    return {
        "schema": SCHEMA,
        "tests": health.tests,
        "dated": health.dated,
        "tolerance": plain(health.tolerance),
        "action": health.action,
        "scatter": plain(health.scatter),
        "sensors": [_member(m) for m in health.sensors],
        "seats": [_member(m) for m in health.seats],
        "notes": list(health.notes),
    }


def _member(member: Member) -> dict[str, Any]:
    return {
        "name": member.name,
        "serial": member.serial,
        "seats": [{"rig": rig, "channel": channel} for rig, channel in member.seats],
        "tests": member.tests,
        "first": member.first,
        "last": member.last,
        "state": str(member.state),
        "told_apart": member.apart,
        "level": {p: {"value": plain(v), "U": plain(u)} for p, (v, u) in member.level.items()},
        "changes": [_deviation(member, d) for d in member.deviations],
    }


def _deviation(member: Member, found: Deviation) -> dict[str, Any]:
    numbers = {name: plain(getattr(found, name)) for name in ("value", "U", "z")}
    named = ("parameter", "shape", "since", "earliest", "latest", "beyond", "restated")
    words = {name: getattr(found, name) for name in named}
    now = None if found.now is None else {"value": plain(found.now[0]), "U": plain(found.now[1])}
    return {**words, **numbers, "now": now, "rivals": list(found.rivals), "sentence": sentence(member, found)}


__all__ = ["SCHEMA", "amount", "called", "document", "sentence", "summary", "text_table"]
