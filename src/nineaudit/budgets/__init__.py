"""Error-propagation budgets of a rig or a recording (METHODS 5): three ways, what would help most, what it can prove.

at their word     root sum of squares through the product-free or rate-sensor estimator   estimate/at_their_word.py
Monte Carlo       the same estimator on drawn instruments, nothing linear                  monte_carlo.py
whole-record fit  covariance through the smoother, by source                               estimate/functional.py
"""

from __future__ import annotations

from nineaudit.budgets.compute import Budget, Line, budget_of, typical

__all__ = ["Budget", "Line", "budget_of", "typical"]
