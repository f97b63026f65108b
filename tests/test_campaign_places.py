"""Places of recordings, rigs and lakes: what cannot be reached, what tells that a file changed, what names it."""

from __future__ import annotations

import os
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from fsspec.core import url_to_fs
from fsspec.implementations.memory import MemoryFileSystem

from campaigns import campaign, contents, entries, plan, told
from nineaudit.campaign import lake as lakes
from nineaudit.campaign import task
from nineaudit.campaign.places import signature
from nineaudit.campaign.results.compact import compact
from nineaudit.campaign.settings import collect
from nineaudit.campaign.waiving import unmatched
from nineaudit.errors import ConfigurationError
from nineaudit.waivers import load_waivers

UNREACHABLE = ["s3://bucket/T1.csv", "s3://A_bad/bucket!/T1.csv", "nonsense://T1.csv", "zip://T1.csv::broken.zip"]


@pytest.fixture(autouse=True)
def home(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The current folder: a rig and a recording."""
    monkeypatch.chdir(campaign(tmp_path, ["T1.csv"]))
    return tmp_path


@pytest.fixture
def no_store(monkeypatch: pytest.MonkeyPatch) -> None:
    """No credentials, and nobody at the endpoint."""
    s3fs = pytest.importorskip("s3fs")
    for name in ("ACCESS_KEY_ID", "SECRET_ACCESS_KEY", "PROFILE", "SESSION_TOKEN"):
        monkeypatch.delenv(f"AWS_{name}", raising=False)
    told = {"EC2_METADATA_DISABLED": "true", "ENDPOINT_URL": "http://127.0.0.1:1", "CONFIG_FILE": "none"}
    for name, value in {**told, "SHARED_CREDENTIALS_FILE": "none", "MAX_ATTEMPTS": "1"}.items():
        monkeypatch.setenv(f"AWS_{name}", value)
    s3fs.S3FileSystem.clear_instance_cache()
    Path("broken.zip").write_bytes(b"PK no archive")


@pytest.mark.usefixtures("no_store")
@pytest.mark.parametrize("credentials", [False, True])
@pytest.mark.parametrize("uri", UNREACHABLE)
def test_what_cannot_be_reached_is_told(uri: str, credentials: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    if credentials:
        monkeypatch.setenv("AWS_ACCESS_KEY_ID", "x")
        monkeypatch.setenv("AWS_SECRET_ACCESS_KEY", "x")
    with pytest.raises(ConfigurationError, match="cannot read the rig file: "):
        collect(uri)
    with pytest.raises(ConfigurationError, match="cannot be opened: "):
        lakes.open_lake(uri, create=True)
    done = task.audit_one(uri, "rig.toml", lake="lake")
    assert (done["verdict"], done["transient"]) == ("not_audited", True)
    assert "cannot be fetched: " in done["reason"]
    assert task.audit_one(uri, "rig.toml")["result"]["reason"] == done["reason"]


def test_a_mistake_of_ours_is_none_of_the_store(monkeypatch: pytest.MonkeyPatch) -> None:
    def wrong(*_: Any) -> None:
        raise ValueError("ours")

    monkeypatch.setattr(task, "recording_files", wrong)
    with pytest.raises(ValueError, match="ours"):
        task.audit_one("tests/T1.csv", "rig.toml", lake="lake")


def waived(pattern: str) -> None:
    """A waiver in w.toml of what is not evaluated in T1.csv."""
    Path("w.toml").write_text(
        f"[[waiver]]\nrule = 'ZO102'\nrecordings = '{pattern}'\nreason = 'r'\napproved_by = 'a'\n"
        "approved_on = 2026-01-01\nexpires = 2099-01-01\n",
        encoding="utf-8",
    )


@pytest.mark.parametrize(
    ("uri", "pattern"),
    [
        ("memory://2025/T[1].csv", "memory://2025/*"),
        ("memory://2025/T[1].csv", "T[[]1].csv"),
        ("memory://2025/T1.csv", "T?.csv"),
        ("file://{home}/tests/T1.csv", "{home}/tests/*.csv"),
        ("file://{home}/tests/T1.csv", "file://{home}/*"),
        ("tests/T1.csv", "tests/*"),
    ],
)
def test_a_waiver_is_for_a_recording_by_its_name_wherever_it_is(home: Path, uri: str, pattern: str) -> None:
    uri, pattern = (text.format(home=home.as_posix()) for text in (uri, pattern))
    if uri.startswith("memory://"):
        url_to_fs(uri)[0].pipe_file(url_to_fs(uri)[1], Path("tests/T1.csv").read_bytes())
    waived(pattern)
    result = task.audit_one(uri, "rig.toml", waivers="w.toml")["result"]
    verdicts = {f["rule"]: f["verdict"] for f in result["findings"]}
    assert (verdicts["ZO102"], verdicts["WV001"], result["verdict"]) == ("waived", "pass", "pass")


def test_a_waiver_is_told_as_it_was_written() -> None:
    fs, path = url_to_fs("memory://2026/T1.csv")
    fs.pipe_file(path, Path("tests/T1.csv").read_bytes())
    waived("memory://2026/*")
    Path("w.toml").write_text(Path("w.toml").read_text(encoding="utf-8").replace("ZO102", "RQ106"), encoding="utf-8")
    findings = task.audit_one("memory://2026/T1.csv", "rig.toml", waivers="w.toml")["result"]["findings"]
    (said,) = (f["reason"] for f in findings if f["rule"] == "WV001")
    assert said == "waiver of RQ106 for memory://2026/* by a has no finding to waive"


def test_waivers_that_match_no_recording_of_a_store() -> None:
    waived("s3://b/2025/*")
    waivers = load_waivers("w.toml")
    assert unmatched(waivers, ["s3://b/2025/T1.mf4"]) == ()
    assert unmatched(waivers, ["s3://b/2026/T1.mf4", "b/2025/T1.mf4"]) == waivers


@pytest.fixture
def mme() -> str:
    """An ISO-MME test of two channels; the second and the folder Channel of another are symbolic links."""
    for name in ("store", "test", "linked"):
        Path(name).mkdir()
    for name in ("test/t.mme", "test/t.001", "store/t.002", "linked/t.mme"):
        Path(name).write_text(name, encoding="utf-8")
    Path("test/t.002").symlink_to(Path("store/t.002").absolute())
    Path("linked/Channel").symlink_to(Path("store").absolute())
    return "test/t.mme"


def changed(path: str) -> None:
    Path(path).write_text("of another size", encoding="utf-8")


@pytest.mark.usefixtures("mme")
@pytest.mark.parametrize("uri", ["test/t.mme", "linked/t.mme"])
def test_a_channel_that_is_a_link_tells_that_it_changed(uri: str) -> None:
    before = signature([uri])
    assert before == signature([uri]) is not None
    changed("store/t.002")
    assert signature([uri]) != before


def test_a_channel_of_another_name_is_another_recording(mme: str) -> None:
    before = signature([mme])
    Path("test/t.001").rename("test/t.003")
    assert signature([mme]) != before


@pytest.mark.skipif(sys.platform in ("win32", "darwin"), reason="names there are Unicode")
def test_a_name_beside_a_test_need_not_be_utf_8(mme: str) -> None:
    before = signature([mme])
    Path(os.fsdecode(os.fsencode(Path(mme).parent) + b"/Pr\xfcfung.jpg")).write_bytes(b"x")
    assert signature([mme]) not in (None, before)


@pytest.mark.parametrize(
    "key", ["ETag", "Last-Modified", "Content-MD5", "LastModified", "last_modified", "modify", "mtime", None]
)
def test_what_a_store_says_of_a_file_tells_that_it_changed(key: str | None, monkeypatch: pytest.MonkeyPatch) -> None:
    fs, path = url_to_fs("memory://said/T1.csv")
    fs.pipe_file(path, b"1")
    whole, said = fs.info(path), []
    for value in ("a", "b", "a"):
        told = {"name": path, "size": 1, "type": "file", **({key: value} if key else {})}
        monkeypatch.setattr(MemoryFileSystem, "info", lambda *_, told=told, **__: told)
        said.append(signature(["memory://said/T1.csv"]))
    assert set(whole) == {"name", "size", "type", "created"}
    if key is None:
        assert said == [None, None, None], "it is read"
    else:
        assert said[0] == said[2] != said[1]
        assert None not in said


@pytest.fixture
def fails(monkeypatch: pytest.MonkeyPatch) -> Iterator[Callable[[Exception | None], None]]:
    """Lets files of memory:// not be fetched."""
    fetch = MemoryFileSystem.get_file

    def fail(error: Exception | None) -> None:
        def instead(*asked: Any, **options: Any) -> None:
            if error is not None:
                raise error
            fetch(*asked, **options)

        monkeypatch.setattr(MemoryFileSystem, "get_file", instead)

    fs, path = url_to_fs("memory://fails/T1.csv")
    fs.pipe_file(path, Path("tests/T1.csv").read_bytes())
    yield fail
    fs.rm("/fails", recursive=True)


def test_a_recording_that_cannot_be_fetched_this_time_keeps_its_entry(fails: Callable[..., None]) -> None:
    def run(**options: Any) -> dict[str, Any]:
        return task.audit_one("memory://fails/T1.csv", "rig.toml", lake="lake", **options)

    first = run()
    before = contents(Path("lake"), ".")
    fails(TimeoutError("no answer"))
    missed = run()
    assert (missed["verdict"], missed["transient"], missed["key"]) == ("not_audited", True, first["key"])
    assert missed["reason"] == "memory://fails/T1.csv: cannot be fetched: no answer; its result of before stands"
    assert contents(Path("lake"), ".") == before
    other = run(test={"number": "7"})
    assert (other["verdict"], other["kept"]) == ("not_audited", False), "there is no result of this to stand"
    assert entries(Path("lake"))["T1.csv"]["transient"]
    fails(None)
    assert run()["kept"]
    assert contents(Path("lake"), ".") == before, "what was not finished is gone"


def test_an_edition_is_the_newest_when_there_is_something_in_it(home: Path) -> None:
    task.audit_one("tests/T1.csv", "rig.toml", lake="lake")
    lake = lakes.open_lake("lake")
    before = lakes.head(lake)
    for sources, options in ((), {"scheduler": "typo.json"}), ((), {"shard": "3/2"}), (("tests", "missing"), {}):
        with pytest.raises(ConfigurationError):
            told(plan(home, *sources, select="RB301", **options))
        assert lakes.head(lake) == before
    assert compact(lake).recordings == 1
    task.audit_one("tests/T1.csv", "rig.toml", lake="lake", select="RB301")
    assert lakes.head(lake) not in (before, None)


def test_an_edition_without_results_is_no_reason_to_empty_the_tables() -> None:
    task.audit_one("tests/T1.csv", "rig.toml", lake="lake")
    lake = lakes.open_lake("lake")
    edition = lakes.head(lake)
    compact(lake)
    tables = contents(Path("lake"), "tables")
    lakes.write(lake, "head.json", {"edition": "f" * 12})
    with pytest.raises(
        ConfigurationError, match=f"no result of its newest edition, ffffffffffff; expected .* {edition}"
    ):
        compact(lake)
    assert contents(Path("lake"), "tables") == tables
    lakes.remove(lake, "head.json")
    assert compact(lake).edition == edition, "the first run was killed before it was told"


def test_the_rig_is_there_where_the_inputs_are(monkeypatch: pytest.MonkeyPatch) -> None:
    lake, document = lakes.open_lake("lake", create=True), collect("rig.toml")

    write, done = lakes.write_bytes, []

    def killed(*asked: Any) -> None:
        if done:
            raise KeyboardInterrupt
        done.append(write(*asked))

    with monkeypatch.context() as killing:
        killing.setattr(lakes, "write_bytes", killed)
        with pytest.raises(KeyboardInterrupt):
            task.prepare(lake, document)
    task.prepare(lake, document)
    (rig,) = Path("lake/rigs").iterdir()
    assert rig.read_bytes() == Path("rig.toml").read_bytes()
