"""The command line: arguments, exit codes, and the only place that prints.

Exit codes: 0 gate passed; 1 findings at or above --fail-on; 2 wrong usage or configuration; 3 a recording could not
be audited; 70 a defect of nineaudit. Results go to standard output, everything else to standard error. What a command
needs is imported in it: ``nineaudit --help`` answers in 0.3 s.
"""

from __future__ import annotations

import io
import os
import sys
from collections.abc import Callable, Iterable, Sequence
from enum import StrEnum
from functools import partial, wraps
from pathlib import Path
from typing import Annotated, NoReturn, ParamSpec

import typer

from nineaudit import compare_command, motion_command, options, plain_text, progress, verify_command
from nineaudit.calibrate import calibrate_app
from nineaudit.campaign.commands import campaign_app
from nineaudit.errors import NineauditError, last_words
from nineaudit.options import Dbc, Force, Log, Output, Recording, Recordings, RigFile, RigOption, Rules, example, group
from nineaudit.reference import rig_app, rules_app

INTERRUPTED = 130
"""Exit code after Ctrl-C (128 + SIGINT)."""

FailOn = StrEnum("FailOn", ["error", "warning", "never"])
Format = StrEnum("Format", ["text", "json", "jsonl", "junit", "github"])
P = ParamSpec("P")

app = group(pretty_exceptions_enable=False, add_completion=True)


def _version(wanted: bool) -> None:
    if wanted:
        from importlib.metadata import version

        typer.echo(f"nineaudit {version('nineaudit')}")
        raise typer.Exit


@app.callback(epilog=example("nineaudit demo"))
def _root(
    version: Annotated[
        bool, typer.Option("--version", callback=_version, is_eager=True, help="Show the version and exit.")
    ] = False,
    debug: Annotated[bool, typer.Option("--debug", help="Show the traceback of an error.")] = False,
) -> None:
    """Quality audit of recordings of rigid-body sensor arrays: names the faulty channel, or says which ones cannot
    be told apart.

    Exit codes: 0 gate passed, 1 findings at or above --fail-on, 2 wrong usage or configuration, 3 a recording could
    not be audited, 70 a defect of nineaudit.
    """


@app.command(epilog=example("nineaudit check T0001.csv --rig rig.toml --html T0001.html"))
def check(
    context: typer.Context,
    recordings: Recordings,
    rig: RigOption,
    dbc: Dbc = None,
    rules: Rules = None,
    select: Annotated[str | None, typer.Option(metavar="CODES", help="Only these rules: RB301,RQ")] = None,
    ignore: Annotated[str | None, typer.Option(metavar="CODES", help="Not these rules: ZO,RQ203")] = None,
    waivers: Annotated[Path | None, typer.Option(metavar="W.toml", help="Violations that were accepted.")] = None,
    fail_on: Annotated[FailOn, typer.Option(help="Findings for which the exit code is 1.")] = FailOn.error,
    format: Annotated[Format, typer.Option(help="Of standard output.")] = Format.text,
    html: Annotated[
        str | None, typer.Option(metavar="F", help="Write the report; of several: a folder, or {stem}.html")
    ] = None,
    json: Annotated[
        str | None, typer.Option(metavar="F", help="Write the result; of several: a list, a folder, or {stem}.json")
    ] = None,
    junit: Annotated[Path | None, typer.Option(metavar="F", help="Write JUnit XML.")] = None,
    summary: Annotated[Path | None, typer.Option(metavar="F.md", help="Write a summary in Markdown.")] = None,
    test: options.TestOption = None,
    log: Log = None,
) -> None:
    """Audit recordings: which rules hold, which channel is at fault, what that does to the results."""
    from nineaudit import checking, logging_runs
    from nineaudit.identity import from_options
    from nineaudit.parts import recordings as each_recording
    from nineaudit.rig import load_rig
    from nineaudit.waivers import load_waivers

    about = from_options(test or ())
    instrument, book = load_rig(rig), checking.load_book(rules, select, ignore)
    accepted = None if waivers is None else load_waivers(waivers, checking.load_book(rules).codes)
    originals = [file for recording in recordings for file in instrument.files(recording)]
    inputs = (*originals, rig, waivers, *(dbc or instrument.dbc))
    recordings = list(each_recording(recordings, instrument.parts))
    logging_runs.protect_log(log, inputs)
    files = checking.files(recordings, (*inputs, log), html=html, json=json, junit=junit, summary=summary)
    outcomes = checking.audit_each(recordings, instrument, book, accepted, dbc or (), context.obj or (), about)
    used = [rig, *([waivers] if waivers else []), *(dbc or instrument.dbc)]
    noted = logging_runs.Run(log, context.obj or (), used, fail_on) if log else None
    each: Iterable[checking.Outcome] = noted.watch(outcomes) if noted else outcomes
    shows: Sequence[progress.Show] = (partial(typer.echo, nl=False), _say)
    if progress.wanted(len(recordings), sys.stderr.isatty()):
        each, shows = progress.along(each, len(recordings), shows)
    many = len(recordings) > 1
    code = checking.run(each, files, style=format, fail_on=fail_on, many=many, show=shows[0], say=shows[1])
    if noted:
        noted.close(files)
    raise typer.Exit(code)


