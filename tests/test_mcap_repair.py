"""A repaired MCAP log: its own topics bit by bit, the rebuilt channel beside them, by the mcap library."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mcap.reader import NonSeekingReader, SeekingReader, make_reader
from mcap.writer import Writer

from mcap_logs import COMPRESSIONS, PQ, STEP_NS, of, oracle, write_log
from nineaudit.provenance import MCAP_RECORD
from nineaudit.readers import read
from nineaudit.writers.mcap_rebuilt import Column, NotWhole, add_rebuilt, log_time_of_zero

N = 120
TIME = np.arange(N) * STEP_NS * 1e-9
HALF = TIME > 0.06
DOCUMENT: dict[str, Any] = {
    "schema": "nineaudit/provenance/1",
    "original": {"path": "r.mcap", "sha256": "3f"},
    "channels": ["c0"],
    "stretches_s": {"c0": [[0.06, 0.119]]},
    "samples_replaced": 60,
    "method": "each sample from the others",
    "donors": ["c1"],
    "reason": "</script><script>alert(1)</script>",
}


def column(n: int = N, channel: str = "c0") -> Column:
    time = np.arange(n) * STEP_NS * 1e-9
    return Column(channel, "m/s^2", time, np.sin(time / 0.007) * 1e3 / 3, np.full(n, 0.25), time > 0.06)


def added(log: Path, *columns: Column, document: dict[str, Any] = DOCUMENT, start: int = 0) -> Path:
    target = log.with_name("repaired.mcap")
    add_rebuilt(log, target, columns or [column()], document, start)
    return target


LOGS: dict[str, dict[str, Any]] = {
    "zstd": {},
    "lz4, attachment": {"compression": "lz4", "attachment": True},
    "plain": {"compression": "none", "data_crcs": False},
    "no chunks": {"use_chunking": False},
    "no statistics": {"use_statistics": False},
    "definitions in chunks only": {"repeat_channels": False, "repeat_schemas": False},
}


@pytest.mark.parametrize("options", LOGS.values(), ids=LOGS)
def test_the_log_stays_and_the_library_finds_all(tmp_path: Path, options: dict[str, Any]) -> None:
    log = write_log(tmp_path / "r.mcap", N, **options)
    before = log.read_bytes()
    target = added(log)
    data = target.read_bytes()
    ((end, _),) = of(before, 15)  # type: ignore[arg-type]
    assert data[:end] == before[:end]  # not a byte of the data section is touched
    assert log.read_bytes() == before
    for topic in ("/imu", "/other"):
        assert oracle(target, topic) == oracle(log, topic)
    mine = [(t, json.loads(d)) for t, d in oracle(target, "/nineaudit/c0")]
    assert [t for t, _ in mine] == [round(t * 1e9) for t in TIME.tolist()]
    assert [m["value"] for _, m in mine] == column().values.tolist()
    assert [m["replaced"] for _, m in mine] == HALF.tolist()
    assert {m["u"] for _, m in mine if m["replaced"]} == {0.25}
    assert {m["u"] for _, m in mine if not m["replaced"]} == {None}


@pytest.mark.parametrize("options", LOGS.values(), ids=LOGS)
@pytest.mark.parametrize("reader", [SeekingReader, NonSeekingReader])
def test_both_readers_of_the_library_agree_with_the_log(tmp_path: Path, options: dict[str, Any], reader: Any) -> None:
    """As Foxglove reads: by the index, or from the first byte to the last."""
    log = write_log(tmp_path / "r.mcap", N, **options)
    with added(log).open("rb") as file, log.open("rb") as original:
        found = [(c.topic, m.log_time, m.data) for _, c, m in reader(file, validate_crcs=True).iter_messages()]
        was = [(c.topic, m.log_time, m.data) for _, c, m in NonSeekingReader(original).iter_messages()]
    assert sorted(f for f in found if f[0] != "/nineaudit/c0") == sorted(was)
    assert sum(topic == "/nineaudit/c0" for topic, _, _ in found) == N
    assert [t for _, t, _ in found] == sorted(t for _, t, _ in found)


def test_summary_counts_old_and_new_and_metadata_is_the_record(tmp_path: Path) -> None:
    log = write_log(tmp_path / "r.mcap", N, attachment=True)
    hostile = {**DOCUMENT, "original": {"path": "ü\u202e\x1b[2J.mcap", "sha256": "3f"}}
    with added(log, document=hostile).open("rb") as file:
        reader = make_reader(file)
        summary = reader.get_summary()
        assert summary is not None
        assert summary.statistics is not None
        assert {c.topic for c in summary.channels.values()} == {"/imu", "/other", "/nineaudit/c0"}
        assert summary.statistics.message_count == N + N // 3 + N
        assert summary.statistics.chunk_count == len(summary.chunk_indexes)
        assert (summary.statistics.metadata_count, summary.statistics.attachment_count) == (1, 1)
        assert summary.statistics.channel_count == 3
        (record,) = [m for m in reader.iter_metadata() if m.name == MCAP_RECORD]
        assert [a.data for a in reader.iter_attachments()] == [b"a photograph"]
        schemas = {s.name: s for s in summary.schemas.values()}
    document = json.loads(record.metadata["json"])
    assert document == {**hostile, "mcap": {"topics": {"c0": "/nineaudit/c0"}}}
    schema = schemas["nineaudit.rebuilt.c0"]
    assert schema.encoding == "jsonschema"
    assert json.loads(schema.data)["properties"]["value"]["description"] == "reading, m/s^2"


def test_long_channels_go_into_several_chunks(tmp_path: Path) -> None:
    log = write_log(tmp_path / "r.mcap", N)
    target = added(log, column(25_000))
    with target.open("rb") as file:
        summary = make_reader(file).get_summary()
        assert summary is not None
        assert max(c.uncompressed_size for c in summary.chunk_indexes) < 1 << 21
    assert len(oracle(target, "/nineaudit/c0")) == 25_000


def test_a_second_repair_keeps_the_first(tmp_path: Path) -> None:
    log = write_log(tmp_path / "r.mcap", N)
    first = added(log)
    second = tmp_path / "second.mcap"
    again = {**DOCUMENT, "previous": {**DOCUMENT, "mcap": {"topics": {"c0": "/nineaudit/c0"}}}}
    other = column()
    changed = Column("c0", "m/s^2", other.time, other.values + 1.0, other.u, other.replaced)
    add_rebuilt(first, second, [changed], again, 0)
    assert oracle(second, "/nineaudit/c0") == oracle(first, "/nineaudit/c0")
    recording = read(second, PQ)
    np.testing.assert_array_equal(recording.column("c0"), changed.values)
    assert any("/nineaudit/c0-2" in note for note in recording.source.notes)
    assert [made.channel for made in recording.remade] == ["c0", "c0"]


def test_reading_takes_the_rebuilt_channel_and_says_so(tmp_path: Path) -> None:
    log = write_log(tmp_path / "r.mcap", N)
    before, after = read(log, PQ), read(added(log), PQ)
    np.testing.assert_array_equal(after.time, before.time)
    np.testing.assert_array_equal(after.column("c0"), column().values)
    np.testing.assert_array_equal(after.column("c1"), before.column("c1"))
    assert before.remade == ()
    (made,) = after.remade
    assert (made.channel, made.samples, made.from_others) == ("c0", 60, True)
    np.testing.assert_array_equal(after.made_of_others[:, 0], HALF)
    assert not after.made_of_others[:, 1].any()
    assert after.source.damage == ()


def test_dates_stay_dates_in_the_log(tmp_path: Path) -> None:
    """Log times since 1970: what is rebuilt stands at the same dates, and reads back on the same clock."""
    log, epoch = tmp_path / "r.mcap", 1_700_000_000_123_456_789
    with log.open("wb") as file:
        writer = Writer(file, compression=COMPRESSIONS["zstd"])
        writer.start()
        schema = writer.register_schema("s", "jsonschema", b"{}")
        late = writer.register_channel("/early", "json", schema)
        imu = writer.register_channel("/imu", "json", schema)
        writer.add_message(late, log_time=epoch - 10**9, publish_time=0, data=b"{}")
        for i in range(N):
            data = json.dumps({"p": float(i), "q": 2.0 * i}).encode()
            writer.add_message(imu, log_time=epoch + i * 10**6, publish_time=0, data=data)
        writer.finish()  # type: ignore[no-untyped-call]
    before = read(log, PQ)
    start = log_time_of_zero(log, ["/imu"], float(before.time[0]))
    assert start == epoch
    target = added(log, start=start)
    assert [t for t, _ in oracle(target, "/nineaudit/c0")] == [epoch + i * 10**6 for i in range(N)]
    after = read(target, PQ)
    np.testing.assert_allclose(after.time, before.time, atol=1e-12, rtol=0)
    np.testing.assert_array_equal(after.column("c0"), column().values)


def test_nothing_is_added_to_a_log_that_is_not_whole(tmp_path: Path) -> None:
    log = write_log(tmp_path / "r.mcap", N)
    whole = log.read_bytes()
    ((end, _),) = of(whole, 15)  # type: ignore[arg-type]
    flipped = bytearray(whole)
    flipped[end // 2] ^= 0x10
    for data in (whole[: end // 2], whole[:end], whole[:-20], b"not MCAP", bytes(flipped)):
        log.write_bytes(data)
        with pytest.raises(NotWhole):
            added(log)
        assert not (tmp_path / "repaired.mcap").exists()


def test_a_record_without_its_topic_is_an_error(tmp_path: Path) -> None:
    from nineaudit.errors import RecordingError

    log = tmp_path / "r.mcap"
    with log.open("wb") as file:
        writer = Writer(file)
        writer.start()
        schema = writer.register_schema("s", "jsonschema", b"{}")
        imu = writer.register_channel("/imu", "json", schema)
        for i in range(N):
            writer.add_message(imu, log_time=i * 10**6, publish_time=0, data=b'{"p": 1.0, "q": 2.0}')
        writer.add_metadata(MCAP_RECORD, {"json": json.dumps({**DOCUMENT, "mcap": {"topics": {"c0": "/gone"}}})})
        writer.finish()  # type: ignore[no-untyped-call]
    with pytest.raises(RecordingError, match=r"rebuilt channel 'c0' is not there.*topic /gone"):
        read(log, PQ)


@pytest.mark.parametrize("text", ["", "{}", "[1]", "null", '{"schema": "nineaudit/provenance/1"}', "{" * 2000])
def test_a_record_that_is_none_is_an_error_and_no_crash(tmp_path: Path, text: str) -> None:
    from nineaudit.errors import RecordingError

    log = write_log(tmp_path / "r.mcap", N)
    (tmp_path / "r.mcap.provenance.json").write_text(text, encoding="utf-8")
    with pytest.raises(RecordingError, match=r"r.mcap.provenance.json: is no record of a repair") as caught:
        read(log, PQ)
    assert caught.value.exit_code == 3
