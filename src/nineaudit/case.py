"""A recording with what every check needs of it, each computed once.

Readings that a repair made of the other channels agree with those whatever happened: no residual and no fit that holds
channels against each other counts them. They stand in for the channel only where all of them are needed to integrate ω.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from nineaudit.array import BoolArray, FloatArray, SensorArray
from nineaudit.errors import EstimationError
from nineaudit.estimate import budget, closed_form, condense
from nineaudit.estimate import parity as parity_of
from nineaudit.estimate.at_their_word import at_their_word
from nineaudit.estimate.deferred import deferred, worth
from nineaudit.estimate.functional import smoothed
from nineaudit.estimate.hypotheses import healthy_fit, log_evidence
from nineaudit.estimate.model import Data
from nineaudit.estimate.motion import Motion, bridge, estimate_motion, has_rates, product_free, resampled
from nineaudit.estimate.search import Search, search
from nineaudit.estimate.separation import DETECTION_NATS
from nineaudit.estimate.start import make_data
from nineaudit.estimate.student import StudentFit, first_fit
from nineaudit.estimate.suspects import Suspect, suspects
from nineaudit.estimate.trajectory import Fit
from nineaudit.physics import filters, nap
from nineaudit.zeroed import Zeroed

CFC_TO_PASS_BAND = 0.6
"""CFC number over its −3 dB frequency: the class is 1000 for 1650 Hz (SAE J211-1)."""
COARSE, PROMISING = 0.1, 0.5
"""Part of a fault's evidence that the truncation of the midpoint rule must reach to be looked into; part of that which
its first steps must show."""


@dataclass(frozen=True, eq=False)
class Case(Zeroed):
    """`recording` and its derived quantities; SI, columns in the order of ``recording.rig.array``."""

    @cached_property
    def motion(self) -> Motion:
        """ω, α, a0 of the body as the array gives them, all channels taken at their word.

        EstimationError where the array cannot tell them.
        """
        start = None if self.rest is None else self.rest.start
        if has_rates(self.array) or product_free(self.array):
            return estimate_motion(self.array, self.time, self.readings, self.sigma, start)
        found, blocks = self.healthy.motion, self.condensed.time
        omega, alpha, a0 = (resampled(v, blocks, self.time) for v in (found.omega, found.alpha, found.a0))
        return Motion(omega, alpha, a0, found.method)

    def with_readings(self, channels: Sequence[str], readings: FloatArray) -> Case:
        """The same recording with other readings (n,m) SI, zero taken off, in some channels."""
        columns = [self.array.index(c) for c in channels]
        changed = self.recording.readings.copy()
        changed[:, columns] = readings + self.zero[columns]
        return Case(replace(self.recording, readings=changed, valid=np.isfinite(changed)))

    @cached_property
    def condensed(self) -> condense.Condensed:
        """All readings as block means, nearly independent and at most 2000."""
        return self._condense(self.readings)

    @cached_property
    def made_blocks(self) -> BoolArray:
        """(m,k) blocks of `condensed` that hold a sample made of other channels."""
        return condense.marked_blocks(self.recording.made_of_others, self.condensed.length)

    @cached_property
    def parity(self) -> parity_of.Residual:
        """Residual of every channel against the array, on the blocks of `condensed`, all measured samples at their
        word."""
        return self._parity(self.condensed)

    @cached_property
    def trusted_parity(self) -> parity_of.Residual:
        """The same without the samples that their own trace shows to be wrong."""
        return self._parity(self._condense(np.where(self.flagged, np.nan, self.readings)))

    def _parity(self, blocks: condense.Condensed) -> parity_of.Residual:
        readings = np.where(self.made_blocks & ~self.array.is_accelerometer, np.nan, blocks.readings)
        motion = self._motion_of(self.array, replace(blocks, readings=readings))
        at = self.array, blocks.time, blocks.readings, blocks.sigma, motion
        return parity_of.measured_residuals(*at, self.made_blocks)

    @cached_property
    def alpha_budget(self) -> budget.AlphaBudget:
        """Uncertainty of the peak of α by source, by the estimator of `motion`, on the blocks of `condensed`."""
        blocks, told = self.condensed, has_rates(self.array) or product_free(self.array)
        start = None if self.rest is None else self.rest.start // blocks.length
        at = self.array, blocks.time, blocks.readings, blocks.sigma, start
        way: budget.Way = at_their_word(*at) if told else smoothed(self.healthy)
        return budget.alpha_budget(way, blocks.time, self.beyond(way.motion))

    def beyond(self, motion: Motion, simulated: bool = False) -> budget.Beyond:
        """Errors of readings besides calibration and noise, in a motion of the blocks of `condensed`."""
        at = None if self.rest is None else self.readings[self.rest.samples]
        return budget.beyond(self.recording, motion, self.condensed.time, self.condensed.length, at, simulated)

    def _motion_of(self, array: SensorArray, blocks: condense.Condensed) -> Motion:
        start = None if self.rest is None else self.rest.start // blocks.length
        return estimate_motion(array, blocks.time, blocks.readings, blocks.sigma, start)

    def _condense(self, readings: FloatArray) -> condense.Condensed:
        cfc = self.recording.rig.cfc
        pass_band = None if cfc is None else cfc / CFC_TO_PASS_BAND
        slowest = condense.SLOWEST_BLOCKS if self.array.is_accelerometer.all() else condense.WITH_RATES
        length = condense.block_length(len(self.time), self.recording.rate, pass_band, slowest)
        rest = None if self.rest is None else self.readings[self.rest.samples]
        rate = self.recording.rate
        slow = cfc is None or not filters.fast_enough(rate, cfc)
        filtered = None if cfc is None or slow else filters.mean_noise(cfc, rate, length)
        return condense.Condensed(
            condense.block_means(self.time, length),
            condense.block_means(readings, length),
            condense.block_noise(self.sigma, rest, length, filtered),
            length,
        )

    @cached_property
    def fit_data(self) -> Data:
        """What the whole-record fit sees: the blocks of `condensed`, ω = 0 known over the quiet interval; without what
        was made of other channels."""
        rest = None
        if self.rest is not None:
            rest = (self.rest.start // self.condensed.length, self.rest.stop // self.condensed.length)
        data = make_data(self.array, self.condensed, rest)
        made = self.made_blocks
        return replace(data, weight=np.where(made, 0.0, data.weight)) if made.any() else data

    @property
    def onset(self) -> int:
        """Block at which the event may begin: the end of the quiet interval, or the first."""
        return (
            0
            if self.rest is None or self.rest.start > 0.5 * len(self.time)
            else self.rest.stop // self.condensed.length
        )

    @property
    def statistic_limit(self) -> float:
        """Largest cost per degree of freedom of the whole-record fit of a healthy recording."""
        return closed_form.limit_per_dof(max(self.fit_data.dof, 1))

    @cached_property
    def search(self) -> Search:
        """The whole-record fit and its hypotheses. EstimationError where the motion cannot be fitted.

        Where the truncation of the midpoint rule (deferred.py) explains as much as a fault must, and no fault ten times
        as much, the samples are coarse: the search is made again with the truncation taken off.
        """
        found = search(self.healthy, self.onset, self.flagged_blocks, self.statistic_limit)
        if not found.found or found.found[0].evidence < DETECTION_NATS:
            return found
        needed = max(COARSE * found.found[0].evidence, DETECTION_NATS)
        if worth(self.healthy) < PROMISING * needed:
            return found
        fine = deferred(self.healthy)
        if not fine.converged or log_evidence(fine) - log_evidence(self.healthy) < needed:
            return found
        return search(fine, self.onset, self.flagged_blocks, self.statistic_limit)

    @cached_property
    def healthy(self) -> Fit:
        """The whole-record fit with every channel at its word. EstimationError where the motion cannot be told."""
        return healthy_fit(self.fit_data)

    @cached_property
    def student_data(self) -> Data:
        """What a large array's fit sees: fit_data without the samples that their own trace shows to be wrong."""
        weight = np.where(self.flagged_blocks, 0.0, self.fit_data.weight)
        return replace(self.fit_data, weight=weight)

    @cached_property
    def student(self) -> StudentFit:
        """The fit of student_data that bears knocks between coarse samples; needs rates on three axes."""
        return first_fit(self.student_data)

    @cached_property
    def suspects(self) -> tuple[Suspect, ...]:
        """The channels of a large array with what their readings claim to be, best first."""
        return suspects(self.student_data, self.student, self.raw_zero)

    @property
    def raw_zero(self) -> BoolArray:
        """(m,k) samples of fit_data at which an instrument put out exactly 0."""
        single = self.condensed.length == 1
        return np.equal(self.recording.readings if single else self.condensed.readings, 0.0)

    @property
    def student_limit(self) -> float:
        """Largest cost per degree of freedom of a typical sample of `student`, for a healthy recording."""
        return closed_form.limit_per_dof(max(self.student_data.dof, 1))

    @property
    def statistic(self) -> float:
        """Cost per degree of freedom of the record with every channel at its word. EstimationError where the motion
        cannot be told."""
        return self.healthy.statistic

    @property
    def flagged_blocks(self) -> BoolArray:
        """(m,k) blocks of `condensed` that hold a flagged sample."""
        return condense.marked_blocks(self.flagged, self.condensed.length)

    @cached_property
    def nap_problem(self) -> closed_form.Problem | None:
        """The nine channels of an ideal 3-2-2-2, condensed, for the closed forms; None where the array has none."""
        if self.nap_layout is None:
            return None
        columns, arms = self.nap_layout
        nine, index, whole = self.array.select(columns), list(columns), self.condensed
        readings = bridge(whole.readings[:, index], whole.time)
        blocks = replace(whole, readings=readings, sigma=whole.sigma[index])
        motion = self._motion_of(nine, blocks)
        rest = 0 if self.rest is None else (self.rest.stop - self.rest.start) // blocks.length
        return closed_form.make_problem(nine, blocks.time, readings, blocks.sigma, motion, arms, rest)

    @cached_property
    def nap_healthy(self) -> closed_form.Hypothesis:
        """Fit of the healthy hypothesis to nap_problem; EstimationError where there is none."""
        return closed_form.fit_hypothesis(self.required_nap_problem, None)

    @property
    def required_nap_problem(self) -> closed_form.Problem:
        """nap_problem; EstimationError where there is none."""
        if self.nap_problem is None:
            raise EstimationError("the accelerometers are no ideal 3-2-2-2 layout")
        return self.nap_problem

    @cached_property
    def nap_layout(self) -> tuple[tuple[int, ...], FloatArray] | None:
        """Columns (9,) and arms (3,) where the accelerometers are an ideal 3-2-2-2 and no more, else None."""
        if self.array.is_accelerometer.sum() != len(nap.CHANNELS):
            return None
        found = nap.layout(self.array)
        return None if found is None else (tuple(int(c) for c in found[0]), np.asarray(found[1], dtype=float))
