"""Optimisation over any set of channels, the in-plane triangle, and cross-axis sensitivity [Takhounts09].

The triangle of Fig 10: triaxes at 1 (0,0,0), 2 (r_x,0,0), 3 (r_x/2, r_y, 0), in the plane z = 0,

    eq 37   a3x = a1x − αz r_y + ωxωy r_y − (r_x/2)(ωy² + ωz²)
            a3y = a1y + αz r_x/2 + ωxωy r_x/2 − r_y(ωz² + ωx²)           (printed with αx in place of αz)
            a3z = a1z + αx r_y − αy r_x/2 + ωz(ωx r_x/2 + ωy r_y)

Optimisation: the rigid motion with ω(0) = 0 and dω/dt = α that the channels chosen fit best, over the whole record
(METHODS 2 with no calibration errors). It cannot undo a cross-axis sensitivity M = I + c, all entries alike: at ω = 0
an equilateral triangle has no constraint that M breaks, and yet α is off by −c(αz, αz, (αx+αy)/2) (METHODS 1.2; else
the third is −c(αx Σy² + αy Σx²)/Σ(x²+y²) about the centroid). M has to be fitted together with the motion, and only
what the motion turns into misfit can be fitted.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from nineaudit.array import FloatArray, IntArray, SensorArray
from nineaudit.errors import EstimationError
from nineaudit.estimate import calibration
from nineaudit.estimate.hypotheses import healthy_fit
from nineaudit.estimate.model import Data
from nineaudit.estimate.posterior import posterior
from nineaudit.estimate.trajectory import Fit
from nineaudit.physics import rigid_body

WIDE = 0.1
"""Prior standard deviation of a cross-axis sensitivity that nothing is known of."""
TELLING = 1.0
"""Least information of the motion, in units of the wide prior's, about what counts as determined."""
_TILTS = [calibration.PARAMETERS.index(name) for name in ("tilt_1", "tilt_2")]
_ENTRIES = [(i, j) for i in range(3) for j in range(3) if i != j]


def triangle_corner(a1: FloatArray, alpha: FloatArray, omega: FloatArray, rx: float, ry: float) -> FloatArray:
    """Acceleration (n,3) of corner 3 from that of corner 1, `alpha` and `omega`, each (n,3), SI: eq 37 put right."""
    (ax, ay, az), (x, y, z), half = alpha.T, omega.T, rx / 2.0
    along = -az * ry + x * y * ry - half * (y**2 + z**2)
    across = az * half + x * y * half - ry * (z**2 + x**2)
    normal = ax * ry - ay * half + z * (x * half + y * ry)
    return np.asarray(a1 + np.stack([along, across, normal], axis=1))


def optimise(data: Data, channels: tuple[str, ...] | None = None) -> Fit:
    """The rigid motion that `channels` (all, if None) fit best over the record, the instrument at its word.

    Raises EstimationError, naming the rank, where they do not determine ω.
    """
    array = data.array
    if channels is not None and (unknown := set(channels) - set(array.channels)):
        raise EstimationError("no such channel", found=sorted(unknown), expected="some of " + " ".join(array.channels))
    chosen = np.array([channels is None or c in channels for c in array.channels])
    _require_rank(array.select(np.flatnonzero(chosen).tolist()))
    return healthy_fit(replace(data, weight=np.where(chosen, data.weight, 0.0), prior_sd=np.zeros_like(data.prior_sd)))


def _require_rank(array: SensorArray) -> None:
    held = array.is_accelerometer
    design = rigid_body.design(array.positions[held] / 0.05, array.axes[held])
    rank = int(np.linalg.matrix_rank(design, tol=1e-6)) if len(design) else 0
    rates = int(np.linalg.matrix_rank(array.axes[~held], tol=1e-3)) if (~held).any() else 0
    if rank < 6 and rates < 3:
        raise EstimationError(
            "the channels do not determine the motion",
            found=f"accelerometers of rank {rank}, rate sensors of rank {rates}",
            expected="rank 6, or rate sensors of rank 3",
            advice="choose more channels",
        )


def cross_axis_error(array: SensorArray, a0: FloatArray, alpha: FloatArray, coupling: FloatArray) -> FloatArray:
    """Error (3,) of the least-squares α at ω = 0 where every triax reads M a, M = I + `coupling` (3,3).

    `a0`, `alpha` (3,). EstimationError where the accelerometers do not span α.
    """
    held = array.is_accelerometer
    _require_rank(array.select(np.flatnonzero(held).tolist()))
    positions, axes = array.positions[held], array.axes[held]
    felt = a0 + np.cross(alpha, positions)
    extra = np.einsum("ki,ij,kj->k", axes, coupling, felt)
    return np.asarray(np.linalg.pinv(rigid_body.design(positions, axes))[3:] @ extra)


