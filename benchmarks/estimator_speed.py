"""Cost of the whole-record estimator with its hypotheses, by record length, and beside a minimisation per time step.

    python benchmarks/estimator_speed.py [--most 2000000] [--runs 3] [--steps 300]

Nine channels, 3-2-2-2, in motion throughout, one channel 15 % off, at 10 kHz. "fit" is the healthy hypothesis of the
whole record alone, "search" that and all the others, "diagnosis" what the audit does, by whichever method it chooses
for this array, with the evidence of the single channels. Memory is the peak of what Python and numpy allocate during
the search (tracemalloc), over the size of the readings.

Figures to hold: 20,000 samples in 1.0 s with all hypotheses; cost per sample the same within 20 % from 20,000 to
2,000,000; memory 40 times the readings; 100 times faster than the minimisation of [Takhounts09 eq 34], which takes at
each time step, one after the other, the α that makes the squares of the residuals of the constraints (eq 14) least, the
ω of the constraints integrated up to the step by the trapezoid rule, with scipy.optimize from the α of eq 12. It is
timed over `--steps` steps in the middle of the record; its cost is linear in their number.
"""

from __future__ import annotations

import argparse
import os
import time
import tracemalloc
from collections.abc import Callable
from dataclasses import dataclass, replace

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # the matrices are small

import numpy as np

from nineaudit.array import FloatArray
from nineaudit.case import Case
from nineaudit.diagnose import diagnose
from nineaudit.physics import kinematics, nap
from nineaudit.recording import Recording
from nineaudit.rig import parse_rig, preset_text
from nineaudit.simulate import simulate

RATE, ARMS = 10_000.0, (50.0, 55.0, 60.0)
LENGTHS = (20_000, 60_000, 200_000, 600_000, 2_000_000)
FAULT = "a1y:gain=15%"


@dataclass(frozen=True)
class Cost:
    """Seconds of the fit, of all hypotheses, and of the diagnosis; peak of memory over the readings."""

    samples: int
    fit: float
    search: float
    diagnosis: float
    memory: float
    said: str


def recording(samples: int) -> Recording:
    """A recording of that many samples, in motion all the while."""
    rig = parse_rig(preset_text("naap-3222", arms=list(ARMS)))
    duration = (samples - 1) / RATE - 0.025
    return simulate(rig, "alem-quiet", seed=1, rate_hz=RATE, duration_s=duration, faults=[FAULT]).recording


def fresh(found: Recording) -> Case:
    """A case in which nothing has been computed yet."""
    return Case(replace(found))


def diagnosed(case: Case) -> str:
    """The diagnosis as the audit makes it, in words."""
    words = {found.channel: found.fault for found in case.evidence if found.fault is not None}
    result = diagnose(case, words)
    return " ".join((str(result.status), *result.channels))


def best_of(runs: int, work: Callable[[], object]) -> float:
    """Least seconds of so many runs: what else the machine does only adds to a time."""
    least = float("inf")
    for _ in range(runs):
        start = time.perf_counter()
        work()
        least = min(least, time.perf_counter() - start)
    return least


def fitted(case: Case) -> object:
    """The healthy hypothesis alone."""
    from nineaudit.estimate.hypotheses import healthy_fit

    return healthy_fit(case.fit_data)


def cost(samples: int, runs: int) -> Cost:
    """Times without, then memory with the tracing of allocations."""
    found = recording(samples)
    fit = best_of(runs, lambda: fitted(fresh(found)))
    search = best_of(runs, lambda: fresh(found).search)
    diagnosis, said = best_of(runs, lambda: diagnosed(fresh(found))), diagnosed(fresh(found))
    tracemalloc.start()
    fresh(found).search  # noqa: B018
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    return Cost(samples, fit, search, diagnosis, peak / found.readings.nbytes, said)


def per_time_step(samples: int, steps: int) -> float:
    """Seconds a time step of the minimisation of [Takhounts09 eq 34], over `steps` steps in mid-record."""
    found = fresh(recording(samples))
    _, arms = found.nap_layout or ((), np.array(ARMS) / 1e3)
    alpha, products = nap.alpha(found.readings, arms), nap.products(found.readings, arms)
    omega, first = kinematics.integrate(alpha, found.time), len(alpha) // 2
    start = time.perf_counter()
    minimised(alpha[first : first + steps], products[first : first + steps], omega[first], 1.0 / RATE)
    return (time.perf_counter() - start) / steps


def minimised(alpha: FloatArray, products: FloatArray, omega: FloatArray, step: float) -> FloatArray:
    """(n,3) α that makes Σ (ωjωk − P_i)² least at each step, ω_t = ω_t−1 + h (α_t−1 + α_t)/2; `alpha` (n,3) the start,
    `products` P (n,3) the right sides of the constraints, `omega` (3,) at the first step."""
    from scipy.optimize import minimize

    out = alpha.copy()
    for t in range(1, len(alpha)):
        target, before, last = products[t], omega, out[t - 1]

        def squares(a: FloatArray, target=target, before=before, last=last) -> float:
            x, y, z = before + 0.5 * step * (last + a)
            return float((y * z - target[0]) ** 2 + (z * x - target[1]) ** 2 + (x * y - target[2]) ** 2)

        out[t] = minimize(squares, alpha[t]).x
        omega = before + 0.5 * step * (last + out[t])
    return out


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--most", type=int, default=LENGTHS[-1], help="samples of the longest record")
    parser.add_argument("--runs", type=int, default=3)
    parser.add_argument("--steps", type=int, default=300, help="time steps of the minimisation")
    options = parser.parse_args()
    costs = [cost(n, options.runs) for n in LENGTHS if n <= options.most]
    base = costs[0]
    head = ("samples", "fit, s", "search, s", "µs/sample", "ratio", "diagnosis, s", "memory/readings")
    print("".join(f"{title:>17}" for title in head), " said")
    for c in costs:
        each = 1e6 * c.search / c.samples
        row = (c.fit, c.search, each, each / (1e6 * base.search / base.samples), c.diagnosis, c.memory)
        print(f"{c.samples:>17}" + "".join(f"{value:>17.2f}" for value in row), "", c.said)
    step = per_time_step(base.samples, options.steps)
    whole = step * base.samples
    print(
        f"minimisation per time step (eq 34): {1e3 * step:.2f} ms a step, {whole:.0f} s for {base.samples} samples: "
        f"{whole / base.fit:.0f} times the fit, {whole / base.search:.0f} times the search, "
        f"{whole / base.diagnosis:.0f} times the diagnosis"
    )


if __name__ == "__main__":
    main()
