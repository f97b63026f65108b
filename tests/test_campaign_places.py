"""Places of recordings, rigs and lakes: what cannot be reached, what tells that a file changed, what names it."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from campaigns import campaign
from nineaudit.campaign import lake as lakes
from nineaudit.campaign import task
from nineaudit.campaign.settings import collect
from nineaudit.errors import ConfigurationError

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
