"""Small campaigns for the tests: a rig, some recordings of 100 ms of computing, and what a lake holds."""

from __future__ import annotations

import hashlib
import json
import time
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

from nineaudit.campaign.campaigning import Plan
from nineaudit.rig import load_rig
from nineaudit.simulate import simulate
from nineaudit.writers import write_recording
from recordings import rig_text

FUNCTIONS = "campaign_functions"


def campaign(folder: Path, names: Iterable[str] = ("T1.csv", "T2.csv", "T3.parquet", "T4.mme")) -> Path:
    """A folder with rig.toml and a folder `tests` of recordings, each with noise of its own."""
    (folder / "rig.toml").write_text(rig_text(), encoding="utf-8")
    rig = load_rig(folder / "rig.toml")
    (folder / "tests").mkdir()
    for seed, name in enumerate(names):
        home = folder / "tests" / (name.removesuffix(".mme") if name.endswith(".mme") else "")
        home.mkdir(exist_ok=True)
        write_recording(simulate(rig, "general", seed=seed, duration_s=0.02).recording, home / name)
    return folder


def plan(folder: Path, *sources: str, **options: Any) -> Plan:
    """A plan over the campaign of a folder, with two workers."""
    return Plan(
        sources=sources or (str(folder / "tests"),),
        **{"lake": str(folder / "lake"), "rig": str(folder / "rig.toml"), "workers": 2, **options},
    )


def told(made: Plan) -> tuple[int, list[str], list[str]]:
    """(exit code, what was shown, what was said) of a plan that is run."""
    shown: list[str] = []
    said: list[str] = []
    return made.run(shown.append, said.append), shown, said


def contents(lake: Path, part: str = "results") -> dict[str, str]:
    """Name -> SHA-256 of every file of a part of a lake."""
    files = sorted(path for path in (lake / part).rglob("*") if path.is_file())
    return {str(path.relative_to(lake)): hashlib.sha256(path.read_bytes()).hexdigest() for path in files}


def entries(lake: Path) -> dict[str, dict[str, Any]]:
    """File name of the recording -> current entry."""
    from nineaudit.campaign import lake as lakes

    return {entry["uri"].rpartition("/")[2]: entry for entry in lakes.entries(lakes.open_lake(lake))}


def noted(lake: Path) -> list[dict[str, Any]]:
    """The lines of all runs."""
    texts = (file.read_text(encoding="utf-8") for file in sorted((lake / "runs").iterdir()))
    return [json.loads(line) for text in texts for line in text.splitlines()]


def until(true: Callable[[], object], seconds: float = 120.0) -> None:
    """Wait until something is so."""
    end = time.monotonic() + seconds
    while not true():
        assert time.monotonic() < end, "it took too long"
        time.sleep(0.05)
