"""Coverage-guided fuzzing of one reader: whatever the bytes, it answers with a recording or one of our errors.

    python tests/fuzz/fuzz_readers.py blf -max_total_time=20

The format is one of targets.FORMATS; what follows goes to libFuzzer. It begins with a small whole recording and the
files of fixtures/fuzz/FORMAT. What it finds is written to where it runs: keep it in that folder, made small
(-minimize_crash=1), and tests/test_fuzz_corpus.py reads it from then on.
"""

from __future__ import annotations

import os
import sys
import tempfile
from pathlib import Path

import atheris
import scipy.signal  # noqa: F401

TESTS = Path(__file__).parents[1]
sys.path.insert(0, str(TESTS))

with atheris.instrument_imports(include=["nineaudit.readers"]):
    from fuzz.targets import attempt, prepared, seeds

LIMITS = ["-timeout=20", "-rss_limit_mb=3000", "-max_len=65536"]


def main(name: str, *options: str) -> None:
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place)
        corpus = folder / "corpus"
        corpus.mkdir()
        kept = sorted((TESTS.parent / "fixtures" / "fuzz" / name).glob("*"))
        whole = list(seeds(name, folder))
        for i, data in enumerate([*whole, *(path.read_bytes() for path in kept)]):
            (corpus / f"seed{i}").write_bytes(data)
        path, dbc = prepared(name, folder)

        def one(data: bytes) -> None:
            path.write_bytes(data)
            attempt(path, dbc)

        for data in whole:  # what is imported at first use takes its time before the clock runs
            one(data)
        atheris.Setup([sys.argv[0], *LIMITS, *options, os.fspath(corpus)], one)
        atheris.Fuzz()


if __name__ == "__main__":
    main(*sys.argv[1:])
