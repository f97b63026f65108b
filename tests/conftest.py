"""What every test may use."""

from __future__ import annotations

import os
from pathlib import Path

import pytest
from hypothesis import settings

settings.register_profile("shared machine", deadline=None)  # a test is as slow as what runs beside it
settings.load_profile("shared machine")
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # before numpy is loaded: as on the command line


@pytest.fixture(scope="session")
def shared_data() -> Path:
    """Folder of the real recordings (made by others, never copied here); skips where it is absent."""
    folder = Path(__file__).parents[1] / ".." / "shared" / "data"
    if not folder.is_dir():
        pytest.skip("the real recordings (../shared/data) are not on this machine")
    return folder.resolve()
