"""What a fault and its repair do to the reported numbers, and whether their stated uncertainty is true."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import chi2

from nineaudit.auditing import mend
from nineaudit.case import Case
from nineaudit.diagnosis import Candidate
from nineaudit.errors import EstimationError
from nineaudit.estimate.motion import Motion
from nineaudit.impact import impact, reported, unit_of
from nineaudit.reconstruct import Reconstruction, rebuild_channel
from nineaudit.rig import parse_rig, preset_text
from nineaudit.simulate import Simulation, simulate
from nineaudit.undo import undo

RIG = parse_rig(preset_text("naap-3222"))


def repaired(motion: str, fault: str, seed: int) -> tuple[Simulation, Case, Reconstruction]:
    found = simulate(RIG, motion, faults=[fault], seed=seed)
    case = Case(found.recording)
    channel, _, rest = fault.partition(":")
    made = undo(case, Candidate((channel,), rest.partition("=")[0], 1.0, 1.0))
    return found, case, made or mend(case, channel)


def true_values(found: Simulation, case: Case) -> dict[str, float]:
    truth = found.truth
    return reported(case, truth.time, Motion(truth.omega, truth.alpha, truth.a0, "truth"))


@pytest.mark.parametrize(("motion", "fault"), [("drop", "a0z:clipping=0.5"), ("general", "a2x:gain=30%")])
def test_a_repair_moves_the_values_to_the_truth(motion: str, fault: str) -> None:
    found, case, made = repaired(motion, fault, 2)
    changes, truth = impact(case, made), true_values(found, case)
    assert set(changes) == set(truth)
    worst = max(abs(changes[n].before - truth[n]) / changes[n].u for n in truth)
    assert worst > 10.0
    for name, change in changes.items():
        assert abs(change.after - truth[name]) < 5.0 * change.u, name
        assert change.unit == unit_of(name)


def test_the_same_seed_gives_the_same_uncertainties() -> None:
    _, case, made = repaired("drop", "a0z:clipping=0.6", 1)
    assert impact(case, made) == impact(case, made)


def test_a_repair_without_a_fit_has_no_impact() -> None:
    case = Case(simulate(RIG, "drop", seed=1).recording)
    with pytest.raises(EstimationError, match="no whole-record fit"):
        impact(case, replace(rebuild_channel(case, "a0z"), fit=None))


@pytest.mark.slow
@pytest.mark.parametrize(
    ("motion", "fault"),
    [("general", "a1y:gain=30%"), ("drop", "a0z:clipping=0.6"), ("oblique", "a3y:unknown=30%")],
)
def test_observed_scatter_is_the_predicted_one(motion: str, fault: str) -> None:
    """Values after the repair less the true ones, over u, of 28 motions, instruments and noises: the scatter of a
    standard normal variable within its χ² limits at 1e-4 and the 9 % to which 64 draws know u. The mean is not 0 for
    peaks, which noise raises, so u holds that bias and may be larger than the scatter, not smaller."""
    count, off = 28, []
    for seed in range(count):
        found, case, made = repaired(motion, fault, 500 + seed)
        changes, truth = impact(case, made), true_values(found, case)
        off.append({n: (changes[n].after - truth[n]) / changes[n].u for n in truth})
    low, high = np.sqrt(chi2.ppf([1e-4, 1 - 1e-4], count - 1) / (count - 1))
    for name in off[0]:
        scatter = np.std([x[name] for x in off], ddof=1)
        assert scatter < 1.09 * high, name
        if name not in ("peak α", "peak a"):
            assert scatter > low / 1.09, name
