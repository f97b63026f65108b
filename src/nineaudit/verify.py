"""Is what lies here still what was written? Recordings, records of repairs, results and logs, each by the hashes that
the others hold of it."""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

from nineaudit import audit_log
from nineaudit.errors import NineauditError
from nineaudit.files import is_sealed
from nineaudit.provenance import SCHEMA as REPAIR
from nineaudit.provenance import chain, parse, path_beside
from nineaudit.readers import READERS, fingerprint
from nineaudit.readers.mcap.rebuilt import record_in
from nineaudit.units import counted

RESULT: Final = "nineaudit/result/1"
UNCHANGED, CHANGED, UNKNOWN = 0, 1, 3
"""Exit code of each state."""
_WORDS: Final = {UNCHANGED: "unchanged", CHANGED: "CHANGED", UNKNOWN: "NOT VERIFIED"}


@dataclass(frozen=True)
class Answer:
    """What was found of one file or line: its `state` is an exit code."""

    place: str
    state: int
    said: str

    def __str__(self) -> str:
        return f"{self.place}: {_WORDS[self.state]}: {self.said}"


def verify(paths: Sequence[Path]) -> list[Answer]:
    """What is found of each file, log, and file in a folder; an answer for each at least."""
    return [answer for path in paths for answer in _of(path)]


def exit_code(answers: Iterable[Answer]) -> int:
    """0 nothing changed, 1 something did, 3 something could not be verified."""
    return max((answer.state for answer in answers), default=UNKNOWN)


def _of(path: Path) -> Iterator[Answer]:
    if path.is_dir():
        known = [file for file in sorted(path.rglob("*")) if file.is_file() and _kind(file) is not None]
        if not known:
            yield Answer(str(path), UNKNOWN, "nothing in this folder holds the hash of another file")
        for file in known:
            yield from _of(file)
    elif not path.exists():
        yield Answer(str(path), UNKNOWN, "there is no such file")
    else:
        yield from _answers(path)


def _answers(path: Path) -> Iterator[Answer]:
    """What is found of one file."""
    kind = _kind(path)
    try:
        if kind == "log":
            yield from _log(path)
        elif kind == REPAIR:
            yield from _repair(path)
        elif kind == RESULT:
            yield from _results(path)
        elif path_beside(path).is_file():
            yield from _repair(path_beside(path))
        else:
            yield Answer(str(path), UNKNOWN, "nothing beside it holds its hash; name the log or the result that does")
    except (OSError, NineauditError) as error:
        yield Answer(str(path), UNKNOWN, str(error))


def _kind(path: Path) -> str | None:
    """Whether a file is a log, the record of a repair, or results; None: nothing that holds hashes."""
    if path.name.endswith(".provenance.json"):
        return REPAIR
    if path.suffix == ".jsonl" or audit_log.head_of(path).is_file():
        return "log"
    if path.suffix == ".json":
        document = _json(path)
        return RESULT if isinstance(document, dict) or _listed(document) else None
    return None


def _listed(document: Any) -> bool:
    return isinstance(document, list) and any(isinstance(d, dict) and d.get("schema") == RESULT for d in document)


def _json(path: Path) -> Any:
    """The content of a JSON file that is one of ours; else None."""
    try:
        document = json.loads(path.read_bytes())
    except (OSError, ValueError):
        return None
    ours = isinstance(document, list) or (isinstance(document, dict) and document.get("schema") == RESULT)
    return document if ours else None


def _repair(record: Path) -> Iterator[Answer]:
    """A record of a repair, the file that it is of, and the original where it is in the same folder."""
    document = parse(record.read_bytes(), record)
    sealed = is_sealed(document)
    yield Answer(str(record), UNCHANGED if sealed else CHANGED, _SEAL[sealed])
    output = document.get("output")
    name = output.get("path", "") if isinstance(output, dict) else ""
    yield from _file(record.parent / name, document.get("output"), record.name)
    inside = record_in(record.parent / name)
    if inside is not None and _bare(inside) != _bare(document):
        yield Answer(str(record), CHANGED, f"it is not the record that stands in {name}")
    for one in chain(document):
        original = one["original"]
        for part in _tables(original.get("parts")) or [original]:
            if (record.parent / str(part.get("path"))).exists():
                yield from _file(record.parent / str(part["path"]), part, record.name)


_SEAL: Final = {True: "it has the hash of its own content", False: "its content is not that of its own hash"}


def _bare(document: Mapping[str, Any]) -> dict[str, Any]:
    """A record without what only one of its two places has."""
    return {key: value for key, value in document.items() if key not in ("output", "mcap", "seal")}


def _results(path: Path) -> Iterator[Answer]:
    """A result or a list of them, and the recordings that they are of."""
    found = _json(path)
    for document in _tables(found if isinstance(found, list) else [found]):
        sealed = is_sealed(document)
        yield Answer(str(path), UNCHANGED if sealed else CHANGED, _SEAL[sealed])
        for recording in _tables([document.get("recording")]):
            for part in _tables(recording.get("parts")) or [recording]:
                if "sha256" in part:
                    yield from _file(_near(str(part.get("path")), path.parent), part, path.name)


def _near(name: str, folder: Path) -> Path:
    """A file that is named as it was seen when it was read: from here, or beside what names it."""
    beside = folder / Path(name).name
    return beside if beside.exists() or not Path(name).exists() else Path(name)


def _file(path: Path, stated: Any, by: str) -> Iterator[Answer]:
    """A file against the hash that something states of it."""
    expected = stated.get("sha256") if isinstance(stated, dict) else None
    if not path.exists() or not expected:
        yield Answer(str(path), UNKNOWN, f"it is not there; {by} holds its hash" if expected else f"{by} has no hash")
        return
    found = fingerprint(path)[1] if path.is_dir() or path.suffix.lower() in READERS else _plain(path)
    same = found == expected
    said = f"its SHA-256 is that in {by}" if same else f"its SHA-256 is {found}, {by} holds {expected}"
    yield Answer(str(path), UNCHANGED if same else CHANGED, said)


def _plain(path: Path) -> str:
    from nineaudit.files import sha256

    return sha256(path)


def _log(log: Path) -> Iterator[Answer]:
    """The chain of a log, and the files as its last words on them have it."""
    wrong = audit_log.broken(log)
    for place in wrong:
        yield Answer(f"{log}: line {place.line}" if place.line else str(log), CHANGED, place.what)
    lines = audit_log.entries(log)
    if not lines:
        yield Answer(str(log), UNKNOWN, "no line of a log is in it")
        return
    if not audit_log.head_of(log).is_file():
        said = f"{audit_log.head_of(log).name} is not there: lines that were cut off at the end cannot be seen"
        yield Answer(str(log), UNKNOWN, said)
    elif not wrong:
        yield Answer(str(log), UNCHANGED, f"{counted(len(lines), 'line')}, each with the hash of the one before")
    last: dict[str, tuple[Any, object]] = {}
    for entry in lines:
        for stated in [*_tables(entry.get("inputs")), *_tables(entry.get("outputs"))]:
            last[str(stated.get("path"))] = stated, entry.get("line")
    for name, (stated, number) in last.items():
        yield from _file(log.parent / name, stated, f"{log.name} line {number}")


def _tables(value: Any) -> list[dict[str, Any]]:
    """The objects of a list that somebody else may have written."""
    return [one for one in value if isinstance(one, dict)] if isinstance(value, list) else []
