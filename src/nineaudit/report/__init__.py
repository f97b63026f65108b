"""Reports of an Audit: HTML page, result JSON, text lines, CI outputs. The Audit is their only input."""

from __future__ import annotations

from nineaudit.report.ci import github, junit, markdown
from nineaudit.report.machine import failure_document, result_document, result_schema, to_json, to_jsonl
from nineaudit.report.page import render, write_report
from nineaudit.report.text import lines

__all__ = [
    "failure_document",
    "github",
    "junit",
    "lines",
    "markdown",
    "render",
    "result_document",
    "result_schema",
    "to_json",
    "to_jsonl",
    "write_report",
]