@app.command(epilog=example("nineaudit repair T0001.csv --rig rig.toml --output repaired.csv"))
def repair(
    context: typer.Context,
    recording: Recording,
    rig: RigOption,
    output: Output,
    channel: Annotated[str | None, typer.Option(metavar="NAME", help="Default: the one that is isolated.")] = None,
    reason: Annotated[str, typer.Option(metavar="TEXT", help="Why, for the provenance.")] = "",
    by: Annotated[str, typer.Option(metavar="NAME", help="Who, for the provenance.")] = "",
    dbc: Dbc = None,
    force: Force = False,
    log: Log = None,
) -> None:
    """Rebuild the faulty channel into a new file, with its provenance beside it. The original stays as it is."""
    from nineaudit import commands, logging_runs
    from nineaudit.outputs import protect
    from nineaudit.rig import load_rig

    instrument = load_rig(rig)
    originals, used = instrument.files(recording), [rig, *(dbc or instrument.dbc)]
    protect([output], [*originals, *used])
    logging_runs.protect_log(log, [*originals, *used, output])
    audit = commands.audit_one(recording, instrument, dbc or ())
    said = commands.repaired(audit, output, channel=channel, reason=reason, by=by, dbc=dbc or (), force=force)
    if log:
        logging_runs.log_repair(log, context.obj or (), audit, used, output)
    _print(said)


@app.command(
    epilog=example(
        "nineaudit simulate rig.toml --motion general --output healthy.csv",
        "nineaudit simulate rig.toml --motion general --fault a1y:clipping=0.5 \\",
        "    --output T0001.csv",
    )
)
def simulate(
    rig: RigFile,
    motion: Annotated[str, typer.Option(metavar="NAME", help="alem, sled, drop, planar, oblique, general, ...")],
    output: Output,
    fault: Annotated[
        list[str] | None, typer.Option(metavar="CHANNEL:FAULT[=VALUE][@TIME]", help="May be repeated.")
    ] = None,
    seed: Annotated[int, typer.Option(help="Of noise and imperfections.")] = 0,
    rate: Annotated[float, typer.Option(metavar="HZ", help="Samples per second.")] = 10_000.0,
    duration: Annotated[float | None, typer.Option(metavar="S", help="Default: the motion's own.")] = None,
    dbc: Dbc = None,
    force: Force = False,
) -> None:
    """Write a recording of a known motion, with the rig's noise and imperfections, and with faults if wanted."""
    from nineaudit import commands
    from nineaudit.outputs import protect
    from nineaudit.rig import load_rig

    instrument = load_rig(rig)
    protect([output], [rig, *(dbc or instrument.dbc)])
    made = commands.simulated(instrument, motion, fault or (), seed=seed, rate=rate, duration=duration)
    _print(commands.written(made, output, dbc or (), force))


@app.command(epilog=example("nineaudit report result.json --html result.html"))
def report(
    result: Annotated[Path, typer.Argument(metavar="RESULT.json", help="What `check --json` wrote.")],
    html: Annotated[Path, typer.Option(metavar="F", help="The page.")],
) -> None:
    """Show a result as an HTML page. It is without curves, which are in the recording: see `check --html`."""
    from nineaudit.outputs import protect, write_text
    from nineaudit.report.result_page import render_result

    protect([html], [result])
    write_text(html, render_result(result))
    _print([str(html)])


