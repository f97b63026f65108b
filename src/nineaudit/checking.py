"""The command `check`: every recording is audited, whatever becomes of the others, and each output is written."""

from __future__ import annotations

import shlex
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

from nineaudit.collecting import collecting
from nineaudit.errors import ConfigurationError, NineauditError
from nineaudit.outcome import Outcome
from nineaudit.outputs import each_its_own, make_folder, places, protect, unwritable, write_text
from nineaudit.units import counted

__all__ = [
    "Files", "Outcome", "audit_each", "files", "load_book", "run", "tally", "write_page",
]  # fmt: skip

if TYPE_CHECKING:
    from nineaudit.auditing import Audit
    from nineaudit.identity import Stated
    from nineaudit.rig import Rig
    from nineaudit.rulebook import Rulebook
    from nineaudit.waivers import Waiver


@dataclass(frozen=True)
class Files:
    """What `check` writes besides standard output. `html` and `json`: one for each recording, or none;
    `json_list`: all results in one."""

    html: tuple[Path, ...] = ()
    json: tuple[Path, ...] = ()
    json_list: Path | None = None
    junit: Path | None = None
    summary: Path | None = None

    @property
    def all(self) -> tuple[Path | None, ...]:
        return (*self.html, *self.json, self.json_list, self.junit, self.summary)

    @property
    def collected(self) -> tuple[tuple[str, Path | None], ...]:
        """(kind, file) of those that speak of all recordings."""
        return (("json", self.json_list), ("junit", self.junit), ("markdown", self.summary))


def files(
    recordings: Sequence[Path],
    inputs: Iterable[Path | None],
    *,
    html: str | None = None,
    json: str | None = None,
    junit: Path | None = None,
    summary: Path | None = None,
) -> Files:
    """The files of the options. ConfigurationError: two outputs in one place, or an output in that of an input."""
    one_list = json is not None and len(recordings) > 1 and not each_its_own(json)
    made = Files(
        html=places(html, recordings, "--html", ".html") if html else (),
        json=places(json, recordings, "--json", ".json") if json and not one_list else (),
        json_list=Path(json) if json and one_list else None,
        junit=junit,
        summary=summary,
    )
    protect(made.all, [*recordings, *inputs])
    return made


def load_book(rules: Path | None = None, select: str | None = None, ignore: str | None = None) -> Rulebook:
    """The rules of a run, each held to its check. ConfigurationError: bad sheet, unknown code, limit that does not
    fit the check."""
    from nineaudit.engine import bind
    from nineaudit.rulebook import load_rulebook

    book = load_rulebook(rules, select, ignore)
    bind(book)
    return book


def audit_each(
    recordings: Iterable[Path],
    rig: Rig,
    rulebook: Rulebook,
    waivers: Sequence[Waiver] | None = None,
    dbc: Sequence[Path] = (),
    command: Sequence[str] = (),
    test: Sequence[Stated] = (),
) -> Iterator[Outcome]:
    """Audit one recording after the other. One that cannot be audited is an Outcome with its error and does not
    stop the others; a ConfigurationError does, for it would come again with each of them. Waivers that match none
    of the recordings are findings of the first that is audited. `command`: the arguments of the run, for the report;
    `test`: what was stated of the test there."""
    from nineaudit.auditing import audit
    from nineaudit.identity import identify
    from nineaudit.readers import read
    from nineaudit.waivers import unmatched

    paths = list(recordings)
    lost = unmatched(waivers, paths)
    for path in paths:
        about = identify(rig.test, test)
        try:
            recording = read(path, rig, dbc=dbc, test=test)
            about = recording.test
            done = audit(recording, rulebook, waivers=waivers)
            done = replace(done, command=shlex.join(["nineaudit", *command]) if command else "")
            yield Outcome(path, audit=_with_unmatched(done, lost))
            lost = ()
        except ConfigurationError:
            raise
        except NineauditError as error:
            yield Outcome(path, error=error, test=about)


def _with_unmatched(audit: Audit, lost: Sequence[Waiver]) -> Audit:
    """The audit, judged with the waivers that match no recording of the run; as it is where the rule is left out."""
    from nineaudit.auditing import judge
    from nineaudit.waivers import CODE, with_unmatched

    if not lost or CODE not in audit.rulebook:
        return audit
    findings = with_unmatched(audit.findings, lost, audit.rulebook[CODE].severity)
    return replace(audit, findings=findings, verdict=judge(findings))


def run(
    outcomes: Iterable[Outcome],
    files: Files,
    *,
    style: str,
    fail_on: str,
    many: bool,
    show: Callable[[str], None],
    say: Callable[[str], None],
) -> int:
    """Write the files, `show` the results in `style` (text, json, jsonl, junit, github), `say` the rest; exit code.

    Outcomes are let go one by one.
    """
    streamed = style in ("text", "jsonl") or (style == "json" and not many)
    kinds = [(kind, file) for kind, file in files.collected if file is not None]
    verdicts: Counter[str] = Counter()
    code = 0
    with collecting(kinds if streamed else [(style, None), *kinds], fail_on, show) as collect:
        for i, outcome in enumerate(outcomes):
            if outcome.error is not None:
                say(str(outcome.error))
            if streamed:
                show(_styled(outcome, style))
            _write_own(outcome, files, i)
            collect(outcome)
            verdicts[outcome.verdict] += 1
            code = max(code, outcome.exit_code(fail_on))
    if many:
        say(tally(verdicts))
    return code


def write_page(audit: Audit, path: Path) -> None:
    """Write the HTML report; its folder is made. ConfigurationError where that cannot be."""
    from nineaudit.report import write_report

    make_folder(path.parent)
    try:
        write_report(audit, path)
    except OSError as error:
        raise unwritable(path, error) from error


def _write_own(outcome: Outcome, files: Files, i: int) -> None:
    from nineaudit.report import to_json

    if files.html and outcome.audit is not None:
        write_page(outcome.audit, files.html[i])
    if files.json:
        write_text(files.json[i], to_json(outcome.document()))


def _styled(outcome: Outcome, style: str) -> str:
    from nineaudit.report import to_json, to_jsonl

    if style == "text":
        return "".join(f"{line}\n" for line in outcome.lines())
    return (to_json if style == "json" else to_jsonl)(outcome.document())


def tally(verdicts: Mapping[str, int]) -> str:
    """``12 recordings: 2 fail, 1 not audited, 9 pass``."""
    parts = ", ".join(f"{n} {verdict.replace('_', ' ')}" for verdict, n in sorted(verdicts.items()))
    return f"{counted(sum(verdicts.values()), 'recording')}: {parts}"
