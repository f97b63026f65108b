"""Whether the tables of a lake are behind its results, told without reading the results."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from nineaudit.campaign.lake import Lake

_TABLE = "tables/recordings.parquet"


def behind(lake: Lake, edition: str) -> str | None:
    """One sentence where the newest run, or a result of the tables' `edition`, is not in the tables; else None."""
    from nineaudit.campaign.lake import head

    newest = head(lake)
    if newest not in (None, edition):
        return f"the tables are of edition {edition}, the newest run is of edition {newest}: {_ADVICE}"
    later = _local(lake, edition) if lake.local else _store(lake)
    return f"results are newer than the tables: {_ADVICE}" if later else None


_ADVICE = "`nineaudit campaign compact` makes them anew"


def _local(lake: Lake, edition: str) -> bool:
    """A pointer that is written takes its name in a folder, whose time changes."""
    made = Path(lake.place(_TABLE)).stat().st_mtime_ns
    folder = Path(lake.place(f"editions/{edition}"))
    return folder.is_dir() and any(one.stat().st_mtime_ns > made for one in (folder, *folder.iterdir()))


def _store(lake: Lake) -> bool:
    """A store knows no time of a folder: what was audited is noted in runs/."""
    lake.fs.invalidate_cache()
    made, runs = lake.fs.modified(lake.place(_TABLE)), lake.place("runs")
    names = lake.fs.find(runs) if lake.fs.exists(runs) else []
    newer = (name for name in names if lake.fs.modified(name) > made)
    return any(b'"kept": false' in lake.fs.cat_file(name) for name in newer)
