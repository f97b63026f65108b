"""Does a cause that many channels share explain the record? (causes.py; evidence as in hypotheses.py)

A hypothesis of one channel absorbs a common cause as well as it can, and may look sure of itself; but it leaves part
of it, a third and more, where the true fault of one channel leaves the noise that the channels have at rest. So where
more than that is left, all common causes are tried on a coarser record without calibration errors, beside the record
without the channel that is to be named; the few that do as well are fitted to the whole record. A factor is free from
the nearest that was tried, and so is the place of all accelerometers of one block:

    y_i = n_i·(a0 + α × (r_i + e) + ω × (ω × (r_i + e)))    one e for all i of the block

So are the lags of messages that hold several channels each (message_delays.py).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from nineaudit.array import FloatArray
from nineaudit.errors import EstimationError
from nineaudit.estimate import hypotheses as h
from nineaudit.estimate.causes import NEAR_UNIT, Cause, near, tried
from nineaudit.estimate.condense import MEDIAN_SPREAD
from nineaudit.estimate.hypotheses import Hypothesis
from nineaudit.estimate.message_delays import delays
from nineaudit.estimate.model import Data, Extra
from nineaudit.estimate.normal import eliminate, normal_equations
from nineaudit.estimate.point import point
from nineaudit.estimate.separation import DETECTION_NATS, coarser
from nineaudit.estimate.start import first_omega
from nineaudit.estimate.trajectory import ROUGH, Fit, fit, log_determinant
from nineaudit.recording import Message

COARSE, LOOKS = 250, 3
"""Samples and iterations of the first tries."""
AS_GOOD, TRIED = 1.5, 2
"""Cost per degree of freedom, over that without the best channel, up to which a first try is worth another; so many of
them at most."""
PART, SPARE = 0.8, 10.0
"""Part of the best channel's evidence, and nats less, that a common cause must promise on the coarser record."""
ROUNDS, SETTLED = 4, 2e-3
"""Steps of what is free in a cause, and the step, in prior standard deviations, that is none."""
CERTAIN = 10.0
"""Nats by which a factor must be better than the nearest ratio of units to be said."""
CLEARLY = 1.3
"""Cost of a record over that of the best channel from which causes far from none are tried: a small fault has none."""
FEWEST, LEFT, WHOLE = 8, 0.03, 1.3
"""Blocks of rest that tell the noise; part of what is wrong with a record that a true hypothesis may leave; its cost
over that of the noise, and that of the noise over what the rig says."""
QUIETEST = 1e-2
"""Least noise at rest, over what the rig states, that counts: below, a record is computed."""


@dataclass(frozen=True, eq=False)
class Common:
    """A common `cause` that was fitted, as the hypothesis `found` of all its channels."""

    cause: Cause
    found: Hypothesis


@dataclass(frozen=True, eq=False)
class Try:
    """A cause and the fit with it undone; None where the changed readings do not tell the motion."""

    cause: Cause
    fit: Fit | None

    @property
    def statistic(self) -> float:
        """Cost per degree of freedom, ∞ without a fit."""
        return np.inf if self.fit is None else self.fit.statistic

    @property
    def required(self) -> Fit:
        """The fit; EstimationError where there is none."""
        if self.fit is None:
            raise EstimationError(f"the motion cannot be told: {self.cause.said}")
        return self.fit


def mostly_explained(healthy: Fit, best: Hypothesis) -> bool:
    """Whether a hypothesis leaves so little of what is wrong with the record, over the noise that its channels have at
    rest, that no common cause is to be looked for. Never, where nothing is known of that noise, or where it is far more
    than the rig says, as in another unit; nor of two free channels, which imitate a reversed axis."""
    if len(best.channels) > 1 and best.word != "swap":
        return False
    weighted = _at_rest(healthy.data)[:, healthy.data.used]
    if len(weighted) < FEWEST:
        return False
    noise, spread = float(np.median(np.var(weighted, axis=0, ddof=1))), float(np.sqrt(2.0 / weighted.size))
    if noise > WHOLE:
        return False
    least = noise * (1.0 - 2.0 * MEDIAN_SPREAD * spread)
    return best.statistic < WHOLE * noise and best.statistic - least < LEFT * (healthy.statistic - least)


