"""The budget of a case: every output, by source, three ways."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from nineaudit.array import FloatArray, SensorArray
from nineaudit.budgets import filtering, monte_carlo
from nineaudit.budgets.ambiguity import Groups, ambiguity
from nineaudit.budgets.improve import Change, Present, changes
from nineaudit.budgets.monte_carlo import Scatter
from nineaudit.case import Case
from nineaudit.errors import EstimationError
from nineaudit.estimate import budget
from nineaudit.estimate.at_their_word import Word, at_their_word, spans
from nineaudit.estimate.budget import DRAWN, Beyond, Rows, Way, total
from nineaudit.estimate.condense import Condensed, block_means
from nineaudit.estimate.functional import Smoothed, smoothed
from nineaudit.estimate.hypotheses import healthy_fit
from nineaudit.estimate.model import Data
from nineaudit.estimate.motion import has_rates, product_free
from nineaudit.estimate.outputs import Gradient, Output, at_instant, outputs
from nineaudit.estimate.rate_smoother import Smoother
from nineaudit.estimate.trajectory import Fit
from nineaudit.rig import Rig
from nineaudit.simulate import simulate
from nineaudit.units import counted

INSTANTS = 60
"""Instants at which a budget over time is computed."""
CERTAIN = 3.0
"""Standard deviations of the Monte Carlo's own error beyond which it contradicts the root sum of squares."""


