"""Rate gyros and linear accelerometers (RGLA): three of each at one point [Hu77].

ω is measured, so α is a derivative and attitude an integral:

    C_i+1 = C_i (I + h [ω_i×])            direction cosines as printed: first order, rows grow by √(1 + h²ω²) a step
    C_i+1 = C_i exp([φ_i×])               orthonormal, kinematics.orientation

(Hu calls the matrix self-adjoint where orthogonal is meant.) Derivative by five-point least squares with the parabola
(the Lagrange polynomial of the smoothed points),

    f'_i = (−2 f_i−2 − f_i−1 + f_i+1 + 2 f_i+2)/10h,

or of a truncated Fourier series f ≈ Σ_k≤K c_k sin(πkx/T), the chord of the ends taken off, each term times the factor
of Lanczos

    σ_k = sin(πk/(K+1)) / (πk/(K+1))

which takes away the ripple of the cut (Gibbs). Integrals by Simpson's rule or any closed Newton–Cotes rule.
"""

from __future__ import annotations

from typing import Final, Literal, NamedTuple

import numpy as np

from nineaudit.array import FloatArray, SensorArray
from nineaudit.errors import EstimationError
from nineaudit.estimate.motion import Motion, bridge
from nineaudit.physics import kinematics
from nineaudit.schemes.martin import gyro_omega
from nineaudit.units import counted

SAMPLES_PER_CYCLE: Final = 10.0
"""Samples a cycle of the highest harmonic that carries the signal: SAE J211 asks for ten times the class."""
HARMONIC_PART: Final = 0.99
"""Part of the mean square that the harmonics are to carry."""
_UNEVEN = 1e-3


def direction_cosines(omega: FloatArray, time: FloatArray, initial: FloatArray | None = None) -> FloatArray:
    """C (n,3,3), v_inertial = C v_body, by the recursion as printed; not orthonormal: see `departure`.

    `omega` (n,3) rad/s, `time` (n,) s, `initial` (3,3). The orthonormal one is kinematics.orientation.
    EstimationError where ω has gaps or the time base does not increase.
    """
    if not np.isfinite(omega).all() or not (np.diff(time) > 0.0).all():
        raise EstimationError("angular velocity has gaps, or time does not increase", advice="fill or cut them first")
    out = np.empty((len(time), 3, 3))
    out[0] = np.eye(3) if initial is None else initial
    x, y, z = omega.T
    o = np.zeros_like(x)
    cross = np.moveaxis(np.array([[o, -z, y], [z, o, -x], [-y, x, o]]), 2, 0)
    steps = np.eye(3) + np.diff(time)[:, None, None] * cross[:-1]
    for i, step in enumerate(steps):
        out[i + 1] = out[i] @ step
    return out


class Departure(NamedTuple):
    """How far a matrix is from a rotation: largest row `norm` less 1, largest |CCᵀ − I| entry, and determinant."""

    norm: float
    product: float
    determinant: float


def departure(matrix: FloatArray) -> Departure:
    """Non-orthonormality of a direction-cosine matrix (3,3)."""
    norms = np.linalg.norm(matrix, axis=1) - 1.0
    product = np.abs(matrix @ matrix.T - np.eye(3)).max()
    return Departure(float(norms[np.argmax(np.abs(norms))]), float(product), float(np.linalg.det(matrix)))


def five_point_derivative(values: FloatArray, time: FloatArray) -> FloatArray:
    """d(values)/dt (n,) or (n,m), least-squares parabola over five points, at the ends that of the first and last five.

    Noise σ/(√10 h), a fifth of the power of the central difference over 2h; truncation error 17/30 h² f‴ inside.
    EstimationError unless the steps are even and there are five samples.
    """
    from scipy.signal import savgol_filter

    step = even_step(time, 5)
    return np.asarray(savgol_filter(values, 5, 2, deriv=1, delta=step, axis=0, mode="interp"))


class Sines(NamedTuple):
    """A record as its chord and a sine series: `chord` (2,m) ends, `amplitudes` (K,m), `duration` s."""

    chord: FloatArray
    amplitudes: FloatArray
    duration: float


