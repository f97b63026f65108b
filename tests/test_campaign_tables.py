"""The tables of a lake: the same results give the same bytes, damage is named, SQL can do nothing but read."""

from __future__ import annotations

import csv
import io
import json
import random
import re
from collections import Counter
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from campaign_entries import EDITION, audited, entries, entry, lake_of
from nineaudit import cli
from nineaudit.campaign import lake as lakes
from nineaudit.campaign.results import schema, tables
from nineaudit.campaign.results.compact import compact, stored
from nineaudit.campaign.results.query import select
from nineaudit.errors import ConfigurationError
from nineaudit.files import sealed

COUNT = 60
FAULTED = ("a1y:clipping=0.5",)


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> lakes.Lake:
    lake = lake_of(tmp_path_factory.mktemp("campaign") / "lake", entries(COUNT))
    compact(lake)
    return lake


def ask(lake: lakes.Lake, sql: str) -> list[dict[str, Any]]:
    return select(stored(lake).tables, sql).to_pylist()


def called(capsys: pytest.CaptureFixture[str], *arguments: object) -> tuple[int, str, str]:
    with pytest.raises(SystemExit) as ended:
        cli.main([str(argument) for argument in arguments])
    shown = capsys.readouterr()
    return int(ended.value.code or 0), shown.out, shown.err


def parquet(lake: lakes.Lake) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in sorted(Path(lake.place("tables")).iterdir())}


def test_equal_results_give_equal_bytes_whatever_order_they_were_written_in(made: lakes.Lake, tmp_path: Path) -> None:
    shuffled = list(entries(COUNT))
    random.Random(1).shuffle(shuffled)
    other = lake_of(tmp_path / "elsewhere", shuffled)
    compact(other)
    assert parquet(other) == parquet(made)
    compact(other)
    assert parquet(other) == parquet(made)
    assert set(parquet(made)) == {f"{name}.parquet" for name in schema.TABLES}


def test_a_changed_result_changes_the_tables(made: lakes.Lake, tmp_path: Path) -> None:
    changed = lake_of(tmp_path / "lake", [*entries(COUNT), entry(3, fault=(), rig="another")])
    compact(changed)
    assert parquet(changed)["recordings.parquet"] != parquet(made)["recordings.parquet"]


def test_the_tables_are_on_an_object_store_too(made: lakes.Lake) -> None:
    there = lake_of("memory://campaign/lake", entries(COUNT))
    compact(there)
    for name, data in parquet(made).items():
        assert there.fs.cat_file(there.place(f"tables/{name}")) == data
    assert ask(there, "SELECT count(*) AS n FROM recordings") == [{"n": COUNT}]


def test_the_tables_say_what_the_results_say(made: lakes.Lake) -> None:
    by_uri = {one["uri"]: one for one in entries(COUNT)}
    rows = ask(made, "SELECT * FROM recordings ORDER BY uri")
    assert [row["uri"] for row in rows] == sorted(by_uri)
    assert {row["uri"]: row["verdict"] for row in rows} == {u: e["result"]["verdict"] for u, e in by_uri.items()}
    row = next(row for row in rows if row["fault"] == "clipping")
    result = by_uri[row["uri"]]["result"]
    assert (row["status"], row["culprits"]) == ("isolated", ["a1y"])
    assert row["date"].isoformat() == by_uri[row["uri"]]["test"]["date"]
    assert row["samples"] == result["recording"]["samples"]
    assert dict(row["impact"])["HIC15"]["before"] == result["impact"]["HIC15"]["before"]
    fit = [f["value"] / f["limit"] for f in result["findings"] if f["rule"] == "RB303"]
    assert row["statistic"] == max(fit) > 1
    failed = {f["rule"] for f in result["findings"] if f["verdict"] == "fail"}
    assert set(row["rules_failed"]) == failed
    lost = next(row for row in rows if row["verdict"] == "not_audited")
    assert "is empty" in lost["reason"]
    assert (lost["rig"], lost["statistic"], lost["culprits"]) == (None, None, [])


