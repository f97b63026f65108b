"""What fuzzing found, once and for all: each kept input, and small whole files with bytes flipped, cut and doubled."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from fuzz.targets import FORMATS, attempt, prepared, seeds

CORPUS = Path(__file__).parents[1] / "fixtures" / "fuzz"
KEPT = [(name, path) for name in FORMATS for path in sorted((CORPUS / name).glob("*"))]
TRIES = 60


@pytest.mark.parametrize(("name", "found"), KEPT, ids=[f"{name}/{path.name}" for name, path in KEPT])
def test_a_kept_input_is_read_or_refused(tmp_path: Path, name: str, found: Path) -> None:
    path, dbc = prepared(name, tmp_path)
    path.write_bytes(found.read_bytes())
    attempt(path, dbc)


@pytest.mark.parametrize("name", FORMATS)
def test_a_damaged_file_is_read_or_refused(tmp_path: Path, name: str) -> None:
    rng = np.random.default_rng(17)
    (whole,) = seeds(name, tmp_path)
    path, dbc = prepared(name, tmp_path)
    for _ in range(TRIES):
        path.write_bytes(_damaged(whole, rng))
        attempt(path, dbc)


def _damaged(data: bytes, rng: np.random.Generator) -> bytes:
    """Bytes flipped, then perhaps a stretch cut out, doubled or filled with one byte."""
    out = bytearray(data)
    for place in rng.integers(0, len(out), rng.integers(0, 4)):
        out[place] = rng.integers(0, 256)
    start, stop = np.sort(rng.integers(0, len(out), 2))
    middle = (out[start:stop], b"", out[start:stop] * 2, bytes([rng.integers(0, 256)]) * 100)[rng.integers(0, 4)]
    return bytes(out[:start] + middle + out[stop:])