@app.command(epilog=example("nineaudit demo"))
def demo(
    output: Annotated[
        Path | None, typer.Option(metavar="DIR", help="Empty or new folder; default: nineaudit-demo, -2, -3, ...")
    ] = None,
) -> None:
    """Simulate a recording with one clipped channel, check it, repair it, report it, in a fresh folder."""
    from nineaudit import demo as demonstration

    _print(demonstration.run(demonstration.fresh_folder(output)))


@app.command(epilog=example("nineaudit budget rig.toml --html budget.html"))
def budget(
    rig: RigFile,
    recording: Annotated[
        Path | None, typer.Option("--recording", metavar="REC", help="Of this recording; default: a typical motion.")
    ] = None,
    motion: Annotated[
        str, typer.Option(metavar="NAME", help="The typical motion: sled, drop, planar, oblique, general, ...")
    ] = "general",
    html: Annotated[Path | None, typer.Option(metavar="F", help="Write the page, with the budget over time.")] = None,
    dbc: Dbc = None,
) -> None:
    """How well the results will be known, from which sources, what would help most, and what the layout can prove."""
    from nineaudit import commands
    from nineaudit.outputs import protect
    from nineaudit.rig import load_rig

    instrument = load_rig(rig)
    protect([html], [rig, *(instrument.files(recording) if recording else ()), *(dbc or instrument.dbc)])
    _print(commands.budgeted(instrument, recording, motion=motion, html=html, dbc=dbc or ()))


@app.command(epilog=example("nineaudit selftest --date 2026-01-31"))
def selftest(
    date: Annotated[str | None, typer.Option(metavar="YYYY-MM-DD", help="Of the record; default: now.")] = None,
    json: Annotated[Path | None, typer.Option(metavar="F", help="Write the record for machines.")] = None,
) -> None:
    """Compute the published numbers afresh and print the validation record. Exit code 1 where one is missed."""
    from nineaudit import commands

    said, passed = commands.selftested(date, json)
    _print(said)
    raise typer.Exit(0 if passed else 1)


def _printing(command: Callable[P, tuple[list[str], int]]) -> Callable[P, None]:
    """A command that returns its lines and its exit code, as one that prints them and exits."""

    @wraps(command)
    def run(*arguments: P.args, **options: P.kwargs) -> None:
        _ended(command(*arguments, **options))

    return run


def _ended(done: str | tuple[list[str], int] | Callable[[progress.Show, progress.Show], int]) -> None:
    """Print what a command returned, its text or its lines, and exit with its code; or run what it returned, which
    shows results and says the rest as it goes."""
    if callable(done):
        raise typer.Exit(done(typer.echo, _say))
    lines, code = ([done], 0) if isinstance(done, str) else done
    _print(lines)
    raise typer.Exit(code)


app.command("motion", epilog=motion_command.EXAMPLE)(_printing(motion_command.motion))
app.command("compare", epilog=compare_command.EXAMPLE)(_printing(compare_command.compare))
app.command("verify", epilog=verify_command.EXAMPLE)(_printing(verify_command.verify))

APPS = {"rules": rules_app, "rig": rig_app, "calibrate": calibrate_app, "campaign": campaign_app}
for name, reference in APPS.items():
    app.add_typer(reference, name=name, result_callback=_ended)


def main(arguments: Sequence[str] | None = None) -> NoReturn:
    """Run a command and exit with its code. An error is a sentence; with --debug, a traceback."""
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # the matrices are small: threads would wait for each other
    given = list(sys.argv[1:] if arguments is None else arguments)
    debug = "--debug" in given
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):  # a redirected stream on Windows has not all characters
            chosen = stream.isatty() or "PYTHONIOENCODING" in os.environ
            stream.reconfigure(encoding=None if chosen else "utf-8", errors=plain_text.install())
    try:
        app([argument for argument in given if argument != "--debug"], prog_name="nineaudit", obj=given)
    except KeyboardInterrupt:
        sys.exit(INTERRUPTED)
    except NineauditError as error:
        if debug:
            raise
        _say(str(error))
        sys.exit(error.exit_code)
    except Exception as error:  # the last place that can turn a defect into a sentence
        if debug:
            raise
        said, code = last_words(error)
        _say(said)
        sys.exit(code)
    sys.exit(0)


def _print(lines: Iterable[str]) -> None:
    for line in lines:
        typer.echo(line)


def _say(text: str) -> None:
    typer.echo(f"nineaudit: {text}", err=True)
