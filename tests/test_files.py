"""Files that appear whole or not at all; documents that show a change."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from nineaudit import files


def test_a_failure_leaves_what_was_there(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "a.txt"
    files.write_whole(path, "first\n")

    def fail(*_: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "fsync", fail)
    with pytest.raises(OSError, match="No space"):
        files.write_whole(path, "second\n")
    assert path.read_bytes() == b"first\n"
    assert list(tmp_path.iterdir()) == [path]


def test_links_stay_and_devices_are_written_to(tmp_path: Path) -> None:
    target, link = tmp_path / "target.txt", tmp_path / "link.txt"
    target.write_text("old")
    link.symlink_to(target)
    files.write_whole(link, "new")
    assert link.is_symlink()
    assert target.read_text() == "new"
    files.write_whole(Path(os.devnull), "anything")
    assert not Path(os.devnull).is_file()


def test_a_seal_is_of_the_content() -> None:
    document = files.sealed({"b": [1.5, None, "ω"], "a": {"x": 1}})
    assert files.is_sealed(document)
    assert files.is_sealed(dict(reversed(document.items())))
    assert not files.is_sealed({**document, "b": [1.5, None, "w"]})
    assert not files.is_sealed({key: value for key, value in document.items() if key != "seal"})
