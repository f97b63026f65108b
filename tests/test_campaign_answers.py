"""Answers of queries keep every column, and numbers stay numbers."""

from __future__ import annotations

import csv
import io
import json
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from nineaudit.campaign.results.answers import as_text, write_parquet
from nineaudit.campaign.results.query import select

RECORDINGS = pa.table({"uri": ["a", "b"], "n": pa.array([1, 2], pa.int64()), "size": pa.array([2**62, 2**62])})
TWICE = "SELECT a.uri, b.uri, a.n AS uri_1 FROM recordings a JOIN recordings b ON a.n = b.n - 1"


def asked(sql: str) -> pa.Table:
    return select({"recordings": RECORDINGS}, sql)


def test_columns_of_one_name_are_all_there(tmp_path: Path) -> None:
    """Two of a join, and one that is called what the second would be."""
    answer = asked(TWICE)
    assert json.loads(as_text(answer, "json")) == [{"uri": "a", "uri_2": "b", "uri_1": 1}]
    assert list(csv.reader(io.StringIO(as_text(answer, "csv")))) == [["uri", "uri_2", "uri_1"], ["a", "b", "1"]]
    assert as_text(answer, "table").splitlines()[0].split() == ["uri", "uri_2", "uri_1"]
    write_parquet(answer, tmp_path / "answer.parquet")
    assert pq.read_table(tmp_path / "answer.parquet").to_pylist() == [{"uri": "a", "uri_2": "b", "uri_1": 1}]


@pytest.mark.parametrize(
    ("what", "expected"),
    [
        ("sum(n)", 3),
        ("0.1", 0.1),
        ("sum(size)", 2**63),  # beyond 64 bits: DuckDB has it as a decimal
        ("-12.50", -12.5),
        ("CAST(NULL AS DECIMAL(9, 3))", None),
        ("[1.5, 2.0]", [1.5, 2]),
        ("max(uri)", "b"),
    ],
)
def test_decimals_are_numbers(what: str, expected: Any) -> None:
    answer = asked(f"SELECT {what} AS x FROM recordings LIMIT 1")
    found = json.loads(as_text(answer, "json"))
    assert found == [{"x": expected}]
    assert type(found[0]["x"]) is type(expected)


def test_numbers_of_every_kind_stand_right() -> None:
    said = as_text(asked("SELECT sum(n) AS a_long_name, 'x' AS a_long_word FROM recordings"), "table")
    assert said.splitlines()[2] == "          3   x"
