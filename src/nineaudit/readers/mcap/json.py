"""Numbers out of many JSON messages at once: by Arrow where every message is one object, else one after the other."""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import islice, pairwise
from typing import Any, Final

import numpy as np

from nineaudit.readers.mcap.columns import Column, Decoded, numbers
from nineaudit.readers.mcap.fields import MISSING, leaves, lookup
from nineaudit.readers.mcap.json_arrow import by_arrow
from nineaudit.readers.mcap.records import Batch

_BLOCK: Final = 2**22
"""Bytes of messages that are parsed together."""
_WRONG: Final = object()


@dataclass(frozen=True)
class Json:
    """Decoder of JSON messages."""

    def has(self, path: str, batch: Batch) -> bool:
        """Whether the first message that can be decoded has a value at a path."""
        return lookup(_first(batch), path) is not MISSING

    def leaves(self, batch: Batch) -> list[str]:
        """Paths of the numbers of the first message that can be decoded."""
        return list(islice(leaves(_first(batch)), 1000))

    def read(self, batch: Batch, paths: Sequence[str]) -> Decoded:
        """The numbers at paths. A message that is not JSON is not good."""
        parts = [_block(batch, rows, paths) for rows in _blocks(batch)]
        columns = (_joined([p.columns[k] for p in parts]) for k in range(len(paths)))
        return Decoded(tuple(columns), np.concatenate([p.good for p in parts]))


def _first(batch: Batch) -> Any:
    for start, end in zip(batch.starts.tolist(), batch.ends.tolist(), strict=True):
        found = _loads(bytes(batch.data[start:end]))
        if found is not _WRONG:
            return found
    return None


def _loads(text: bytes) -> Any:
    try:
        return json.loads(text)
    except (ValueError, RecursionError):
        return _WRONG


def _blocks(batch: Batch) -> Iterator[slice]:
    """Messages of about _BLOCK bytes together."""
    size = np.cumsum(batch.ends - batch.starts)
    cuts = np.searchsorted(size, np.arange(_BLOCK, size[-1], _BLOCK)) + 1
    edges = np.unique(np.concatenate([[0], cuts, [len(batch)]])).tolist()
    for first, last in pairwise(edges):
        yield slice(first, last)


def _block(batch: Batch, rows: slice, paths: Sequence[str]) -> Decoded:
    bounds = zip(batch.starts[rows].tolist(), batch.ends[rows].tolist(), strict=True)
    texts = [bytes(batch.data[start:end]) for start, end in bounds]
    columns = by_arrow(texts, paths)
    return _by_python(texts, paths) if columns is None else Decoded(columns, np.ones(len(texts), dtype=bool))


def _by_python(texts: Sequence[bytes], paths: Sequence[str]) -> Decoded:
    messages = [_loads(text) for text in texts]
    columns = tuple(numbers([lookup(m, path) for m in messages]) for path in paths)
    return Decoded(columns, np.array([m is not _WRONG for m in messages], dtype=bool))


def _joined(parts: Sequence[Column]) -> Column:
    return Column(np.concatenate([p.values for p in parts]), np.concatenate([p.there for p in parts]))
