"""Text tables: encodings, dialects, exports; faults are reported with count and line, and the rest is kept."""

from __future__ import annotations

import codecs
import gzip
import random
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from nineaudit.errors import NineauditError, RecordingError
from nineaudit.readers import read
from nineaudit.readers.contents import Contents
from nineaudit.readers.tables import text_blocks
from nineaudit.readers.tables.csv_table import read_text_table
from nineaudit.rig import Rig, parse_rig

SMALL = '[rig]\nname="s"\n[units]\nacceleration="m/s^2"\n{recording}' + "".join(
    f'[[sensor]]\nchannel="{c}"\nkind="accelerometer"\nposition=[0,0,0]\naxis=[1,0,0]\n' for c in ("p", "q")
)
COUNT = 12
RIG = parse_rig(SMALL.format(recording=""))
P, Q = np.arange(COUNT) + 0.5, -np.arange(float(COUNT))


def rig(recording: str = "") -> Rig:
    return parse_rig(SMALL.format(recording=recording))


def rows(count: int = COUNT, pattern: str = "{t},{p},{q}\n") -> str:
    return "".join(pattern.format(t=i / 100, p=i + 0.5, q=-i) for i in range(count))


def contents(tmp_path: Path, text: str | bytes, recording: str = "") -> Contents:
    path = tmp_path / "t.csv"
    path.write_bytes(text.encode() if isinstance(text, str) else text)
    return read_text_table(path, rig(recording))


def same(found: Contents, p: object = P, q: object = Q) -> None:
    np.testing.assert_array_equal(found.traces[0].values, p)
    np.testing.assert_array_equal(found.traces[1].values, q)
    np.testing.assert_array_equal(found.traces[0].time, np.arange(len(found.traces[0].values)) / 100)


# --- encodings ----------------------------------------------------------------------------------------------------

TEXT = "# Prüfung µ\nt_s,p,q\n" + rows()


@pytest.mark.parametrize(
    ("data", "note"),
    [
        (TEXT.encode(), ""),
        (codecs.BOM_UTF8 + TEXT.encode(), ""),
        (codecs.BOM_UTF16_LE + TEXT.encode("utf-16-le"), "read as UTF-16 (little endian), by its byte order mark"),
        (codecs.BOM_UTF16_BE + TEXT.encode("utf-16-be"), "read as UTF-16 (big endian), by its byte order mark"),
        (TEXT.encode("cp1252"), "not UTF-8 (byte 4 is 0xFC): read as Windows-1252"),
        (TEXT.replace("\n", "\r").encode(), ""),
        (TEXT.replace("\n", "\r\n").encode(), ""),
    ],
)
def test_encodings_and_line_ends(tmp_path: Path, data: bytes, note: str) -> None:
    found = contents(tmp_path, data)
    same(found)
    assert [n for n in found.notes if "read as" in n] == ([note] if note else [])
    assert found.damage == ()


@pytest.mark.parametrize(
    ("data", "says"),
    [
        (codecs.BOM_UTF32_LE + TEXT.encode("utf-32-le"), r"byte 0: not text that can be read; found 'a UTF-32 byte"),
        (TEXT.encode("utf-16-le"), r"byte 1: not text.*UTF-16 without its byte order mark.*save the table as UTF-8"),
        (bytes(300), r"byte 0: not text"),
    ],
)
def test_what_is_no_text(tmp_path: Path, data: bytes, says: str) -> None:
    with pytest.raises(RecordingError, match=says):
        contents(tmp_path, data)


def test_a_byte_that_is_no_text_costs_its_cell_alone(tmp_path: Path) -> None:
    text = ("t_s,p,q\n" + rows()).encode().replace(b"3.5", b"3\xe45")
    found = contents(tmp_path, text)
    same(found, np.where(P == 3.5, np.nan, P))
    assert "column 'p': 1 cell without a number, first in line 5: '3ä5'" in found.notes


# --- rows ---------------------------------------------------------------------------------------------------------


