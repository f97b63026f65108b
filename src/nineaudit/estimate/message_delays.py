"""Common causes of time: all channels of one message late or early by one lag.

Channels that share a CAN message, a topic or a file of a recording share what its stamps are worth. A message sent a
whole cycle after the samples it holds looks, by its stamps, as if there were no skew at all:

    y_i(t) = x_i(t − s_m)    one s_m for all i of message m, found as x_i of the others' motion; undone by y_i(t + s_m)

Only differences of lags are felt: all messages late by the same is another origin of time.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from nineaudit.array import FloatArray
from nineaudit.estimate.causes import OCCAM, Cause
from nineaudit.estimate.fault_models import advanced
from nineaudit.estimate.model import Data
from nineaudit.estimate.shapes import DELAY_SD
from nineaudit.estimate.trajectory import Fit
from nineaudit.physics import kinematics
from nineaudit.recording import Message

FARTHEST_STEP = 2.0
"""Samples by which a lag is moved at once: beyond, the slope of a reading tells nothing of it."""
UNEVEN = 0.01
"""Of a sampling interval: on a time base that varies by more a reading is not moved."""
STILL = 0.05
"""Of the largest lag: a message that is late by less is not said to be."""


def delays(time: FloatArray, messages: Sequence[Message]) -> Iterator[Cause]:
    """Every message of several channels with a lag of its own, and all of them with theirs; none on an uneven time
    base (n,) s, or where there is one message only."""
    if len(messages) < 2 or np.ptp(np.diff(time)) > UNEVEN * np.median(np.diff(time)):
        return
    for at, message in enumerate(messages):
        if len(message.columns) > 1:
            yield delayed(messages, (at,), np.zeros(1))
    if len(messages) > 2 and any(len(m.columns) > 1 for m in messages):
        yield delayed(messages, tuple(range(1, len(messages))), np.zeros(len(messages) - 1))


def delayed(messages: Sequence[Message], free: tuple[int, ...], lags: FloatArray) -> Cause:
    """The messages that are `free` late by `lags` (c,) s, the others on time."""
    late = np.zeros(len(messages))
    late[list(free)] = lags
    late -= np.sort(late)[(len(late) - 1) // 2]  # against most of them
    size = float(late[np.argmax(np.abs(late))])
    off = [i for i, s in enumerate(late) if abs(s) > STILL * abs(size)] or list(free)
    columns = tuple(sorted(c for i in off for c in messages[i].columns))
    price = float(np.minimum(0.5 * (late / DELAY_SD) ** 2, OCCAM).sum())
    return Cause(
        "delay", columns, partial(_advance, messages, late), price, _said(messages, off, late), size,
        slope=partial(_by_lag, messages, free),
        step=lambda c: delayed(messages, free, lags + DELAY_SD * c),
        chance=partial(_chance, columns, size),
    )  # fmt: skip


def _chance(columns: tuple[int, ...], lag: float, data: Data) -> float:
    """Nats that noise moved by whole samples may gain by chance, as in refitted.delayed(): two standard deviations, of
    variance 4 × 0.6 a sample. Within half a sample of none a lag is a time skew like those of single channels."""
    moved = float((data.weight[:, list(columns)] > 0).sum())
    return float(np.sqrt(2.4 * moved)) if abs(lag) > 0.5 * float(np.median(data.step)) else 0.0


def _said(messages: Sequence[Message], off: Sequence[int], late: FloatArray) -> str:
    each = [f"of {messages[i].name} {'late' if late[i] > 0 else 'early'} by {1e3 * abs(late[i]):.3g} ms" for i in off]
    rest = [m.name for i, m in enumerate(messages) if i not in off]
    others = f"those of {rest[0]}" if len(rest) == 1 else "the others"
    skews = "a time skew" if len(off) == 1 else "time skews"
    return f"all channels {', '.join(each)} against {others}: {skews} that the stamps do not show"


def _by_lag(messages: Sequence[Message], free: tuple[int, ...], at: Fit) -> FloatArray:
    """(c,k,n) change of the readings by a lag of DELAY_SD of each free message, −dy/dt."""
    slope = kinematics.differentiate(at.ideal, at.data.time).T
    out = np.zeros((len(free), *slope.shape))
    for part, i in zip(out, free, strict=True):
        part[list(messages[i].columns)] = -DELAY_SD * slope[list(messages[i].columns)]
    return out


def _advance(messages: Sequence[Message], late: FloatArray, data: Data) -> Data:
    """The readings as they were when their stamps say; none where the record has no such time."""
    readings, weight = data.readings.copy(), data.weight.copy()
    step = float(np.median(np.diff(data.time)))
    for message, lag in zip(messages, late / step, strict=True):
        for c in message.columns if lag else ():
            seen = advanced(np.where(weight[:, c] > 0, readings[:, c], np.nan), float(lag))
            readings[:, c] = np.nan_to_num(seen)
            weight[:, c] = np.where(np.isfinite(seen), weight[:, c].max(), 0.0)
    return replace(data, readings=readings, weight=weight)
