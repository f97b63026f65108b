"""Markdown tables of many trials."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from itertools import groupby

import numpy as np
from draws import HEALTHY, LISTED, SEVERITIES, WHITE
from trials import AUDIT, CLOSED_FORMS, NAIVE, Outcome, Rebuilt, Trial

METHODS = (AUDIT, CLOSED_FORMS, NAIVE)
VISIBLE = 21.7
"""λ of an injected fault above which one who knows its waveform sees it 94 times in a hundred at one false alarm in a
thousand."""
FOUND = (Outcome.ALONE, Outcome.GROUP)
COLUMNS = (Outcome.ALONE, Outcome.GROUP, Outcome.WRONG, Outcome.OTHER, Outcome.UNDIAGNOSED, Outcome.MISSED)


def percent(part: Iterable[bool]) -> str:
    """Share of True, with one decimal where there are a hundred."""
    values = list(part)
    if not values:
        return "–"
    share = 100.0 * sum(values) / len(values)
    return f"{share:.1f}" if len(values) >= 100 else f"{share:.0f}"


def of_outcomes(trials: Sequence[Trial], method: str, outcomes: Sequence[Outcome]) -> str:
    """Share of the trials that ended so, of those the method applies to."""
    return percent(o in outcomes for t in trials if (o := t.outcome(method)) is not None)


def number(values: Iterable[float], combine: Callable[[Sequence[float]], float], digits: int = 2) -> str:
    """`combine` of the finite values, or a dash."""
    finite = [v for v in values if math.isfinite(v)]
    return f"{combine(finite):.{digits}f}" if finite else "–"


def rms(values: Sequence[float]) -> float:
    return float(np.sqrt(np.mean(np.square(values))))


def mean(values: Sequence[float]) -> float:
    return float(np.mean(values))


def median(values: Sequence[float]) -> float:
    return float(np.median(values))


def table(head: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """A Markdown table, numbers to the right of the first two columns."""
    lines = ["| " + " | ".join(head) + " |", "|" + "|".join(["---", *["--:"] * (len(head) - 1)]) + "|"]
    return "\n".join([*lines, *("| " + " | ".join(row) + " |" for row in rows)])


def report(trials: Sequence[Trial], command: str) -> str:
    """The whole document."""
    parts = [
        "# Diagnosis benchmark\n\n" + _preface(trials, command),
        "## Figures\n\n" + figures(trials),
        "## By fault and severity: nineaudit\n\n" + by_severity(trials),
        "## Side by side\n\nPer cent named alone / right group / wrong name / undiagnosed or missed; for healthy "
        "recordings, per cent called faulty.\n\n" + side_by_side(trials),
        "## By motion: nineaudit\n\n" + by_motion(trials),
        "## Wrong names and groups, false alarms, crashes\n\nEach can be drawn again with `--case NAME`.\n\n"
        + failures(trials),
    ]
    return "\n\n".join(parts) + "\n"


def _preface(trials: Sequence[Trial], command: str) -> str:
    return f"""{len(trials)} simulated recordings, made by `{command}`.

Motions in general, in a plane, of a sled test, of a drop, of an oblique impact; instruments drawn from 0.5 % gain,
0.5° alignment, 0.5 mm, 0.1 g_0 zero; noise 0.05 to 0.4 g_0 behind CFC1000; 10 and 20 kHz; arms 45 to 65 mm. Faults in
channels whose peak is a quarter of the array's largest at least; swaps of channels that differ by as much; a dropout,
or a channel that is stuck, about its peak; all else as in `benchmarks/draws.py`. `white`: a free waveform in a channel
of a perfect instrument in white noise.