def sine_series(values: FloatArray, time: FloatArray, terms: int | None = None) -> Sines:
    """Fourier sine series of `values` (n,) or (n,m) less the chord between its ends; `terms` K, all if None.

    The chord makes the odd continuation free of steps. EstimationError for uneven steps or too many terms.
    """
    from scipy.fft import dst

    step = even_step(time, 4)
    table = np.asarray(values, dtype=np.float64).reshape(len(time), -1)
    along = np.linspace(0.0, 1.0, len(time))[:, None]
    left = table - (table[0] + along * (table[-1] - table[0]))
    amplitudes = np.asarray(dst(left[1:-1], type=1, axis=0)) / (len(time) - 1)
    terms = len(amplitudes) if terms is None else terms
    if not 1 <= terms <= len(amplitudes):
        raise EstimationError("number of harmonics", found=terms, expected=f"1 to {len(amplitudes)} for this record")
    return Sines(np.stack([table[0], table[-1]]), amplitudes[:terms], step * (len(time) - 1))


def lanczos(terms: int) -> FloatArray:
    """(K,) σ factors sinc(k/(K+1)), k = 1 … K."""
    return np.asarray(np.sinc(np.arange(1, terms + 1) / (terms + 1)))


def fourier_derivative(values: FloatArray, time: FloatArray, terms: int, *, sigma: bool = False) -> FloatArray:
    """d(values)/dt, same shape, of the sine series cut after `terms`; `sigma`: with Lanczos factors.

    Errors as `sine_series`.
    """
    series = sine_series(values, time, terms)
    k = np.arange(1, terms + 1)
    rates = np.pi * k / series.duration
    weights = rates * (lanczos(terms) if sigma else 1.0)
    angles = np.outer((time - time[0]) / series.duration, np.pi * k)
    slope = (series.chord[1] - series.chord[0]) / series.duration
    out = np.cos(angles) @ (weights[:, None] * series.amplitudes) + slope
    return np.asarray(out.reshape(np.shape(values)))


def simpson_integral(values: FloatArray, time: FloatArray, initial: FloatArray | float = 0.0) -> FloatArray:
    """`initial` + ∫values dt (n,) or (n,m) at every sample, by Simpson's parabolas. EstimationError: bad time base."""
    from scipy.integrate import cumulative_simpson

    if len(time) < 3 or not (np.diff(time) > 0.0).all():
        raise EstimationError(
            "time base is not increasing", found=counted(len(time), "sample"), expected="three or more"
        )
    start = np.zeros_like(np.asarray(values)[:1])
    return np.asarray(initial + cumulative_simpson(values, x=time, axis=0, initial=start))


def newton_cotes_integral(values: FloatArray, step: float, order: int) -> float:
    """∫values over the record (n,) by closed Newton–Cotes panels of `order` intervals: 1 trapezoid, 2 Simpson.

    EstimationError unless the record is a whole number of panels.
    """
    from scipy.integrate import newton_cotes

    panels, spare = divmod(len(values) - 1, order)
    if spare or panels < 1:
        raise EstimationError(
            "record is not a whole number of panels",
            found=counted(len(values) - 1, "interval"),
            expected=f"a multiple of {order}",
        )
    weights = np.asarray(newton_cotes(order, equal=1)[0])
    rows = np.arange(panels)[:, None] * order + np.arange(order + 1)
    return float(step * (values[rows] @ weights).sum())


def resultant_difference(body: FloatArray, laboratory: FloatArray) -> float:
    """Largest difference of the resultants of one vector (n,3) told in two frames over its largest resultant: what
    a matrix that is no rotation does. EstimationError where the vector is zero."""
    first, second = kinematics.resultant(body), kinematics.resultant(laboratory)
    if not first.max() > 0.0:
        raise EstimationError("resultant check of a vector that is zero")
    return float(np.abs(second - first).max() / first.max())


def as_printed(omega: FloatArray, a0: FloatArray, time: FloatArray) -> str:
    """What the printed recursion would have made of a record, in words: lengths of rows, CCᵀ − I, resultants of a0."""
    turned = direction_cosines(omega, time)
    left = departure(turned[-1])
    told = np.einsum("nij,nj->ni", turned, a0)
    lengths = f"rows {1.0 + left.norm:.6g} long, |CCᵀ − I| {left.product:.2g}"
    return f"{lengths} at the end, resultants off by {resultant_difference(a0, told):.2g}"


class Bandwidth(NamedTuple):
    """`harmonics` that carry HARMONIC_PART of the mean square of the record, the `frequency` of the last, Hz, the
    `rate` of the recording and what is `required`, Hz, and whether it `suffices`."""

    harmonics: int
    frequency: float
    rate: float
    required: float
    suffices: bool


