"""What a whole-record fit found of the calibration: the posterior of every error that the rig's file leaves open."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from nineaudit.array import FloatArray
from nineaudit.estimate.posterior import posterior
from nineaudit.estimate.trajectory import Fit


@dataclass(frozen=True, eq=False)
class Calibrated:
    """Calibration errors as fitted, (k,8) SI in the order of calibration.PARAMETERS: `value`, its posterior standard
    uncertainty `u`, and the rig's, `prior`. NaN (and 0) where nothing is open: what is certain, and channels that the
    fit leaves out."""

    value: FloatArray
    u: FloatArray
    prior: FloatArray


def calibrated(found: Fit) -> Calibrated:
    """The calibration errors of a fit with their uncertainty. EstimationError where the readings do not determine ω."""
    data, (channel, parameter) = found.data, found.data.active
    sd = posterior(found).theta_sd[: len(channel)]
    value, u, prior = (np.full(data.prior_sd.shape, np.nan) for _ in range(3))
    prior[channel, parameter] = data.prior_sd[channel, parameter]
    value[channel, parameter] = found.theta[: len(channel)] * data.prior_sd[channel, parameter]
    u[channel, parameter] = sd * data.prior_sd[channel, parameter]
    return Calibrated(value, u, prior)
