"""Audit -> the HTML report: one file, offline, complete without script, the same bytes for the same audit.

The script of the page (zoom, reviewer's form) and the style sheet are let in by their hashes, and nothing else is.
"""

from __future__ import annotations

import base64
import hashlib
import math
from collections.abc import Sequence
from functools import cache
from importlib.resources import files
from pathlib import Path
from typing import TYPE_CHECKING, Any

from nineaudit.files import write_whole
from nineaudit.finding import Verdict
from nineaudit.report import annex, hypotheses, mended, method, origin, review, tables, tested
from nineaudit.report.channels import gallery
from nineaudit.report.figures import Figure, constraint_figures, motion_figures, reconstruction_figures
from nineaudit.report.findings import NOTABLE, WEIGHT, by_rule, channels
from nineaudit.report.numbers import (
    digits,
    edge,
    printable,
    probability,
    quantity,
    sensor_edge,
    spelled,
)
from nineaudit.report.text import diagnosis_sentence, fault_word, joined
from nineaudit.report.view import views
from nineaudit.report.zoom import store, zoomable

if TYPE_CHECKING:
    from jinja2 import Template

    from nineaudit.auditing import Audit
    from nineaudit.diagnose import Diagnosis

MARKS = {
    Verdict.PASS: "✓",
    Verdict.FAIL: "✕",
    Verdict.WARN: "!",
    Verdict.INCONCLUSIVE: "?",
    Verdict.WAIVED: "~",
    Verdict.NOT_APPLICABLE: "·",
    Verdict.NOT_EVALUATED: "?",
}
"""A sign beside every verdict's word, so that neither colour nor sign alone has to carry it."""

LEAD = {
    "pass": "The recording passes every rule that applies to it.",
    "fail": "The recording breaks at least one rule of severity error.",
    "inconclusive": "The recording can neither be passed nor failed within the measurement uncertainty.",
    "not_audited": "The recording could not be audited. That is not a pass.",
}


def write_report(audit: Audit, path: str | Path) -> Path:
    """Write the report of `audit` to `path`, whole or not at all. OSError where the place cannot be written."""
    path = Path(path)
    write_whole(path, render(audit))
    return path


def render(audit: Audit) -> str:
    """The report as a string of HTML."""
    return template("report.html.j2").render(context(audit)) + "\n"


@cache
def template(name: str) -> Template:
    """A template of this package; what it is given is escaped."""
    from jinja2 import Environment, PackageLoader, StrictUndefined
    from markupsafe import Markup

    environment = Environment(
        loader=PackageLoader("nineaudit.report", "templates"),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        finalize=lambda value: value if isinstance(value, Markup) else printable(value),
    )
    environment.filters["drawn"] = _drawn
    return environment.get_template(name)


def _drawn(figure: Figure) -> Any:
    """The SVG of a figure, which svg.py has escaped, as safe markup."""
    from markupsafe import Markup

    return Markup(figure.svg)


ZOOMS = ("vendor/uplot/uPlot.iife.min.js", "templates/zoom.js")
SCRIPTS = (*ZOOMS, "templates/review.js")


def style(more: str = "") -> dict[str, Any]:
    """The style sheet, with `more` rules after it, and the policy that allows it and nothing else."""
    from markupsafe import Markup

    sheet = "\n" + _packaged("templates/report.css") + more
    return {"css": Markup(sheet), "csp": _policy(f"style-src {_digest(sheet)}")}


ZOOM_STYLE = "vendor/uplot/uPlot.min.css"


def script(names: Sequence[str] = SCRIPTS, sheet: str = ZOOM_STYLE, more: str = "") -> dict[str, Any]:
    """The style sheet with `sheet` and `more` rules, the scripts of a page (of one that can zoom and be reviewed), and
    the policy that allows just these."""
    from markupsafe import Markup

    code = "\n" + "\n".join(_packaged(name) for name in names)
    styled = style("\n" + _packaged(sheet) + "\n" + more)
    policy = _policy(f"script-src {_digest(code)}; style-src {_digest(styled['css'])}")
    return styled | {"script": Markup(code), "csp": policy}


@cache
def _packaged(name: str) -> str:
    return files("nineaudit.report").joinpath(name).read_text(encoding="utf-8")


def _digest(text: str) -> str:
    digest = base64.b64encode(hashlib.sha256(str(text).encode("utf-8")).digest()).decode("ascii")
    return f"'sha256-{digest}'"


def _policy(allowed: str) -> str:
    return f"default-src 'none'; {allowed}; base-uri 'none'; form-action 'none'"


