"""What the terminal and a pull request show. One line a finding:

T0001.blf: error RB301 a1y 0.0312 s: residual 12.4 g > 3.1 g (U 0.8 g, k=2)
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from nineaudit.finding import Finding, Verdict
from nineaudit.report.findings import NOTABLE, by_weight, channels
from nineaudit.report.numbers import NO_BREAK, printable, probability, seconds

if TYPE_CHECKING:
    from nineaudit.auditing import Audit
    from nineaudit.diagnose import Diagnosis

_WORDS = {Verdict.WARN: "warning", Verdict.NOT_EVALUATED: "not evaluated"}
_MANY = 4


def lines(audit: Audit) -> list[str]:
    """The findings a reader must know of, the worst first, and the summary line."""
    name = printable(audit.recording.source.path.name)
    notable = [f for f in by_weight(audit.findings) if f.verdict in NOTABLE]
    return [f"{name}: {finding_line(f)}" for f in notable] + [f"{name}: {summary(audit)}"]


def finding_line(finding: Finding) -> str:
    """``error RB301 a1y 0.0312 s: residual 12.4 g > 3.1 g (U 0.8 g, k=2)``, without the file's name."""
    word = "error" if finding.verdict is Verdict.FAIL else _WORDS.get(finding.verdict, str(finding.verdict))
    measure = finding.measure
    where = [word, finding.rule, listed(channels(finding))]
    if measure and measure.interval:
        where.append(seconds(measure.interval[0]))
    return _on_a_line(f"{' '.join(part for part in where if part)}: {finding.reason}")


def summary(audit: Audit) -> str:
    """Verdict, the diagnosis in a sentence, and how many findings there are of each kind."""
    counts = {v: sum(f.verdict is v for f in audit.findings) for v in Verdict}
    tally = ", ".join(f"{n} {v.replace('_', ' ')}" for v, n in counts.items() if n)
    verdict = str(audit.verdict).replace("_", " ").upper()
    return _on_a_line(f"{verdict}: {diagnosis_sentence(audit.diagnosis)}{_remade(audit)} ({tally})")


def _remade(audit: Audit) -> str:
    """What is not as measured, as the end of a sentence."""
    names = tuple(dict.fromkeys(made.channel for made in audit.recording.remade))
    if not names:
        return ""
    return f"; {joined(names)} {'is' if len(names) == 1 else 'are'} reconstructed, not measured"


def diagnosis_sentence(diagnosis: Diagnosis) -> str:
    """Who did it, as one sentence: the culprit with its probability, the group, nobody, or that it is not known."""
    names, status = diagnosis.channels, str(diagnosis.status)
    best = diagnosis.candidates[0] if diagnosis.candidates else None
    if status == "isolated" and best:
        fault = fault_word(best.fault)
        verb = "is" if len(names) == 1 else "are"
        return f"{joined(names)} {verb} at fault: {fault}, probability {probability(best.probability)}"
    if status == "ambiguous":
        together = probability(sum(c.probability for c in diagnosis.candidates if set(c.channels) <= set(names)))
        return f"the fault is in {joined(names, 'or')}, probability {together}; this motion cannot tell them apart"
    if status == "healthy":
        return "no channel contradicts the others"
    return f"no culprit named: {diagnosis.reason}" if diagnosis.reason else "no culprit named"


def fault_word(fault: str) -> str:
    """``zero_shift`` as people say it."""
    return {"unknown": "fault of unknown kind", "unit": "wrong unit"}.get(fault, fault.replace("_", " "))


def joined(names: tuple[str, ...], conjunction: str = "and") -> str:
    """``a``, ``a and b``, ``a, b and c``."""
    if len(names) < 2:
        return "".join(names)
    return f"{', '.join(names[:-1])} {conjunction} {names[-1]}"


def listed(names: tuple[str, ...]) -> str:
    """Channels of a finding on one line; of many, the first few and how many more there are."""
    shown = ",".join(printable(name) for name in names[:_MANY])
    return f"{shown},+{len(names) - _MANY}" if len(names) > _MANY else shown


def _on_a_line(text: str) -> str:
    """Printable, with the spaces and minus signs that people type when they search a log."""
    return printable(text).replace(NO_BREAK, " ").replace("−", "-")