def as_noisy_as_at_rest(data: Data) -> Data:
    """`data` with the noise that each kind of sensor has at rest (median of its channels) in place of the rig's, so
    that a record gains nothing by being shrunk into what the rig states; as it is where no rest tells it."""
    weighted, held = _at_rest(data), data.array.is_accelerometer
    if len(weighted) < FEWEST:
        return data
    seen, found = np.std(weighted, axis=0, ddof=1), np.ones(len(held))
    for kind in (held & data.used, ~held & data.used):
        if kind.any():
            found[kind] = max(float(np.median(seen[kind])), QUIETEST)
    return replace(data, weight=data.weight / found)


def _at_rest(data: Data) -> FloatArray:
    """(m,k) weighted readings of the blocks that lie wholly at rest."""
    return np.asarray((data.weight * data.readings)[(data.still[:-1] > 0) & (data.still[1:] > 0)])


def common_causes(
    healthy: Fit, best: Hypothesis | None, reference: float, messages: Sequence[Message] = ()
) -> list[Common]:
    """The common causes that may explain the record as well as the `best` hypothesis of a channel, fitted, best first;
    `reference`: log evidence of no fault. Where no channel was looked at (None), those that beat no fault. `messages`:
    what the channels came in, whose lags are looked for."""
    at = coarser(healthy, COARSE)
    data = replace(at.data, extra=None)
    least = DETECTION_NATS if best is None else PART * best.evidence - SPARE
    alone = tied(at, np.zeros((0, len(data.array), len(data.time))))
    close = [(promised(at, cause, alone), cause) for cause in near(data.array)]
    close = [x for x in close if x[0] > least]
    scale = any(cause.word == "unit" for _, cause in close)
    clear = best is None or healthy.statistic > CLEARLY * best.statistic
    far = _far(at, data, best) if scale or clear else []
    likely = [Try(x.cause, fit(x.cause.undo(data), x.required.omega, None, LOOKS)) for x in far[:TRIED]]
    likely += [Try(cause, at) for cause in _most_promising(close)]
    late = [(promised(at, cause, alone), cause) for cause in delays(healthy.data.time, messages)]
    likely += [Try(cause, at) for cause in _most_promising([x for x in late if x[0] > least])]
    if not likely:
        return []
    coarse = h.log_evidence(fit(data, at.omega, at.theta, LOOKS))
    settled = [x for y in likely if _evidence(x := _freed(data, y)) - coarse > least]
    whole = [_whole(healthy.data, x, reference) for x in _once(settled)]
    return _one_a_delay(sorted(whole, key=lambda x: -x.found.evidence))


def _one_a_delay(found: list[Common]) -> list[Common]:
    """Without lags of the same messages as a better one, however they were found."""
    first = {x.found.channels: x for x in reversed(found) if x.cause.word == "delay"}
    return [x for x in found if x.cause.word != "delay" or x is first[x.found.channels]]


def _most_promising(causes: list[tuple[float, Cause]]) -> list[Cause]:
    return [cause for _, cause in sorted(causes, key=lambda x: -x[0])[:TRIED]]


def _once(settled: list[Try]) -> list[Try]:
    """Without those that came to the same cause from another start."""
    kept: list[Try] = []
    for x in sorted(settled, key=lambda x: x.statistic):
        if not any(_same(x.cause, y.cause) for y in kept):
            kept.append(x)
    return kept


def _same(one: Cause, other: Cause) -> bool:
    """Whether two causes are one, their sizes within what tells units apart."""
    alike = one.said == other.said or (one.word, one.step is None) == (other.word, other.step is None) == (
        "unit",
        False,
    )
    return alike and one.channels == other.channels and abs(one.size - other.size) < NEAR_UNIT * abs(other.size)


def _far(at: Fit, data: Data, best: Hypothesis | None) -> list[Try]:
    """Causes that may be far from none, as good as the record without the best channel, the best first."""
    certain = replace(data, prior_sd=np.zeros_like(data.prior_sd))
    enough = np.inf if best is None else AS_GOOD * _beside(certain, best, at.omega)
    far = [found for cause in tried(data.array) if (found := _look(certain, cause)).statistic < enough]
    return sorted(far, key=lambda x: x.statistic)


def _beside(certain: Data, best: Hypothesis, start: FloatArray) -> float:
    """Cost per degree of freedom without calibration errors and without the channels that are to be named, or with
    them exchanged where they were."""
    readings, weight, pair = certain.readings.copy(), certain.weight.copy(), list(best.channels)
    if best.word == "swap":
        readings[:, pair], weight[:, pair] = readings[:, pair[::-1]], weight[:, pair[::-1]]
    else:
        weight[:, pair] = 0.0
    return fit(replace(certain, readings=readings, weight=weight), start, iterations=2 * LOOKS).statistic