def context(audit: Audit) -> dict[str, Any]:
    """Everything that the template shows, as finished strings, lists of them, and figures."""
    drawn = {
        "constraints": zoomable(constraint_figures(audit)),
        "motion": zoomable(motion_figures(audit)),
        "gallery": zoomable(gallery(audit, audit.diagnosis.channels)),
    }
    new = rebuilt(audit)
    shown = [*(new["figures"] if new else ()), *(f for figures in drawn.values() for f in figures)]
    return (
        script()
        | drawn
        | _tables(audit)
        | {
            "marks": {str(verdict): mark for verdict, mark in MARKS.items()},
            "name": audit.recording.source.path.name,
            "banner": banner(audit),
            "diagnosis": audit.diagnosis,
            "residuals": hypotheses.residuals(audit),
            "ambiguity": hypotheses.ambiguity(audit),
            "rebuilt": new,
            "tally": tally(audit),
            "views": views(audit),
            "rig": rig(audit),
            "store": store(shown),
            "review": review.form(audit),
        }
    )


def _tables(audit: Audit) -> dict[str, Any]:
    return {
        "identity": origin.identity(audit),
        "test": tested.section(audit.recording.test),
        "candidates": tables.candidates(audit),
        "sensitivity": tables.sensitivity(audit),
        "impact": tables.impact(audit),
        "methods": tables.methods(audit),
        "families": tables.rule_families(audit),
        "budget": annex.budget(audit),
        "waivers": annex.waivers(audit),
        "deviations": annex.deviations(audit),
        "calibration": annex.calibration(audit),
        "rest": annex.rest(audit),
        "bus": annex.bus(audit),
        "damage": annex.damage(audit),
        "provenance": origin.provenance(audit) + ([("Command", audit.command, True)] if audit.command else []),
        "method": method.paragraphs(audit),
        "references": method.references(audit),
    }


def banner(audit: Audit) -> dict[str, Any]:
    """The verdict, who is at fault, how sure that is, and who would be next."""
    diagnosis, verdict = audit.diagnosis, str(audit.verdict)
    others = [c for c in diagnosis.candidates if not set(c.channels) & set(diagnosis.channels)]
    rival = others[0] if others else None
    return {
        "verdict": verdict,
        "number": origin.number(audit),
        "label": verdict.replace("_", " "),
        "lead": LEAD[verdict],
        "power": tables.power(audit) if str(diagnosis.status) == "healthy" else "",
        "sentence": headline(diagnosis),
        "next": (
            f"{joined(rival.channels)} ({fault_word(rival.fault)}), probability {probability(rival.probability)}"
            if rival and diagnosis.channels
            else ""
        ),
        "repaired": mended.sentences(audit),
        "broken": [
            {"code": g.rule, "verdict": str(g.verdict), "channels": _channels(g)}
            for g in sorted(by_rule(audit.findings), key=lambda g: WEIGHT.index(g.verdict))
            if g.verdict in NOTABLE
        ],
    }


def headline(diagnosis: Diagnosis) -> str:
    """The diagnosis as a sentence that starts with a capital, which a channel's name may not."""
    sentence = diagnosis_sentence(diagnosis)
    if str(diagnosis.status) == "isolated":
        return f"{'Channels' if len(diagnosis.channels) > 1 else 'Channel'} {sentence}."
    return f"{sentence[0].upper()}{sentence[1:]}."


def _channels(group: Any) -> str:
    """The channels that share the worst verdict of a rule; of many, how many."""
    named = dict.fromkeys(c for f in group.findings if f.verdict is group.verdict for c in channels(f))
    return f"{len(named)} channels" if len(named) > 3 else ", ".join(named)


def tally(audit: Audit) -> list[tuple[str, str, int]]:
    """(verdict, label, number of rules) for every verdict that occurs, by each rule's worst finding."""
    verdicts = [g.verdict for g in by_rule(audit.findings)]
    return [(str(v), v.replace("_", " "), verdicts.count(v)) for v in Verdict if v in verdicts]


def rebuilt(audit: Audit) -> dict[str, Any] | None:
    """What was replaced, how, from what, and how well it is known."""
    new = audit.reconstruction
    if new is None:
        return None
    rig = audit.recording.rig
    unit, one = sensor_edge(rig.array[new.channels[0]], rig)
    replaced = int(new.replaced.sum())
    said = mended.words(new)
    facts = [
        ("Channel", joined(new.channels)),
        ("Interval", tables.interval(new.interval)),
        ("Samples replaced", f"{replaced} of {new.replaced.size}"),
        ("Method", new.method),
        (said["donors"], ", ".join(new.donors)),
        ("Standard uncertainty u (rms)", quantity(float(new.u_rms) / one, unit, 2)),
    ]
    if math.isfinite(new.bound_ratio):
        facts.append(("Its white-noise part against the Cramér–Rao bound", f"{digits(new.bound_ratio)} times"))
    return said | {"facts": facts, "figures": zoomable(reconstruction_figures(audit))}


def rig(audit: Audit) -> dict[str, Any]:
    """The rig's table and its units."""
    value = audit.recording.rig
    unit, metre = edge("m", value)
    return {
        "name": value.name,
        "length": spelled(unit),
        "sensors": tables.sensors(audit),
        "points": [(p.name, [digits(float(v) / metre) for v in p.position]) for p in value.points],
    }
