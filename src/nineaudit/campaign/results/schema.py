"""The tables of a lake: their columns, what each means, and the version that stands in every file.

A later version may add tables and columns; one that changes the meaning of a column gets another number in VERSION,
and a nineaudit that does not know it refuses the tables. docs/campaign.md shows this list (a test holds it to it).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

if TYPE_CHECKING:
    import pyarrow as pa

VERSION: Final = 1
SCHEMA: Final = f"nineaudit/tables/{VERSION}"


@dataclass(frozen=True)
class Column:
    """A column: `kind` is text, texts, whole, number, numbers, truth, date, words (text by text) or impact."""

    name: str
    kind: str
    about: str


WHICH: Final = (
    Column("uri", "text", "the recording, as the run was given it"),
    Column("edition", "text", "rules and tool that it was audited with"),
)
"""The first columns of every table: what they are joined by."""

RECORDINGS: Final = (
    *WHICH,
    Column("key", "text", "of the entry: recording, rig, rules, tool, waivers, databases"),
    Column("verdict", "text", "pass, fail, inconclusive, not_audited"),
    Column("reason", "text", "why it could not be audited"),
    Column("transient", "truth", "not audited for a cause that may pass; the next run tries again"),
    Column("status", "text", "of the diagnosis: healthy, isolated, ambiguous, undiagnosed"),
    Column("culprits", "texts", "the channels at fault; of an ambiguous diagnosis the whole group"),
    Column("fault", "text", "the kind of fault of the most probable candidate, where one is named"),
    Column("probability", "number", "of that candidate"),
    Column("statistic", "number", "RB303: largest value over limit; above 1 the channels contradict each other"),
    Column("rules_failed", "texts", "codes of the rules with a finding fail"),
    Column("findings_failed", "whole", "findings fail"),
    Column("findings_warned", "whole", "findings warn"),
    Column("findings_open", "whole", "findings inconclusive or not evaluated"),
    Column("findings_waived", "whole", "findings waived"),
    Column("number", "text", "of the test"),
    Column("item", "text", "what was tested"),
    Column("date", "date", "of the test, where it is YYYY-MM-DD"),
    Column("laboratory", "text", "where it was tested"),
    Column("test", "words", "everything that is known of the test, by name"),
    Column("rig", "text", "name of the rig"),
    Column("rig_sha256", "text", "of the rig file"),
    Column("format", "text", "csv, blf, mcap, ..."),
    Column("sha256", "text", "of the recording; of one of several files, of the first"),
    Column("bytes", "whole", "of the recording's files together"),
    Column("samples", "whole", "on the common clock"),
    Column("duration_s", "number", "s"),
    Column("rate_hz", "number", "1/s"),
    Column("reconstructed", "texts", "channels that are not as measured"),
    Column("impact", "impact", "by name (HIC15, BrIC, ...): before, after, u, unit of a value that the fault changes"),
)

FINDINGS: Final = (
    *WHICH,
    Column("place", "whole", "of the finding in the result, from 0"),
    Column("rule", "text", "RB301"),
    Column("verdict", "text", "pass, warn, fail, inconclusive, waived, not_applicable, not_evaluated"),
    Column("severity", "text", "error, warning, info"),
    Column("channels", "texts", "that it speaks of"),
    Column("t_start", "number", "s of the recording's clock"),
    Column("t_end", "number", "s"),
    Column("value", "number", "in unit"),
    Column("limit_value", "number", "limit, in unit (limit is a word of SQL)"),
    Column("unit", "text", "of value, limit_value and U"),
    Column("U", "number", "expanded uncertainty, k = 2"),
    Column("reason", "text", "in words"),
)

CANDIDATES: Final = (
    *WHICH,
    Column("rank", "whole", "1 is the most probable"),
    Column("channels", "texts", "that would be at fault"),
    Column("fault", "text", "gain, zero_shift, drift, polarity, swap, ..."),
    Column("probability", "number", "0 to 1"),
    Column("statistic", "number", "cost per degree of freedom under it"),
    Column("parameters", "text", "JSON, SI"),
)

ERRORS: Final = {
    "gain": "1",
    "zero": "m/s², rad/s",
    "tilt_1": "rad",
    "tilt_2": "rad",
    "position_x": "m",
    "position_y": "m",
    "position_z": "m",
    "timing": "s",
}
"""Calibration errors of a sensor, in the order of the result, with their units."""

SENSORS: Final = (
    *WHICH,
    Column("place", "whole", "of the sensor in the rig, from 0"),
    Column("channel", "text", "its channel"),
    Column("serial", "text", "its serial number, where the rig file has it"),
    Column("kind", "text", "accelerometer, gyroscope"),
    Column("unit", "text", "of peak"),
    Column("peak", "number", "largest reading without sign, zero taken off"),
    Column("shock", "number", "m/s²; of a rate sensor that of the hardest hit accelerometer"),
    Column("scale", "number", "as the rig states it"),
    Column("position", "numbers", "m, as the rig states it"),
    Column("axis", "numbers", "as the rig states it"),
    *(
        Column(f"{error}{end}", "number", f"{unit}; {about}")
        for error, unit in ERRORS.items()
        for end, about in (("", "as fitted"), ("_u", "its standard uncertainty"), ("_prior", "that of the rig"))
    ),
)

PROVENANCE: Final = (
    *WHICH,
    Column("key", "text", "of the entry"),
    Column("tool_version", "text", "of nineaudit"),
    Column("tool", "words", "versions of nineaudit and its libraries, by name"),
    Column("rulebook_sha256", "text", "of the rules"),
    Column("rig_sha256", "text", "of the rig file"),
    Column("files", "texts", "of the recording: SHA-256 and path"),
    Column("seal", "text", "SHA-256 of the result's content"),
)

TABLES: Final = {
    "recordings": RECORDINGS,
    "findings": FINDINGS,
    "candidates": CANDIDATES,
    "sensors": SENSORS,
    "provenance": PROVENANCE,
}
"""Name of a table (of its file and of its view) -> its columns."""


def arrow(table: str) -> pa.Schema:
    """The Arrow schema of a table."""
    import pyarrow as pa

    text, number = pa.string(), pa.float64()
    value = pa.struct([("before", number), ("after", number), ("u", number), ("unit", text)])
    kinds = {
        "text": text,
        "texts": pa.list_(text),
        "whole": pa.int64(),
        "number": number,
        "numbers": pa.list_(number),
        "truth": pa.bool_(),
        "date": pa.date32(),
        "words": pa.map_(text, text),
        "impact": pa.map_(text, value),
    }
    return pa.schema([pa.field(column.name, kinds[column.kind]) for column in TABLES[table]])


def markdown(table: str) -> str:
    """The columns of a table as a table of Markdown, for the manual."""
    rows = [f"| `{column.name}` | {column.kind} | {column.about} |" for column in TABLES[table]]
    return "\n".join(["| column | kind | meaning |", "|---|---|---|", *rows])