def test_ragged_rows_are_left_out_counted_and_placed(tmp_path: Path) -> None:
    lines = ["t_s,p,q", *rows().splitlines()]
    lines[5:5] = ["1,2", "1,2,3,4", "1"]
    found = contents(tmp_path, "\n".join(lines) + "\n")
    same(found)
    assert [str(d) for d in found.damage] == [
        "line 6: a row of the wrong length (3 times, first there); 2 cells for 3 columns; these rows are left out"
    ]


def test_a_cut_last_row(tmp_path: Path) -> None:
    found = contents(tmp_path, "t_s,p,q\n" + rows() + "0.12,12")
    same(found)
    assert [(d.what, d.place) for d in found.damage] == [
        ("a row of the wrong length", "line 14"),
        ("the last line has no line end: the file may be cut", "line 14"),
    ]


def test_nul_bytes_cost_their_rows_alone(tmp_path: Path) -> None:
    found = contents(tmp_path, ("t_s,p,q\n" + rows() + "0.12,1\0,2\n").encode() + bytes(100))
    same(found)
    assert str(found.damage[0]).startswith("line 14: NUL bytes in a row (2 times, first there)")


def test_a_very_long_line_is_no_row_and_takes_no_memory(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(text_blocks, "BLOCK", 256)
    monkeypatch.setattr(text_blocks, "LONGEST", 2048)
    found = contents(tmp_path, "t_s,p,q\n" + rows(6) + "9" * 9000 + "\n" + rows()[rows(6).__len__() :])
    same(found)
    assert [(d.place, d.count) for d in found.damage] == [("line 8", 1)]


@pytest.mark.parametrize("block", [40, 64, 101, 4096])
def test_blocks_do_not_show(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, block: int) -> None:
    lines = ["t_s,p,q", *rows(300).splitlines()]
    lines[250] = "2.49,OVERFLOW,-249"
    lines[270] = "1,2"
    monkeypatch.setattr(text_blocks, "BLOCK", block)
    found = contents(tmp_path, "\n".join(lines) + "\n")
    kept = np.delete(np.arange(300), 269)
    values = np.where(kept == 249, np.nan, kept + 0.5)
    np.testing.assert_array_equal(found.traces[0].values, values)
    assert "column 'p': 1 cell without a number, first in line 251: 'OVERFLOW'" in found.notes
    assert [d.place for d in found.damage] == ["line 271"]


@pytest.mark.parametrize(
    "word", ["", "NaN", "Inf", "-inf", "#N/A", "OVL", "1_000", "0x1F", "-", "nan(2)", "1e999", "١"]
)
def test_cells_without_a_number_are_counted_and_named(tmp_path: Path, word: str) -> None:
    found = contents(tmp_path, "t_s,p,q\n" + rows().replace(",3.5,", f",{word},"))
    same(found, np.where(P == 3.5, np.nan, P))
    assert f"column 'p': 1 cell without a number, first in line 5: {word!r}" in found.notes
    assert found.counts["invalid_cells"] == 1
    assert found.damage == ()


@pytest.mark.parametrize(
    ("text", "place"),
    [
        ("t_s,p,q\n" + rows().replace(",3.5,", ',"1,234.5",'), r"line 5, column 'p'.*thousands.*'1,234.5'"),
        ("t_s,p,q\n" + rows().replace(",3.5,", ',"1,234",'), r"line 5, column 'p'.*thousands.*'1,234'"),
        ("t_s;p;q\n" + rows(pattern="{t};{p};{q}\n").replace(";3.5;", ";1 234.5;"), r"line 5, column 'p'.*'1 234.5'"),
        ("t_s;p;q\n" + rows(pattern="{t};{p};{q}\n").replace(";3.5;", ";1'234.5;"), r"line 5, column 'p'.*1'234.5"),
        (
            "t_s;p;q\n" + rows(pattern="{t};{p};{q}\n").replace(".", ",").replace(";3,5;", ";1.234,5;"),
            r"line 5, column 'p'.*'1.234,5'; expected a number with a decimal comma",
        ),
    ],
)
def test_thousands_separators_are_refused(tmp_path: Path, text: str, place: str) -> None:
    with pytest.raises(RecordingError, match=place):
        contents(tmp_path, text)


@pytest.mark.parametrize(
    ("head", "pattern", "note"),
    [
        ("sep=;\nt_s;p;q\n", "{t};{p};{q}\n", "separated by semicolon, with a decimal point"),
        ("t_s\tp\tq\t\n", "{t}\t{p}\t{q}\t\n", "separated by tab, with a decimal point"),
        ('"t_s","p","q"\n', '"{t}","{p}","{q}"\n', ""),
        ('t_s,"p",q,"a ""b"", c"\n', '{t},{p},{q},"x ""y"", z"\n', ""),
        ("t_s,p,q\n", "  {t} ,{p}\t,{q}\n", ""),
        ("t_s,p,q\n", "{t},{p},+{q}\n", ""),
    ],
)
def test_more_dialects(tmp_path: Path, head: str, pattern: str, note: str) -> None:
    found = contents(tmp_path, head + rows(pattern=pattern).replace("+-", "-"))
    same(found)
    assert any(note in n for n in found.notes) if note else found.notes == ()


def test_decimal_commas_in_quoted_cells_between_commas(tmp_path: Path) -> None:
    quoted = rows(pattern='"{t}";"{p}";{q}\n').replace(".", ",").replace(";", ",")
    same(contents(tmp_path, "t_s,p,q\n" + quoted))


# --- exports ------------------------------------------------------------------------------------------------------


def test_labelled_rows_of_a_crash_recorder(tmp_path: Path) -> None:
    """Preamble of DTS exports: lines of Key,Value, then a row for each property of the channels."""
    text = (
        "Test Name,Sled 12\nSoftware Version,1.08.0868\nSample Rate (Hz),100\n\n"
        "Channel Number,1,2\nISO code,11HEAD0000H3ACXA,11HEAD0000H3ACYA\nChannel Description,p,q\n"
        "Sensor Serial,4711,4712\nEU,g,g\nSample Rate,100,100\nTime (sec),,\n"
    )
    found = contents(tmp_path, text + rows())
    same(found)
    assert [t.unit for t in found.traces] == ["g", "g"]
    assert found.notes == ("the first column, under the label 'Channel Description', is taken as time",)


def test_units_in_brackets_and_key_value_lines(tmp_path: Path) -> None:
    """Names with units in brackets (DIAdem, enDAQ), lines of Key: Value above."""
    found = contents(tmp_path, "Title: x\nSamplerate [Hz],100\n\nTime [s],p [m/(s^2)],q (m/s²)\n" + rows())
    same(found)
    assert [t.unit for t in found.traces] == ["m/(s^2)", "m/s²"]


def test_a_row_of_units_below_the_names(tmp_path: Path) -> None:
    found = contents(tmp_path, "time,p,q\nms,[g],-\n" + rows())
    np.testing.assert_array_equal(found.traces[0].values, P)
    np.testing.assert_allclose(found.traces[0].time, np.arange(COUNT) / 100 * 1e-3, rtol=1e-15)
    assert [t.unit for t in found.traces] == ["g", None]


def test_an_export_for_a_spreadsheet(tmp_path: Path) -> None:
    """`sep=,` first, units below the names, a separator at the end of every row (Shimmer)."""
    found = contents(tmp_path, '"sep=,"\nTime,p,q,\ns,m/(s^2),m/(s^2),\n' + rows(pattern="{t},{p},{q},\n"))
    same(found)
    assert [t.unit for t in found.traces] == ["m/(s^2)", "m/(s^2)"]
    assert found.notes == ()


@pytest.mark.parametrize("name", ["t.csv", "t.csv.gz"])
def test_a_packed_table_is_refused(tmp_path: Path, name: str) -> None:
    path = tmp_path / name
    path.write_bytes(gzip.compress(("t_s,p,q\n" + rows()).encode()))
    says = r"(gzip archive.*|unknown kind of file; found '\.gz'.*); unpack it and read"
    with pytest.raises(RecordingError, match=says):
        read(path, RIG)


def test_a_name_with_a_range_in_brackets_is_no_unit(tmp_path: Path) -> None:
    found = contents(tmp_path, "t_s,p (100g),q\n" + rows())
    assert found.traces[0].unit is None
    same(found)


@pytest.mark.parametrize(
    "line", ["Sample Rate,100", "SampleRate: 0.1 kHz", ";SampleRate, 100,Hz", "Sampling interval (ms);10", "dt=10 ms"]
)
def test_time_from_a_rate_that_the_file_states(tmp_path: Path, line: str) -> None:
    text = f"{line}\np,q\n" + rows(pattern="{p},{q}\n").replace("3.5,-3", "3.5")
    found = contents(tmp_path, text)
    same(found, np.where(P == 3.5, np.nan, P), np.where(Q == -3, np.nan, Q))  # a row keeps its place in time
    assert any("counted from 0 at the 100 Hz that line 1 states" in note for note in found.notes)
    assert found.damage[0].place == "line 6"
    assert "rows without readings" in found.damage[0].lost


@pytest.mark.parametrize("head", ["p,q\n", "Sample Rate,100\nSample Rate,200\np,q\n"])
def test_without_time_or_a_rate(tmp_path: Path, head: str) -> None:
    with pytest.raises(RecordingError, match="no time column"):
        contents(tmp_path, head + rows(pattern="{p},{q}\n"))


def test_the_time_that_the_rig_names_is_not_made_up(tmp_path: Path) -> None:
    with pytest.raises(RecordingError, match="missing time; expected a column 't_s'"):
        contents(tmp_path, "Sample Rate,100\np,q\n" + rows(pattern="{p},{q}\n"), '[recording]\ntime="t_s"\n')


# --- laws ---------------------------------------------------------------------------------------------------------

FINITE = st.floats(allow_nan=False, allow_infinity=False)


@settings(max_examples=30, deadline=None, derandomize=True)
@given(
    values=st.lists(st.tuples(FINITE, FINITE), min_size=2, max_size=30),
    separator=st.sampled_from([",", ";", "\t", "|"]),
    decimal=st.sampled_from([".", ","]),
    codec=st.sampled_from(["utf-8", "utf-8-sig", "utf-16", "cp1252"]),
    end=st.sampled_from(["\n", "\r\n", "\r"]),
    quoted=st.booleans(),
    trailing=st.booleans(),
    block=st.sampled_from([200, 4 * 2**20]),  # the header is in the first
)
def test_any_table_reads_back(
    tmp_path_factory: pytest.TempPathFactory,
    values: list[tuple[float, float]],
    separator: str,
    decimal: str,
    codec: str,
    end: str,
    quoted: bool,
    trailing: bool,
    block: int,
) -> None:
    decimal = "." if separator == "," else decimal
    cells = [[repr(v).replace(".", decimal) for v in (i / 8, *row)] for i, row in enumerate(values)]
    cells = [[f'"{c}"' if quoted else c for c in row] for row in cells]
    lines = [separator.join(row) + (separator if trailing else "") for row in [["t_s", "p", "q"], *cells]]
    path = tmp_path_factory.getbasetemp() / "any.csv"
    path.write_bytes(("# µ" + end + end.join(lines) + end).encode(codec))
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(text_blocks, "BLOCK", block)
        found = read_text_table(path, RIG)
    for trace, column in zip(found.traces, zip(*values, strict=True), strict=True):
        np.testing.assert_array_equal(trace.values, column)
    np.testing.assert_array_equal(found.traces[0].time, np.arange(len(values)) / 8)
    assert found.damage == ()


@pytest.mark.parametrize("seed", range(4))
def test_flipped_and_cut_files_end_in_a_recording_or_one_of_our_errors(tmp_path: Path, seed: int) -> None:
    rng = random.Random(seed)
    whole = ("Sample Rate,100\nt_s,p,q\ns,g,g\n" + rows(60)).encode()
    path = tmp_path / "t.csv"
    ends = {True: 0, False: 0}
    for _ in range(60):
        data = bytearray(whole)
        for _ in range(rng.randint(1, 8)):
            data[rng.randrange(len(data))] = rng.choice([0, 10, 13, 34, 35, 44, 59, 255, rng.randrange(256)])
        path.write_bytes(bytes(data[: rng.randint(1, len(data))] if rng.random() < 0.3 else data))
        try:
            found = read(path, rig())
        except NineauditError:
            ends[False] += 1
        else:
            ends[True] += 1
            assert np.isfinite(found.time).all()
    assert ends[True] > 20


# --- found by odd files -------------------------------------------------------------------------------------------


def test_readings_without_a_time_are_damage(tmp_path: Path) -> None:
    """They were left out with a note, and the recording passed."""
    found = contents(tmp_path, "time,p,q\n" + rows().replace("0.02,", "0.0ÿ2,", 1))
    (damage,) = found.damage
    assert (damage.what, damage.count) == ("readings in a row without a time stamp", 1)
    assert damage.place.startswith("line 4: '0.0ÿ2'")


def test_many_rows_without_any_number_are_damage(tmp_path: Path) -> None:
    """Another decimal mark half way: twenty rows of sixty were gone with a note."""
    text = "time;p;q\n" + rows().replace(",", ";")
    lines = text.splitlines(keepends=True)
    mixed = "".join([lines[0], *(line.replace(".", ",") for line in lines[1:6]), *lines[6:]])
    found = contents(tmp_path, mixed + "time;p;q\n")
    whats = [d.what for d in found.damage]
    assert any("without a time stamp" in what for what in whats), whats
    said_again = contents(tmp_path, text + "time;p;q\n")
    assert said_again.damage == ()


def test_rows_of_numbers_above_the_names_are_damage(tmp_path: Path) -> None:
    """A table pasted below another lost the first without a word; two rows may be numbers of channels."""
    found = contents(tmp_path, rows() + "time,p,q\n" + rows())
    same(found)
    (damage,) = found.damage
    assert (damage.place, damage.count) == ("line 1", COUNT)
    assert contents(tmp_path, "1,2,3\n4711,4712,4713\ntime,p,q\n" + rows()).damage == ()


@pytest.mark.parametrize("mark", ["D", "d"])
def test_exponents_of_fortran(tmp_path: Path, mark: str) -> None:
    lines = [
        f"{i / 100}{mark}+00,{p * 100}{mark}-02,{q / 100}{mark}2\n" for i, (p, q) in enumerate(zip(P, Q, strict=True))
    ]
    found = contents(tmp_path, "time,p,q\n" + "".join(lines))
    np.testing.assert_allclose([t.values for t in found.traces], [P, Q], rtol=1e-12)
    np.testing.assert_allclose(found.traces[0].time, np.arange(COUNT) / 100, rtol=1e-12)


@pytest.mark.parametrize("rate", ["1e400", "1e-320", "0", "-5", "nan"])
def test_a_rate_that_is_none_gives_no_time(tmp_path: Path, rate: str) -> None:
    text = "".join(line.split(",", 1)[1] for line in rows().splitlines(keepends=True))
    with pytest.raises(RecordingError, match="no time column"):
        contents(tmp_path, f"Sample Rate,{rate}\np,q\n{text}")


def test_dates_are_told_apart_from_too_few_samples(tmp_path: Path) -> None:
    text = "".join(f"2024-01-01T00:00:00.{i:03d},1,2\n" for i in range(COUNT))
    with pytest.raises(
        RecordingError, match=r"column 'time': no row has a time that is a number; found .*line 2: '2024-01"
    ):
        contents(tmp_path, "time,p,q\n" + text)


@pytest.mark.parametrize("name", ["p (100g)", "p [100 g]", "p (head)", "p (CFC1000)", "p [X]", "p [-]", "p (3)"])
def test_brackets_that_hold_no_unit_are_told(tmp_path: Path, name: str) -> None:
    found = contents(tmp_path, f"time,{name},q\n" + rows())
    assert f"column '{name}': its brackets hold no unit of acceleration and count as its name" in found.notes
    assert found.traces[0].unit is None


@pytest.mark.parametrize("name", ["p [V]", "p (mV/V)", "p [EU]", "p (counts)", "p [rad/s]", "p (deg/s)", "p [furlong]"])
def test_a_unit_in_brackets_that_is_none_of_the_quantity_is_an_error(tmp_path: Path, name: str) -> None:
    """It was a note among others, and the readings were taken to be in the rig's unit."""
    path, unit = tmp_path / "t.csv", name[3:-1]
    path.write_text(f"time,{name},q\n" + rows())
    says = rf"t.csv: signal p: unknown unit of acceleration; found '{unit}'; .* in the rig's m/s\^2 all the same"
    with pytest.raises(RecordingError, match=says):
        read(path, RIG)
    named = SMALL.format(recording="").replace('channel="p"', f'channel="p"\nsignal="{name}"')
    np.testing.assert_array_equal(read(path, parse_rig(named)).column("p"), P)  # as the error advises
    path.write_text(f"time,{name},q\ns,g,g\n" + rows())  # a row of units says it better
    np.testing.assert_allclose(read(path, RIG).column("p"), 9.80665 * P, rtol=1e-12)


def test_millivolts_in_brackets_are_those_of_a_rig_in_millivolts(tmp_path: Path) -> None:
    (tmp_path / "t.csv").write_text("time,p [mV],q (mV)\n" + rows())
    text = SMALL.format(recording="").replace('"m/s^2"', '"mV"').replace("axis=", "sensitivity=2.0\naxis=")
    found = read(tmp_path / "t.csv", parse_rig(text))
    np.testing.assert_allclose(found.column("p"), P / 2.0 * 9.80665, rtol=1e-12)
    assert not [note for note in found.source.notes if "brackets" in note]
    (tmp_path / "t.csv").write_text("time,p [V],q (mV)\n" + rows())
    with pytest.raises(RecordingError, match="found 'V'"):
        read(tmp_path / "t.csv", parse_rig(text))


def test_what_was_found_is_told_in_a_sentence(tmp_path: Path) -> None:
    """NUL bytes before the names were all of them in the message."""
    with pytest.raises(RecordingError) as caught:
        contents(tmp_path, b"\0" * 5000 + b"time,p,q\n" + rows().encode())
    assert len(str(caught.value)) < 1000


# --- as loggers export --------------------------------------------------------------------------------------------


def test_a_preamble_of_23_lines_with_labels_that_are_not_known(tmp_path: Path) -> None:
    """Public code that reads SLICEWare exports skips 23 lines, the labels of all in the first column, and knows
    `Channel Description` among them; the other labels here are made up."""
    above = "".join(f"Test {word},x\n" for word in ("Date", "Time", "ID", "Operator", "Room"))
    label = "".join(f"Gauge {i} of {i},{i},{i + 1}\n" for i in range(15))
    names = "Data Channel Number,1,2\nChannel Description,p,q\n"
    found = contents(tmp_path, above + names + label + "EU,g,g\n" + rows())
    same(found)
    assert found.damage == ()
    assert [t.unit for t in found.traces] == ["g", "g"]
    assert any("taken as a description" in note for note in found.notes)


def test_a_first_row_without_a_time_is_no_description(tmp_path: Path) -> None:
    found = contents(tmp_path, "time,p,q\nnull,1,2\n" + rows())
    assert [d.what for d in found.damage] == ["readings in a row without a time stamp"]


def test_a_line_of_names_with_a_label_and_a_remark_at_the_end(tmp_path: Path) -> None:
    """The layout of the manual of Gulf Coast Data Concepts' loggers (X16-1D, section 3.2)."""
    text = ";Title, x16-1d, ADXL345\n;SampleRate, 100,Hz\n;Headers, time,p,q\n" + rows() + ";shutdown: switched off\n"
    found = contents(tmp_path, text)
    same(found)
    assert found.damage == ()
    assert "1 line of comment among the rows" in found.notes