def test_every_finding_candidate_and_sensor_is_a_row(made: lakes.Lake) -> None:
    results = [one["result"] for one in entries(COUNT)]
    wanted = {
        "findings": sum(len(r["findings"]) for r in results),
        "candidates": sum(len(r.get("diagnosis", {}).get("candidates", ())) for r in results),
        "sensors": sum(len(r.get("sensors", {}).get("channels", ())) for r in results),
        "provenance": COUNT,
    }
    found = {name: ask(made, f"SELECT count(*) AS n FROM {name}")[0]["n"] for name in wanted}
    assert found == wanted
    counts = Counter(f["verdict"] for r in results for f in r["findings"])
    rows = ask(made, "SELECT verdict, count(*) AS n FROM findings GROUP BY verdict")
    assert {row["verdict"]: row["n"] for row in rows} == counts
    healthy = "uri IN (SELECT uri FROM recordings WHERE status = 'healthy')"
    rows = ask(
        made, f"SELECT DISTINCT peak, gain, gain_u, timing_prior FROM sensors WHERE channel = 'a1z' AND {healthy}"
    )
    sensor = next(s for s in audited(())["sensors"]["channels"] if s["channel"] == "a1z")
    told = sensor["calibration"]
    wanted = {
        "peak": sensor["peak"],
        "gain": told["value"][0],
        "gain_u": told["u"][0],
        "timing_prior": told["prior"][7],
    }
    assert rows == [wanted]


def test_what_a_table_of_recordings_says_goes_before_what_the_recording_says(tmp_path: Path) -> None:
    one = entry(1, fault=(), test={"number": "from the table", "date": "12.3.2026", "impactor": "sled"})
    compact(lake := lake_of(tmp_path / "lake", [one]))
    row = ask(lake, "SELECT number, date, test FROM recordings")[0]
    assert (row["number"], row["date"]) == ("from the table", None)
    assert dict(row["test"])["date"] == "12.3.2026"
    assert dict(row["test"])["impactor"] == "sled"


