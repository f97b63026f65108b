"""Which recordings a campaign has where folders are as they are: links, hidden files, names of other code pages, pipes,
ISO-MME tests with all their folders, archives and tables that are damaged, stores without credentials."""

from __future__ import annotations

import os
import zipfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from nineaudit.campaign.source_tables import is_table, rows
from nineaudit.campaign.sources import find
from nineaudit.errors import ConfigurationError

LATIN = os.fsdecode(b"Pr\xfcfung.csv")


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The current folder."""
    monkeypatch.chdir(tmp_path)
    return tmp_path


def made(*names: str) -> None:
    for name in names:
        Path(name).parent.mkdir(parents=True, exist_ok=True)
        Path(name).write_bytes(b"0")


def uris(*sources: str, exclude: tuple[str, ...] = ()) -> list[str]:
    return [one.uri for one in find(sources, lambda _: (), exclude=exclude)]


def refused(*sources: str, exclude: tuple[str, ...] = ()) -> str:
    with pytest.raises(ConfigurationError) as error:
        uris(*sources, exclude=exclude)
    return str(error.value)


NAMES = ("a b.csv", "a#1.csv", "100%.csv", "ü.csv", "🚗.csv", 'it\'s "T1".csv', "two\nlines.csv", "~T1.csv", "a\\b.csv")


@pytest.mark.parametrize("name", NAMES)
def test_a_name_may_have_any_character(name: str) -> None:
    made(f"in/{name}")
    assert uris("in") == uris("in/*") == [f"in/{name}"]
    os.chdir("in")
    assert uris(".") == uris("*") == uris(name) == [name]


def test_a_name_that_is_not_utf8_is_told_and_may_be_left_out() -> None:
    made("in/T1.csv", f"in/{LATIN}")
    said = r"in/Pr\udcfcfung.csv: its name is not UTF-8; rename it, or leave it out with --exclude"
    assert refused("in") == refused("in/*.csv") == refused(f"in/{LATIN}") == said
    assert uris("in", exclude=("Pr*",)) == ["in/T1.csv"]
    made(os.fsdecode(b"in/\xfc/notes.doc"), os.fsdecode(b"in/\xfc.doc"))
    assert uris("in", exclude=("Pr*",)) == ["in/T1.csv"], "what is no recording may have any name"


def test_a_name_that_reads_as_an_archive_is_told_and_may_be_left_out() -> None:
    made("in/T1.csv", "in/T2::x.csv", "in/a::b.doc")
    assert refused("in").startswith("in/T2::x.csv: its name has ::, which stands for an archive; rename it")
    assert uris("in", exclude=("T2*",)) == ["in/T1.csv"]


def test_links_to_folders_are_followed_each_folder_once() -> None:
    made("in/T1.csv", "in/real/T2.csv", "disk/T3.csv", "disk/sub/T4.csv")
    Path("in/2024").symlink_to(Path("disk").absolute())
    Path("in/again").symlink_to(Path("disk/sub").absolute())
    Path("in/a link").symlink_to("real")
    Path("in/real/up").symlink_to("..")
    Path("disk/self").symlink_to(".")
    expected = ["in/2024/T3.csv", "in/2024/sub/T4.csv", "in/T1.csv", "in/real/T2.csv"]
    assert uris("in") == uris("in/**") == uris("in/**/*.csv") == expected
    assert uris("in/*/*.csv") == ["in/2024/T3.csv", "in/a link/T2.csv", "in/again/T4.csv", "in/real/T2.csv"]


def test_what_is_no_file_is_told_and_a_broken_link_costs_itself() -> None:
    made("in/T1.csv")
    Path("in/T2.csv").symlink_to("nothing")
    assert uris("in") == ["in/T1.csv", "in/T2.csv"]
    os.mkfifo("in/T3.csv")
    said = "in/T3.csv: is neither a file nor a folder; leave it out with --exclude"
    assert refused("in") == refused("in/T3.csv") == said
    assert uris("in", exclude=("T3*",)) == ["in/T1.csv", "in/T2.csv"]


def test_a_folder_that_cannot_be_listed_is_told_and_may_be_left_out(monkeypatch: pytest.MonkeyPatch) -> None:
    made("in/T1.csv", "in/deep/lost+found/T2.csv")
    scandir = os.scandir

    def scanned(place: Any) -> Any:
        if str(place).endswith("lost+found"):
            raise PermissionError(13, "Permission denied", str(place))
        return scandir(place)

    monkeypatch.setattr(os, "scandir", scanned)
    said = "in/deep/lost+found: cannot be listed: Permission denied"
    assert refused("in").startswith(said)
    assert refused("in/**/*.csv").startswith(said)
    assert uris("in", exclude=("lost+found",)) == uris("in/**/*.csv", exclude=("in/deep",)) == ["in/T1.csv"]


def test_a_folder_may_be_called_as_a_table_or_an_archive() -> None:
    made("tests.csv/T1.csv", "tests.zip/T2.csv")
    Path("empty").mkdir()
    assert uris("tests.csv", "tests.zip") == ["tests.csv/T1.csv", "tests.zip/T2.csv"]
    assert refused("empty").startswith("empty: no recording in it")


def test_a_glob_leaves_out_what_is_hidden_unless_it_names_it() -> None:
    made("in/T1.csv", "in/._T1.csv", "in/.h/T2.csv", "in/d/T3.csv")
    assert uris("in/*.csv") == ["in/T1.csv"]
    assert uris("in/**/*.csv") == ["in/T1.csv", "in/d/T3.csv"]
    assert uris("in/.*/*.csv") == uris("in/.h/*.csv") == ["in/.h/T2.csv"]
    assert uris("in/._*") == ["in/._T1.csv"]


def test_brackets_in_the_name_of_a_folder() -> None:
    made("a[1]/T1.csv", "a1/T2.csv", "b1/T3.csv", "b2/T4.csv")
    assert uris("a[1]/*.csv") == uris("a[[]1]/*.csv") == ["a[1]/T1.csv"]
    assert uris("b[12]/*.csv") == ["b1/T3.csv", "b2/T4.csv"]
    assert uris("b[12]**/T*") == ["b1/T3.csv", "b2/T4.csv"]
    assert refused("c[1]/*.csv").startswith("c[1]/*.csv: no recording in it")


MME = ("t.mme", "t.txt", "Channel/t.001", "Channel/notes.csv", "REPORT/a/b.txt", "Movie/t.log", "Static/sled.csv")


def test_an_iso_mme_test_is_one_recording_with_all_its_folders() -> None:
    made(*(f"in/mme/{name}" for name in MME))
    assert uris("in") == uris("in/mme") == uris("in/**") == ["in/mme/t.mme"]
    assert refused("in", exclude=("*.mme",)).startswith("in: no recording in it")
    assert uris("in/mme/*") == uris("in/*/t.*") == ["in/mme/t.mme"]
    assert uris("in/mme/t.txt", "in/mme/Static/*") == ["in/mme/t.txt", "in/mme/Static/sled.csv"], (
        "what is named is audited"
    )
    assert refused("in/**/*.csv").startswith("in/**/*.csv: no recording in it")


def test_recordings_beside_an_iso_mme_test_stay() -> None:
    made("in/T1.csv", "in/T4/T4.mme", "in/T5.mme", "in/T6.csv", "in/T6.txt", "in/2025/T7.csv", "in/2025/Report/T8.csv")
    assert uris("in") == sorted(
        ["in/T1.csv", "in/T4/T4.mme", "in/T5.mme", "in/T6.csv", "in/T6.txt", "in/2025/T7.csv", "in/2025/Report/T8.csv"]
    )


@pytest.mark.parametrize("home", ["", "test 1/"])
def test_an_archive_of_an_iso_mme_test_is_one_recording(home: str) -> None:
    with zipfile.ZipFile("one.zip", "w") as archive:
        for name in (*MME, "README.txt"):
            archive.writestr(home + name, "0")
    assert uris("one.zip") == ["one.zip"]
    assert refused("one.zip", exclude=("*.mme",)).startswith("one.zip: no recording in it")
    with zipfile.ZipFile("one.zip", "a") as archive:
        archive.writestr(f"{home}T9.csv", "0")
    assert uris("one.zip") == [f"zip://{home}T9.csv::one.zip", f"zip://{home}t.mme::one.zip"]
    assert uris("one.zip", exclude=("*.mme",)) == [f"zip://{home}T9.csv::one.zip"]


def test_an_archive_of_channels_without_a_header_is_one_recording() -> None:
    with zipfile.ZipFile("one.zip", "w") as archive:
        archive.writestr("t/Channel/t.001", "0")
    assert uris("one.zip") == ["one.zip"]


@pytest.mark.parametrize("end", [0, 10, 200, -1, -10, -30])
def test_an_archive_that_is_cut_costs_itself(end: int) -> None:
    with zipfile.ZipFile("year.zip", "w") as archive:
        for name in ("T1.csv", "T2.csv"):
            archive.writestr(name, "0" * 100)
    whole = Path("year.zip").read_bytes()
    Path("year.zip").write_bytes(whole[:end])
    assert uris("year.zip") == ["year.zip"]
    assert refused("zip://*.csv::year.zip").startswith("zip://*.csv::year.zip: cannot be opened: ")


@pytest.mark.parametrize("line_end", ["\r", "\n", "\r\n"])
def test_a_table_may_have_any_line_ends(line_end: str) -> None:
    text = line_end.join(["recording,number,note", 'T1.csv,1,"two\u2028lines"', "T2.csv,2,", ""])
    Path("t.csv").write_bytes(text.encode())
    assert [(place, row["recording"], row["number"]) for place, row in rows("t.csv")] == [
        ("t.csv row 1", "T1.csv", "1"),
        ("t.csv row 2", "T2.csv", "2"),
    ]
    Path("t.jsonl").write_text('{"recording": "T1.csv", "note": "two\u2028lines"}\n', encoding="utf-8")
    assert [row["note"] for _, row in rows("t.jsonl")] == ["two\u2028lines"]


def test_a_cell_that_is_too_large_is_told_where() -> None:
    Path("t.csv").write_text(f'recording,note\nT1.csv,\nT2.csv,"{"x" * 200_000}"\n', encoding="utf-8")
    assert refused("t.csv") == "t.csv: row 2: cannot be read: field larger than field limit (131072)"


@pytest.mark.parametrize(
    ("name", "text", "said"),
    [
        ("t.csv", "recording,Number,number\nT1.csv,1,2\n", "t.csv: has a column twice; found 'number'"),
        ("t.jsonl", '{"recording": "T1.csv", "note": "\\ud800"}\n', "t.jsonl: line 1: is no JSON: 'utf-8' codec"),
        ("t.jsonl", '{"recording": ' + "[" * 100_000, "t.jsonl: line 1: is no JSON: maximum recursion depth"),
    ],
    ids=["twice", "surrogate", "deep"],
)
def test_a_table_that_cannot_be_meant_is_told(name: str, text: str, said: str) -> None:
    Path(name).write_text(text, encoding="utf-8")
    assert refused(name).startswith(said)


def test_a_date_that_is_none_is_told() -> None:
    pq.write_table(pa.table({"recording": ["T1.csv"], "date": pa.array([2**31 - 1], pa.date32())}), "t.parquet")
    assert refused("t.parquet").startswith("t.parquet: cannot be read: days=2147483647")


def test_of_a_recording_only_the_head_is_read(monkeypatch: pytest.MonkeyPatch) -> None:
    from fsspec.implementations.local import LocalFileSystem

    whole = LocalFileSystem.cat_file

    def head(fs: Any, path: str, start: int | None = None, end: int | None = None) -> Any:
        assert end, f"{path} is read whole"
        return whole(fs, path, start, end)

    monkeypatch.setattr(LocalFileSystem, "cat_file", head)
    made("T1.csv", "T2.csv")
    pq.write_table(pa.table({"t": [0.0]}), "T3.parquet")
    Path("T4.parquet").write_bytes(Path("T3.parquet").read_bytes()[:-9])
    Path("T5.parquet").write_bytes(b"PAR1" + b"\xff" * 40 + b"\x20\0\0\0PAR1")
    assert [name for name in sorted(os.listdir()) if is_table(name)] == []
    assert uris(*sorted(os.listdir())) == ["T1.csv", "T2.csv", "T3.parquet", "T4.parquet", "T5.parquet"]


def test_a_parquet_table_is_read_where_it_is() -> None:
    table = pa.table({"recording": [f"T{i}.csv" for i in range(1000)]})
    pq.write_table(table, "t.parquet", row_group_size=100)
    assert [row["recording"] for _, row in rows("t.parquet")] == table["recording"].to_pylist()
    data = bytearray(Path("t.parquet").read_bytes())
    data[4:40] = b"\xff" * 36
    Path("t.parquet").write_bytes(data)
    assert refused("t.parquet").startswith("t.parquet: cannot be read: ")


@pytest.fixture
def nobody(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """A machine without credentials for a store."""
    s3fs = pytest.importorskip("s3fs")
    for name in [name for name in os.environ if name.startswith("AWS_")]:
        monkeypatch.delenv(name)
    for name, value in (
        ("EC2_METADATA_DISABLED", "true"),
        ("CONFIG_FILE", "none"),
        ("SHARED_CREDENTIALS_FILE", "none"),
    ):
        monkeypatch.setenv(f"AWS_{name}", value)
    s3fs.S3FileSystem.clear_instance_cache()
    yield
    s3fs.S3FileSystem.clear_instance_cache()


@pytest.mark.usefixtures("nobody")
@pytest.mark.parametrize(
    "source", ["s3://bucket/tests", "s3://bucket/*.csv", "s3://bucket/**/*.csv", "s3://bucket/t.csv"]
)
def test_a_store_without_credentials_is_told(source: str) -> None:
    assert refused(source) == f"{source}: cannot be opened: Unable to locate credentials"
