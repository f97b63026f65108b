"""What the readings of one recording say of the calibration, and no more: the likelihood, without the rig's prior.

With S the Schur complement of θ in the normal equations (normal.py), posterior precision of θ in units of its prior
standard deviations, and p the gradient that is left where the fit ended, the posterior is N(θ + S⁻¹p, S⁻¹). The prior,
N(0, 1), is taken out again, so that recordings can be combined without counting it twice:

    likelihood N(θ; Λ⁻¹η, Λ⁻¹),    Λ = S − 1,    η = S θ + p                               (GUM-S2; natural parameters)

What is of this recording only (zero that is left, time skew, fault shapes), index n, is integrated out with its prior:

    Λ = S_kk − 1 − S_kn S_nn⁻¹ S_nk,    η = η_k − S_kn S_nn⁻¹ η_n

Λ may be singular: what a recording cannot see (a scale that all channels share) has no information here.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from nineaudit.array import FloatArray, IntArray
from nineaudit.estimate import calibration
from nineaudit.estimate.normal import eliminate, normal_equations
from nineaudit.estimate.trajectory import Fit

LASTING = ("gain", "tilt_1", "tilt_2", "position_x", "position_y", "position_z")
"""The errors that a sensor or its seat takes from test to test."""


@dataclass(frozen=True, eq=False)
class Information:
    """`channel` (p,) and `parameter` (p,) of calibration.PARAMETERS, `prior` (p,) standard deviations SI, `eta` (p,)
    and `matrix` (p,p) in units of them."""

    channel: IntArray
    parameter: IntArray
    prior: FloatArray
    eta: FloatArray
    matrix: FloatArray


def information(found: Fit, kept: Sequence[str] = LASTING, colour: float = 1.0) -> Information:
    """The likelihood of the errors named by `kept`, every other unknown of the fit integrated out.

    `colour`: how much larger the noise of long stretches is than the weights of the fit say. EstimationError where the
    readings do not determine ω.
    """
    data, (channel, parameter) = found.data, found.data.active
    solved = eliminate(normal_equations(found.point))
    eta = solved.schur @ found.theta + solved.pull
    matrix = solved.schur - np.eye(len(eta))
    matrix, eta = matrix / colour**2, eta / colour**2
    wanted = np.zeros(len(eta), dtype=np.bool_)
    wanted[: len(channel)] = np.isin(parameter, [calibration.PARAMETERS.index(name) for name in kept])
    inner = matrix[np.ix_(~wanted, ~wanted)] + np.eye(int((~wanted).sum()))
    gone = np.linalg.solve(inner, np.column_stack([matrix[np.ix_(~wanted, wanted)], eta[~wanted]]))
    across = matrix[np.ix_(wanted, ~wanted)]
    left = matrix[np.ix_(wanted, wanted)] - across @ gone[:, :-1]
    here = wanted[: len(channel)]
    prior = data.prior_sd[channel[here], parameter[here]]
    return Information(channel[here], parameter[here], prior, eta[wanted] - across @ gone[:, -1], 0.5 * (left + left.T))
