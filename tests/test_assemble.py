"""Laws of assemble: clocks, gaps, disorder, the common time base, units."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from nineaudit.array import FloatArray, frozen
from nineaudit.errors import RecordingError
from nineaudit.readers import Contents, assemble
from nineaudit.readers.clocks.clock import clock_of, in_order
from nineaudit.recording import Clock, Recording, Source, Trace
from nineaudit.rig import parse_rig
from nineaudit.units import G0

RIG = parse_rig(
    '[rig]\nname="a"\n'
    + "".join(f'[[sensor]]\nchannel="{c}"\nkind="accelerometer"\nposition=[0,0,0]\naxis=[1,0,0]\n' for c in "pq")
    + '[[sensor]]\nchannel="w"\nkind="gyroscope"\naxis=[0,0,1]\n'
)
GRID = np.arange(200) / 1000  # 1 kHz


def clock(time: FloatArray) -> Clock:
    return clock_of(frozen(time), in_order(frozen(time)))


def assembled(*signals: tuple[FloatArray, FloatArray], units: tuple[str | None, ...] = (None, None, None)) -> Recording:
    traces = tuple(
        Trace(c, c, frozen(t), frozen(v), unit) for c, (t, v), unit in zip("pqw", signals, units, strict=True)
    )
    return assemble(Contents(traces), RIG, Source(Path("x.csv"), "csv", "", 0))


def line(t: FloatArray) -> FloatArray:
    return 3.0 * t - 0.25


def same(t: FloatArray = GRID) -> tuple[FloatArray, FloatArray]:
    return t, line(t)


# --- clocks -------------------------------------------------------------------------------------------------------


def test_a_regular_clock() -> None:
    c = clock(GRID)
    assert c.rate == pytest.approx(1000, rel=1e-12)
    assert c.jitter < 1e-15
    assert c == Clock(c.rate, c.jitter)


@given(st.sets(st.integers(1, 198), min_size=1, max_size=20))
def test_gaps_hold_what_was_taken_out(lost: set[int]) -> None:
    """Samples taken out of a regular clock: as many are missed, in the gaps where they were."""
    c = clock(np.delete(GRID, sorted(lost)))
    assert c.rate == pytest.approx(1000, rel=1e-9)
    assert c.lost == len(lost)
    assert {i for start, end in c.gaps for i in lost if start < GRID[i] < end} == lost
    assert (c.duplicates, c.backward, c.first_disorder) == (0, 0, None)


def test_a_late_frame_is_an_interval_too_long_but_nothing_is_lost() -> None:
    time = GRID.copy()
    time[50] += 0.0008
    assert clock(time).gaps == ((time[49], time[50]),)
    assert clock(time).lost == 0


def test_jitter_is_the_deviation_of_the_intervals() -> None:
    """Stamps with independent errors of deviation s: intervals deviate by s√2, and jitter is no gap."""
    rng = np.random.default_rng(1)
    time = np.arange(5000) / 1000 + rng.normal(0, 5e-5, 5000)
    c = clock(time)
    assert c.jitter == pytest.approx(5e-5 * np.sqrt(2), rel=0.05)
    assert c.rate == pytest.approx(1000, rel=1e-3)
    assert not c.gaps


def test_frames_that_wait_show_their_mean_rate_and_no_gaps() -> None:
    """Frames every 12 ms, each stamped up to 8 ms late, one after the other: no frame is lost."""
    time = np.arange(2000) * 0.012 + np.random.default_rng(2).uniform(0, 0.008, 2000)
    c = clock(time)
    assert c.rate == pytest.approx(1 / 0.012, rel=0.01)
    assert (c.lost, c.gaps) == (0, ())


def test_resolution_of_dates_does_not_bias_the_rate() -> None:
    """Stamps around 1.7e9 s are 0.24 µs apart: single intervals of 100 µs are off by 0.1 %, the rate is not."""
    time = 1.7e9 + np.arange(5000) / 1e4
    assert clock(time - time[0]).rate == pytest.approx(1e4, rel=5e-5)


@pytest.mark.parametrize("back", [1, 3, 40])
def test_backward_and_duplicate_stamps_are_counted_and_not_used(back: int) -> None:
    time = np.insert(GRID, 100, GRID[100 - back] - 0.0005)  # backward
    time = np.insert(time, 50, time[49])  # the same again
    c = clock(time)
    assert (c.duplicates, c.backward) == (1, 1)
    assert c.first_disorder == GRID[49]
    assert in_order(time).sum() == 200
    assert (np.diff(time[in_order(time)]) > 0).all()
    found = assembled(*[(time, line(time))] * 3)
    np.testing.assert_array_equal(found.time, GRID)
    np.testing.assert_array_equal(found.column("p"), line(GRID) * G0)


def test_a_stamp_that_leaps_ahead_spoils_itself_only() -> None:
    time = GRID.copy()
    time[120] = 1e5
    assert np.flatnonzero(~in_order(time)).tolist() == [120]
    c = clock(time)
    assert (c.backward, c.duplicates, c.lost) == (1, 0, 1)


@given(st.lists(st.integers(0, 50), min_size=1, max_size=60))
def test_used_stamps_rise_and_every_sample_is_accounted_for(ticks: list[int]) -> None:
    time = frozen(np.array(ticks) / 10)
    used = in_order(time)
    c = clock_of(time, used)
    assert (np.diff(time[used]) > 0).all()
    assert used.sum() + c.duplicates + c.backward == time.size


# --- the common time base -----------------------------------------------------------------------------------------


def test_shared_stamps_are_the_time_base_bit_for_bit() -> None:
    found = assembled(same(), same(), same())
    np.testing.assert_array_equal(found.time, GRID)
    assert found.resampled == ()
    assert all(trace.time is not None and np.array_equal(trace.time, GRID) for trace in found.native)
    assert not found.readings.flags.writeable
    assert not found.valid.flags.writeable


def test_interpolation_is_exact_on_a_line() -> None:
    """Half the rate and a shift of 0.3 ms: a linear signal comes out as if sampled on the base."""
    slow = np.arange(0.0003, 0.2, 0.002)
    found = assembled(same(), (slow, line(slow)), same())
    assert found.resampled == ("q",)
    inside = (slow[0] <= GRID) & (slow[-1] >= GRID)
    np.testing.assert_allclose(found.column("q")[inside], line(GRID[inside]) * G0, rtol=1e-12, atol=1e-12)
    np.testing.assert_array_equal(found.valid[:, 1], inside)
    np.testing.assert_array_equal(found.native[1].time, slow)
    assert found.clocks[1].rate == pytest.approx(500)


def test_nothing_is_interpolated_over_a_gap_but_samples_on_a_stamp_stay() -> None:
    slow = np.delete(np.arange(0, 0.2, 0.002), [30, 31])
    found = assembled(same(), (slow, line(slow)), same())
    gap = (GRID > 0.058 + 1e-9) & (GRID < 0.064 - 1e-9)
    outside = slow[-1] < GRID
    np.testing.assert_array_equal(found.valid[:, 1], ~gap & ~outside)
    assert found.clocks[1].gaps == ((slow[29], slow[30]),)


def test_invalid_readings_stay_invalid() -> None:
    broken = line(GRID)
    broken[[7, 90]] = np.nan
    shifted = GRID + 0.0004
    late = line(shifted)
    late[100] = np.nan
    found = assembled((GRID, broken), (shifted, late), same())
    assert np.flatnonzero(~found.valid[:, 0]).tolist() == [7, 90]
    # A sample that is not valid spoils what is interpolated from it, on both sides; the first stamp has none before.
    assert np.flatnonzero(~found.valid[:, 1]).tolist() == [0, 100, 101]
    assert np.isnan(found.readings[~found.valid]).all()


def test_the_trace_with_most_samples_gives_the_time_base() -> None:
    fast = np.arange(0, 0.2, 0.0001)
    found = assembled(same(), same(), (fast, fast))
    np.testing.assert_array_equal(found.time, fast)
    assert found.resampled == ("p", "q")


@given(st.floats(1.2e6, 4e9), st.floats(0, 0.1))
def test_dates_are_counted_from_the_first_of_all_stamps(date: float, later: float) -> None:
    found = assembled(same(GRID + date), same(GRID + date), same(GRID + date + later))
    assert found.time[0] == 0.0
    assert found.native[2].time[0] == (date + later) - date
    assert any("counted from the first" in note for note in found.source.notes)


def test_other_times_are_kept_as_recorded() -> None:
    found = assembled(*[same(GRID - 0.05)] * 3)
    np.testing.assert_array_equal(found.time, GRID - 0.05)
    assert found.source.notes == ()


def test_channels_of_one_clock_share_their_stamps_and_no_reading_is_copied_twice() -> None:
    """Memory of a recording is that of the traces, of one array of stamps, of the readings and of which are valid."""
    import tracemalloc

    n = 100_000
    time, values = np.arange(n) / 1e4, np.sin(np.arange(n))
    traces = tuple(Trace(c, c, frozen(time), frozen(values), None) for c in "pqw")
    tracemalloc.start()
    found = assemble(Contents(traces), RIG, Source(Path("x.csv"), "csv", "", 0))
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert found.native[0].time is found.native[1].time is found.native[2].time is found.time
    assert peak < n * (8 * (3 + 1 + 3 + 4.5) + 3)  # some arrays more for the analysis of the clock
    assert not any(a.flags.writeable for t in found.native for a in (t.time, t.values))
    assert not any(a.flags.writeable for a in (found.readings, found.valid))


def test_a_number_that_no_unit_can_hold_is_no_reading() -> None:
    huge = np.where(np.arange(200) == 7, 1.7e308, 1.0)
    found = assembled((GRID, huge), same(), same())
    assert np.flatnonzero(~found.valid[:, 0]).tolist() == [7]
    assert np.isnan(found.native[0].values[7])
    assert "p: 1 number beyond 1e+75 m/s² or rad/s, no readings" in found.source.notes


def test_stamps_that_are_no_times_are_left_out_and_said() -> None:
    odd = np.where(np.arange(200) == 9, 1e300, GRID)
    found = assembled(same(), (odd, line(GRID)), same())
    assert found.native[1].time.tolist() == np.delete(GRID, 9).tolist()
    assert any(note.startswith("q: 1 sample stamped 1e+300 s") for note in found.source.notes)
    with pytest.raises(RecordingError, match=r"channel p: .*no times in seconds; found '1.7e\+18 s'; .*time_unit"):
        assembled(*[(1.7e18 + GRID * 1e9, line(GRID))] * 3)


# --- units --------------------------------------------------------------------------------------------------------


def test_the_unit_of_the_recording_comes_before_that_of_the_rig() -> None:
    found = assembled(same(), same(), same(), units=(None, "m/s²", "deg/s"))
    np.testing.assert_array_equal(found.column("p"), line(GRID) * G0)
    np.testing.assert_array_equal(found.column("q"), line(GRID))
    np.testing.assert_allclose(found.column("w"), np.radians(line(GRID)), rtol=1e-15)
    assert [t.values[5] for t in found.native] == found.readings[5].tolist()
    assert "q in m/s² (rig: g_0), w in deg/s (rig: rad/s)" in found.source.notes[0]


@pytest.mark.parametrize("unit", ["furlong", "deg/s"])
def test_an_unknown_unit_names_signal_and_unit(unit: str) -> None:
    with pytest.raises(RecordingError, match=f"x.csv: signal q: unknown unit of acceleration; found '{unit}'"):
        assembled(same(), same(), same(), units=(None, unit, None))


# --- refusals -----------------------------------------------------------------------------------------------------


def test_too_few_samples() -> None:
    with pytest.raises(RecordingError, match=r"x.csv: too few samples; found '7 with a time stamp of their own'"):
        assembled(*[same(np.r_[GRID[:7], GRID[:7]])] * 3)


def test_no_time_in_common() -> None:
    with pytest.raises(RecordingError, match=r"channel w: no time in common.*'5 s to 5.199 s'.*0 s and 0.199 s"):
        assembled(same(), same(), same(GRID + 5))


def test_stamps_that_only_go_back_are_named() -> None:
    t = np.arange(20.0)[::-1]
    with pytest.raises(RecordingError, match=r"too few samples.*0 repeat one before them, 19 go back"):
        assembled((t, t), (t, t), (t, t))
