"""Kinematics -> the page of `nineaudit motion --html`: values with their U, and the curves with their bands."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from nineaudit.array import FloatArray
from nineaudit.finding import COVERAGE_FACTOR
from nineaudit.report.chart import Band, Chart, Line
from nineaudit.report.figures import AXES, Figure, figure
from nineaudit.report.numbers import DASH, digits, edge, quantity, spelled
from nineaudit.report.page import ZOOMS, script, template
from nineaudit.report.zoom import store, zoomable

if TYPE_CHECKING:
    from nineaudit.motion import Kinematics
    from nineaudit.rig import Rig

ANGLES = ("yaw", "pitch", "roll")


def render_motion(found: Kinematics, rig: Rig, name: str) -> str:
    """The page as a string of HTML; `name` of the recording."""
    drawn = zoomable(figures(found, rig))
    context = script(ZOOMS) | {
        "name": name,
        "rig": rig.name,
        "method": found.method,
        "notes": found.notes,
        "values": value_rows(found, rig),
        "figures": drawn,
        "store": store(drawn),
    }
    return template("motion.html.j2").render(context) + "\n"


def value_rows(found: Kinematics, rig: Rig) -> list[tuple[str, str, str, str]]:
    """Name, unit, value and U (k = 2) of what is reported, in the rig's units."""
    rows = []
    for name, value in found.values.items():
        unit, one = edge(value.unit, rig)
        expanded = DASH if value.u is None else digits(COVERAGE_FACTOR * value.u / one, 2, full=True)
        rows.append((name, spelled(unit), digits(value.value / one, full=True), expanded))
    return rows


def figures(found: Kinematics, rig: Rig) -> list[Figure]:
    """ω, α, Euler angles; of every point a (body axes), v and x (laboratory)."""
    turned = np.degrees(found.euler)
    made = [
        _figure(found, "omega", "Angular velocity ω, body axes", found.omega, edge("rad/s", rig), "omega"),
        _figure(found, "alpha", "Angular acceleration α, body axes", found.alpha, ("rad/s^2", 1.0), "alpha"),
        _figure(found, "euler", "Yaw, pitch, roll", turned, ("deg", 1.0), "", ANGLES),
    ]
    for i, (name, path) in enumerate(found.paths.items()):
        made += [
            _figure(found, f"a{i}", f"Acceleration of {name}, body axes", path.a_body, edge("m/s^2", rig), f"{name} a"),
            _figure(found, f"v{i}", f"Velocity of {name}, laboratory", path.v, ("m/s", 1.0), f"{name} v"),
            _figure(found, f"x{i}", f"Position of {name}, laboratory", path.x, edge("m", rig), f"{name} x"),
        ]
    return made


def _figure(
    found: Kinematics,
    key: str,
    title: str,
    values: FloatArray,
    unit: tuple[str, float],
    u: str,
    names: tuple[str, str, str] = AXES,
) -> Figure:
    """One chart of three curves (n,3) SI, in `unit` (name, what one is in SI), with bands where `u` is known."""
    shown = values / unit[1]
    largest = f"largest {', '.join(f'{n} {quantity(_peak(shown[:, i]), unit[0])}' for i, n in enumerate(names))}"
    around = COVERAGE_FACTOR * found.u[u] / unit[1] if u in found.u else None
    chart = Chart(
        key=key,
        title=title,
        description=f"Components {', '.join(names)}; {largest}.",
        time=found.time,
        unit=spelled(unit[0]),
        lines=tuple(Line(shown[:, i], f"axis-{a}", n) for i, (a, n) in enumerate(zip(AXES, names, strict=True))),
        bands=() if around is None else _bands(shown, around),
    )
    return figure(chart, f"{title}, {spelled(unit[0])}; {largest}.")


def _bands(shown: FloatArray, around: FloatArray) -> tuple[Band, ...]:
    pairs = zip(shown.T, around.T, strict=True)
    return tuple(Band(v - r, v + r, "band", "" if i else "± 2u") for i, (v, r) in enumerate(pairs))


def _peak(values: FloatArray) -> float:
    return float(values[np.argmax(np.abs(values))])
