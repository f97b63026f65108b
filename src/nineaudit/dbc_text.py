"""The text of a DBC file: is it all there? Parsers pass over a last statement that is cut, and cannot miss what a file
that ends early would have said (float signals, codes for "not available", cycle times)."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Final

_PASSED: Final = re.compile(r'"(?:\\"|[^"])*"|//[^\n]*')
"""Text and comments, which may hold what looks like statements."""
_STATEMENT: Final = re.compile(
    r"^[ \t]*(VERSION|NS_|BS_|BU_|BO_|SG_|BO_TX_BU_|EV_|ENVVAR_DATA_|CM_|BA_DEF_(?:REL_|DEF_|DEF_REL_)?|BA_(?:REL_)?"
    r"|VAL_(?:TABLE_)?|SIG_GROUP_|SIG_VALTYPE_|SIGTYPE_VALTYPE_|SGTYPE_(?:VAL_)?|SG_MUL_VAL_|CAT_(?:DEF_)?)"
    r"(?=[ \t]+\S|[ \t]*:)",
    re.M,
)
_BY_LINE: Final = {
    "BO_": r"\s*BO_\s+\d+\s+\w+\s*:\s*\d+\s+\w+[ \t]*\r?\n\s*",
    "SG_": r"\s*SG_\s+\w+(?:\s+[mM]\w*)?\s*:\s*\d+\|\d+@[01][+-]\s*\([^()]*\)\s*\[[^\[\]]*\]"
    r"\s*[~\n]+[ \t]*\S[^\n]*\n\s*",
}
"""Statements that the end of a line ends; all others a semicolon. ``~`` stands for text."""
_ENDED: Final = r"[^;]*;\s*"
_HEAD: Final = ("VERSION", "NS_", "BS_", "BU_")
_MESSAGE: Final = re.compile(r"\s*BO_\s+(\d+)\s+\w+\s*:\s*(\d+)")
_SIGNAL: Final = re.compile(r"\s*SG_\s+(\w+)")
_REFERENCE: Final = re.compile(
    r"\s*(?:CM_|BA_\s+[~\n]+)\s+(?:BO_\s+(\d+)|SG_\s+(\d+)\s+(\w+))"
    r"|\s*(?:VAL_|SIG_VALTYPE_|SG_MUL_VAL_)\s+(\d+)\s+(\w+)|\s*(?:BO_TX_BU_|SIG_GROUP_)\s+(\d+)"
)


@dataclass(frozen=True)
class Fault:
    """What is wrong with the text from `line` on, or in `count` places of which that is the first; `lost` in words."""

    what: str
    line: int
    count: int
    lost: str


def faults(text: str) -> tuple[Fault, ...]:
    """A last statement that is not ended; statements on messages and signals that are not in the file."""
    plain = _PASSED.sub(lambda found: _masked(found.group()), text)
    statements = [(m.start(), m.group(1)) for m in _STATEMENT.finditer(plain)]
    if not statements:
        return ()
    cut = tuple(_cut(plain, *statements[-1]))
    return (*cut, *_unknown(plain, statements[:-1] if cut else statements))


def _masked(found: str) -> str:
    """As long as it was: text as ``~``, comments as blanks."""
    return re.sub(r"[^\n]", "~" if found.startswith('"') else " ", found)


def _cut(plain: str, start: int, kind: str) -> Iterator[Fault]:
    last = plain[start:]
    line = _line(plain, start)
    if kind in _HEAD:
        return
    if '"' in last or not re.fullmatch(_BY_LINE.get(kind, _ENDED), last):
        yield Fault(f"the CAN database ends inside a statement ({kind})", line, 1, _LOST)
    elif kind == "BO_" and int(_MESSAGE.match(last)[2]):  # type: ignore[index]  # it matches what fullmatch did
        yield Fault("the CAN database ends behind the head of a message, before its signals", line, 1, _LOST)


_LOST: Final = "it is cut: what was behind (messages, float signals, codes for no value, cycle times) is lost"


def _unknown(plain: str, statements: list[tuple[int, str]]) -> Iterator[Fault]:
    messages, signals, number = set[int](), set[tuple[int, str]](), -1
    told = list[tuple[int, int, str]]()
    for at, kind in statements:
        if kind == "BO_" and (head := _MESSAGE.match(plain, at)):
            number = int(head[1])
            messages.add(number)
        elif kind == "SG_" and (name := _SIGNAL.match(plain, at)):
            signals.add((number, name[1]))
        elif found := _REFERENCE.match(plain, at):
            of, signal = next(iter(x for x in found.groups() if x)), found[3] or found[5] or ""
            told.append((at, int(of), signal))
    strange = [x for x in told if x[1] not in messages or (x[2] and x[1:] not in signals)]
    if strange:
        at, of, signal = strange[0]
        what = f"the CAN database speaks of a message {of}{f', signal {signal},' if signal else ''} that is not in it"
        yield Fault(what, _line(plain, at), len(strange), "messages or signals may be lost")


def _line(plain: str, at: int) -> int:
    return plain.count("\n", 0, at) + 1