**detected**: not called healthy. **alone**: the faulty channel, and no other, is named (both of a swap). **group**: an
ambiguous group that contains it. **wrong**: a name that is not the faulty channel's. **other**: a group without the
culprit, or one of two swapped channels. **word**: of those named alone, the kind of fault is right too. Reconstruction,
of those named alone, over the replaced samples after the event began: rms error over the Cramér–Rao bound of white
noise σ√(h/(1−h)), over the rms of the stated u, and the share inside the stated 95 % interval; the truth is what the
rig at its word would have read. **Above isolable**: the injected error is worth more than the smallest isolable zero
shift that the diagnosis states for that channel (the smaller ratio of a swapped pair). It is worth its rms from the
event to the end, or the zero shift that stands out as far from calibration errors where that is less; both are exact
for a zero shift. A size stated as infinite is never exceeded.
**Visible**: λ > {VISIBLE} for one who knows the waveform of the fault (`closed_forms.visibility`); what is not visible
nobody can find among calibration errors of the stated size."""


def by_severity(trials: Sequence[Trial]) -> str:
    head = (
        "fault", "severity", "n", "visible", "above isolable", "detected", *(str(c) for c in COLUMNS[:-1]), "word",
        "rms / bound", "rms / u", "in 95 %", "s",
    )  # fmt: skip
    return table(head, (_severity_row(kind, severity, group) for kind, severity, group in _grouped(trials)))


def _grouped(trials: Sequence[Trial]) -> Iterable[tuple[str, str, list[Trial]]]:
    """Healthy recordings by motion, then white, then the faults in the order of SEVERITIES."""
    kinds = [HEALTHY, WHITE, *SEVERITIES]

    def key(t: Trial) -> tuple[int, int, str]:
        labels = [s.label for s in SEVERITIES.get(t.kind, ())]
        return kinds.index(t.kind), labels.index(t.severity) if t.severity in labels else 0, t.severity

    for (kind, _, severity), group in groupby(sorted(trials, key=key), key):
        yield kinds[kind], severity, list(group)


def _severity_row(kind: str, severity: str, group: list[Trial]) -> list[str]:
    repaired = [t.rebuilt[AUDIT] for t in group if AUDIT in t.rebuilt]
    faulty = kind != HEALTHY
    named = [t for t in group if t.outcome(AUDIT) is Outcome.ALONE]
    return [
        kind.replace("_", " "),
        severity,
        str(len(group)),
        percent(t.visible > VISIBLE for t in group if math.isfinite(t.visible)),
        percent(t.size > 1.0 for t in group if math.isfinite(t.size)),
        percent(t.outcome(AUDIT) is not Outcome.MISSED for t in group) + ("" if faulty else " (false)"),
        *(of_outcomes(group, AUDIT, [c]) for c in COLUMNS[:-1]),
        percent(t.word == kind for t in named) if kind in SEVERITIES else "–",
        *_quality(repaired),
        number((t.seconds for t in group), median),
    ]


def _quality(repaired: Sequence[Rebuilt]) -> tuple[str, str, str]:
    return (
        number((r.over_bound for r in repaired), rms),
        number((r.over_u for r in repaired), rms),
        number((100 * r.covered for r in repaired), mean, 0),
    )


def side_by_side(trials: Sequence[Trial]) -> str:
    rows = []
    for kind in (HEALTHY, WHITE, *SEVERITIES):
        group = [t for t in trials if t.kind == kind]
        if group:
            cells = [_alarms(group, m) if kind == HEALTHY else _four(group, m) for m in METHODS]
            rows.append([kind.replace("_", " "), str(len(group)), *cells])
    return table(("fault", "n", "nineaudit", "closed forms, calibration in the fit", "naive"), rows)


def _alarms(group: Sequence[Trial], method: str) -> str:
    return of_outcomes(group, method, [o for o in Outcome if o is not Outcome.MISSED])


def _four(group: Sequence[Trial], method: str) -> str:
    parts = ([Outcome.ALONE], [Outcome.GROUP], [Outcome.WRONG], [Outcome.UNDIAGNOSED, Outcome.MISSED])
    return " / ".join(of_outcomes(group, method, part) for part in parts)


def by_motion(trials: Sequence[Trial]) -> str:
    faulty = [t for t in trials if t.kind in SEVERITIES]
    rows = []
    for motion in sorted({t.motion for t in faulty}):
        group = [t for t in faulty if t.motion == motion]
        rows.append([motion, str(len(group)), *(of_outcomes(group, AUDIT, [c]) for c in COLUMNS)])
    return table(("motion", "n", *map(str, COLUMNS)), rows)


def figures(trials: Sequence[Trial]) -> str:
    """One line for each figure demanded: of nineaudit, the closed forms and the naive test."""
    healthy = [t for t in trials if t.kind == HEALTHY]
    faulty = [t for t in trials if t.kind in SEVERITIES]
    rows = [
        ("healthy recordings called faulty, %", "≤ 1", len(healthy), *(_alarms(healthy, m) for m in METHODS)),
        ("their cost per degree of freedom, mean", "0.9–1.1", len(healthy), _statistic(healthy), "–", "–"),
        *_naming("above the stated smallest isolable", [t for t in faulty if t.size > 1.0], "≥ 99", "≤ 0.5", "–"),
        *_naming("all faults", faulty, "≥ 97", "≤ 1", "≥ 85"),
        *_naming("the eight listed kinds", [t for t in faulty if t.kind in LISTED], "≥ 97", "≤ 1", "≥ 85"),
        *_naming("visible faults", [t for t in faulty if t.visible > VISIBLE], "–", "–", "–"),
        *_reconstruction(trials),
        ("channels in a right group, mean", "–", len(faulty), *(_group_size(faulty, m) for m in METHODS)),
        ("seconds a recording, whole audit, median", "–", len(trials), _median_seconds(trials), "–", "–"),
        ("crashes", "0", len(trials), str(sum(t.error is not None for t in trials)), "–", "–"),
    ]
    head = ("figure", "demanded", "n", "nineaudit", "closed forms", "naive")
    return table(head, ([str(cell) for cell in row] for row in rows))


def _naming(what: str, group: Sequence[Trial], found: str, wrong: str, alone: str) -> list[tuple[object, ...]]:
    demands = (("right name or group", FOUND, found), ("wrong name", [Outcome.WRONG], wrong),
               ("named alone", [Outcome.ALONE], alone))  # fmt: skip
    return [
        (f"{what}: {label}, %", demanded, len(group), *(of_outcomes(group, m, outcomes) for m in METHODS))
        for label, outcomes, demanded in demands
    ]


def _statistic(healthy: Sequence[Trial]) -> str:
    """Mean, and the 5th and 95th percentile."""
    values = [t.statistic for t in healthy if t.statistic is not None]
    if not values:
        return "–"
    low, high = np.percentile(values, [5, 95])
    return f"{np.mean(values):.2f} ({low:.2f} to {high:.2f})"


def _reconstruction(trials: Sequence[Trial]) -> list[tuple[object, ...]]:
    def of(method: str, white: bool) -> list[Rebuilt]:
        return [t.rebuilt[method] for t in trials if method in t.rebuilt and (t.kind == WHITE) is white]

    white, real, closed = of(AUDIT, True), of(AUDIT, False), of(CLOSED_FORMS, True)
    over_u, covered = [r.over_u for r in real], [100 * r.covered for r in real]
    own, n = [100 * r.covered_own for r in real], len(real)
    bounds = [number((r.over_bound for r in found), rms, 3) for found in (white, closed)]
    lines: list[tuple[object, ...]] = [
        ("rms over the bound, white noise, perfect instrument", "≤ 1.1", len(white), *bounds),
        ("rms over the stated u", "≤ 1.3", n, number(over_u, rms), "–"),
        ("rms over the stated u, median recording", "–", n, number(over_u, median), "–"),
        ("in the stated 95 % interval, %", "93–97", n, number(covered, mean, 1), "–"),
        ("the same, of what the drawn instrument reads, %", "–", n, number(own, mean, 1), "–"),
    ]
    return [(f"reconstruction: {what}", *rest, "–") for what, *rest in lines]


def _group_size(faulty: Sequence[Trial], method: str) -> str:
    sizes = (len(t.answers[method][1]) for t in faulty if t.outcome(method) is Outcome.GROUP)
    return number(sizes, mean, 1)


def _median_seconds(trials: Sequence[Trial]) -> str:
    return number((t.seconds for t in trials), median)


def failures(trials: Sequence[Trial], most: int = 60) -> str:
    """The answers that must not be, worst kinds first."""
    lines = []
    for t in sorted(trials, key=lambda t: (t.kind, t.name)):
        outcome = t.outcome(AUDIT)
        if (
            t.error
            or outcome in (Outcome.WRONG, Outcome.OTHER)
            or (t.kind == HEALTHY and outcome is not Outcome.MISSED)
        ):
            status, named = t.answers[AUDIT]
            said = t.error or f"{status} {', '.join(named)}".strip()
            lines.append([f"{t.name}", t.motion, f"{t.noise_g:.2f}", t.fault or "none", said, f"{t.size:.1f}"])
    head = ("case", "motion", "noise, g_0", "injected", "said", "size / isolable")
    more = f"\n\nand {len(lines) - most} more" if len(lines) > most else ""
    return table(head, lines[:most]) + more if lines else "None."