def _look(certain: Data, cause: Cause) -> Try:
    """A first try from what the changed readings say by themselves; without end where they do not tell the motion."""
    undone = cause.undo(certain)
    try:
        return Try(cause, fit(undone, first_omega(undone), iterations=LOOKS))
    except EstimationError:
        return Try(cause, None)


def _freed(data: Data, at: Try) -> Try:
    """What is free in a cause, with calibration errors: steps as long as the cost falls."""
    for _ in range(ROUNDS):
        if at.cause.step is None or at.cause.slope is None:
            break
        amplitude, _, _ = tied(at.required, at.cause.slope(at.required))
        cause = at.cause.step(amplitude)
        found = fit(cause.undo(data), at.required.omega, at.required.theta, LOOKS)
        if found.cost > at.required.cost:
            break
        at = Try(cause, found)
        if np.abs(amplitude).max() < SETTLED:
            break
    return at


def tied(at: Fit, shapes: FloatArray) -> tuple[FloatArray, float, float]:
    """The linear step (c,) of parameters whose `shapes` (c,k,n) touch many channels each, in prior standard deviations,
    how far the cost falls with it and the calibration errors, and ln det of their posterior precision. The rows and
    columns of a parameter's parts in the normal equations are added."""
    part, channel = np.nonzero(shapes.any(axis=2))
    order = np.argsort(channel, kind="stable")
    part, channel = part[order], channel[order]
    base = len(at.data.active[0])
    whole = replace(at.data, extra=Extra(shapes[part, channel], channel))
    solved = eliminate(normal_equations(point(whole, at.omega, np.r_[at.theta[:base], np.zeros(len(channel))])))
    count = base + len(channel)
    together = np.zeros((count, base + len(shapes)))
    together[np.arange(count), np.r_[np.arange(base), base + part]] = 1.0
    alone = np.diag((np.arange(count) >= base).astype(float))
    prior = np.diag((np.arange(base + len(shapes)) >= base).astype(float))
    precision = together.T @ (solved.schur - alone) @ together + prior
    pull = together.T @ solved.pull
    step = np.linalg.solve(precision, pull)
    return np.asarray(step[base:]), solved.fall + float(pull @ step), log_determinant(precision)


def promised(at: Fit, cause: Cause, alone: tuple[FloatArray, float, float]) -> float:
    """Evidence (nats, over no fault) of a small common cause, linear about the fit of no fault. What the fit would
    still gain without a cause, `alone` = tied(at, no shapes), is none of its: a coarser record is not yet settled."""
    if cause.slope is None:
        return 0.0
    _, fall, log_det = tied(at, cause.slope(at))
    return 0.5 * (fall - alone[1] - log_det + alone[2])


def _whole(data: Data, at: Try, reference: float) -> Common:
    """The cause fitted to the whole record, its factor the nearest ratio of units where that does as well."""
    nodes = np.linspace(0.0, 1.0, len(data.time) + 1)
    coarse = np.linspace(0.0, 1.0, len(at.required.omega))
    omega = np.stack([np.interp(nodes, coarse, w) for w in at.required.omega.T], axis=1)
    best = _fitted(data, at.cause, omega)
    unit = None if at.cause.nearest is None else at.cause.nearest()
    if unit is not None and unit.size != at.cause.size:
        other = _fitted(data, unit, best.required.omega)
        best = other if _evidence(other) > _evidence(best) - CERTAIN else best
    if best.cause.word == "delay":  # of a coarser record a lag is known to a part of its samples
        best = _freed(data, best)
    cause, left = best.cause, best.required
    name = "size" if cause.word in ("position", "delay") else "factor"
    evidence = _evidence(best) - reference
    return Common(cause, Hypothesis(cause.channels, cause.word, evidence, left.statistic, {name: cause.size}))


def _fitted(data: Data, cause: Cause, omega: FloatArray) -> Try:
    return Try(cause, fit(cause.undo(data), omega, None, h.LOOK, ROUGH))


def _evidence(tried: Try) -> float:
    """Log evidence of a fitted cause; what was free in it costs ½ ln det of how well it is told."""
    at, cause = tried.required, tried.cause
    freedom = 0.0 if cause.slope is None else max(0.5 * (tied(at, cause.slope(at))[2] - at.log_det), 0.0)
    return h.log_evidence(at) - cause.price - freedom - cause.chance(at.data)
