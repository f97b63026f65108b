"""The budget of a case: every output, by source, three ways."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from nineaudit.array import FloatArray
from nineaudit.budgets import filtering, monte_carlo
from nineaudit.budgets.ambiguity import Groups, ambiguity
from nineaudit.budgets.improve import Change, Present, changes
from nineaudit.budgets.monte_carlo import Scatter
from nineaudit.case import Case
from nineaudit.errors import EstimationError
from nineaudit.estimate.at_their_word import Word, at_their_word, total
from nineaudit.estimate.functional import Smoothed, smoothed
from nineaudit.estimate.outputs import Output, at_instant, outputs
from nineaudit.physics import rigid_body
from nineaudit.rig import Rig
from nineaudit.simulate import simulate

Rows = dict[str, float]
INSTANTS = 60
"""Instants at which a budget over time is computed."""
CERTAIN = 3.0
"""Standard deviations of the Monte Carlo's own error beyond which it contradicts the root sum of squares."""


@dataclass(frozen=True, eq=False)
class Line:
    """One output: its `value` in `unit`, the rows of its standard uncertainty by source `at_their_word`, its `scatter`
    by Monte Carlo, and the rows through the `fit`; None where the array does not allow that way."""

    name: str
    unit: str
    value: float
    at_their_word: Rows | None
    scatter: Scatter | None
    fit: Rows | None
    draws: int

    @property
    def linear(self) -> bool:
        """Whether Monte Carlo agrees with the root sum of squares within its own error, in spread and in mean."""
        if self.at_their_word is None or self.scatter is None:
            return True
        rss, found = total(self.at_their_word), self.scatter
        spread = abs(found.sd - rss) <= CERTAIN * found.sd / np.sqrt(2.0 * (self.draws - 1))
        return bool(spread and abs(found.bias) <= CERTAIN * found.sd / np.sqrt(self.draws))


@dataclass(frozen=True, eq=False)
class OverTime:
    """Standard uncertainty of α (rad/s²), ω (rad/s) and a (g_0), root of the summed squares of three components, by
    source: `curves` (m,) at `time` (m,) s."""

    time: FloatArray
    curves: dict[str, dict[str, FloatArray]]


@dataclass(frozen=True, eq=False)
class Budget:
    """The budget of a `case`, described by `subject`. Standard uncertainties, k = 1."""

    case: Case
    subject: str
    draws: int = monte_carlo.DRAWS

    @property
    def rig(self) -> Rig:
        return self.case.recording.rig

    @property
    def rest_index(self) -> int | None:
        """Block at which ω = 0."""
        rest = self.case.rest
        return None if rest is None else rest.start // self.case.condensed.length

    @cached_property
    def word(self) -> Word | None:
        """The estimator for channels taken at their word; None where the array has none."""
        blocks = self.case.condensed
        try:
            return at_their_word(self.case.array, blocks.time, blocks.readings, blocks.sigma, self.rest_index)
        except EstimationError:
            return None

    @cached_property
    def smoothed(self) -> Smoothed | None:
        """The whole-record fit with its uncertainty; None where the accelerometers do not span α: it then has no more
        than the rate sensors, differentiated."""
        return smoothed(self.case.healthy) if spans(self.case) else None

    @cached_property
    def outputs(self) -> list[Output]:
        """What is budgeted: at the rig's points, or at the origin."""
        return outputs([(p.name, p.position) for p in self.rig.points] or [("", np.zeros(3))])

    @cached_property
    def lines(self) -> tuple[Line, ...]:
        """Every output. EstimationError where neither way gives a motion."""
        word, fit, blocks = self.word, self.smoothed, self.case.condensed
        if word is None and fit is None:
            raise EstimationError(
                "no motion, hence no budget",
                found=f"{int(self.case.array.is_accelerometer.sum())} accelerometers that do not span α",
                expected="six accelerometers of rank 6, or rate sensors on three axes",
            )
        found: list[Scatter] | list[None] = [None] * len(self.outputs)
        if word is not None:
            at = (self.case.array, blocks.time, blocks.readings, blocks.sigma, self.rest_index)
            found = monte_carlo.scatter(*at, self.outputs, self.draws)
        return tuple(self._line(o, s) for o, s in zip(self.outputs, found, strict=True))

    def _line(self, output: Output, scatter: Scatter | None) -> Line:
        time, word, fit = self.case.condensed.time, self.word, self.smoothed
        motion = self.case.healthy.motion if word is None else word.motion
        by_word = None if word is None else word.rows(output.gradient(motion, time))
        by_fit = None if fit is None else fit.rows(output.gradient(self.case.healthy.motion, time))
        return Line(output.name, output.unit, output.value(motion, time), by_word, scatter, by_fit, self.draws)

    @cached_property
    def over_time(self) -> OverTime:
        """α, ω and a at the first point, by source, at up to INSTANTS instants."""
        time = self.case.condensed.time
        rows = np.unique(np.linspace(0, len(time) - 1, INSTANTS).astype(int))
        way = self.word or self.smoothed
        if way is None:
            raise EstimationError("no motion, hence no budget")
        motion = way.motion
        place = self.rig.points[0].position if self.rig.points else np.zeros(3)
        curves: dict[str, dict[str, FloatArray]] = {}
        for kind in ("α", "ω", "a"):
            found = [[way.rows(at_instant(kind, int(row), i, motion, place)) for i in range(3)] for row in rows]
            curves[kind] = {
                source: np.array([total({str(i): axis[source] for i, axis in enumerate(axes)}) for axes in found])
                for source in found[0][0]
            }
        return OverTime(time[rows], curves)

    @cached_property
    def changes(self) -> tuple[Change, ...]:
        """What would help most, best first."""
        present = Present(self.case.array, self.case.healthy, self.case.condensed, self.rest_index, spans(self.case))
        return changes(present, self.outputs)

    @cached_property
    def groups(self) -> dict[str, Groups]:
        """What the layout can prove in each kind of motion."""
        return ambiguity(self.case.array)

    @cached_property
    def filter_note(self) -> str | None:
        """What the noise at rest says of the filter class, where it says anything."""
        return filtering.note(self.case)


def spans(case: Case) -> bool:
    """Whether the accelerometers tell α."""
    held = case.array.is_accelerometer
    h: FloatArray = rigid_body.design(case.array.positions[held], case.array.axes[held])
    return len(h) >= 6 and int(np.linalg.matrix_rank(h, tol=1e-6)) == 6


def typical(rig: Rig, motion: str = "general") -> Budget:
    """The budget of a rig before any test: a simulated motion (simulate.MOTIONS, seed 0) with the rig's noise."""
    case = Case(simulate(rig, motion, imperfect=False).recording)
    return Budget(case, f"a typical motion ({motion}, simulated, seed 0)")


def budget_of(case: Case, name: str) -> Budget:
    """The budget of a recording, named `name`."""
    return Budget(case, name)
