"""A campaign in an object store: recordings, rig and lake at s3://, on a server that speaks it."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from campaigns import campaign, plan, told
from nineaudit.campaign import lake as lakes
from nineaudit.campaign import task

s3fs = pytest.importorskip("s3fs")
HOME = "bucket/2026"


@pytest.fixture
def store(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Any]:
    """A bucket with a campaign in it; the current folder has nothing of it."""
    from moto.server import ThreadedMotoServer

    server = ThreadedMotoServer(ip_address="127.0.0.1", port=0, verbose=False)
    server.start()
    host, port = server.get_host_and_port()
    monkeypatch.setenv("AWS_ENDPOINT_URL", f"http://{host}:{port}")
    for name, value in (("ACCESS_KEY_ID", "x"), ("SECRET_ACCESS_KEY", "x"), ("DEFAULT_REGION", "us-east-1")):
        monkeypatch.setenv(f"AWS_{name}", value)
    s3fs.S3FileSystem.clear_instance_cache()
    fs = s3fs.S3FileSystem()
    fs.makedirs("bucket", exist_ok=True)  # the server remembers what tests before this one made
    (tmp_path / "home").mkdir()
    home = campaign(tmp_path / "home")
    fs.put(str(home / "tests"), f"{HOME}/tests", recursive=True)
    fs.put_file(str(home / "rig.toml"), f"{HOME}/rig.toml")
    (tmp_path / "empty").mkdir()
    monkeypatch.chdir(tmp_path / "empty")
    yield fs
    s3fs.S3FileSystem.clear_instance_cache()
    server.stop()


def test_a_campaign_in_an_object_store(store: Any, tmp_path: Path) -> None:
    lake = f"s3://{HOME}/lake"
    told(plan(tmp_path, f"s3://{HOME}/tests", rig=f"s3://{HOME}/rig.toml", lake=lake))
    store.invalidate_cache()
    opened = lakes.open_lake(lake)
    found = list(lakes.entries(opened))
    names = [f"s3://{HOME}/tests/{name}" for name in ("T1.csv", "T2.csv", "T3.parquet", "T4/T4.mme")]
    assert [entry["uri"] for entry in found] == [entry["result"]["recording"]["path"] for entry in found] == names
    home = tmp_path / "home"
    for entry in found:
        here = task.audit_one(str(home / entry["uri"].removeprefix(f"s3://{HOME}/")), home / "rig.toml")
        assert here["result"]["recording"]["sha256"] == entry["result"]["recording"]["sha256"]
        assert here["result"]["findings"] == entry["result"]["findings"]
        assert here["key"] == entry["key"]
    rig = f"s3://{HOME}/rig.toml"
    assert all(task.audit_one(uri, rig, lake=lake, resume=True)["kept"] for uri in names)
    store.pipe_file(f"{HOME}/tests/T1.csv", store.cat_file(f"{HOME}/tests/T2.csv"))
    again = [task.audit_one(uri, rig, lake=lake, resume=True)["kept"] for uri in names]
    assert again == [False, True, True, True]
    assert list(Path().iterdir()) == []


@pytest.mark.usefixtures("store")
def test_what_is_not_there_is_told() -> None:
    rig = f"s3://{HOME}/rig.toml"
    gone = task.audit_one(f"s3://{HOME}/tests/T9.csv", rig, lake=f"s3://{HOME}/lake")
    assert (gone["verdict"], gone["transient"]) == ("not_audited", False)
    assert gone["reason"] == f"s3://{HOME}/tests/T9.csv: no such file"
