"""Which recordings a campaign has: folders, globs, archives, tables, parts; and what is said of the others."""

from __future__ import annotations

import zipfile
from collections.abc import Callable
from datetime import date
from pathlib import Path

import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from nineaudit.campaign.places import child, fetched, on_path, recording_files, signature, split
from nineaudit.campaign.sources import Found, find
from nineaudit.errors import ConfigurationError
from nineaudit.parts import Part

TREE = ("T1.csv", "deep/T2.BLF", "deep/er/T3.mcap", "rig.toml", "T1.csv.provenance.json", "page.html", ".hidden/T.csv")


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A tree of files, which are not read; the current folder."""
    for name in TREE:
        (tmp_path / "in" / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / "in" / name).write_bytes(b"0")
    monkeypatch.chdir(tmp_path)
    return tmp_path


def found(*sources: str, parts: tuple[Part, ...] = (), without: str = "") -> list[Found]:
    return list(find(sources, lambda _: parts, without))


def uris(*sources: str, parts: tuple[Part, ...] = ()) -> list[str]:
    return [one.uri for one in found(*sources, parts=parts)]


@pytest.mark.parametrize("source", ["in", "./in", "in/"])
def test_a_folder_is_searched_to_the_bottom_for_what_readers_know(source: str) -> None:
    assert uris(source) == ["in/T1.csv", "in/deep/T2.BLF", "in/deep/er/T3.mcap"]


def test_names_are_as_they_were_given(folder: Path) -> None:
    assert uris(str(folder / "in"))[0] == f"{folder.as_posix()}/in/T1.csv"
    assert uris(f"file://{folder.as_posix()}/in")[0] == f"file://{folder.as_posix()}/in/T1.csv"
    assert uris("in/deep/T2.BLF") == ["in/deep/T2.BLF"]


def test_a_glob_is_one() -> None:
    assert uris("in/**/*.mcap") == ["in/deep/er/T3.mcap"]
    assert uris("in/*") == ["in/T1.csv"]
    assert uris("in/deep/T[12].BLF") == ["in/deep/T2.BLF"]


def test_a_file_whose_name_looks_like_a_glob_is_a_file() -> None:
    Path("in/T[1].csv").write_bytes(b"0")
    assert uris("in/T[1].csv") == ["in/T[1].csv"]


def test_lakes_are_left_out(folder: Path) -> None:
    (folder / "in" / "lake" / "results").mkdir(parents=True)
    (folder / "in" / "lake" / "lake.json").write_text("{}", encoding="utf-8")
    (folder / "in" / "lake" / "recordings.parquet").write_bytes(b"0")
    assert len(uris("in")) == 3
    assert uris("in/lake/*", "in") == ["in/lake/recordings.parquet", *uris("in/**")]
    with pytest.raises(ConfigurationError, match="no recording in it"):
        found("in/lake/*", without=(folder / "in" / "lake").as_posix())


def test_an_archive_is_a_test_or_a_folder(folder: Path) -> None:
    with zipfile.ZipFile("many.zip", "w") as archive:
        for name in TREE:
            archive.write(folder / "in" / name, name)
    assert uris("many.zip") == [f"zip://{name}::many.zip" for name in ("T1.csv", "deep/T2.BLF", "deep/er/T3.mcap")]
    assert uris("zip://deep/*::many.zip") == ["zip://deep/T2.BLF::many.zip"]
    with zipfile.ZipFile("one.zip", "w") as archive:
        for name in ("t.mme", "Channel/t.001", "Channel/t.chn"):
            archive.writestr(name, "0")
    assert uris("one.zip") == ["one.zip"]


def test_a_folder_of_channels_is_one_recording(folder: Path) -> None:
    for name in ("t.mme", "Channel/t.001", "Channel/t.002", "Channel/t.chn"):
        (folder / "mme" / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / "mme" / name).write_bytes(b"0")
    assert uris("mme") == ["mme/t.mme"]


def test_files_of_one_recording_are_one(folder: Path) -> None:
    parts = (Part("{name}_a.csv", ("a",)), Part("{name}_b.csv", ("b",)))
    for name in ("T1_a.csv", "T1_b.csv", "T2_a.csv", "T2_b.csv", "whole.csv"):
        (folder / "in" / "parts").mkdir(exist_ok=True)
        (folder / "in" / "parts" / name).write_bytes(b"0")
    assert uris("in/parts", parts=parts) == ["in/parts/T1_a.csv", "in/parts/T2_a.csv", "in/parts/whole.csv"]
    assert recording_files("s3://b/x/T1_b.csv", parts) == ["s3://b/x/T1_a.csv", "s3://b/x/T1_b.csv"]


def _csv(rows: list[dict[str, object]], path: Path) -> None:
    lines = [";".join(rows[0]), *(";".join("" if v is None else str(v) for v in row.values()) for row in rows)]
    path.write_text("\n".join(lines) + "\n", encoding="utf-8-sig")


def _jsonl(rows: list[dict[str, object]], path: Path) -> None:
    import json

    path.write_text("".join(json.dumps(row, default=str) + "\n\n" for row in rows), encoding="utf-8")


def _parquet(rows: list[dict[str, object]], path: Path) -> None:
    pq.write_table(pa.Table.from_pylist(rows), path)


@pytest.mark.parametrize(
    ("suffix", "write"), [(".csv", _csv), (".jsonl", _jsonl), (".parquet", _parquet)], ids=["csv", "jsonl", "parquet"]
)
def test_a_table_says_rig_databases_and_test(
    folder: Path, suffix: str, write: Callable[[list[dict[str, object]], Path], None]
) -> None:
    rows: list[dict[str, object]] = [
        {"recording": "T1.csv", "rig": "../rig.toml", "dbc": "a.dbc", "number": 42, "date": date(2026, 3, 1)},
        {"recording": "s3://b/T9.csv", "rig": None, "dbc": None, "number": None, "date": None},
    ]
    write(rows, folder / "in" / f"tests{suffix}")
    first, second = found(f"in/tests{suffix}")
    assert (first.uri, first.rig, first.dbc) == ("in/T1.csv", "rig.toml", ("in/a.dbc",))
    assert first.test == {"number": "42", "date": "2026-03-01"}
    assert (second.uri, second.rig, second.dbc, second.test) == ("s3://b/T9.csv", None, (), {})
    assert second.place == f"tests{suffix} row 2"


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (
            "rig;number\nr.toml;1\n",
            "t.csv: has no column of recordings; found 'rig, number'; expected a column",
        ),
        ("recording,number\nT1.csv,1\n,2\n", "t.csv: row 2: a row without a recording"),
        (
            "recording\nT1.csv\nT1.csv\n",
            "T1.csv: the recording is named twice; it is in t.csv row 1 and in t.csv row",
        ),
        ("recording\n", "t.csv: no recording in it"),
    ],
)
def test_a_table_that_is_wrong_is_told_where(text: str, said: str) -> None:
    Path("t.csv").write_text(text, encoding="utf-8")
    with pytest.raises(ConfigurationError) as error:
        found("t.csv")
    assert str(error.value).startswith(said)


@pytest.mark.parametrize(
    ("text", "said"), [("[1]\n", "t.jsonl: line 1: is no object"), ("{}\n{\n", "t.jsonl: row 1: a row without")]
)
def test_json_lines_that_are_wrong_are_told_where(text: str, said: str) -> None:
    Path("t.jsonl").write_text(text, encoding="utf-8")
    with pytest.raises(ConfigurationError) as error:
        found("t.jsonl")
    assert str(error.value).startswith(said)


@pytest.mark.parametrize(
    ("sources", "said"),
    [
        (["nothing"], "nothing: no such file or folder"),
        (["in/*.mf4"], "in/*.mf4: no recording in it"),
        (["in", "in/T1.csv"], "in/T1.csv: the recording is named twice; it is in in and in in/T1.csv"),
        (["nofs://x/y"], "nofs://x/y: cannot be opened: Protocol not known: nofs"),
    ],
)
def test_a_source_that_is_wrong_is_a_sentence(sources: list[str], said: str) -> None:
    with pytest.raises(ConfigurationError) as error:
        found(*sources)
    assert str(error.value).startswith(said)


def test_names_are_taken_apart_and_put_together() -> None:
    assert split("s3://b/k.csv") == ("s3://", "b/k.csv", "")
    assert split("zip://m.csv::s3://b/a.zip") == ("zip://", "m.csv", "::s3://b/a.zip")
    assert on_path("zip://x/m.csv::a.zip", lambda path: path.with_name("n.csv")) == "zip://x/n.csv::a.zip"
    assert child("s3://b/d/t.csv", "../r.toml") == "s3://b/r.toml"
    assert child("d/t.csv", "s3://b/r.toml") == "s3://b/r.toml"


def test_a_signature_tells_a_change_and_is_none_of_what_is_not_there() -> None:
    before = signature(["in/T1.csv"])
    assert before == signature(["in/T1.csv"])
    Path("in/T1.csv.provenance.json").write_bytes(b"another")
    assert signature(["in/T1.csv"]) != before
    assert signature(["in/none.csv"]) is None


def test_a_copy_is_whole_and_goes() -> None:
    parts = (Part("a/{name}.csv", ("a",)), Part("b/{name}.csv", ("b",)))
    with zipfile.ZipFile("parts.zip", "w") as archive:
        for name in ("run/a/T.csv", "run/b/T.csv", "run/a/T.csv.provenance.json"):
            archive.writestr(name, name)
    with fetched("zip://run/a/T.csv::parts.zip", parts) as path:
        assert path.read_text() == "run/a/T.csv"
        assert path.with_name("T.csv.provenance.json").is_file()
        assert (path.parent.parent / "b" / "T.csv").read_text() == "run/b/T.csv"
    assert not path.exists()
    assert not path.parent.parent.exists()
