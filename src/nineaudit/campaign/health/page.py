"""The sensors on the index page of a campaign: verdicts, sentences, and control charts of those not in control."""

from __future__ import annotations

from collections.abc import Sequence
from datetime import date
from typing import Final

import numpy as np

from nineaudit.array import FloatArray
from nineaudit.campaign.health.assess import Health, Member, State
from nineaudit.campaign.health.words import amount, called, sentence, summary
from nineaudit.campaign.index.index_page import Section
from nineaudit.report.chart import Band, Chart, Level, Line
from nineaudit.report.numbers import printable
from nineaudit.units import counted

CHARTS: Final = 12
"""Sensors with a chart of their own: the worst."""
ROWS: Final = 2000
"""Sensors in the table: the worst."""
APART: Final = 5
"""Names that stand side by side below the strip of all sensors, on the screen of a phone too."""
SIGNS: Final = 12
"""Of a name there."""
LEAST_TOLD: Final = 1.0
"""Tests whose own estimate is less certain than so many times the tolerance are not drawn."""


def section(health: Health) -> Section:
    """The part of the index that speaks of sensors: of every one a row, of those not in control a sentence and a
    control chart, and one strip of all."""
    told = [sentence(m, d) for m in (*health.sensors, *health.seats) for d in m.deviations]
    drawn = [m for m in health.sensors if m.state is not State.IN_CONTROL and m.course is not None][:CHARTS]
    charts = [_control(i, member, health) for i, member in enumerate(drawn)]
    return Section(
        key="sensors",
        title="Sensors",
        text=(*told, *summary(health), *_left_out(health)),
        headers=("sensor", "tests", "first", "last", "gain now", "verdict"),
        rows=page_rows(health),
        charts=(*([_strip(health)] if any("gain" in m.level for m in health.sensors) else []), *charts),
    )


def page_rows(health: Health) -> list[tuple[str, ...]]:
    """(name with seats, tests, first, last, gain now, verdict) of every sensor, the worst first."""
    return [
        (
            called(member),
            str(member.tests),
            member.first,
            member.last,
            amount("gain", *member.level["gain"]) if "gain" in member.level else "–",
            str(member.state),
        )
        for member in health.sensors[:ROWS]
    ]


def _left_out(health: Health) -> list[str]:
    more = len(health.sensors) - ROWS
    return (
        [f"In control, and listed by `nineaudit campaign health` only: {counted(more, 'more sensor')}"]
        if more > 0
        else []
    )


def _control(number: int, member: Member, health: Health) -> Chart:
    """Gain test by test, with what the model makes of it and the tolerance about where it began."""
    course = member.course
    assert course is not None
    told = course.u < LEAST_TOLD * health.tolerance
    told = told if told.sum() > 1 else np.ones_like(told)
    when, value, fitted, u = (v[told] for v in (course.when, course.value, course.fitted, course.u))
    value, fitted, spread = 100.0 * value, 100.0 * fitted, 200.0 * u
    return Chart(
        key=f"sensor-{number}",
        title=f"Gain of {called(member)}, test by test",
        description=f"{counted(member.tests, 'test')}, {member.first} to {member.last}: {member.state}",
        time=when,
        unit="%",
        lines=(Line(value, "measured", "what each test says by itself"), Line(fitted, "rebuilt", "all tests together")),
        bands=(Band(fitted - spread, fitted + spread, "band", "where a test may be, k = 2"),),
        levels=_limits(float(fitted[0]), health.tolerance),
        height=120,
        zooms=False,
        across=_ticks(when, health.dated),
        across_label="date" if health.dated else "test",
    )


def _limits(start: float, tolerance: float) -> tuple[Level, ...]:
    return tuple(Level(start + sign * 100.0 * tolerance, "tolerance") for sign in (1.0, -1.0))


def _strip(health: Health) -> Chart:
    """Every sensor's gain side by side."""
    members = sorted((m for m in health.sensors if "gain" in m.level), key=lambda m: m.name)
    value, spread = (np.array([100.0 * m.level["gain"][i] for m in members]) for i in range(2))
    place = np.arange(len(members), dtype=np.float64)
    return Chart(
        key="sensor-strip",
        title="Gain of every sensor now",
        description=f"{counted(len(members), 'sensor')} by name",
        time=place if len(place) > 1 else np.array([0.0, 1.0]),
        unit="%",
        lines=(
            Line(value if len(place) > 1 else np.repeat(value, 2), "measured", "gain, against what its rig states"),
        ),
        bands=(Band(value - spread, value + spread, "band", "k = 2"),) if len(place) > 1 else (),
        levels=_limits(0.0, health.tolerance),
        height=90,
        zooms=False,
        across=_marks(members, health),
        across_label="sensor",
    )


def _marks(members: Sequence[Member], health: Health) -> tuple[tuple[float, str], ...]:
    """The worst by short names, as far apart as names are wide: a serial number, or the channel of the seat."""
    kept: dict[int, str] = {}
    for member in (m for m in health.sensors if "gain" in m.level):  # the worst first
        place = members.index(member)
        if member.state is not State.IN_CONTROL and all(abs(place - at) >= len(members) / APART for at in kept):
            kept[place] = short(member)
    return tuple((float(at), name) for at, name in sorted(kept.items())) or ((0.0, short(members[0])),)


def short(member: Member) -> str:
    """A name for an axis: of a sensor without a serial number its channel. The end tells those of one serial number."""
    name = member.name if member.serial or not member.seats else member.seats[0][1]
    return printable(name if len(name) <= SIGNS else f"{name[: SIGNS - 3]}…{name[-2:]}")


def _ticks(when: FloatArray, dated: bool) -> tuple[tuple[float, str], ...]:
    """Five places of time, by their names."""
    at = np.linspace(float(when[0]), float(when[-1]), 5)
    return tuple((float(v), date.fromordinal(round(v)).isoformat() if dated else str(round(v) + 1)) for v in at)
