"""How much the calibration errors differ from test to test: the variances T of the model, by restricted likelihood.

With V the covariance of all readings and P = V⁻¹ − V⁻¹X(XᵀV⁻¹X)⁻¹XᵀV⁻¹, REML has for each variance component
yᵀPZZᵀPy = tr(ZᵀPZ) (Patterson & Thompson 1971); here, of each recording's row,

    Σ r² = Σ diag(Λ' − Λ' A cov(x) Aᵀ Λ'),    r = η' − Λ' A x

and the variance is multiplied by the ratio of both sides until they agree (Schaeffer's fixed point).
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from nineaudit.array import FloatArray, IntArray
from nineaudit.campaign.health.model import Change, Marginal, Part, Scatter, Solution, moves, solve
from nineaudit.campaign.health.records import family

ROUNDS, SETTLED, LEAST = 25, 0.02, 1e-6
MANY = 250
"""Recordings that are enough to tell five variances."""


def estimate_scatter(
    parts: Sequence[Part], changes: Sequence[Sequence[Change]], start: Scatter | None = None
) -> Scatter:
    """The variances, of up to MANY recordings spread over the campaign, from `start` on."""
    everything = np.sort(np.concatenate([g.index for part in parts for g in part.groups]))
    chosen = everything[np.unique(np.linspace(0, len(everything) - 1, min(MANY, len(everything))).astype(int))]
    some = [part.take(chosen) for part in parts]
    families = sorted({(r.kind, family(r.parameter)) for part in parts for g in part.groups for r in g.rows})
    tau = dict.fromkeys(families, 0.2**2) | (start or {})
    for _ in range(ROUNDS):
        ratio = _ratios([solve(p, tau, c, across=False) for p, c in zip(some, changes, strict=True) if p.groups], tau)
        tau = {f: max(tau[f] * ratio[f], LEAST) for f in families}
        if all(abs(np.log(ratio[f])) < SETTLED or tau[f] == LEAST for f in families):
            break
    return tau


def coupling(one: Marginal, solution: Solution) -> tuple[FloatArray, IntArray]:
    """(J,p,m) Λ' times what each entry of the solution does to θ, and which entries (m,)."""
    columns = moves(one.group, solution.changes)
    told = one.matrix @ one.group.design
    more = [one.matrix @ column[:, :, None] for _, column in columns]
    place = [len(solution.part.unknowns) + k for k, _ in columns]
    return np.concatenate([told, *more], axis=2), np.concatenate([one.group.at, np.array(place, dtype=np.intp)])


def _ratios(solutions: Sequence[Solution], tau: Scatter) -> Scatter:
    seen, meant = dict.fromkeys(tau, 1e-12), dict.fromkeys(tau, 1e-12)
    for solution in solutions:
        for one in solution.marginals:
            told, at = coupling(one, solution)
            taken = ((told @ solution.cov[np.ix_(at, at)]) * told).sum(axis=(0, 2))
            expected = np.einsum("jpp->p", one.matrix) - taken
            found = (solution.residual(one) ** 2).sum(axis=0)
            for i, row in enumerate(one.group.rows):
                key = row.kind, family(row.parameter)
                seen[key] += found[i]
                meant[key] += max(expected[i], 0.0)
    return {key: seen[key] / meant[key] for key in tau}
