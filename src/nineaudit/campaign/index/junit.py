"""JUnit XML of a campaign, one testcase a recording, written as the tables are read: memory holds one row group."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import IO, TYPE_CHECKING, Any, Final
from xml.etree import ElementTree as ET

from nineaudit.finding import Severity, Verdict
from nineaudit.report.numbers import printable

if TYPE_CHECKING:
    from nineaudit.campaign.results.compact import Stored

Row = Mapping[str, Any]
OUTCOMES: Final = {"fail": "failure", "inconclusive": "error", "not_audited": "error"}
"""Verdict -> element: what could not be decided or audited never counts as a pass."""
_TOLD: Final = tuple(str(v) for v in (Verdict.FAIL, Verdict.INCONCLUSIVE, Verdict.NOT_EVALUATED, Verdict.WARN))


def write_junit(stored: Stored, name: str, file: IO[str]) -> None:
    """Write the recordings of a campaign called `name` as one suite. OSError."""
    verdicts = stored.tables["recordings"].to_table(columns=["verdict"])["verdict"].to_pylist()
    counts = {tag: sum(OUTCOMES.get(v) == tag for v in verdicts) for tag in ("failure", "error")}
    suite = {"name": printable(name), "tests": str(len(verdicts)), "failures": str(counts["failure"])}
    suite |= {"errors": str(counts["error"]), "skipped": "0"}
    file.write('<?xml version="1.0" encoding="UTF-8"?>\n<testsuites name="nineaudit">\n')
    file.write(ET.tostring(ET.Element("testsuite", suite), encoding="unicode").removesuffix(" />") + ">\n")
    findings = _Findings(_rows(stored, "findings", ("uri", "rule", "verdict", "severity", "channels", "reason")))
    for row in _rows(stored, "recordings", ("uri", "verdict", "reason", "rig", "status", "culprits", "fault")):
        case = testcase(row, findings.of(row["uri"]))
        file.write(ET.tostring(case, encoding="unicode") + "\n")
    file.write("</testsuite>\n</testsuites>\n")


def testcase(row: Row, findings: list[Row]) -> ET.Element:
    """A recording: a failure where it fails, an error where it could not be decided or audited; warnings are said."""
    case = ET.Element("testcase", classname=printable(row["rig"] or "campaign"), name=printable(row["uri"]))
    text = "\n".join(_line(finding) for finding in findings)
    tag = OUTCOMES.get(row["verdict"])
    if tag is not None:
        ET.SubElement(case, tag, message=_message(row), type=row["verdict"]).text = text or None
    elif text:
        ET.SubElement(case, "system-out").text = text
    return case


def _message(row: Row) -> str:
    """The diagnosis, or why there is none."""
    if row["reason"]:
        return printable(row["reason"])
    names = ", ".join(row["culprits"])
    fault = f": {row['fault'].replace('_', ' ')}" if row["fault"] else ""
    return printable(f"{row['status'] or row['verdict']}{f', {names}' if names else ''}{fault}")


def _line(finding: Row) -> str:
    serious = finding["verdict"] == Verdict.FAIL and finding["severity"] == Severity.ERROR
    word = "error" if serious else finding["verdict"].replace("_", " ")
    parts = [word, finding["rule"], ",".join(finding["channels"])]
    return printable(f"{' '.join(part for part in parts if part)}: {finding['reason']}")


class _Findings:
    """The findings of one recording after the other: both tables are sorted by uri."""

    def __init__(self, rows: Iterator[Row]) -> None:
        self._rows = rows
        self._next = next(rows, None)

    def of(self, uri: str) -> list[Row]:
        found: list[Row] = []
        while self._next is not None and self._next["uri"] <= uri:
            if self._next["uri"] == uri and self._next["verdict"] in _TOLD:
                found.append(self._next)
            self._next = next(self._rows, None)
        return found


def _rows(stored: Stored, table: str, columns: tuple[str, ...]) -> Iterator[Row]:
    """Rows in the order of the file."""
    import pyarrow.compute as pc

    wanted = pc.field("verdict").isin(_TOLD) if table == "findings" else None
    batches = stored.tables[table].to_batches(columns=list(columns), filter=wanted, batch_size=4096)
    for batch in batches:
        yield from batch.to_pylist()