@dataclass(frozen=True, eq=False)
class Sensitivity:
    """The joint fit of motion and cross-axis sensitivity.

    `fit`; per channel `tilts` (k,2) towards calibration.perpendiculars and their standard uncertainty `sd` (k,2);
    `rank` of `unknowns` that the motion determines; and the one matrix for all triaxes, `coupling` (3,3) with zero
    diagonal, `coupling_sd`, `coupling_rank` of 6. What the motion does not tell stays at 0 with the prior's width.
    """

    fit: Fit
    tilts: FloatArray
    sd: FloatArray
    rank: int
    unknowns: int
    coupling: FloatArray
    coupling_sd: FloatArray
    coupling_rank: int

    @property
    def determined(self) -> bool:
        """Whether the motion tells the matrix that all triaxes share."""
        return self.coupling_rank == len(_ENTRIES)

    def require(self) -> FloatArray:
        """`coupling`; EstimationError, naming the rank, where the motion does not tell all of it."""
        if not self.determined:
            raise EstimationError(
                "cross-axis sensitivity cannot be told from this motion",
                found=f"rank {self.coupling_rank} of {len(_ENTRIES)}, by channel {self.rank} of {self.unknowns}",
                expected="full rank",
                advice="record a general three-dimensional motion, or calibrate the sensors on a rate table",
            )
        return self.coupling


def fit_sensitivity(data: Data, prior: float = WIDE) -> Sensitivity:
    """Fit the sensitivity of all accelerometers with the motion; `prior`: the width of a cross-axis sensitivity.

    Ranks count the directions in which the motion holds at least as much information as the prior, P − I ≥ TELLING
    in units of it, P the marginal precision of the tilts. The one matrix follows from the same Gaussian with tilts =
    B c + δ, six numbers c and each sensor's own δ of the rig's alignment: information Bᵀ((P−I)⁻¹ + u²)⁻¹B.
    EstimationError where ω is not determined.
    """
    sds = data.prior_sd.copy()
    sds[np.ix_(np.flatnonzero(data.array.is_accelerometer), np.array(_TILTS))] = prior
    found = healthy_fit(replace(data, prior_sd=sds))
    covariance = posterior(found).theta
    channel, parameter = found.data.active
    mine = np.flatnonzero(np.isin(parameter, _TILTS) & data.array.is_accelerometer[channel])
    precision = np.linalg.inv(covariance[np.ix_(mine, mine)])
    told = precision - np.eye(len(mine))
    basis = _common(found.data, channel[mine], parameter[mine]) / prior
    own = (found.data.array.values("u_alignment")[channel[mine]] / prior) ** 2
    blurred = np.linalg.inv(np.eye(len(mine)) + told * own)
    shared = basis.T @ blurred @ told @ basis * prior**2
    pull = basis.T @ blurred @ precision @ found.theta[mine] * prior
    inverse = np.linalg.inv(shared + np.eye(len(_ENTRIES)))
    tilts, sd = np.zeros((len(data.array), 2)), np.zeros((len(data.array), 2))
    place = channel[mine], parameter[mine] - _TILTS[0]
    tilts[place], sd[place] = prior * found.theta[mine], prior * np.sqrt(np.diag(covariance)[mine])
    return Sensitivity(
        fit=found,
        tilts=tilts,
        sd=sd,
        rank=_rank(told),
        unknowns=len(mine),
        coupling=_matrix(prior * inverse @ pull),
        coupling_sd=_matrix(prior * np.sqrt(np.diag(inverse))),
        coupling_rank=_rank(shared),
    )


def _common(data: Data, channel: IntArray, parameter: IntArray) -> FloatArray:
    """(q,6) tilt per entry c_ij of the shared matrix: a sensor along n senses n + cᵀn."""
    across = calibration.perpendiculars(data.array)
    towards = across[channel, parameter - _TILTS[0]]
    axes = data.array.axes[channel]
    return np.stack([axes[:, i] * towards[:, j] for i, j in _ENTRIES], axis=1)


def _rank(information: FloatArray) -> int:
    return int(np.count_nonzero(np.linalg.eigvalsh(information) >= TELLING))


def _matrix(entries: FloatArray) -> FloatArray:
    out = np.zeros((3, 3))
    for (i, j), value in zip(_ENTRIES, entries, strict=True):
        out[i, j] = value
    return out
