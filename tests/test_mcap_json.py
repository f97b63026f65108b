"""JSON messages in MCAP: whatever Arrow's parser is given, the numbers are those of Python's."""

from __future__ import annotations

import json
import random
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from mcap.writer import Writer

from mcap_logs import batch_of, pairs, rig_of
from nineaudit.readers.mcap import json as mcap_json
from nineaudit.readers.mcap.columns import is_number
from nineaudit.readers.mcap.fields import MISSING, lookup
from nineaudit.readers.mcap.json import Json
from nineaudit.readers.mcap.json_arrow import by_arrow
from nineaudit.readers.mcap.reader import read_mcap

SEVERAL = settings(derandomize=True, max_examples=80, deadline=None)
PATHS = ["p", "v.x", "v.y", "s.1.value", "s.0.value", "list.2"]
ODD = [
    None,
    True,
    10**400,
    2**53 + 1,
    "1",
    [],
    {},
    [[1]],
    10**30,
    2**63,
    -(2**63),
    float("nan"),
    float("inf"),
    1e-320,
    -0.0,
]


def number(draw: random.Random) -> Any:
    return draw.choice(
        [draw.gauss(0, 9), draw.randrange(-9, 9), draw.random() * 10.0 ** draw.randrange(-300, 12), 2**50 + 1]
    )


def message(draw: random.Random, odd: float) -> Any:
    def value() -> Any:
        return draw.choice(ODD) if draw.random() < odd else number(draw)

    found = {
        "p": value(),
        "v": {"x": value(), "y": value(), "name": "ü{}\n"},
        "s": [{"value": value(), "other": [1, {}]} for _ in range(2 if draw.random() > odd else draw.randrange(4))],
        "list": [value() for _ in range(3)],
        "more": {"p": 1, "deep": [[[{}]]]},
    }
    for key in list(found):
        if draw.random() < odd / 3:
            del found[key]
    if draw.random() < odd / 5:
        found["v.x"] = 7.5
    return found


def changed(draw: random.Random, text: bytes) -> bytes:
    at = draw.randrange(len(text))
    return draw.choice(
        [
            text[:at],
            text[:at] + draw.choice([b"}", b"{", b'"', b",", b"\n", b"\xff", b"}{", b"0", b"\\u0070"]) + text[at:],
            text + b"\n",
            b" " + text,
            text + text,
            b'{"p": 1, "p": 2}',
            b'{"\\u0070": 3}',
            b"[1, 2]",
            b"5",
            b"",
            text.decode(errors="replace").encode("utf-16"),
            b'{"v.x": 4, "v": {"x": 5}}',
            b"[" * 5000,
        ]
    )


def check(texts: list[bytes]) -> None:
    found = Json().read(batch_of(texts), PATHS)
    for k, text in enumerate(texts):
        try:
            right = json.loads(text)
        except (ValueError, RecursionError):
            right = MISSING
        assert found.good[k] == (right is not MISSING)
        for path, column in zip(PATHS, found.columns, strict=True):
            value = lookup(right, path)
            assert column.there[k] == is_number(value), (path, text)
            assert not column.there[k] or float(column.values[k]) == float(value), (path, text)


@given(st.integers(0, 10**9), st.sampled_from([0.0, 0.02, 0.3]))
@SEVERAL
def test_random_messages(seed: int, odd: float) -> None:
    draw = random.Random(seed)
    check([json.dumps(message(draw, odd), ensure_ascii=False).encode() for _ in range(draw.randrange(1, 30))])


@given(st.integers(0, 10**9))
@SEVERAL
def test_messages_of_which_some_are_changed(seed: int) -> None:
    draw = random.Random(seed)
    texts = [json.dumps(message(draw, 0.0), ensure_ascii=False).encode() for _ in range(12)]
    for _ in range(draw.randrange(1, 4)):
        k = draw.randrange(12)
        texts[k] = changed(draw, texts[k] or b"{}")
    check(texts)


@pytest.mark.parametrize(
    "texts",
    [
        [b'{"p": [{}', b'{"p": 1}]}', b'{"p": 2}{"p": 3}'],
        [b'{"p": {}', b"}", b'{"p": 2}\n{"p": 3}'],
        [b'{"p": 1, "q": "', b'"}', b'{"p": 2}{"p": 3}'],
        [b'{"p": 1} {"p": 2}', b"{}", b'{"p": 4'],
    ],
)
def test_messages_that_only_together_are_json(texts: list[bytes]) -> None:
    assert by_arrow([b'{"p": 0}', *texts], ["p"]) is None
    check([b'{"p": 0}', *texts])


def test_arrow_reads_plain_messages() -> None:
    draw = random.Random(4)
    found = by_arrow([json.dumps(message(draw, 0.0), ensure_ascii=False).encode() for _ in range(50)], PATHS)
    assert found is not None
    assert all(column.there.all() for column in found)


def test_integers_of_time_keep_their_digits(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(mcap_json, "_BLOCK", 300)
    path, start = tmp_path / "t.mcap", 1_700_000_000_000_000_001
    with path.open("wb") as file:
        writer = Writer(file)
        writer.start()
        channel = writer.register_channel("/imu", "json", 0)
        for i in range(40):
            text = json.dumps(
                {"stamp_ns": start + 10 * i, "p": i if i % 2 else i + 0.5, "header": {"stamp": {"sec": 5, "nsec": i}}}
            )
            writer.add_message(channel, log_time=i, publish_time=0, data=text.encode())
        writer.finish()
    values = [i if i % 2 else i + 0.5 for i in range(40)]
    found = pairs(read_mcap(path, rig_of("p", recording='[recording]\ntime="stamp_ns"\n')))
    assert found == [(10 * i * 1e-9, v) for i, v in enumerate(values)]
    found = pairs(read_mcap(path, rig_of("/imu:p", recording='[recording]\ntime="/imu:header.stamp"\n')))
    assert found == [((5 * 10**9 + i) * 1e-9, v) for i, v in enumerate(values)]
    logged = read_mcap(path, rig_of("/imu:p", recording='[recording]\ntime="/other:stamp_ns"\n'))
    np.testing.assert_array_equal([t for t, _ in pairs(logged)], np.arange(40) * 1e-9)
    assert logged.notes == ("no time signal '/other:stamp_ns' in topic /imu: the log times are taken",)


def test_integers_of_hundreds_of_digits_are_no_readings(tmp_path: Path) -> None:
    path = logged(tmp_path, [(i, {"p": 10**400, "q": i}) for i in range(9)])
    p, q = read_mcap(path, rig_of("/imu:p", "/imu:q")).traces
    assert np.isnan(p.values).all()
    assert q.values.tolist() == list(range(9))


def test_stamps_of_the_next_century_keep_their_digits(tmp_path: Path) -> None:
    path = logged(tmp_path, [(2**63 - 10 + i, {"p": i}) for i in range(9)])
    assert read_mcap(path, rig_of("/imu:p")).traces[0].time.tolist() == [i * 1e-9 for i in range(9)]


def logged(folder: Path, messages: list[tuple[int, Any]]) -> Path:
    """A log of (log time, message) on /imu."""
    path = folder / "made.mcap"
    with path.open("wb") as file:
        writer = Writer(file)
        writer.start()
        channel = writer.register_channel("/imu", "json", writer.register_schema("s", "jsonschema", b"{}"))
        for time, message in messages:
            writer.add_message(channel, log_time=time, publish_time=0, data=json.dumps(message).encode())
        writer.finish()
    return path
