"""What CI systems read: JUnit XML, GitHub annotations, a job summary in Markdown."""

from __future__ import annotations

import html
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING
from xml.etree import ElementTree as ET

from nineaudit.engine import gate
from nineaudit.finding import Finding, Severity, Verdict
from nineaudit.report.findings import NOTABLE, by_family, by_weight, channels, family_title
from nineaudit.report.numbers import printable
from nineaudit.report.text import diagnosis_sentence, finding_line, listed
from nineaudit.units import counted

if TYPE_CHECKING:
    from nineaudit.auditing import Audit

Unread = Mapping[Path, str]
"""Recordings that could not be audited, and why."""

JUNIT_HEAD = '<?xml version="1.0" encoding="UTF-8"?>\n<testsuites name="nineaudit">\n'
JUNIT_TAIL = "</testsuites>\n"
WORST = 10
SUMMARY_BYTES = 1 << 20
LONGEST = 2_000
"""Characters of one message of an annotation or a summary; names and reasons come from files of any size."""
_UNDECIDED = frozenset({Verdict.INCONCLUSIVE, Verdict.NOT_EVALUATED})


@dataclass(frozen=True)
class Digest:
    """What the annotations and the summary need of a recording: its `path`, the `test` in words, `verdict` and
    `diagnosis` as sentences, and its `worst` notable findings, ten at the most. `read`: whether it could be audited;
    if not, `diagnosis` is why."""

    path: Path
    verdict: str
    diagnosis: str
    test: str = ""
    worst: tuple[Finding, ...] = ()
    read: bool = True


def digest(audit: Audit) -> Digest:
    """The digest of an audit, which is then needed no more."""
    telling = [f for f in by_weight(audit.findings) if f.verdict in NOTABLE and f.verdict is not Verdict.WAIVED]
    return Digest(
        audit.recording.source.path,
        audit.verdict.replace("_", " "),
        diagnosis_sentence(audit.diagnosis),
        _test(audit),
        tuple(telling[:WORST]),
    )


def unread_digest(path: Path, reason: str) -> Digest:
    """The digest of a recording that could not be audited."""
    return Digest(path, "not audited", reason, read=False)


def _digests(audits: Sequence[Audit], unread: Unread | None) -> list[Digest]:
    return [digest(a) for a in audits] + [unread_digest(path, reason) for path, reason in (unread or {}).items()]


def junit(audits: Sequence[Audit], unread: Unread | None = None, fail_on: str = "error") -> str:
    """JUnit XML: a suite per recording, a case per rule family.

    failure: a rule of the family fails, or with `fail_on` warning stops the gate. error: none does, but one of
    severity error could not be decided, which never counts as a pass. skipped: a violation is waived, or no rule
    applies. Other notable findings are the case's output.
    """
    suites = [junit_suite(audit, fail_on) for audit in audits]
    suites += [unread_suite(path, reason) for path, reason in (unread or {}).items()]
    return "".join([JUNIT_HEAD, *suites, JUNIT_TAIL])


def junit_suite(audit: Audit, fail_on: str = "error") -> str:
    """The suite of a recording, as text between JUNIT_HEAD and JUNIT_TAIL."""
    return _finished(_suite(audit, fail_on))


def unread_suite(path: Path, reason: str) -> str:
    """The suite of a recording that could not be audited, as junit_suite."""
    suite = ET.Element("testsuite", name=_xml(path.as_posix()))
    case = ET.SubElement(suite, "testcase", classname=_xml(path.as_posix()), name="read the recording")
    ET.SubElement(case, "error", message=_xml(reason), type="not_audited").text = _xml(reason)
    return _finished(suite)


def _finished(suite: ET.Element) -> str:
    _count(suite)
    ET.indent(suite, level=1)
    return f"  {ET.tostring(suite, encoding='unicode')}\n"


def _suite(audit: Audit, fail_on: str) -> ET.Element:
    path = _xml(audit.recording.source.path.as_posix())
    suite = ET.Element("testsuite", name=path)
    known = audit.recording.test.known
    if known:
        properties = ET.SubElement(suite, "properties")
        for key, value in known.items():
            ET.SubElement(properties, "property", name=f"test.{key}", value=_xml(value))
    for code, findings in by_family(audit.findings).items():
        name = f"{code} {family_title(code)}"
        case = ET.SubElement(suite, "testcase", classname=path, name=_xml(name))
        _outcome(case, by_weight(findings), fail_on)
    return suite


def _outcome(case: ET.Element, findings: list[Finding], fail_on: str) -> None:
    """What became of a family, by the finding that decides it; every notable finding is in the text."""
    text = "\n".join(_xml(finding_line(f)) for f in findings if f.verdict in NOTABLE)
    tag, decisive = _decisive(findings, fail_on)
    if decisive is not None:
        message = finding_line(decisive) if decisive.verdict in NOTABLE else decisive.reason
        kind = decisive.rule if tag == "failure" else str(decisive.verdict)
        ET.SubElement(case, tag, message=_xml(message), type=kind).text = text or None
    elif text:
        ET.SubElement(case, "system-out").text = text


