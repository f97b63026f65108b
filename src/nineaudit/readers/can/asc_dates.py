"""Dates in ASC logs: English or German, twelve hours or twenty-four, with parts of a second or without."""

from __future__ import annotations

import re
from datetime import datetime
from typing import Final

_MONTHS: Final = (
    ("jan",),
    ("feb",),
    ("mar", "mär", "mrz", "mae"),
    ("apr",),
    ("may", "mai"),
    ("jun",),
    ("jul",),
    ("aug",),
    ("sep",),
    ("oct", "okt"),
    ("nov",),
    ("dec", "dez"),
)
_DATE: Final = re.compile(
    r"\w+\.?\s+(?P<month>\w{3})\w*\.?\s+(?P<day>\d{1,2})\.?\s+(?P<h>\d{1,2}):(?P<m>\d\d):(?P<s>\d\d)(?:[.,](?P<f>\d{1,6}))?"
    r"(?:\s+(?P<half>[ap])m)?\s+(?P<year>\d{4})",
    re.I,
)


def date_of(text: bytes) -> str:
    """A date such as "Di Mär 14 10:13:20.123 pm 2023" as 2023-03-14 22:13:20.123; one that cannot be read in quotes."""
    try:
        words = text.decode("utf-8")
    except UnicodeDecodeError:
        words = text.decode("cp1252", errors="replace")
    found = _DATE.fullmatch(words.strip())
    months = [i for i, names in enumerate(_MONTHS, 1) if found and found["month"].lower() in names]
    if found is None or not months:
        return repr(words.strip()[:40])
    hour = int(found["h"])
    if found["half"]:
        hour = hour % 12 + (12 if found["half"].lower() == "p" else 0)
    parts = int((found["f"] or "").ljust(6, "0"))
    try:
        moment = datetime(
            int(found["year"]), months[0], int(found["day"]), hour, int(found["m"]), int(found["s"]), parts
        )
    except ValueError:
        return repr(words.strip()[:40])
    return moment.isoformat(" ", "milliseconds")
