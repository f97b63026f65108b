"""The command line: exit codes, outputs, what is never written to, and that every help text's example runs."""

from __future__ import annotations

import json
import shlex
import shutil
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
import typer.main
from jsonschema import Draft202012Validator

from calibration_sheets import write_all
from nineaudit import cli, errors
from nineaudit.report import result_schema
from nineaudit.rig import load_rig
from nineaudit.simulate import MOTIONS
from nineaudit.writers import WRITERS

Run = Callable[..., tuple[int, str, str]]

HEALTHY, CLIPPED = "healthy.csv", "T0001.csv"
CHECK_CLIPPED = ("check", CLIPPED, "--rig", "rig.toml")


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A rig, a healthy and a clipped recording, and the result of the latter."""
    folder = tmp_path_factory.mktemp("made")
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        for line in (
            "rig presets naap-3222 > rig.toml",
            f"simulate rig.toml --motion general --output {HEALTHY}",
            f"simulate rig.toml --motion general --fault a1y:clipping=0.5 --output {CLIPPED}",
            f"check {CLIPPED} --rig rig.toml --json result.json",
        ):
            done = subprocess.run(
                f"{shlex.quote(sys.executable)} -m nineaudit {line}", shell=True, capture_output=True, check=False
            )
            assert done.returncode in (0, 1), done.stderr
    write_all(load_rig(folder / "rig.toml"), folder)
    return folder


@pytest.fixture
def run(made: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Run:
    """(exit code, standard output, standard error) of a command, in a folder with the files of `made`."""
    shutil.copytree(made, tmp_path, dirs_exist_ok=True)
    monkeypatch.chdir(tmp_path)

    def call(*arguments: str) -> tuple[int, str, str]:
        with pytest.raises(SystemExit) as ended:
            cli.main(arguments)
        shown = capsys.readouterr()
        return int(ended.value.code or 0), shown.out, shown.err

    return call


def commands(group: Any, path: tuple[str, ...] = ()) -> Iterator[tuple[str, ...]]:
    """Every command and group of the program."""
    yield path
    for name, command in getattr(group, "commands", {}).items():
        yield from commands(command, (*path, name))


COMMANDS = [path for path in commands(typer.main.get_command(cli.app)) if path[:1] != ("campaign",)]
"""The examples of `campaign` need a lake: test_campaign_examples.py runs them."""


# Help


@pytest.mark.parametrize("command", COMMANDS, ids=" ".join)
def test_the_help_ends_with_an_example_that_runs(command: tuple[str, ...], run: Run) -> None:
    code, text, _ = run(*command, "--help")
    assert code == 0
    examples = text.partition("Example:\n")[2].replace("\\\n", " ").splitlines()
    assert examples
    (Path("my-rules")).mkdir()
    shutil.copy(Path(__file__).parents[1] / "rules" / "RQ202.toml", "my-rules")
    for name in (HEALTHY, CLIPPED):
        if command == ("simulate",):
            Path(name).unlink()
    for example in filter(None, map(str.strip, examples)):
        program, *arguments = shlex.split(example.partition(" > ")[0])
        assert program == "nineaudit"
        if command and arguments[0] == "demo" and command != ("demo",):
            continue
        code, shown, said = run(*arguments)
        assert (code, said) == (1 if arguments[0] == "check" else 0, ""), said
        assert shown


def test_help_of_simulate_names_motions_that_there_are(run: Run) -> None:
    named = run("simulate", "--help")[1].partition("--motion NAME")[2].partition("...")[0]
    words = [word.strip() for word in " ".join(named.split()).split(",") if word.strip()]
    assert len(words) >= 6
    assert set(words) <= set(MOTIONS)


def test_help_and_version_import_nothing_heavy() -> None:
    code = (
        "import sys\nfrom nineaudit.cli import main\n"
        "try:\n    main([sys.argv[1]])\nexcept SystemExit as end:\n    assert not end.code\n"
        "print(sorted({'numpy', 'scipy', 'pandas', 'rich', 'pydantic', 'pyarrow', 'jinja2'} & set(sys.modules)))"
    )
    for option in ("--help", "--version"):
        done = subprocess.run([sys.executable, "-c", code, option], capture_output=True, text=True, check=True)
        assert done.stdout.splitlines()[-1] == "[]", option


def test_python_m_nineaudit_is_the_same_program() -> None:
    done = subprocess.run([sys.executable, "-m", "nineaudit", "--version"], capture_output=True, text=True, check=True)
    assert done.stdout.startswith("nineaudit 0.")


# Exit codes


@pytest.mark.parametrize(
    ("arguments", "code"),
    [
        (("check", HEALTHY, "--rig", "rig.toml"), 0),
        (CHECK_CLIPPED, 1),
        ((*CHECK_CLIPPED, "--fail-on", "never"), 0),
        ((*CHECK_CLIPPED, "--select", "ZO"), 0),
        ((*CHECK_CLIPPED, "--select", "RQ202"), 1),
        ((*CHECK_CLIPPED, "--select", "RQ999"), 2),
        ((*CHECK_CLIPPED, "--ignore", "RQ2O2"), 2),
        ((*CHECK_CLIPPED, "--rules", "no-such-folder"), 2),
        ((*CHECK_CLIPPED, "--waivers", "no-such-file.toml"), 2),
        ((*CHECK_CLIPPED, "--fail-on", "sometimes"), 2),
        (("check", CLIPPED, "--rig", "no-such-rig.toml"), 2),
        (("check", CLIPPED), 2),
        (("chekc", CLIPPED), 2),
        (("check", "no-such-file.csv", "--rig", "rig.toml"), 3),
        (("check", "rig.toml", "--rig", "rig.toml"), 3),
        (("repair", HEALTHY, "--rig", "rig.toml", "--output", "new.csv"), 2),
        (("repair", CLIPPED, "--rig", "rig.toml", "--output", "new.csv", "--channel", "a9y"), 2),
        (("repair", "no-such-file.csv", "--rig", "rig.toml", "--output", "new.csv"), 3),
        (("simulate", "rig.toml", "--motion", "waltz", "--output", "new.csv"), 2),
        (("simulate", "rig.toml", "--motion", "general", "--fault", "a1y:tired", "--output", "new.csv"), 2),
        (("simulate", "rig.toml", "--motion", "general", "--output", "new.xls"), 2),
        (("rules", "explain", "XX999"), 2),
        (("rig", "presets", "naap"), 2),
        (("rig", "presets", "naap-3222", "--arms", "50,fifty,50"), 2),
        (("report", "rig.toml", "--html", "new.html"), 2),
    ],
    ids=lambda value: " ".join(value) if isinstance(value, tuple) else str(value),
)
def test_exit_code(arguments: tuple[str, ...], code: int, run: Run) -> None:
    found, shown, said = run(*arguments)
    assert found == code
    assert "Traceback" not in shown + said
    if code in (2, 3):
        assert said
        assert not Path("new.csv").exists()


def test_one_that_cannot_be_read_does_not_stop_the_others_and_makes_the_code_3(run: Run) -> None:
    code, shown, said = run("check", CLIPPED, "no-such-file.csv", HEALTHY, "--rig", "rig.toml")
    assert code == 3
    assert f"{CLIPPED}: FAIL" in shown
    assert "no-such-file.csv: NOT AUDITED" in shown
    assert f"{HEALTHY}: PASS" in shown
    assert "no-such-file.csv: cannot be read" in said
    assert said.endswith("3 recordings: 1 fail, 1 not audited, 1 pass\n")


def test_a_wrong_rig_stops_before_anything_is_written(run: Run) -> None:
    Path("rig.toml").write_text('[rig]\npreset = "naap-3223"\n', encoding="utf-8")
    code, shown, said = run("check", CLIPPED, "--rig", "rig.toml", "--json", "new.json", "--html", "new.html")
    assert (code, shown) == (2, "")
    assert "rig.toml" in said
    assert "naap-3222" in said
    assert not Path("new.json").exists()
    assert not Path("new.html").exists()


def test_a_defect_is_a_sentence_with_its_own_code(run: Run, monkeypatch: pytest.MonkeyPatch) -> None:
    def broken(_: object) -> list[str]:
        raise ZeroDivisionError("division by zero")

    monkeypatch.setattr("nineaudit.commands.rig_lines", broken)
    code, _, said = run("rig", "check", "rig.toml")
    assert code == errors.DEFECT == 70
    assert "--debug" in said
    assert "Traceback" not in said
    with pytest.raises(ZeroDivisionError):
        cli.main(["--debug", "rig", "check", "rig.toml"])


def test_debug_shows_the_traceback_wherever_it_stands(run: Run) -> None:
    from nineaudit.errors import ConfigurationError

    assert run("rig", "check", "no-such-rig.toml")[0] == 2
    for arguments in (["--debug", "rig", "check", "no-such-rig.toml"], ["rig", "check", "no-such-rig.toml", "--debug"]):
        with pytest.raises(ConfigurationError):
            cli.main(arguments)


# Outputs of check


@pytest.mark.parametrize("name", [CLIPPED, "no-such-file.csv"])
def test_json_on_standard_output_is_the_document(name: str, run: Run) -> None:
    _, shown, _ = run("check", name, "--rig", "rig.toml", "--format", "json", "--json", "one.json")
    document = json.loads(shown)
    Draft202012Validator(result_schema()).validate(document)
    assert json.loads(Path("one.json").read_text(encoding="utf-8")) == document
    assert document["recording"]["path"] == name


def test_several_recordings_in_every_format(run: Run) -> None:
    names = [CLIPPED, "no-such-file.csv"]
    options = ("--json", "all.json", "--junit", "all.xml", "--summary", "all.md", "--html", "pages/")
    _, lines, _ = run("check", *names, "--rig", "rig.toml", "--format", "jsonl", *options)
    documents = [json.loads(line) for line in lines.splitlines()]
    for document in documents:
        Draft202012Validator(result_schema()).validate(document)
    assert [d["verdict"] for d in documents] == ["fail", "not_audited"]
    assert json.loads(Path("all.json").read_text(encoding="utf-8")) == documents
    assert all("no-such-file.csv" in Path(f"all.{end}").read_text(encoding="utf-8") for end in ("xml", "md"))
    assert [page.name for page in Path("pages").iterdir()] == ["T0001.html"]
    for style, start in (("json", "["), ("junit", "<?xml"), ("github", "::error")):
        code, shown, _ = run("check", *names, "--rig", "rig.toml", "--format", style)
        assert code == 3
        assert shown.startswith(start)
    assert len(shown.splitlines()) > 1


@pytest.mark.parametrize("pattern", ["out/{stem}.html", "out/", "made"])
def test_a_page_for_each_recording(pattern: str, run: Run) -> None:
    Path("made").mkdir()
    code, _, _ = run("check", CLIPPED, HEALTHY, "--rig", "rig.toml", "--html", pattern)
    assert code == 1
    folder = Path(pattern).parent if "{" in pattern else Path(pattern)
    assert sorted(page.name for page in folder.iterdir()) == ["T0001.html", "healthy.html"]


def test_one_page_for_several_recordings_is_refused_with_the_cure(run: Run) -> None:
    code, _, said = run("check", CLIPPED, HEALTHY, "--rig", "rig.toml", "--html", "both.html")
    assert code == 2
    assert "{stem}" in said


def test_two_recordings_of_one_name_are_not_written_to_one_page(run: Run) -> None:
    Path("other").mkdir()
    shutil.copy(HEALTHY, f"other/{CLIPPED}")
    code, _, said = run("check", CLIPPED, f"other/{CLIPPED}", "--rig", "rig.toml", "--html", "out/")
    assert code == 2
    assert "would both be written" in said


@pytest.mark.parametrize("option", ["--html", "--json", "--junit", "--summary"])
@pytest.mark.parametrize("target", [CLIPPED, "rig.toml", "link.html"])
def test_an_input_is_never_written_to(option: str, target: str, run: Run) -> None:
    Path("link.html").hardlink_to("rig.toml")
    before = {name: Path(name).read_bytes() for name in (CLIPPED, "rig.toml")}
    code, _, said = run(*CHECK_CLIPPED, option, target)
    assert code == 2
    assert "never written to" in said
    assert {name: Path(name).read_bytes() for name in before} == before


def test_repair_and_simulate_never_write_to_an_input(run: Run) -> None:
    before = {name: Path(name).read_bytes() for name in (CLIPPED, "rig.toml")}
    for target in before:
        for arguments in (
            ("repair", CLIPPED, "--rig", "rig.toml", "--output", target, "--force"),
            ("simulate", "rig.toml", "--motion", "rest", "--output", "rig.toml", "--force"),
        ):
            assert run(*arguments)[0] == 2
    assert {name: Path(name).read_bytes() for name in before} == before


def test_two_outputs_in_one_file_are_refused(run: Run) -> None:
    code, _, said = run(*CHECK_CLIPPED, "--html", "out.html", "--summary", "out.html")
    assert code == 2
    assert "two outputs" in said


def test_a_place_that_cannot_be_written_to_is_a_sentence(run: Run) -> None:
    Path("file").write_text("not a folder", encoding="utf-8")
    for option in ("--html", "--json"):
        code, _, said = run(*CHECK_CLIPPED, option, "file/out")
        assert code == 2
        assert "cannot be written" in said


def test_a_waived_finding_stays_visible_and_does_not_fail(run: Run) -> None:
    findings = json.loads(Path("result.json").read_text(encoding="utf-8"))["findings"]
    rules = sorted({f["rule"] for f in findings if f["verdict"] in ("fail", "inconclusive")})
    waiver = (
        '[[waiver]]\nrule = "{}"\nrecordings = "T*.csv"\nreason = "known"\napproved_by = "A"\n'
        "approved_on = 2024-01-01\nexpires = 2999-01-01\n"
    )
    Path("w.toml").write_text("".join(map(waiver.format, rules)), encoding="utf-8")
    code, shown, _ = run(*CHECK_CLIPPED, "--waivers", "w.toml")
    assert code == 0
    assert "waived RQ202 a1y" in shown


# The other commands


def test_repair_writes_a_new_file_and_what_was_done(run: Run) -> None:
    before = Path(CLIPPED).read_bytes()
    repair = ("repair", CLIPPED, "--rig", "rig.toml", "--output", "new.csv", "--reason", "clipped", "--by", "A. Tester")
    code, shown, _ = run(*repair)
    assert code == 0
    assert "a1y rebuilt" in shown
    done = json.loads(Path("new.csv.provenance.json").read_text(encoding="utf-8"))
    assert (done["channels"], done["reason"], done["by"]) == (["a1y"], "clipped", "A. Tester")
    assert Path(CLIPPED).read_bytes() == before
    code, _, said = run(*repair)
    assert code == 2
    assert "--force" in said
    assert run(*repair, "--force")[0] == 0
    assert run("check", "new.csv", "--rig", "rig.toml")[0] == 0


@pytest.mark.parametrize("suffix", [s for s in WRITERS if s not in (".tsv", ".txt")])
def test_what_simulate_writes_check_reads(suffix: str, run: Run) -> None:
    code, shown, _ = run("simulate", "rig.toml", "--motion", "oblique", "--output", f"new{suffix}")
    assert code == 0
    assert shown.startswith(f"new{suffix}: 9 channels")
    database = ("--dbc", "new.dbc") if suffix in (".blf", ".asc") else ()
    code, shown, said = run("check", f"new{suffix}", "--rig", "rig.toml", *database, "--select", "RQ1")
    assert (code, said) == (0, "")
    assert run("simulate", "rig.toml", "--motion", "oblique", "--output", f"new{suffix}")[0] == 2
    assert run("simulate", "rig.toml", "--motion", "oblique", "--output", f"new{suffix}", "--force")[0] == 0
    assert run("check", f"new{suffix}", "--rig", "rig.toml", *database, "--select", "RQ1")[0] == 0


def test_the_page_of_a_result_names_the_culprit_and_is_safe(run: Run) -> None:
    document = json.loads(Path("result.json").read_text(encoding="utf-8"))
    document["recording"]["path"] = "<script>alert(1)</script>.csv"
    Path("result.json").write_text(json.dumps(document), encoding="utf-8")
    assert run("report", "result.json", "--html", "result.html")[0] == 0
    page = Path("result.html").read_text(encoding="utf-8")
    assert "Channel a1y is at fault: clipping" in page
    assert document["recording"]["sha256"] in page
    assert all(finding["rule"] in page for finding in document["findings"])
    assert "<script" not in page


def test_the_page_of_a_failure_says_why(run: Run) -> None:
    run("check", "no-such-file.csv", "--rig", "rig.toml", "--json", "bad.json")
    assert run("report", "bad.json", "--html", "bad.html")[0] == 0
    page = Path("bad.html").read_text(encoding="utf-8")
    assert "Not audited" in page
    assert "cannot be read" in page


@pytest.mark.parametrize("text", ["", "[]", "{}", '{"schema": "nineaudit/result/2"}', "not JSON"])
def test_what_is_no_result_is_refused(text: str, run: Run) -> None:
    Path("wrong.json").write_text(text, encoding="utf-8")
    code, _, said = run("report", "wrong.json", "--html", "new.html")
    assert code == 2
    assert said.startswith("nineaudit: wrong.json: ")
    assert not Path("new.html").exists()


def test_rules_of_a_folder_are_held_to_their_checks(run: Run) -> None:
    sheet = (Path(__file__).parents[1] / "rules" / "RQ202.toml").read_text(encoding="utf-8")
    Path("mine").mkdir()
    Path("mine/RQ202.toml").write_text(sheet.replace("max_samples", "max_sample"), encoding="utf-8")
    code, _, said = run("rules", "check", "mine")
    assert code == 2
    assert "max_samples" in said
    Path("mine/RQ202.toml").write_text(sheet.replace('severity = "error"', 'severity = "warning"'), encoding="utf-8")
    assert run("rules", "check", "mine")[0] == 0
    assert "RQ202  warning" in run("rules", "list", "--rules", "mine")[1]


@pytest.mark.parametrize("name", ["rules", "rig"])
def test_the_schemas_are_schemas(name: str, run: Run) -> None:
    Draft202012Validator.check_schema(json.loads(run(name, "schema")[1]))


def test_every_preset_is_a_rig_that_is_understood(run: Run) -> None:
    names = [line.split()[0] for line in run("rig", "presets")[1].splitlines()]
    assert len(names) >= 8
    for name in names:
        Path("preset.toml").write_text(run("rig", "presets", name)[1], encoding="utf-8")
        code, shown, _ = run("rig", "check", "preset.toml")
        assert code == 0
        assert "accelerometers" in shown


def test_demo_finds_repairs_and_passes_and_takes_a_fresh_folder_each_time(run: Run) -> None:
    code, shown, _ = run("demo")
    assert code == 0
    assert "FAIL: a1y is at fault: clipping" in shown
    assert "Checked again. PASS" in shown
    files = {path.name for path in Path("nineaudit-demo").iterdir()}
    wanted = {"rig.toml", "recording.csv", "report.html", "result.json", "repaired.csv", "repaired.csv.provenance.json"}
    assert files == wanted
    assert str(Path("nineaudit-demo/report.html")) in shown
    before = {name: Path("nineaudit-demo", name).read_bytes() for name in wanted}
    assert "nineaudit-demo-2" in run("demo")[1]
    assert {name: Path("nineaudit-demo", name).read_bytes() for name in wanted} == before
    code, _, said = run("demo", "--output", "nineaudit-demo")
    assert code == 2
    assert "empty" in said