def test_memory_holds_one_row_group(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Groups of 8 recordings: what is read is the same, in as many groups as it takes."""
    monkeypatch.setattr(tables, "GROUP", 8)
    monkeypatch.setattr(tables, "BATCH", 3)
    count = tables.write_tables(entries(COUNT), tmp_path, EDITION)
    file = pq.ParquetFile(tmp_path / "recordings.parquet")
    assert (count, file.num_row_groups) == (COUNT, -(-COUNT // 8))
    assert file.read(columns=["uri"])["uri"].to_pylist() == [one["uri"] for one in entries(COUNT)]
    assert pq.ParquetFile(tmp_path / "findings.parquet").num_row_groups > 1


def damage(lake: lakes.Lake, one: dict[str, Any], how: str) -> str:
    """Damage the entry in the way named; its place."""
    place = lakes.entry_name(one["uri"], one["key"])
    path = Path(lake.place(place))
    text = path.read_text(encoding="utf-8")
    if how == "cut":
        path.write_text(text[: len(text) // 2], encoding="utf-8")
    elif how == "seal":
        path.write_text(text.replace('"verdict": "fail"', '"verdict": "pass"', 1), encoding="utf-8")
    elif how == "foreign":
        path.write_text('{"schema": "somebody/else/1"}', encoding="utf-8")
    elif how == "newer":
        path.write_text(text.replace("nineaudit/result/1", "nineaudit/result/2"), encoding="utf-8")
    elif how == "other":
        path.write_text(json.dumps({**one, "uri": "another"}), encoding="utf-8")
    elif how == "shape":
        result = {k: v for k, v in one["result"].items() if k not in ("seal", "tool")}
        path.write_text(json.dumps({**one, "result": sealed(result)}), encoding="utf-8")
    else:
        path.unlink()
    return place


@pytest.mark.parametrize(
    ("how", "said"),
    [
        ("cut", "no JSON document"),
        ("seal", "changed since it was written"),
        ("foreign", "something else, or of another version"),
        ("newer", "something else, or of another version"),
        ("other", "in the wrong place"),
        ("shape", "not a result that this version can read"),
        ("gone", "is not there"),
    ],
)
def test_a_damaged_entry_is_named_and_left_out(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], how: str, said: str
) -> None:
    bad = entry(2, fault=FAULTED)
    lake = lake_of(tmp_path / "lake", [entry(1, fault=()), bad, entry(3, fault=())])
    place = damage(lake, bad, how)
    code, shown, _ = called(capsys, "campaign", "compact", lake.uri)
    assert code == 3
    assert said in shown
    assert place in shown or bad["uri"] in shown
    assert "2 recordings" in shown
    assert "1 left out" in shown
    assert ask(lake, "SELECT count(*) AS n FROM recordings") == [{"n": 2}]


def test_a_damaged_pointer_is_named(tmp_path: Path) -> None:
    lake = lake_of(tmp_path / "lake", [entry(1, fault=()), entry(2, fault=())])
    pointer = sorted(Path(lake.place(f"editions/{EDITION}")).rglob("*.json"))[0]
    pointer.write_text("{", encoding="utf-8")
    done = compact(lake)
    assert done.recordings == 1
    assert [one.place for one in done.damaged] == [pointer.relative_to(lake.place("")).as_posix()]


def test_a_lake_without_runs_or_tables_says_what_to_do(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    lake = lakes.open_lake(tmp_path / "lake", create=True)
    code, _, said = called(capsys, "campaign", "compact", lake.uri)
    assert code == 2
    assert "has no results yet; `nineaudit campaign run` makes them" in said
    code, _, said = called(capsys, "campaign", "query", lake.uri, "SELECT 1")
    assert code == 2
    assert "has no tables yet; `nineaudit campaign compact` makes them" in said
    code, _, said = called(capsys, "campaign", "compact", tmp_path / "nowhere")
    assert code == 2
    assert "is no lake" in said


def test_an_edition_is_chosen_by_the_beginning_of_its_name(tmp_path: Path) -> None:
    old = [entry(n, edition="00aa11bb22cc", fault=()) for n in range(2)]
    lake = lake_of(tmp_path / "lake", [*old, *(entry(n, fault=()) for n in range(3))])
    assert compact(lake).recordings == 3
    assert compact(lake, "00aa").recordings == 2
    assert ask(lake, "SELECT DISTINCT edition FROM recordings") == [{"edition": "00aa11bb22cc"}]
    with pytest.raises(ConfigurationError, match=r"no edition ffff; expected one of 00aa11bb22cc, abc123abc123"):
        compact(lake, "ffff")


def retold(path: Path, **changed: str) -> None:
    """Write a Parquet file again with other metadata."""
    table = pq.read_table(path)
    known = {k.decode(): v.decode(errors="replace") for k, v in pq.read_metadata(path).metadata.items()}
    known.pop("ARROW:schema", None)
    pq.write_table(table.replace_schema_metadata(known | changed), path)


def test_tables_of_a_newer_version_are_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    compact(lake := lake_of(tmp_path / "lake", [entry(1, fault=())]))
    retold(Path(lake.place("tables/findings.parquet")), **{"nineaudit.schema": "nineaudit/tables/7"})
    code, _, said = called(capsys, "campaign", "query", lake.uri, "SELECT 1")
    assert code == 2
    assert said.count("\n") == 1
    assert "tables of another version; found 'nineaudit/tables/7'; expected nineaudit/tables/1" in said
    assert "older than that which made them" in said


def test_tables_of_two_compactions_are_refused(tmp_path: Path) -> None:
    """As after a crash between two files."""
    first = lake_of(tmp_path / "first", [entry(1, fault=())])
    second = lake_of(tmp_path / "second", [entry(2, fault=())])
    compact(first)
    compact(second)
    Path(first.place("tables/findings.parquet")).replace(second.place("tables/findings.parquet"))
    with pytest.raises(ConfigurationError, match=r"its tables are of two compactions; `nineaudit campaign compact`"):
        stored(second)
    compact(second)
    assert ask(second, "SELECT count(*) AS n FROM recordings") == [{"n": 1}]


def test_a_failed_compaction_leaves_the_tables_that_were_there(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    compact(lake := lake_of(tmp_path / "lake", [entry(1, fault=())]))
    before = parquet(lake)
    lakes.write_entry(lake, entry(2, fault=()))

    def broken(*_: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(tables.Writer, "_group", broken)
    with pytest.raises(ConfigurationError, match="No space left on device"):
        compact(lake)
    assert parquet(lake) == before


FORBIDDEN = [
    "COPY recordings TO '{folder}/out.csv'",
    "COPY (SELECT 1) TO '{lake}/tables/recordings.parquet' (FORMAT parquet, USE_TMP_FILE false)",
    "ATTACH '{folder}/other.db'",
    "ATTACH ':memory:' AS other",
    "INSTALL httpfs",
    "LOAD httpfs",
    "SET enable_external_access = true",
    "RESET lock_configuration",
    "CREATE TABLE mine (a INTEGER)",
    "DROP VIEW recordings",
    "INSERT INTO recordings SELECT * FROM recordings",
    "EXPORT DATABASE '{folder}/out'",
    "IMPORT DATABASE '{folder}/out'",
    "PRAGMA database_list",
    "CALL pragma_version()",
    "EXPLAIN ANALYZE COPY recordings TO '{folder}/out.csv'",
    "SELECT 1; COPY (SELECT 1) TO '{folder}/out.csv'",
    "SELECT * FROM read_csv('{folder}/secret.csv')",
    "SELECT * FROM '{folder}/secret.csv'",
    "SELECT * FROM read_text('{folder}/secret.csv')",
    "SELECT * FROM read_blob('{folder}/secret.csv')",
    "SELECT * FROM sniff_csv('{folder}/secret.csv')",
    "SELECT * FROM read_parquet('{lake}/tables/recordings.parquet')",
    "SELECT * FROM parquet_metadata('{lake}/tables/recordings.parquet')",
    "SELECT * FROM glob('{folder}/*')",
    "SELECT * FROM query_table('{folder}/secret.csv')",
    "SELECT * FROM query('SELECT * FROM read_csv(''{folder}/secret.csv'')')",
    "SELECT getenv('HOME')",
    "SELECT * FROM secret",
    "",
    ";",
    " -- nothing",
]


@pytest.mark.parametrize("sql", FORBIDDEN)
def test_a_query_reads_the_tables_and_nothing_else(
    made: lakes.Lake, tmp_path: Path, capsys: pytest.CaptureFixture[str], sql: str
) -> None:
    secret = pa.table({"hidden": ["hidden"]})  # DuckDB would find it by its name
    (tmp_path / "secret.csv").write_text("a,b\n1,hidden\n", encoding="utf-8")
    before, files = parquet(made), sorted(tmp_path.iterdir())
    code, shown, said = called(capsys, "campaign", "query", made.uri, sql.format(folder=tmp_path, lake=made.root))
    assert (code, shown) == (2, "")
    assert said.count("\n") == 1
    assert "hidden" not in said
    assert "Traceback" not in said
    assert sorted(tmp_path.iterdir()) == files
    assert parquet(made) == before
    assert secret.num_rows == 1


def test_a_wrong_query_is_one_sentence(made: lakes.Lake, capsys: pytest.CaptureFixture[str]) -> None:
    code, _, said = called(capsys, "campaign", "query", made.uri, "SELECT nope FROM recordings")
    assert code == 2
    assert said.count("\n") == 1
    assert '"nope" not found' in said
    assert "the tables are recordings, findings, candidates, sensors, provenance" in said
    code, _, said = called(capsys, "campaign", "query", made.uri, "SELEC 1")
    assert code == 2
    assert "syntax error" in said


VERDICTS = "SELECT verdict, count(*) AS n FROM recordings GROUP BY verdict ORDER BY verdict"


def test_the_answer_in_every_format(made: lakes.Lake, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    counts = Counter(one["result"]["verdict"] for one in entries(COUNT))
    wanted = [{"verdict": verdict, "n": n} for verdict, n in sorted(counts.items())]
    assert ask(made, VERDICTS) == wanted
    _, shown, _ = called(capsys, "campaign", "query", made.uri, VERDICTS)
    assert re.findall(r"(?m)^(\w+) +(\d+)$", shown) == [(row["verdict"], str(row["n"])) for row in wanted]
    _, shown, _ = called(capsys, "campaign", "query", made.uri, VERDICTS, "--format", "json")
    assert json.loads(shown) == wanted
    _, shown, _ = called(capsys, "campaign", "query", made.uri, VERDICTS, "--format", "csv")
    assert list(csv.DictReader(io.StringIO(shown))) == [{"verdict": r["verdict"], "n": str(r["n"])} for r in wanted]
    code, shown, _ = called(capsys, "campaign", "query", made.uri, VERDICTS, "--output", tmp_path / "a.parquet")
    assert (code, shown) == (0, f"{tmp_path / 'a.parquet'}: {len(wanted)} rows\n")
    assert pq.read_table(tmp_path / "a.parquet").to_pylist() == wanted
    called(capsys, "campaign", "query", made.uri, VERDICTS, "--output", tmp_path / "a.csv")
    assert (tmp_path / "a.csv").read_text(encoding="utf-8").splitlines()[0] == "verdict,n"
    code, _, said = called(capsys, "campaign", "query", made.uri, VERDICTS, "--format", "parquet")
    assert code == 2
    assert "--output F.parquet" in said


def test_values_of_every_kind_are_text(made: lakes.Lake, capsys: pytest.CaptureFixture[str]) -> None:
    sql = (
        "SELECT NULL AS none, 'nan'::DOUBLE AS nan, DATE '2026-01-02' AS day, [1, 2] AS list, true AS yes, "
        "MAP {'a': 1.5::DOUBLE} AS map, {'x': [1]} AS struct, 1.25::DECIMAL(9, 2) AS exact, "
        "'a' || chr(27) || '[2J' AS hostile"
    )
    _, shown, _ = called(capsys, "campaign", "query", made.uri, sql, "--format", "json")
    assert json.loads(shown) == [
        {
            "none": None, "nan": None, "day": "2026-01-02", "list": [1, 2], "yes": True,
            "map": {"a": 1.5}, "struct": {"x": [1]}, "exact": 1.25,
            "hostile": "a\x1b[2J",
        }
    ]  # fmt: skip
    _, shown, _ = called(capsys, "campaign", "query", made.uri, sql)
    assert "\x1b" not in shown
    _, shown, _ = called(capsys, "campaign", "query", made.uri, sql, "--format", "csv")
    assert next(csv.DictReader(io.StringIO(shown)))["list"] == "[1, 2]"


def test_a_long_answer_says_how_much_it_shows(made: lakes.Lake, capsys: pytest.CaptureFixture[str]) -> None:
    _, shown, _ = called(capsys, "campaign", "query", made.uri, "SELECT uri FROM findings")
    findings = sum(len(one["result"]["findings"]) for one in entries(COUNT))
    assert shown.splitlines()[-1] == f"{findings} rows, 200 shown; --format csv gives all"


PAGE = (Path(__file__).parents[1] / "docs" / "campaign-tables.md").read_text(encoding="utf-8")


def test_every_column_is_in_the_manual() -> None:
    assert [name for name in schema.TABLES if schema.markdown(name) not in PAGE] == []


@pytest.mark.parametrize("sql", re.findall(r"^```sql\n(.*?)^```$", PAGE, re.MULTILINE | re.DOTALL))
def test_every_query_of_the_manual_finds_something(made: lakes.Lake, sql: str) -> None:
    assert ask(made, sql)


def test_columns_are_what_the_schema_says(made: lakes.Lake) -> None:
    for name, columns in schema.TABLES.items():
        found = pq.read_schema(made.place(f"tables/{name}.parquet"))
        assert found.names == [column.name for column in columns]
        assert len(set(map(str.lower, found.names))) == len(found.names)
        assert found.metadata[b"nineaudit.schema"] == schema.SCHEMA.encode()
        assert found.equals(schema.arrow(name))