def bandwidth(values: FloatArray, time: FloatArray, part: float = HARMONIC_PART) -> Bandwidth:
    """How many harmonics carry the signal (n,) or (n,m), and whether it was sampled SAMPLES_PER_CYCLE times the last.

    EstimationError for uneven steps or a signal that is its own chord.
    """
    series = sine_series(values, time)
    power = np.cumsum((series.amplitudes**2).sum(axis=1))
    if not power[-1] > 0.0:
        raise EstimationError("the record is a straight line: no harmonic carries it")
    count = int(np.searchsorted(power, part * power[-1])) + 1
    frequency, rate = count / (2.0 * series.duration), (len(time) - 1) / series.duration
    required = SAMPLES_PER_CYCLE * frequency
    return Bandwidth(count, frequency, rate, required, bool(rate >= required))


def spectrum(values: FloatArray, time: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Frequencies (m,) Hz and amplitudes (m,) or (m,c) of the sine series of `values`."""
    series = sine_series(values, time)
    frequencies = np.arange(1, len(series.amplitudes) + 1) / (2.0 * series.duration)
    return frequencies, np.abs(series.amplitudes).reshape(-1, *np.shape(values)[1:])


def signal_terms(values: FloatArray, time: FloatArray, sigma: FloatArray) -> int:
    """K: how many harmonics reach up to the last that rises above the noise, `sigma` (m,), of any column of `values`.

    Coefficients of white noise have the standard deviation σ√(2/N); the largest of N of them stays below √(2 ln N)
    times that (Donoho and Johnstone 1994). Errors as `sine_series`.
    """
    size = np.abs(sine_series(values, time).amplitudes) / sigma
    count = size.size
    above = np.flatnonzero((size > 2.0 * np.sqrt(np.log(count) / len(time))).any(axis=1))
    return int(above[-1]) + 1 if above.size else 1


Derivative = Literal["five-point", "fourier", "lanczos"]
_SAID: Final[dict[Derivative, str]] = {
    "five-point": "five-point derivative",
    "fourier": "derivative of a truncated Fourier series",
    "lanczos": "derivative of a Fourier series with Lanczos factors",
}


def derivative_of(omega: FloatArray, time: FloatArray, sigma: FloatArray, how: Derivative) -> FloatArray:
    """α (n,3) from ω (n,3) of noise `sigma` (3,); the Fourier series is cut after `signal_terms`, with Lanczos factors
    after twice as many, so that no harmonic that rises above the noise is damped by more than sinc(½), 0.64."""
    if how == "five-point":
        return five_point_derivative(omega, time)
    terms = signal_terms(omega, time, sigma)
    if how == "lanczos":
        return fourier_derivative(omega, time, min(2 * terms, len(time) - 2), sigma=True)
    return fourier_derivative(omega, time, terms)


def motion(
    array: SensorArray,
    time: FloatArray,
    readings: FloatArray,
    sigma: FloatArray,
    derivative: Derivative = "five-point",
) -> Motion:
    """ω of the rate sensors, α by differentiation, a0 of the accelerometers at the origin (METHODS 1).

    `readings` (n,k) SI zeroed, `sigma` (k,). EstimationError unless there are three axes of rate sensors and, at the
    origin, of accelerometers.
    """
    omega = gyro_omega(array, time, readings, sigma)
    held = np.flatnonzero(array.is_accelerometer & (np.abs(array.positions).max(axis=1) <= 1e-5))
    rank = int(np.linalg.matrix_rank(array.axes[held], tol=1e-3)) if held.size else 0
    if rank < 3:
        raise EstimationError(
            "RGLA needs three accelerometers at the origin", found=f"{held.size}, of rank {rank}", expected="rank 3"
        )
    a0 = bridge(readings[:, held], time) @ np.linalg.pinv(array.axes[held]).T
    rates = ~array.is_accelerometer
    noise = np.linalg.norm(np.linalg.pinv(array.axes[rates]) * sigma[rates], axis=1)
    return Motion(omega, derivative_of(omega, time, noise, derivative), a0, f"RGLA, {_SAID[derivative]} [Hu77]")


def even_step(time: FloatArray, least: int) -> float:
    """The sampling step, s; EstimationError unless steps are even and there are `least` samples."""
    steps = np.diff(time)
    if len(time) < least or not (steps > 0.0).all() or np.ptp(steps) > _UNEVEN * steps.mean():
        raise EstimationError(
            "the method needs even steps",
            found=f"{len(time)} samples, steps {steps.min(initial=np.inf):.3g} to {steps.max(initial=0.0):.3g} s",
            expected=f"{least} samples or more, evenly spaced",
            advice="resample the recording",
        )
    return float((time[-1] - time[0]) / (len(time) - 1))
