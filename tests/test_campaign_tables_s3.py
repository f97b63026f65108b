"""Tables, queries and the index page of a lake in an object store, on a server that speaks S3."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

from campaign_entries import entries, lake_of
from nineaudit import cli
from nineaudit.campaign import lake as lakes

s3fs = pytest.importorskip("s3fs")
moto = pytest.importorskip("moto.server")
COUNT = 20


@pytest.fixture
def place(monkeypatch: pytest.MonkeyPatch) -> Iterator[str]:
    """A lake of entries in a bucket."""
    server = moto.ThreadedMotoServer(ip_address="127.0.0.1", port=0, verbose=False)
    server.start()
    host, port = server.get_host_and_port()
    settings = {"ACCESS_KEY_ID": "x", "SECRET_ACCESS_KEY": "x", "DEFAULT_REGION": "us-east-1"}
    for name, value in (settings | {"ENDPOINT_URL": f"http://{host}:{port}"}).items():
        monkeypatch.setenv(f"AWS_{name}", value)
    s3fs.S3FileSystem.clear_instance_cache()
    s3fs.S3FileSystem().makedirs("tables", exist_ok=True)
    lake_of("s3://tables/lake", entries(COUNT))
    yield "s3://tables/lake"
    s3fs.S3FileSystem.clear_instance_cache()
    server.stop()


def test_the_tables_of_a_lake_in_a_bucket(place: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    here = lake_of(tmp_path / "lake", entries(COUNT))
    for name in (place, here.uri):
        assert called("campaign", "compact", name) == 0
    there = lakes.open_lake(place)
    for path in Path(here.place("tables")).iterdir():
        assert there.fs.cat_file(there.place(f"tables/{path.name}")) == path.read_bytes()
    capsys.readouterr()
    assert called("campaign", "query", place, "SELECT count(*) AS n FROM recordings", "--format", "csv") == 0
    assert capsys.readouterr().out == f"n\n{COUNT}\n"
    assert called("campaign", "diff", place, here.uri) == 0
    files = "--html", str(tmp_path / "i.html"), "--junit", str(tmp_path / "j.xml")
    assert called("campaign", "report", place, *files) == 0
    assert f"{COUNT} recordings" in (tmp_path / "i.html").read_text(encoding="utf-8")
    assert called("campaign", "query", place, "SELECT * FROM read_csv('s3://tables/lake/lake.json')") == 2
    assert "Permission Error" in capsys.readouterr().err


def called(*arguments: str) -> int:
    with pytest.raises(SystemExit) as ended:
        cli.main(arguments)
    return int(ended.value.code or 0)
