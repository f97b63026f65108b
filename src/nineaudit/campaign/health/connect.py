"""The records of a campaign by what connects them: sensors that no chain of rigs connects are parts of their own."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from nineaudit.campaign.health.model import Group, Part, Unknown
from nineaudit.campaign.health.records import Record, Row, family


def parts(records: Sequence[Record]) -> list[Part]:
    """The records by what connects them."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    by_rows: dict[tuple[Row, ...], list[int]] = {}
    keys: dict[tuple[object, ...], list[int]] = {}
    for i, record in enumerate(records):
        if not record.rows:
            continue  # its rig leaves no error open
        key = tuple((r.sensor, r.seat, r.kind, r.parameter, r.setting) for r in record.rows)
        keys.setdefault(key, []).append(i)
    for members in keys.values():
        by_rows[records[members[0]].rows] = members
    number: dict[Unknown, int] = {}
    prior: list[float] = []
    touched = [_touched(rows, number, prior) for rows in by_rows]
    edges = [(t[0][0], a) for t in touched for pair in t for a in pair]
    own: dict[str | None, int] = {}  # what a sensor has in one seat or setting and in another
    edges += [(own.setdefault(one.sensor, i), i) for one, i in number.items() if one.sensor is not None]
    first, second = np.array(edges, dtype=np.intp).reshape(-1, 2).T
    graph = coo_array((np.ones(len(edges)), (first, second)), shape=(len(number),) * 2)
    count, label = connected_components(graph, directed=False)
    unknowns, sizes = list(number), np.array(prior)
    made = []
    for part in range(count):
        mine = np.flatnonzero(label == part)
        place = {int(u): i for i, u in enumerate(mine)}
        groups = tuple(
            _group(rows, [records[i] for i in members], members, t, place)
            for (rows, members), t in zip(by_rows.items(), touched, strict=True)
            if t[0][0] in place
        )
        made.append(Part(groups, tuple(unknowns[u] for u in mine), sizes[mine]))
    return made


def _touched(rows: tuple[Row, ...], number: dict[Unknown, int], prior: list[float]) -> list[tuple[int, ...]]:
    """The unknowns of each row; new ones are numbered."""
    out = []
    for row in rows:
        of = family(row.parameter)
        within = (row.setting,) if of == "gain" else row.seat
        mine = [] if of == "position" else [Unknown(row.parameter, row.sensor, None, within)]
        mine += [] if of == "gain" else [Unknown(row.parameter, None, row.seat)]
        for unknown in mine:
            if number.setdefault(unknown, len(number)) == len(prior):
                prior.append(row.prior / np.sqrt(len(mine)))
        out.append(tuple(number[u] for u in mine))
    return out


def _group(
    rows: tuple[Row, ...],
    records: Sequence[Record],
    members: Sequence[int],
    touched: Sequence[tuple[int, ...]],
    place: dict[int, int],
) -> Group:
    at = sorted({place[u] for pair in touched for u in pair})
    design = np.zeros((len(rows), len(at)))
    for i, pair in enumerate(touched):
        for u in pair:
            design[i, at.index(place[u])] = 1.0
    return Group(
        rows,
        np.array(members, dtype=np.intp),
        np.array([r.when for r in records]),
        np.stack([r.eta for r in records]),
        np.stack([r.matrix for r in records]),
        np.array(at, dtype=np.intp),
        design,
        np.array([[r.shock.get(row.sensor, 0.0) for row in rows] for r in records]),
    )
