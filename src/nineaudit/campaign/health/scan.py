"""Does an unknown of the model change in the campaign? Score tests of steps, ramps and shock history.

A change x_i → x_i + β f(t) has, with every other unknown of the model eliminated, the score and its information

    u = Σ_j f_j A_ijᵀ (η'_j − Λ'_j A_j x̂),    I = Σ_j f_j² A_ijᵀ Λ'_j A_ij − gᵀ H⁻¹ g,    g = Σ_j f_j A_jᵀ Λ'_j A_ij

and under no change Z = u/√I is standard normal (Rao 1948); the change itself is β = u/I. The recordings of an unknown
are put into at most BINS runs of equal length, and shapes are constant in each:

    step       from the start of a run on                 ramp        linear in time from the start of a run on
    count      recordings before, by their number         worst       hardest shock before, by its size

Where readings scatter more than the model says, as successive ones tell (von Neumann 1941), Z is made smaller by it.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from statistics import NormalDist
from typing import Final

import numpy as np

from nineaudit.array import FloatArray, IntArray
from nineaudit.campaign.health.model import Change, Marginal, Solution, moves

BINS: Final = 50
LEAST_SIDE: Final = 3
"""Recordings on each side of a step."""
LEAST_RECORDINGS: Final = 6
FALSE_ALARM: Final = 1e-3
"""Probability that a sensor without a change is accused in a campaign."""
PER_SENSOR: Final = 8
"""Unknowns of a sensor and its seat: gain, two tilts each, three positions."""
SHAPES: Final = 2 * BINS
"""At most: steps at 49 places, ramps from 48, two shapes of shock history."""
LEAST_INFORMATION: Final = 1e-6


def threshold() -> float:
    """|Z| above which a change is significant: Bonferroni over all shapes of all unknowns of a sensor, two-sided."""
    return NormalDist().inv_cdf(1.0 - FALSE_ALARM / (2.0 * PER_SENSOR * SHAPES))


@dataclass(frozen=True, eq=False)
class Track:
    """The recordings of one unknown in order of time: `index` (J,), `when` (J,), `shock` (J,), `z` (J,) standardised
    score of each, `bin` (J,), and by bin the score `r` (B,), information `info` (B,), coupling `g` (B,m) with the
    entries `at` (m,) of the solution."""

    unknown: int
    index: IntArray
    when: FloatArray
    shock: FloatArray
    z: FloatArray
    weight: FloatArray
    bin: IntArray
    r: FloatArray
    info: FloatArray
    g: FloatArray
    at: IntArray


@dataclass(frozen=True, eq=False)
class Found:
    """The best change of one unknown: `shape` (step, ramp, count, worst) from `first` on, the index of a recording
    (the first that it can be in, and `earliest`, `latest` by shapes that explain nearly as much); `z`, how far it
    goes (`size`), and the `track`."""

    unknown: int
    shape: str
    first: int
    earliest: int
    latest: int
    z: float
    size: float
    amount: FloatArray
    track: Track


def scan(solution: Solution, size: int) -> list[Found]:
    """The best change of every unknown with recordings enough, largest |Z| first. `size`: recordings of the
    campaign."""
    found = (best(track, solution, size) for track in tracks(solution))
    return sorted((f for f in found if f is not None), key=lambda f: -abs(f.z))


def tracks(solution: Solution) -> Iterator[Track]:
    """Every unknown with recordings enough."""
    residuals = [solution.residual(one) for one in solution.marginals]
    for unknown in range(len(solution.part.unknowns)):
        pairs = zip(solution.marginals, residuals, strict=True)
        mine = [_piece(unknown, one, residual) for one, residual in pairs if unknown in one.group.at]
        if sum(len(piece.index) for piece in mine) >= LEAST_RECORDINGS:
            yield _track(unknown, mine, solution)


@dataclass(frozen=True, eq=False)
class Piece:
    """What one group says of an unknown: `index`, `when`, `shock`, score `r` and information `info` (J,), and `told`
    (J,p) what its recordings say of it with every other error."""

    marginal: Marginal
    index: IntArray
    when: FloatArray
    shock: FloatArray
    r: FloatArray
    info: FloatArray
    told: FloatArray


def _piece(unknown: int, one: Marginal, residual: FloatArray) -> Piece:
    group = one.group
    rows = np.flatnonzero(group.design[:, np.flatnonzero(group.at == unknown)[0]])
    told = one.matrix[:, rows].sum(axis=1)
    info, r = told[:, rows].sum(axis=1), residual[:, rows].sum(axis=1)
    return Piece(one, group.index, group.when, group.shock[:, rows[0]], r, info, told)


def _coupled(piece: Piece, bins: IntArray, count: int, solution: Solution) -> tuple[FloatArray, list[int]]:
    """(B,m) by bin, and which entries of the solution (m,)."""
    group, n = piece.marginal.group, len(solution.part.unknowns)
    member = np.zeros((count, len(bins)))
    member[bins, np.arange(len(bins))] = 1.0
    columns = moves(group, solution.changes)
    changed = [member @ (piece.told * column).sum(axis=1) for _, column in columns]
    by_bin = np.column_stack([member @ piece.told @ group.design, *changed])
    return by_bin, [*group.at.tolist(), *(n + k for k, _ in columns)]


def _track(unknown: int, pieces: Sequence[Piece], solution: Solution) -> Track:
    index = np.concatenate([p.index for p in pieces])
    order = np.argsort(index)
    rank = np.empty(len(index), dtype=np.intp)
    rank[order] = np.arange(len(index))
    bins = rank * min(BINS, len(index)) // len(index)
    count = int(bins.max()) + 1
    cuts = np.cumsum([len(p.index) for p in pieces])[:-1]
    by_piece = [_coupled(p, b, count, solution) for p, b in zip(pieces, np.split(bins, cuts), strict=True)]
    at = np.unique([place for _, places in by_piece for place in places])
    coupling = np.zeros((count, len(at)))
    for values, places in by_piece:
        coupling[:, np.searchsorted(at, places)] += values
    bins = bins[order]
    when, shock = (np.concatenate([getattr(p, name) for p in pieces])[order] for name in ("when", "shock"))
    r, info = (np.concatenate([getattr(p, name) for p in pieces])[order] for name in ("r", "info"))
    z = r / np.sqrt(np.maximum(info, LEAST_INFORMATION))
    by_bin, info_by_bin = (np.asarray(np.bincount(bins, v, count), dtype=np.float64) for v in (r, info))
    return Track(unknown, index[order], when, shock, z, info, bins, by_bin, info_by_bin, coupling, at)


def shapes(track: Track) -> tuple[list[tuple[str, int]], FloatArray]:
    """Name and first bin of every shape, and (S,B) their values, 0 to 1."""
    count = len(track.r)
    sizes, bins = np.bincount(track.bin, minlength=count), np.arange(count)
    when = np.bincount(track.bin, track.when, count) / sizes
    before = np.cumsum(sizes) - sizes
    steps = np.flatnonzero(np.minimum(before, len(track.bin) - before) >= LEAST_SIDE)
    ramps = np.flatnonzero((bins < count - 2) & (len(track.bin) - before >= 2 * LEAST_SIDE) & (when < when[-1]))
    names = [("step", int(k)) for k in steps] + [("ramp", int(k)) for k in ramps]
    rising = (when - when[ramps, None]) / (when[-1] - when[ramps, None])
    rows = [*(bins >= steps[:, None]).astype(np.float64), *np.clip(rising, 0.0, 1.0)]
    hardest = np.concatenate([[0.0], np.maximum.accumulate(track.shock)[:-1]])
    histories = (("count", np.arange(len(track.bin), dtype=np.float64)), ("worst", hardest))
    for name, history in histories:
        if history[-1] > 0.0:
            names.append((name, 0))
            rows.append(np.bincount(track.bin, history / history[-1], count) / sizes)
    return names, np.array(rows).reshape(-1, count)


def best(track: Track, solution: Solution, size: int) -> Found | None:
    """The shape with the largest |Z|; None where no shape can be told from what else is unknown."""
    names, values = shapes(track)
    cov = solution.cov[np.ix_(track.at, track.at)]
    hidden = track.g @ cov @ track.g.T
    plain = values**2 @ track.info
    info = plain - np.einsum("sb,bc,sc->s", values, hidden, values)
    seen = info > LEAST_INFORMATION * np.maximum(plain, 1.0)
    if not seen.any():
        return None
    score = values @ track.r
    z = np.where(seen, score / np.sqrt(np.where(seen, info, 1.0)), 0.0) / excess(track)
    top = int(np.argmax(np.abs(z)))
    near = [k for k, (name, _) in enumerate(names) if name == names[top][0] and z[top] ** 2 - z[k] ** 2 < 3.84]
    first, earliest = (int(track.index[np.searchsorted(track.bin, names[k][1])]) for k in (top, min(near)))
    latest = int(track.index[np.searchsorted(track.bin, names[max(near)][1], side="right") - 1])
    amount = np.zeros(size)
    amount[track.index] = values[top][track.bin]
    return Found(
        track.unknown,
        names[top][0],
        first,
        earliest,
        latest,
        float(z[top]),
        float(score[top] / info[top]),
        amount,
        track,
    )


def excess(track: Track) -> float:
    """Scatter of successive estimates over what the model says, 1 at least: a change is in few of the differences."""
    told = track.weight > LEAST_INFORMATION
    if told.sum() < 2 * LEAST_RECORDINGS:
        return 1.0
    variance = 1.0 / track.weight[told]
    estimate = track.z[told] * np.sqrt(variance)
    steps = np.diff(estimate) ** 2 / (variance[1:] + variance[:-1])
    few = max(len(steps) // 25, 2)  # a bad test is in two differences; it is left to outlying()
    return float(np.sqrt(max(np.sort(steps)[:-few].mean() / _trimmed(few / len(steps)), 1.0)))


def _trimmed(part: float) -> float:
    """Mean of the squares of a standard normal without its largest `part`."""
    limit = NormalDist().inv_cdf(1.0 - part / 2.0)
    return (1.0 - part - 2.0 * limit * NormalDist().pdf(limit)) / (1.0 - part)


def outlying(found: Found) -> IntArray:
    """Recordings without which a change is not significant, and that are unlike those about them: bad tests."""
    track = found.track
    near = np.array([np.median(track.z[max(i - 3, 0) : i + 4]) for i in range(len(track.z))])
    odd = np.abs(track.z - near) > 5.0 * excess(track)
    if not odd.any():
        return np.zeros(0, dtype=np.intp)
    shape = found.amount[track.index]
    centred = shape - np.average(shape, weights=np.maximum(track.weight, LEAST_INFORMATION))
    kept = ~odd
    left = centred[kept] @ (track.z * np.sqrt(track.weight))[kept]
    power = float(np.sqrt((centred[kept] ** 2) @ track.weight[kept]))
    return track.index[odd] if abs(left) < threshold() * power else np.zeros(0, dtype=np.intp)


def change(found: Found) -> Change:
    """The change as the model takes it."""
    return Change(found.unknown, found.amount)
