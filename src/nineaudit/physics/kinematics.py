"""Integration, differentiation and attitude of sampled motions. Body frame, SI, any increasing time base.

Integration, per interval [t_i, t_i+1], from the polynomial through p = 6 samples about it, x = (t−t_i)/h_i:

    ∫ f dt = h_i Σ_j w_j f_j,    Σ_j w_j x_j^m = 1/(m+1),  m = 0 … p−1     [moment conditions of quadrature]

On a uniform time base w = (11, −93, 802, 802, −93, 11)/1440 inside the record. Two properties choose it:
- noise: the weights that one sample gets from its intervals sum to 1, as in the trapezoidal rule, so an
  integrated white noise is no larger (cumulative Simpson: √(10/9) times, weights 4/3 and 2/3 in turn);
- truncation: exact for polynomials up to degree 5; else (191/60480) h⁶ [f⁽⁵⁾]₀ᵗ inside, 1e-13 of the peak
  ∫f for 25 Hz at 10 kHz (trapezoid: h²/12 [f′]₀ᵗ, 2e-5), plus at each end up to (863/60480) h⁷ f⁽⁶⁾.
Where the steps under a stencil differ by more than a factor of three (a gap), the trapezoid is used: a
polynomial would extrapolate the noise of a cluster of samples across the gap.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from nineaudit.array import FloatArray
from nineaudit.errors import EstimationError

STENCIL: Final = 6
"""Samples per quadrature polynomial."""
MAX_STEP_RATIO: Final = 3.0
"""Longest over shortest step under a stencil; beyond, the trapezoidal rule is used."""


def integrate(values: FloatArray, time: FloatArray, initial: FloatArray | float = 0.0) -> FloatArray:
    """`initial` + ∫ values dt from time[0] to every sample; same shape as `values`.

    `values` (n,m) or (n,), `time` (n,) s increasing, `initial` (m,) or a number. Linear in `values`.
    A NaN makes everything after it NaN (and up to two samples before). Truncation error: see the module.
    Raises EstimationError when the time base is not finite and increasing.
    """
    steps = _steps(time, values)
    result = np.empty(values.shape)
    result[0] = initial
    if steps.size:
        increments = _increments(steps[:, None] * _quadrature(time, steps), values.reshape(time.size, -1))
        result[1:] = result[0] + np.cumsum(increments, axis=0).reshape(values[1:].shape)
    return result


def _increments(weights: FloatArray, values: FloatArray) -> FloatArray:
    """(n-1,m) weighted sums of `values` (n,m) over the stencil of every interval, `weights` (n-1,p)."""
    size = weights.shape[1]
    before, centred = size // 2 - 1, len(values) - size + 1
    out = np.empty((len(weights), values.shape[1]))
    out[:before] = weights[:before] @ values[:size]
    out[before + centred :] = weights[before + centred :] @ values[-size:]
    inner, own = out[before : before + centred], weights[before : before + centred]
    np.multiply(own[:, :1], values[:centred], out=inner)
    for j in range(1, size):
        inner += own[:, j : j + 1] * values[j : j + centred]
    return out


def _steps(time: FloatArray, values: FloatArray) -> FloatArray:
    """(n-1,) s; EstimationError unless the time base fits the values and increases."""
    if time.ndim != 1 or time.size == 0 or len(values) != time.size:
        raise EstimationError(
            "values and time base do not match",
            found=(values.shape, time.shape),
            expected="(n, ...) and (n,)",
        )
    steps = np.diff(time)
    if not (np.isfinite(time).all() and (steps > 0.0).all()):
        raise EstimationError("time base is not increasing", expected="finite, strictly increasing seconds")
    return steps


def _quadrature(time: FloatArray, steps: FloatArray) -> FloatArray:
    """(n-1,p) weights of every interval's stencil: the p samples about it, at the ends the first and last p."""
    size = min(STENCIL, time.size)
    interval = np.arange(steps.size)
    first = np.clip(interval - (size // 2 - 1), 0, time.size - size)
    nodes = time[first[:, None] + np.arange(size)]
    x = (nodes - time[:-1, None]) / steps[:, None]

    which = first - interval + size - 2
    uniform = np.arange(2.0 - size, 1.0)[:, None] + np.arange(float(size))
    weights = _moment_weights(uniform)[which]
    uneven = np.abs(x - uniform[which]).max(axis=1) > 1e-9
    weights[uneven] = _moment_weights(x[uneven])

    spacing = np.diff(nodes, axis=1)
    rough = np.flatnonzero(spacing.max(axis=1) > MAX_STEP_RATIO * spacing.min(axis=1))
    weights[rough] = 0.0
    weights[rough, rough - first[rough]] = weights[rough, rough - first[rough] + 1] = 0.5
    return np.asarray(weights)


def _moment_weights(x: FloatArray) -> FloatArray:
    """(m,p) weights over nodes `x` (m,p) that integrate every polynomial of degree < p over [0, 1]."""
    size = x.shape[1]
    powers = x[:, None, :] ** np.arange(size)[None, :, None]
    moments = np.broadcast_to(1.0 / np.arange(1.0, size + 1.0), x.shape)[:, :, None]
    return np.asarray(np.linalg.solve(powers, moments)[:, :, 0])


def differentiate(values: FloatArray, time: FloatArray) -> FloatArray:
    """d(values)/dt, same shape as `values` (n,m) or (n,), `time` (n,) s increasing, n ≥ 3.

    Second-order differences, exact for quadratics on any time base; error h²/6 f‴, noise σ/(√2 h).
    Raises EstimationError when the time base is not increasing or shorter than three samples.
    """
    if _steps(time, values).size < 2:
        raise EstimationError("too short to differentiate", found=time.size, expected="at least 3 samples")
    return np.asarray(np.gradient(values, time, axis=0, edge_order=2))


def resultant(values: FloatArray) -> FloatArray:
    """Length (n,) of the vectors `values` (n,3), in their unit."""
    return np.asarray(np.sqrt(np.einsum("ni,ni->n", values, values)))


def orientation(omega: FloatArray, time: FloatArray, initial: FloatArray | None = None) -> FloatArray:
    """Attitude C (n,3,3) of the body: v_inertial = C v_body, so dC/dt = C [ω×] with ω in the body frame.

    `omega` (n,3) rad/s, `time` (n,) s increasing, `initial` (3,3) = C at time[0] (default identity).
    Steps C_{i+1} = C_i exp([φ_i×]) by the rotation vector with the first coning term [Bortz 1971]

        φ_i = ∫ω dt + (h_i²/12) ω_i × ω_{i+1},

    fourth order in h, exact for a fixed axis. Raises EstimationError for a bad time base or non-finite ω.
    """
    from scipy.spatial.transform import Rotation

    if not np.isfinite(omega).all():
        raise EstimationError("angular velocity has gaps", advice="fill or cut them before integrating attitude")
    steps = _steps(time, omega)
    coning = np.cross(omega[:-1], omega[1:]) * (steps**2 / 12.0)[:, None]
    vectors = np.vstack([np.zeros((1, 3)), np.diff(integrate(omega, time), axis=0) + coning])
    turned = Rotation.from_rotvec(vectors)
    shift = 1  # prefix product by doubling: log2(n) vectorised passes
    while shift < time.size:
        turned = Rotation.concatenate([turned[:shift], turned[:-shift] * turned[shift:]])
        shift *= 2
    matrices = np.asarray(turned.as_matrix())
    return matrices if initial is None else np.asarray(initial @ matrices)
