"""What CI systems read: JUnit XML, GitHub annotations, a job summary in Markdown."""

from __future__ import annotations

import html
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING
from xml.etree import ElementTree as ET

from nineaudit.finding import Finding, Severity, Verdict
from nineaudit.report.findings import NOTABLE, by_family, by_weight, channels, family_title
from nineaudit.report.numbers import printable
from nineaudit.report.text import diagnosis_sentence, finding_line, listed

if TYPE_CHECKING:
    from nineaudit.auditing import Audit

Unread = Mapping[Path, str]
"""Recordings that could not be audited, and why."""

WORST = 10
SUMMARY_BYTES = 1 << 20
_UNDECIDED = frozenset({Verdict.INCONCLUSIVE, Verdict.NOT_EVALUATED})
_SET_ASIDE = frozenset({Verdict.WAIVED, Verdict.NOT_APPLICABLE})


def junit(audits: Sequence[Audit], unread: Unread | None = None) -> str:
    """JUnit XML: a suite per recording, a case per rule family.

    failure: a rule of the family fails. error: none fails, but one of severity error could not be decided,
    which never counts as a pass. skipped: every rule is waived or does not apply. Other notable findings are
    the case's output.
    """
    root = ET.Element("testsuites", name="nineaudit")
    for audit in audits:
        _suite(root, audit)
    for path, reason in (unread or {}).items():
        suite = ET.SubElement(root, "testsuite", name=_xml(path.as_posix()))
        case = ET.SubElement(suite, "testcase", classname=_xml(path.name), name="read the recording")
        ET.SubElement(case, "error", message=_xml(reason), type="not_audited").text = _xml(reason)
    for suite in root:
        _count(suite)
    ET.indent(root)
    return '<?xml version="1.0" encoding="UTF-8"?>\n' + ET.tostring(root, encoding="unicode") + "\n"


def _suite(root: ET.Element, audit: Audit) -> None:
    source = audit.recording.source
    suite = ET.SubElement(root, "testsuite", name=_xml(source.path.as_posix()))
    for code, findings in by_family(audit.findings).items():
        name = f"{code} {family_title(code)}"
        case = ET.SubElement(suite, "testcase", classname=_xml(source.path.name), name=_xml(name))
        _outcome(case, by_weight(findings))


def _outcome(case: ET.Element, findings: list[Finding]) -> None:
    text = [_xml(finding_line(f)) for f in findings if f.verdict in NOTABLE]
    verdicts = {f.verdict for f in findings}
    worst = findings[0]
    if Verdict.FAIL in verdicts:
        ET.SubElement(case, "failure", message=text[0], type=worst.rule).text = "\n".join(text)
    elif any(f.verdict in _UNDECIDED and f.severity is Severity.ERROR for f in findings):
        ET.SubElement(case, "error", message=text[0], type=str(worst.verdict)).text = "\n".join(text)
    elif verdicts <= _SET_ASIDE:
        ET.SubElement(case, "skipped", message=_xml(worst.reason))
    elif text:
        ET.SubElement(case, "system-out").text = "\n".join(text)


def _count(suite: ET.Element) -> None:
    suite.set("tests", str(len(suite)))
    for plural, tag in (("failures", "failure"), ("errors", "error"), ("skipped", "skipped")):
        suite.set(plural, str(len(suite.findall(f"testcase/{tag}"))))


def _xml(text: str) -> str:
    """XML 1.0 has no place for control characters, not even escaped."""
    return printable(text)


def github(audits: Sequence[Audit], unread: Unread | None = None) -> str:
    """GitHub workflow commands: unreadable recordings, then the worst findings, ten lines at the most."""
    commands = [_command("error", path, "not audited", reason) for path, reason in (unread or {}).items()]
    for finding, audit in _worst(audits):
        level = "error" if finding.verdict is Verdict.FAIL else "warning"
        title = f"{finding.rule} {listed(channels(finding))}".strip()
        line = finding_line(finding)
        commands.append(_command(level, audit.recording.source.path, title, line))
    return "".join(f"{command}\n" for command in commands[:WORST])


def _worst(audits: Sequence[Audit]) -> list[tuple[Finding, Audit]]:
    """Notable findings of all recordings, the worst first."""
    owner = {id(finding): audit for audit in audits for finding in audit.findings}
    every = by_weight(finding for audit in audits for finding in audit.findings)
    return [(f, owner[id(f)]) for f in every if f.verdict in NOTABLE and f.verdict is not Verdict.WAIVED]


def _command(level: str, path: Path, title: str, message: str) -> str:
    file = _escape_property(printable(path.as_posix()))
    return f"::{level} file={file},title={_escape_property(title)}::{_escape_data(message)}"


def _escape_data(text: str) -> str:
    return text.replace("%", "%25").replace("\r", "%0D").replace("\n", "%0A")


def _escape_property(text: str) -> str:
    return _escape_data(text).replace(":", "%3A").replace(",", "%2C")


def markdown(audits: Sequence[Audit], unread: Unread | None = None) -> str:
    """A job summary: a row per recording, then the worst findings; never more than 1 MiB."""
    rows = [
        f"| {_cell(a.recording.source.path.name)} | **{a.verdict.replace('_', ' ')}** "
        f"| {_cell(diagnosis_sentence(a.diagnosis))} |"
        for a in audits
    ] + [f"| {_cell(p.name)} | **not audited** | {_cell(reason)} |" for p, reason in (unread or {}).items()]
    items = [f"- {_cell(a.recording.source.path.name)}: {_cell(finding_line(f))}" for f, a in _worst(audits)[:WORST]]
    head = ["## nineaudit", "", "| recording | verdict | diagnosis |", "|---|---|---|"]
    tail = ["", "### Worst findings", "", *items] if items else []
    return _within(head, rows, tail)


def _within(head: list[str], rows: list[str], tail: list[str]) -> str:
    """As many rows as fit between head and tail; the rest is counted, not silently dropped."""
    room = SUMMARY_BYTES - sum(len(line.encode()) + 1 for line in head + tail) - 100
    kept, used = 0, 0
    while kept < len(rows) and (used := used + len(rows[kept].encode()) + 1) <= room:
        kept += 1
    more = [] if kept == len(rows) else ["", f"{len(rows) - kept} more recordings are not shown."]
    return "\n".join(head + rows[:kept] + more + tail) + "\n"


_MARKS = str.maketrans({mark: f"&#{ord(mark)};" for mark in "\\`*_[]|~@"})


def _cell(text: str) -> str:
    """Text that Markdown and HTML leave alone."""
    return html.escape(printable(text), quote=False).translate(_MARKS)
