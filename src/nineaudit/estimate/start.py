"""Where the whole-record fit starts: readings to Data, and a first ω for any set of valid channels."""

from __future__ import annotations

import numpy as np

from nineaudit.array import BoolArray, FloatArray, SensorArray
from nineaudit.estimate import calibration
from nineaudit.estimate.condense import Condensed
from nineaudit.estimate.model import Data
from nineaudit.estimate.motion import bridge, has_rates, rates_omega
from nineaudit.physics import nap, rigid_body

STILL_SD = 1e-4
"""rad/s: how well ω = 0 is known where the body rests."""
USED = 0.5
"""A channel with fewer valid samples than this part of the record does not help to start."""


def make_data(array: SensorArray, blocks: Condensed, rest: tuple[int, int] | None) -> Data:
    """Data of condensed readings; `rest` the first and one past the last block at which the body is at rest."""
    valid = np.isfinite(blocks.readings)
    still = np.zeros(len(blocks.time) + 1)
    if rest is not None:
        still[rest[0] : rest[1] + 1] = STILL_SD**-2
    return Data(
        array=array,
        time=blocks.time,
        readings=np.where(valid, blocks.readings, 0.0),
        weight=np.where(valid, 1.0 / blocks.sigma, 0.0),
        prior_sd=calibration.prior_sds(array),
        still=still,
    )


def first_omega(data: Data) -> FloatArray:
    """ω (n+1,3) at the nodes from the valid channels: rate sensors where they span three axes, else α integrated from
    rest, product-free as far as the geometry allows. EstimationError where α is not determined."""
    used = (data.weight > 0).mean(axis=0) > USED
    array, columns = data.array.select(np.flatnonzero(used).tolist()), np.flatnonzero(used)
    readings = bridge(np.where(data.weight > 0, data.readings, np.nan)[:, columns], data.time)
    rest = int(np.argmax(data.still > 0)) if (data.still > 0).any() else 0
    if has_rates(array):
        gyros = ~array.is_accelerometer
        sigma = 1.0 / data.weight[:, columns][:, gyros].max(axis=0)
        valid = np.ones((len(readings), int(gyros.sum())), dtype=np.bool_)
        return _to_nodes(rates_omega(array.axes[gyros], readings[:, gyros], sigma, valid))
    closed = _closed_form(data, used, rest)
    return _integrated(array, readings, data, rest) if closed is None else closed


def _closed_form(data: Data, used: BoolArray, rest: int) -> FloatArray | None:
    """ω of a 3-2-2-2 array with one channel unusable: that one by its closed form, which does not feed on ω."""
    found = nap.layout(data.array)
    if found is None:
        return None
    columns, arms = list(found[0]), found[1]
    lost = [i for i, c in enumerate(columns) if not used[c]]
    if len(lost) > 1:
        return None
    held = [c for i, c in enumerate(columns) if i not in lost]
    nine = np.zeros((len(data.time), 9))
    valid = np.where(data.weight > 0, data.readings, np.nan)
    nine[:, [i for i in range(9) if i not in lost]] = bridge(valid[:, held], data.time)
    for i in lost:
        nine[:, i] = nap.rebuild(nap.CHANNELS[i], nine, arms, data.time)
    alpha = nap.alpha(nine, arms)
    nodes = np.vstack([np.zeros(3), np.cumsum(alpha * data.step[:, None], axis=0)])
    return np.asarray(nodes - nodes[rest])


def _to_nodes(samples: FloatArray) -> FloatArray:
    return np.vstack([samples[:1], 0.5 * (samples[1:] + samples[:-1]), samples[-1:]])


def _integrated(array: SensorArray, readings: FloatArray, data: Data, rest: int) -> FloatArray:
    """dω/dt = L (y − q(ω)), L the least leaking product-free combination; the leak is fed back step by step
    (METHODS.md 1.3: its error grows with the angle turned, so ω is held under √(a/r), and the fit does the rest)."""
    held = array.is_accelerometer
    positions, axes = array.positions[held], array.axes[held]
    combination = rigid_body.product_free_alpha(positions, axes, leak=np.inf)
    alpha = readings[:, held] @ combination.T
    leak = combination @ rigid_body.product_matrix(positions, axes)
    nodes = np.zeros((len(alpha) + 1, 3))
    if np.abs(leak).max() < 1e-6:
        nodes[1:] = np.cumsum(alpha * data.step[:, None], axis=0)
        return np.asarray(nodes - nodes[rest])
    size = np.abs(readings[:, held]).max() / max(float(np.ptp(positions, axis=0).max()), 1e-9)
    fastest = 2.0 * float(np.sqrt(size))
    for order in (range(rest, len(alpha)), range(rest - 1, -1, -1)):
        forward = order.step > 0
        for t in order:
            here = nodes[t] if forward else nodes[t + 1]
            change = _step(here, alpha[t], leak, data.step[t] if forward else -data.step[t])
            nodes[t + 1 if forward else t] = np.clip(here + change, -fastest, fastest)
    return nodes


def _step(omega: FloatArray, alpha: FloatArray, leak: FloatArray, step: float) -> FloatArray:
    """One step of the midpoint rule; the products are [ωx², ωy², ωz², ωyωz, ωzωx, ωxωy]."""
    half = omega + 0.5 * step * (alpha - leak @ _products(omega))
    return np.asarray(step * (alpha - leak @ _products(half)))


def _products(w: FloatArray) -> FloatArray:
    x, y, z = w
    return np.array([x * x, y * y, z * z, y * z, z * x, x * y])
