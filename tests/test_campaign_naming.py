"""What entries and reports call things: as they were given, never by a folder of the machine that made them."""

from __future__ import annotations

import json
import tempfile
import zipfile
from pathlib import Path
from typing import Any

import pytest
from fsspec.core import url_to_fs

from campaigns import campaign, contents
from nineaudit.campaign import settings, task
from nineaudit.errors import ConfigurationError
from recordings import rig_text

FRONT, REAR = "front/{name}_a.csv", "rear/logger/{name}_b.csv"
A, B = ["a0x", "a0y", "a0z"], ["a1y", "a1z", "wx"]


@pytest.fixture(autouse=True)
def home(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The current folder: a rig of two loggers, and their files of one recording below tests & more/."""
    monkeypatch.chdir(campaign(tmp_path, ["T1.csv"]))
    parts = "".join(f"[[part]]\nfile = '{file}'\nchannels = {c}\n" for file, c in ((FRONT, A), (REAR, B)))
    Path("rig.toml").write_text(rig_text() + parts, encoding="utf-8")
    rows = [line.split(",") for line in Path("tests/T1.csv").read_text(encoding="utf-8").splitlines()]
    for file, columns in ((FRONT, (0, 1, 2, 3)), (REAR, (0, 4, 5, 6))):
        path = Path("tests & more", file.format(name="T1"))
        path.parent.mkdir(parents=True)
        path.write_text("\n".join(",".join(row[i] for i in columns) for row in rows) + "\n", encoding="utf-8")
    return tmp_path


def given(place: str) -> tuple[str, str]:
    """The uris of the two files of the recording, at a place."""
    names = [f"tests & more/{file.format(name='T1')}" for file in (FRONT, REAR)]
    if place == "zip":
        with zipfile.ZipFile("all.zip", "w") as archive:
            for name in names:
                archive.write(name)
        return f"zip://{names[0]}::all.zip", f"zip://{names[1]}::all.zip"
    if place == "memory":
        fs, root = url_to_fs("memory://naming")
        fs.put("tests & more", f"{root}/tests & more", recursive=True)
        return f"memory://naming/{names[0]}", f"memory://naming/{names[1]}"
    return names[0], names[1]


@pytest.mark.parametrize("place", ["zip", "memory", "folder"])
def test_files_of_a_recording_have_their_names(place: str, home: Path) -> None:
    first, second = given(place)
    done = task.audit_one(first, "rig.toml", lake="lake", reports="all")
    assert done["verdict"] != "not_audited", done
    (report,), (entry,) = Path("lake/reports").iterdir(), Path("lake/results").rglob("*.json")
    page, text = report.read_text(encoding="utf-8"), entry.read_text(encoding="utf-8")
    recording: dict[str, Any] = json.loads(text)["result"]["recording"]
    assert [recording["path"], *(part["path"] for part in recording["parts"])] == [first, first, second]
    for uri in (first, second):
        assert f'<dd class="literal">{uri.replace("&", "&amp;")}</dd>' in page
    assert '<dd class="literal">rig.toml</dd>' in page
    for made in (page, text):
        assert tempfile.gettempdir() + "/" not in made.replace(str(home), "")
        assert "nineaudit-" not in made.replace("nineaudit-report", "")


def test_the_same_recording_has_the_same_entry_and_report_each_time() -> None:
    first, _ = given("zip")
    for lake in ("one", "other"):
        task.audit_one(first, "rig.toml", lake=lake, reports="all")
        settings._loaded.cache_clear()
    for part in ("results", "reports"):
        assert contents(Path("one"), part) == contents(Path("other"), part)


def test_what_is_wrong_with_the_second_file_is_told_by_its_name() -> None:
    first, _ = given("folder")
    Path("tests & more", REAR.format(name="T1")).write_text("no recording\n", encoding="utf-8")
    with zipfile.ZipFile("bad.zip", "w") as archive:
        for file in (FRONT, REAR):
            archive.write(f"tests & more/{file.format(name='T1')}")
    reason = task.audit_one(f"zip://{first}::bad.zip", "rig.toml")["result"]["reason"]
    assert reason.startswith("zip://tests & more/rear/logger/T1_b.csv: ")


@pytest.mark.parametrize(
    ("options", "file", "text", "said"),
    [
        ({"rules": "typo"}, None, "", "typo: --rules: no rule sheets"),
        ({"rules": "sheets"}, "sheets/mine.toml", "[[rule]]\n", "sheets/mine.toml: "),
        ({"waivers": "sub/w.toml"}, "sub/w.toml", "[[waiver]]\nrule = 'X'\n", "sub/w.toml: "),
        ({"waivers": "./rig"}, "rig", "nonsense", "./rig: "),
        ({"rig": "sub/rig.toml"}, "sub/rig.toml", "[rig]\nnaem = 1\n", "sub/rig.toml: "),
    ],
)
def test_a_setting_that_is_wrong_is_named_as_it_was_given(
    options: dict[str, str], file: str | None, text: str, said: str
) -> None:
    if file is not None:
        Path(file).parent.mkdir(exist_ok=True)
        Path(file).write_text(text, encoding="utf-8")
    with pytest.raises(ConfigurationError) as raised:
        task.audit_one("tests/T1.csv", **{"rig": "rig.toml", **options})
    assert str(raised.value).startswith(said)
    assert "nineaudit-" not in str(raised.value)


@pytest.mark.parametrize("options", [{"dbc": ["sub/bus.dbc"]}, {}])
def test_a_database_that_is_wrong_is_named_in_the_entry_of_its_recording(options: dict[str, Any]) -> None:
    Path("sub").mkdir()
    for name in ("sub/bus.dbc", "bus.dbc"):
        Path(name).write_text("BO_ nonsense\n", encoding="utf-8")
    rig = rig_text().replace("[recording]\n", "[recording]\ndbc = ['../bus.dbc']\n")
    Path("sub/rig.toml").write_text(rig, encoding="utf-8")
    Path("tests/bus.log").write_text("(0.0) can0 123#00\n", encoding="utf-8")
    reason = task.audit_one("tests/bus.log", "sub/rig.toml", **options)["result"]["reason"]
    assert reason.startswith("bus.dbc: " if options else "../bus.dbc: ")
    assert "nineaudit-" not in reason
