"""What a recording says of each sensor: how hard it was hit, and its calibration as the whole-record fit has it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from nineaudit.array import FloatArray
from nineaudit.case import Case
from nineaudit.diagnosis import Diagnosis, Status
from nineaudit.errors import EstimationError
from nineaudit.estimate.calibrated import Calibrated, calibrated
from nineaudit.estimate.calibration import PARAMETERS
from nineaudit.estimate.information import LASTING, Information, information
from nineaudit.estimate.trajectory import Fit
from nineaudit.reconstruct import Reconstruction, slow_noise

OF_CALIBRATION = frozenset({"gain", "zero_shift", "cross_axis", "position"})
"""Fault words that are calibration errors larger than stated: the fit with all channels holds them."""
UNLIKELY = 0.01
LARGEST = 80
"""Parameters whose joint information is kept: nine accelerometers have 54. Of larger arrays the positions are
integrated out first, then the tilts."""


@dataclass(frozen=True, eq=False)
class Sensed:
    """`peaks` (k,) largest |reading| over the event, SI, zero taken off, NaN where nothing is valid; `fit` what fit
    the calibration is of, or why there is none; its cost per degree of freedom `statistic`; the `calibration`; and
    the likelihood of it, `information`. None where there is no fit to believe."""

    peaks: FloatArray
    fit: str
    statistic: float | None = None
    calibration: Calibrated | None = None
    information: Information | None = None


def sensed(case: Case, diagnosis: Diagnosis, reconstruction: Reconstruction | None) -> Sensed:
    """Peaks and, where the record is explained, the calibration that it speaks for."""
    found, words = _fit(case, diagnosis, reconstruction)
    if found is None:
        return Sensed(_peaks(case), words)
    colour = slow_noise(case) if found is case.healthy else 1.0  # a reconstruction's weights have it
    try:
        told = information(found, _kept(found), colour)
        return Sensed(_peaks(case), words, found.statistic, calibrated(found), told)
    except EstimationError as error:
        return Sensed(_peaks(case), str(error))


def _fit(case: Case, diagnosis: Diagnosis, reconstruction: Reconstruction | None) -> tuple[Fit | None, str]:
    """The fit whose calibration is to be believed, and what it is."""
    if not diagnosis.smallest_detectable:
        return None, "no whole-record fit"
    likely = {c.fault for c in diagnosis.candidates if c.probability > UNLIKELY}
    if diagnosis.status is Status.HEALTHY or (likely and likely <= OF_CALIBRATION):
        return case.healthy, "all channels"
    if diagnosis.status is Status.ISOLATED and reconstruction is not None and reconstruction.fit is not None:
        return reconstruction.fit, f"without what is wrong with {', '.join(diagnosis.channels)}"
    return None, "the record is not explained: it tells no calibration"


def _kept(found: Fit) -> tuple[str, ...]:
    kept: tuple[str, ...] = LASTING
    open_ = found.data.active[1]
    for fewer in (LASTING[:3], LASTING[:1]):
        if np.isin(open_, [PARAMETERS.index(name) for name in kept]).sum() > LARGEST:
            kept = fewer
    return kept


def _peaks(case: Case) -> FloatArray:
    start = case.rest.stop if case.rest is not None and case.rest.stop < len(case.time) else 0
    size = np.abs(case.readings[start:])
    return np.where(np.isfinite(size).any(axis=0), np.nan_to_num(size, nan=0.0).max(axis=0, initial=0.0), np.nan)