def _decisive(findings: list[Finding], fail_on: str) -> tuple[str, Finding | None]:
    """The element of JUnit and the finding for it, the weightiest first; None for a family that passes."""
    undecided = [f for f in findings if f.verdict in _UNDECIDED and f.severity is Severity.ERROR]
    stopping = [f for f in findings if f.verdict is Verdict.FAIL or (f not in undecided and not gate([f], fail_on))]
    waived = [f for f in findings if f.verdict is Verdict.WAIVED]
    idle = findings if all(f.verdict is Verdict.NOT_APPLICABLE for f in findings) else []
    for tag, found in (("failure", stopping), ("error", undecided), ("skipped", waived or idle)):
        if found:
            return tag, found[0]
    return "", None


def _count(suite: ET.Element) -> None:
    suite.set("tests", str(len(suite.findall("testcase"))))
    for plural, tag in (("failures", "failure"), ("errors", "error"), ("skipped", "skipped")):
        suite.set(plural, str(len(suite.findall(f"testcase/{tag}"))))


def _xml(text: str) -> str:
    """XML 1.0 has no place for control characters, not even escaped."""
    return printable(text)


def github(audits: Sequence[Audit], unread: Unread | None = None) -> str:
    """GitHub workflow commands: unreadable recordings, then the worst findings, ten lines at the most."""
    return github_of(_digests(audits, unread))


def github_of(digests: Sequence[Digest]) -> str:
    """The same, of digests."""
    commands = [_command("error", d.path, d.verdict, d.diagnosis) for d in digests if not d.read]
    for finding, path in _worst(digests):
        level = "error" if finding.verdict is Verdict.FAIL else "warning"
        title = f"{finding.rule} {listed(channels(finding))}".strip()
        commands.append(_command(level, path, title, finding_line(finding)))
    return "".join(f"{command}\n" for command in commands[:WORST])


def _worst(digests: Sequence[Digest]) -> list[tuple[Finding, Path]]:
    """Notable findings of all recordings, the ten worst first."""
    owner = {id(finding): d.path for d in digests for finding in d.worst}
    every = by_weight(finding for d in digests for finding in d.worst)
    return [(f, owner[id(f)]) for f in every[:WORST]]


def _command(level: str, path: Path, title: str, message: str) -> str:
    file = _escape_property(printable(path.as_posix()))
    said = "\n".join(map(printable, _short(message).splitlines()))
    return f"::{level} file={file},title={_escape_property(_short(title))}::{_escape_data(said)}"


def _escape_data(text: str) -> str:
    return text.replace("%", "%25").replace("\r", "%0D").replace("\n", "%0A")


def _escape_property(text: str) -> str:
    return _escape_data(text).replace(":", "%3A").replace(",", "%2C")


def markdown(audits: Sequence[Audit], unread: Unread | None = None) -> str:
    """A job summary: a row per recording, then the worst findings; never more than 1 MiB."""
    return markdown_of(_digests(audits, unread))


def markdown_of(digests: Sequence[Digest]) -> str:
    """The same, of digests; what could not be audited comes last."""
    table = [(d.path.name, d.test, f"**{d.verdict}**", d.diagnosis) for d in sorted(digests, key=lambda d: not d.read)]
    shown = [i for i in range(len(_HEADS)) if i != 1 or any(row[1] for row in table)]
    rows = [_row([row[i] if i == _BOLD else _cell(row[i]) for i in shown]) for row in table]
    items = [f"- {_cell(path.name)}: {_cell(finding_line(f))}" for f, path in _worst(digests)]
    head = ["## nineaudit", "", _row([_HEADS[i] for i in shown]), "|" + "---|" * len(shown)]
    tail = ["", "### Worst findings", "", *items] if items else []
    return _within(head, rows, tail)


_HEADS = ("recording", "test", "verdict", "diagnosis")
_BOLD = _HEADS.index("verdict")


def _row(cells: Sequence[str]) -> str:
    return f"| {' | '.join(cells)} |"


def _test(audit: Audit) -> str:
    """Number and item of the test, as far as they are known."""
    test = audit.recording.test
    return ", ".join(word for word in (test.number, test.item) if word)


def _within(head: list[str], rows: list[str], tail: list[str]) -> str:
    """As many rows as fit between head and tail; the rest is counted, not silently dropped."""
    room = SUMMARY_BYTES - 1 - sum(len(line.encode()) + 1 for line in head + tail) - 100
    kept, used = 0, 0
    while kept < len(rows) and (used := used + len(rows[kept].encode()) + 1) <= room:
        kept += 1
    more = [] if kept == len(rows) else ["", f"Not shown: {counted(len(rows) - kept, 'more recording')}."]
    return "\n".join(head + rows[:kept] + more + tail) + "\n"


_MARKS = str.maketrans({mark: f"&#{ord(mark)};" for mark in "\\`*_[]|~@"})


def _cell(text: str) -> str:
    """Text that Markdown and HTML leave alone."""
    return html.escape(printable(_short(text)), quote=False).translate(_MARKS)


def _short(text: str) -> str:
    """At most `LONGEST` characters; what is left out is counted."""
    left_out = len(text) - LONGEST
    return text if left_out <= 0 else f"{text[:LONGEST]}… ({counted(left_out, 'more character')})"