@dataclass(frozen=True, eq=False)
class Line:
    """One output: its `value` in `unit`, the rows of its standard uncertainty by source `at_their_word`, its `scatter`
    by Monte Carlo, None where no rest is known, and the rows through the `fit`."""

    name: str
    unit: str
    value: float
    at_their_word: Rows | None
    scatter: Scatter | None
    fit: Rows
    draws: int

    @property
    def linear(self) -> bool:
        """Whether Monte Carlo agrees with the root sum of squares of what it draws within its own error, in spread and
        in mean."""
        if self.at_their_word is None or self.scatter is None:
            return True
        rss, found = total({source: self.at_their_word[source] for source in DRAWN}), self.scatter
        if not np.isfinite(found.sd):
            return False
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
    """The budget of a `case`, described by `subject`. Standard uncertainties, k = 1. Of a simulated one `exact` are the
    readings (n,k) SI without noise, so that the budget is about the motion that there was."""

    case: Case
    subject: str
    draws: int = monte_carlo.DRAWS
    exact: FloatArray | None = None

    @property
    def rig(self) -> Rig:
        return self.case.recording.rig

    @property
    def array(self) -> SensorArray:
        return self.rig.array

    @property
    def rest_index(self) -> int | None:
        """Block at which ω = 0."""
        rest = self.case.rest
        return None if rest is None else rest.start // self.case.condensed.length

    @cached_property
    def blocks(self) -> Condensed:
        """What is budgeted: the case's blocks, of the exact readings where there are such."""
        found = self.case.condensed
        return found if self.exact is None else replace(found, readings=block_means(self.exact, found.length))

    @cached_property
    def fit(self) -> Fit:
        """The whole-record fit of the blocks."""
        if self.exact is None:
            return self.case.healthy
        data: Data = replace(self.case.fit_data, readings=self.blocks.readings)
        return healthy_fit(data)

    @property
    def fed_back(self) -> bool:
        """Whether ω has to be fed back into α, channels taken at their word."""
        return not (has_rates(self.array) or product_free(self.array))

    @cached_property
    def word(self) -> Word | None:
        """The estimator for channels taken at their word, where ω is fed back about the motion of the fit; None where
        the rest from which ω is integrated is not known."""
        self.require_motion()
        if self.rest_index is None and not has_rates(self.array):
            return None
        blocks, about = self.blocks, self.fit.motion if self.fed_back else None
        return at_their_word(self.array, blocks.time, blocks.readings, blocks.sigma, self.rest_index, about)

    def require_motion(self) -> None:
        """EstimationError where the array tells no motion."""
        if not (has_rates(self.array) or spans(self.array)):
            raise EstimationError(
                "no motion, hence no budget",
                found=f"{counted(int(self.array.is_accelerometer.sum()), 'accelerometer')}, α not spanned",
                expected="six accelerometers of rank 6, or rate sensors on three axes",
            )

    @cached_property
    def smoothed(self) -> Smoothed | Word:
        """The whole-record fit with its uncertainty; where the accelerometers do not span α, the rates smoothed."""
        self.require_motion()
        if spans(self.array):
            return smoothed(self.fit)
        return self._rates.smooth(self.rate_smoother)

    @property
    def _rates(self) -> Word:
        word = self.word
        if word is None:
            raise EstimationError("no motion, hence no budget")
        return word

    @cached_property
    def rate_smoother(self) -> Smoother:
        """The smoother that the rates of the record ask for, noise and all."""
        if self.exact is None:
            return self._rates.smoother
        blocks = self.case.condensed
        return at_their_word(self.array, blocks.time, blocks.readings, blocks.sigma, self.rest_index).smoother

    @cached_property
    def way(self) -> Way:
        """What is shown over time and what UB401 judges: channels at their word, but where ω is fed back the fit."""
        return self.smoothed if self.fed_back or self.word is None else self.word

    @cached_property
    def beyond(self) -> Beyond:
        """Errors of readings besides calibration and noise."""
        return self.case.beyond(self.way.motion, simulated=self.exact is not None)

    @cached_property
    def outputs(self) -> list[Output]:
        """What is budgeted: at the rig's points, or at the origin; only the rotation where a is not told."""
        points = [(p.name, p.position) for p in self.rig.points] or [("", np.zeros(3))]
        return outputs(points if self.tells_acceleration else [])

    @property
    def tells_acceleration(self) -> bool:
        """Whether the accelerometers are on three axes."""
        held = self.array.is_accelerometer
        return bool(held.any()) and int(np.linalg.matrix_rank(self.array.axes[held], tol=1e-3)) == 3

    @cached_property
    def lines(self) -> tuple[Line, ...]:
        """Every output. EstimationError where no way gives a motion."""
        found: list[Scatter] | list[None] = [None] * len(self.outputs)
        if self.word is not None:
            at = (self.word, self.beyond.rounding * ~self.beyond.counted, self.rest_index)
            found = monte_carlo.scatter(*at, self.outputs, self.draws)
        return tuple(self._line(o, s) for o, s in zip(self.outputs, found, strict=True))

    def _line(self, output: Output, scatter: Scatter | None) -> Line:
        time, motion = self.blocks.time, self.way.motion
        word, fit = self.word, self.smoothed
        by_word = None if word is None else budget.rows(word, output.gradient(word.motion, time), self.beyond)
        by_fit = budget.rows(fit, output.gradient(fit.motion, time), self.beyond)
        return Line(output.name, output.unit, output.value(motion, time), by_word, scatter, by_fit, self.draws)

    @cached_property
    def over_time(self) -> OverTime:
        """α, ω and a at the first point, by source, at up to INSTANTS instants."""
        time, motion = self.blocks.time, self.way.motion
        rows = np.unique(np.linspace(0, len(time) - 1, INSTANTS).astype(int))
        place = self.rig.points[0].position if self.rig.points else np.zeros(3)
        curves: dict[str, dict[str, FloatArray]] = {}
        for kind in ("α", "ω", "a") if self.tells_acceleration else ("α", "ω"):
            found = [[self._rows(at_instant(kind, int(row), i, motion, place)) for i in range(3)] for row in rows]
            curves[kind] = {
                source: np.array([total({str(i): axis[source] for i, axis in enumerate(axes)}) for axes in found])
                for source in found[0][0]
            }
        return OverTime(time[rows], curves)

    def _rows(self, gradient: Gradient) -> Rows:
        return budget.rows(self.way, gradient, self.beyond)

    @cached_property
    def changes(self) -> tuple[Change, ...]:
        """What would help most, best first."""
        fit, rule = (self.fit, None) if spans(self.array) else (None, self.rate_smoother)
        motion = self.smoothed.motion
        return changes(Present(self.array, motion, fit, self.blocks, self.rest_index, self.beyond, rule), self.outputs)

    @cached_property
    def groups(self) -> dict[str, Groups]:
        """What the layout can prove in each kind of motion."""
        return ambiguity(self.array)

    @cached_property
    def filter_note(self) -> str | None:
        """What the noise at rest says of the filter class, where it says anything."""
        return filtering.note(self.case)


def typical(rig: Rig, motion: str = "general") -> Budget:
    """The budget of a rig before any test: a simulated motion (simulate.MOTIONS, seed 0) with the rig's noise. At rest
    there is no direction to be uncertain along but that of the noise, which then stays in."""
    done = simulate(rig, motion, imperfect=False)
    case = Case(done.recording)
    subject = f"a typical motion ({motion}, simulated, seed 0)"
    if not done.ideal.any():
        return Budget(case, subject)
    exact = done.ideal - (0.0 if case.rest is None else done.ideal[case.rest.samples].mean(axis=0))
    return Budget(case, subject, exact=exact)


def budget_of(case: Case, name: str) -> Budget:
    """The budget of a recording, named `name`."""
    return Budget(case, name)
