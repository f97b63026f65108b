"""What a run of `check` or `repair` puts into the log: files read and written with their hashes, the verdict."""

from __future__ import annotations

import os
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

from nineaudit.audit_log import append, require_whole
from nineaudit.files import sha256
from nineaudit.outputs import protect
from nineaudit.provenance import path_beside

if TYPE_CHECKING:
    from nineaudit.auditing import Audit
    from nineaudit.checking import Files, Outcome
    from nineaudit.recording import Source


@dataclass
class Run:
    """The lines of a run of `check`, collected as its recordings pass; none of it is written before `close`."""

    log: Path
    command: Sequence[str]
    inputs: Sequence[Path]
    fail_on: str
    lines: list[dict[str, Any]] = field(default_factory=list)

    def watch(self, outcomes: Iterable[Outcome]) -> Iterator[Outcome]:
        """The outcomes as they are; what they are is noted."""
        for outcome in outcomes:
            self.lines.append(self._line(outcome))
            yield outcome

    def _line(self, outcome: Outcome) -> dict[str, Any]:
        read = [] if outcome.audit is None else _read(outcome.audit.recording.source, self.log)
        said = {} if outcome.error is None else {"reason": str(outcome.error)}
        return _head(self.command, outcome.verdict) | {
            "recording": _relative(outcome.path, self.log),
            "exit_code": outcome.exit_code(self.fail_on),
            "inputs": [*read, *files_of(self.inputs, self.log)],
            **said,
        }

    def close(self, files: Files) -> None:
        """Write the lines; the files that speak of all recordings belong to the last. ConfigurationError."""
        for i, line in enumerate(self.lines):
            own = [made[i] for made in (files.html, files.json) if made]
            last = [file for _, file in files.collected if file] if i == len(self.lines) - 1 else []
            line["outputs"] = files_of([*own, *last], self.log)
        append(self.log, self.lines)


def protect_log(log: Path | None, others: Iterable[Path | None]) -> None:
    """ConfigurationError where a log is none that lines can be added to, or is another file of the command."""
    if log is not None:
        protect([log], others)
        require_whole(log)


def log_repair(log: Path, command: Sequence[str], audit: Audit, used: Sequence[Path], output: Path) -> None:
    """One line about a repair: `audit` of the original, `used` rig and databases. ConfigurationError."""
    source = audit.recording.source
    line = _head(command, str(audit.verdict)) | {
        "recording": _relative(source.path, log),
        "exit_code": 0,
        "inputs": [*_read(source, log), *files_of(used, log)],
        "outputs": files_of([output, path_beside(output)], log),
    }
    append(log, [line])


def _read(source: Source, log: Path) -> list[dict[str, str]]:
    """The files of a recording, with the hashes that they had when they were read."""
    return [{"path": _relative(file.path, log), "sha256": file.sha256} for file in source.files]


def files_of(paths: Iterable[Path], log: Path) -> list[dict[str, str]]:
    """Name, as seen from the log, and hash of each file that is there."""
    from nineaudit.readers import fingerprint

    def digest(path: Path) -> str:
        return fingerprint(path)[1] if path.is_dir() or path.suffix.lower() == ".mme" else sha256(path)

    return [{"path": _relative(path, log), "sha256": digest(path)} for path in dict.fromkeys(paths) if path.exists()]


def _head(command: Sequence[str], verdict: str) -> dict[str, Any]:
    from nineaudit.auditing import versions

    return {"command": list(command), "tool": versions()["version"], "verdict": verdict}


def _relative(path: Path, log: Path) -> str:
    """A path as seen from the folder of the log, so that both may move together; else the whole path."""
    try:
        return Path(os.path.relpath(path, log.parent)).as_posix()
    except ValueError:  # another drive
        return path.absolute().as_posix()
