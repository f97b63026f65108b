"""Drift and skew of CAN messages from the log to the verdict: what is planted is measured, and accuses no channel."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from nineaudit.array import FloatArray, frozen
from nineaudit.auditing import audit
from nineaudit.case import Case
from nineaudit.diagnosis import Status
from nineaudit.engine import run
from nineaudit.finding import Finding, Verdict
from nineaudit.readers import Contents, assemble, read
from nineaudit.readers.clocks.alignment import in_bursts, slip
from nineaudit.recording import Alignment, Recording, Source, Trace
from nineaudit.rig import load_rig, parse_rig, preset_text
from nineaudit.rulebook import load_rulebook
from nineaudit.simulate import simulate
from nineaudit.writers.dbc import make_dbc

RULE = "RQ108"
INTERVAL, BUS = 2e-3, 50e-6  # s: of the messages, and by how much a frame waits for the bus on average
TWO_MESSAGES = """
[rig]
name = "two messages"
[units]
acceleration = "m/s^2"
[recording]
filter_class = "none"
[uncertainty]
noise = 0.1
""" + "".join(
    f'[[sensor]]\nchannel="{c}"\nsignal="{m}.{c}"\nkind="accelerometer"\nposition=[0,0,0]\naxis=[1,0,0]\nrange=100\n'
    for c, m in (("p", "A"), ("q", "B"))
)


def can_log(folder: Path, drift: float, late: float, seconds: float, seed: int, every: int = 1) -> Path:
    """A candump log of two messages, the second `late` and of a clock that runs fast by `drift`; each frame waits."""
    rng = np.random.default_rng(seed)
    count = round(seconds / INTERVAL)
    own = np.arange(count // every) * INTERVAL * every / (1.0 + drift) + late
    sent = [(t, 0x100) for t in np.arange(count) * INTERVAL] + [(t, 0x101) for t in own]
    frames = sorted((1e3 + t + rng.exponential(BUS), ident) for t, ident in sent)
    path = folder / f"{seed}.log"
    path.write_text("".join(f"({t:.6f}) can0 {ident:X}#{'0' * 16}\n" for t, ident in frames))
    return path


def logged(folder: Path, drift: float, late: float, seconds: float = 20.0, seed: int = 0, every: int = 1) -> Recording:
    rig = parse_rig(TWO_MESSAGES)
    database = folder / "two.dbc"
    database.write_text(make_dbc(rig))
    return read(can_log(folder, drift, late, seconds, seed, every), rig, dbc=[database])


def findings(recording: Recording) -> list[Finding]:
    return list(run(Case(recording), load_rulebook(select=RULE)))


@pytest.mark.parametrize("drift", [50e-6, -500e-6])
@pytest.mark.parametrize("every", [1, 2])
def test_a_planted_drift_is_measured_within_its_uncertainty(tmp_path: Path, drift: float, every: int) -> None:
    """Errors of 20 logs over their stated u: 1 rms but for χ² of 20 (99.8 %: 0.54 to 1.5)."""
    found = [logged(tmp_path, drift, 6e-4, 8.0, seed, every).alignments[0] for seed in range(20)]
    error = np.array([(a.drift - drift) / a.u_drift for a in found])
    assert 0.54 < np.sqrt(np.mean(error**2)) < 1.5
    assert all(a.u_drift < 0.1 * abs(drift) for a in found)


@pytest.mark.parametrize("drift", [50e-6, -500e-6])
def test_a_planted_drift_is_a_finding_with_a_remedy(tmp_path: Path, drift: float) -> None:
    said = {f.verdict: f for f in findings(logged(tmp_path, drift, 6e-4))}
    assert said[Verdict.WARN].channels == ("q",)
    assert re.match(r"rate [-+].* ppm off 1:1 against p: along 20 s their time runs apart", said[Verdict.WARN].reason)
    assert said[Verdict.WARN].measure is not None
    assert said[Verdict.WARN].measure.value == pytest.approx(20.0 * abs(drift), rel=0.02)
    assert "timing_s" in load_rulebook()[RULE].advice


@pytest.mark.parametrize("late", [1e-4, 3e-4, 6e-4, 1e-3])
@pytest.mark.parametrize("every", [1, 2])
def test_a_steady_skew_is_measured_and_covered(tmp_path: Path, late: float, every: int) -> None:
    for seed in range(5):
        recording = logged(tmp_path, 0.0, late, 8.0, seed, every)
        (a,) = recording.alignments
        assert abs(a.skew) == pytest.approx(late, abs=5 * BUS * np.sqrt(np.pi * every / 4000))
        assert 2.0 * a.u_timing > late
        assert {f.verdict for f in findings(recording)} == {Verdict.PASS}


def test_a_jump_of_stamps_is_a_skew_that_changes() -> None:
    rng = np.random.default_rng(3)
    base = np.arange(4000) * 1e-3
    own = base + 3e-4 + 2e-5 * base + np.where(base > 1.7, 4e-4, 0.0) + rng.normal(0, 1e-5, base.size)
    value, u = slip(own, base, 1e-3, 1e-5)
    # The line through a step of s has a slope of up to 3/2 s along the record: of 16 parts, s(1 − 3/2/16) is left.
    assert 0.8 * 4e-4 < value < 4e-4 + 4 * u
    assert u == pytest.approx(1e-5 * np.sqrt(np.pi / 250), rel=0.2)
    steady = [slip(base + 2e-5 * base + rng.normal(0, 1e-5, base.size), base, 1e-3, 1e-5) for _ in range(50)]
    assert max(value for value, _ in steady) < 5 * u


def test_a_skew_that_slides_through_many_intervals_does_not_jump() -> None:
    base = np.arange(20_000) * 1e-3
    value, u = slip(base * (1 - 1e-3), base, 1e-3, 1e-6)
    assert value == pytest.approx(0.0, abs=1e-9 + 4 * u)


def test_what_jitters_too_much_or_is_short_is_not_judged() -> None:
    base = np.arange(200) * 1e-3
    assert np.isnan(slip(base, base, 1e-3, 2e-4)).all()
    assert np.isnan(slip(base[:90], base, 1e-3, 1e-6)).all()


def aligned(skew: float, u: float = 1e-5) -> Alignment:
    return Alignment("q", 1e3, (1, 1), 0.0, 0.0, skew, float(np.hypot(u, skew / np.sqrt(3))), 0.0)


def test_the_third_of_three_messages_is_later_than_half_the_cycle() -> None:
    """0, 0.3 and 0.6 ms in a cycle of 1 ms: the nearest stamp of the first is 0.4 ms after the third."""
    found = in_bursts({1: aligned(3e-4), 2: aligned(-4e-4)}, 1e-3)
    assert [found[i].skew for i in (1, 2)] == pytest.approx([3e-4, 6e-4])
    assert found[2].u_timing == pytest.approx(np.hypot(1e-5, 6e-4 / np.sqrt(3)))
    last = in_bursts({1: aligned(-3e-4), 2: aligned(4e-4)}, 1e-3)  # the base is the last of the burst
    assert [last[i].skew for i in (1, 2)] == pytest.approx([-3e-4, -6e-4])


def test_two_messages_and_even_cycles_keep_the_nearest_stamp() -> None:
    assert in_bursts({1: aligned(-4e-4)}, 1e-3)[1].skew == pytest.approx(-4e-4)
    even = {i: aligned(s) for i, s in enumerate((2.5e-4, 5e-4, -2.5e-4))}
    assert in_bursts(even, 1e-3) == even


# --- from skew to diagnosis ---------------------------------------------------------------------------------------


def skewed(seed: int, late: dict[str, float], together: bool, faults: tuple[str, ...] = ()) -> Recording:
    """A 3-2-2-2 of messages of 1 kHz, a point each, `late` s; sampled together, or when they are stamped."""
    rig = parse_rig(re.sub(r"(?m)^filter_class.*$", "", preset_text("naap-3222")))
    fine = simulate(rig, "general", seed=seed, rate_hz=10_000.0, faults=faults).recording
    at = np.arange(30, fine.time.size - 30, 10)
    traces = []
    for t in fine.native:
        steps = round(late.get(t.channel[:2], 0.0) * 1e4)
        values = t.values[at] if together else t.values[at + steps]
        time: FloatArray = fine.time[at] + steps * 1e-4
        traces.append(Trace(t.channel, t.signal, frozen(time), frozen(values), "m/s^2"))
    return assemble(Contents(tuple(traces)), rig, Source(Path("x.blf"), "blf", "", 0))


LATE = {"a1": 3e-4, "a2": 5e-4, "a3": 6e-4}


@pytest.mark.parametrize("together", [False, True])
@pytest.mark.parametrize("late", [LATE, {"a1": 5e-4, "a2": -5e-4, "a3": 5e-4}])
def test_skew_accuses_no_channel(late: dict[str, float], together: bool) -> None:
    """Where time skews were large the fit did not settle: half of these were undiagnosed, with nothing wrong."""
    for seed in (0, 2, 6, 11):
        found = audit(skewed(seed, late, together))
        assert found.diagnosis.status is Status.HEALTHY, (seed, found.diagnosis.reason)
        assert not [f for f in found.findings if f.verdict is Verdict.FAIL]


def test_skew_hides_no_fault() -> None:
    for seed in (0, 1, 2):
        found = audit(skewed(seed, LATE, True, ("a1y:clipping=0.5",))).diagnosis
        assert (found.status, found.channels) == (Status.ISOLATED, ("a1y",))


def test_without_its_uncertainty_skew_is_a_contradiction() -> None:
    """What the skew's part of the timing uncertainty is for."""
    recording = skewed(0, LATE, True)
    sensors = tuple(replace(s, u_timing=1e-5) for s in recording.rig.array.sensors)
    array = replace(recording.rig.array, sensors=sensors)
    bare = Case(replace(recording, rig=replace(recording.rig, array=array)))
    assert bare.statistic > bare.statistic_limit > Case(recording).statistic


# --- of others ----------------------------------------------------------------------------------------------------


def test_a_real_log_of_one_message_has_one_clock(shared_data: Path) -> None:
    folder = shared_data / "rav4-can"
    rig = load_rig(Path(__file__).parents[1] / "fixtures" / "rigs" / "rav4-kinematics.toml")
    (finding,) = findings(read(folder / "drive-60s.blf", rig, dbc=[folder / "toyota_2017.dbc"]))
    assert finding.verdict is Verdict.NOT_APPLICABLE


def test_stamps_too_coarse_to_show_a_drift_say_so() -> None:
    """Two clocks of even stamps, one of which ended early: nothing is seen, and little could be."""
    t = np.arange(64) * 1e-3
    values = np.sin(t)
    traces = tuple(Trace(c, c, frozen(t[:n]), frozen(values[:n]), "m/s^2") for c, n in (("p", 64), ("q", 30)))
    recording = assemble(Contents(traces), parse_rig(TWO_MESSAGES), Source(Path("x.csv"), "csv", "", 0))
    (finding,) = findings(recording)
    assert (finding.verdict, "too coarse" in finding.reason) == (Verdict.NOT_APPLICABLE, True)
