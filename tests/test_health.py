"""Sensor health over a campaign: the algebra of combined likelihoods, who is accused, what cannot be told apart."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from scipy.stats import binom, chi2

from health_campaigns import Plan, drawn
from nineaudit.campaign.health.assess import State, assess, assess_records
from nineaudit.campaign.health.connect import parts
from nineaudit.campaign.health.look import look
from nineaudit.campaign.health.model import FREE, Change, Unknown, solve
from nineaudit.campaign.health.records import read_records
from nineaudit.campaign.health.scan import scan, threshold
from nineaudit.campaign.health.scatter import estimate_scatter
from nineaudit.campaign.health.words import document, sentence, text_table
from nineaudit.case import Case
from nineaudit.estimate.calibration import PARAMETERS, perpendicular
from nineaudit.estimate.information import information
from nineaudit.reconstruct import slow_noise
from nineaudit.rig import parse_rig, preset_text
from nineaudit.simulate import Simulation, simulate
from nineaudit.simulate.instrument import across

SMALL = Plan(rigs=1, channels=3, tests=8, swaps=1, tilts=True)
TAU = {("accelerometer", "gain"): 0.1, ("accelerometer", "tilt"): 0.05}


def test_combined_likelihoods_are_the_joint_least_squares_of_all_unknowns() -> None:
    """Against a brute-force normal equation of x, of every test's own errors and of a change, all at once."""
    (part,) = parts(drawn(SMALL, 1).records.records)
    n = len(part.unknowns)
    index = np.concatenate([g.index for g in part.groups])
    assert sorted(index) == list(range(SMALL.tests))
    rng = np.random.default_rng(5)
    changes = (Change(0, (np.arange(SMALL.tests) >= 4).astype(float)), Change(3, rng.uniform(size=SMALL.tests)))
    found = solve(part, TAU, changes)

    width = len(part.groups[0].rows)
    normal = np.zeros((n + 2 + SMALL.tests * width,) * 2)
    right = np.zeros(len(normal))
    normal[np.arange(n), np.arange(n)] = part.prior**-2.0
    normal[[0, 3], [0, 3]] /= 1.0 + FREE**2  # the levels of what changes
    for group in part.groups:
        for j, place in enumerate(group.index):
            design = np.zeros((width, len(normal)))
            design[:, group.at] = group.design
            for k, change in enumerate(changes):
                for local in np.flatnonzero(group.at == change.unknown):
                    design[:, n + k] = group.design[:, local] * change.amount[place]
            own = n + 2 + width * int(place) + np.arange(width)
            design[np.arange(width), own] = 1.0
            normal += design.T @ group.matrix[j] @ design
            normal[own, own] += 1.0 / group.scatter(TAU)
            right += design.T @ group.eta[j]
    cov = np.linalg.inv(normal)
    np.testing.assert_allclose(found.x, (cov @ right)[: n + 2], rtol=1e-7, atol=1e-9)
    np.testing.assert_allclose(found.cov, cov[: n + 2, : n + 2], rtol=1e-7, atol=1e-9)


def test_a_change_that_no_recording_shows_is_nothing() -> None:
    """The scatter is estimated from some of the recordings: there may be none on one side of a change."""
    (part,) = parts(drawn(SMALL, 1).records.records)
    found = solve(part, TAU, (Change(0, np.zeros(SMALL.tests)),))
    assert found.x[-1] == 0.0
    free = replace(part, prior=part.prior * np.where(np.arange(len(part.unknowns)) == 0, np.hypot(1.0, FREE), 1.0))
    np.testing.assert_allclose(found.x[:-1], solve(free, TAU).x, rtol=1e-9, atol=1e-12)


def test_two_halves_of_a_recording_say_what_the_whole_says() -> None:
    """The prior is in the model once, however many recordings there are."""
    plan = replace(SMALL, tests=4, swaps=0)
    whole = drawn(plan, 2).records.records
    halves = [replace(r, eta=r.eta / 2, matrix=r.matrix / 2) for r in whole for _ in range(2)]
    nothing = dict.fromkeys(TAU, 0.0)
    for one, two in zip(parts(whole), parts(halves), strict=True):
        a, b = solve(one, nothing), solve(two, nothing)
        np.testing.assert_allclose(a.x, b.x, rtol=1e-9, atol=1e-12)
        np.testing.assert_allclose(a.cov, b.cov, rtol=1e-9, atol=1e-12)


def test_the_likelihood_of_a_recording_does_not_know_the_rig_s_prior() -> None:
    """About the same point, another stated uncertainty of the gains changes nothing of what the data say (SI)."""
    rig = parse_rig(preset_text("naap-3222"))
    found = Case(simulate(rig, "general", seed=3, rate_hz=5000.0).recording).healthy
    wider = found.data.prior_sd.copy()
    wider[:, 0] *= 3.0
    theta = np.where(found.data.active[1] == 0, found.theta / 3.0, found.theta)
    told = information(found)
    other = information(replace(found, data=replace(found.data, prior_sd=wider), theta=theta))
    si = [(i.eta / i.prior, i.matrix / np.outer(i.prior, i.prior)) for i in (told, other)]
    scale = np.sqrt(np.diag(si[0][1]))
    np.testing.assert_allclose(si[0][0] / scale, si[1][0] / scale, atol=1e-6)
    np.testing.assert_allclose(si[0][1] / np.outer(scale, scale), si[1][1] / np.outer(scale, scale), atol=1e-8)


def test_predicted_uncertainty_is_the_scatter_about_the_truth() -> None:
    """Posterior of x against the drawn truth, with its correlations: χ² of all unknowns over many campaigns."""
    total, count = 0.0, 0
    for seed in range(12):
        campaign = drawn(replace(SMALL, tests=30), seed)
        for part in parts(campaign.records.records):
            found = solve(part, dict.fromkeys(TAU, 0.09))
            true = np.array([campaign.truth[u.parameter, owner(u)] for u in part.unknowns])
            error = found.x - true
            total += float(error @ np.linalg.solve(found.cov, error))
            count += len(true)
    assert chi2.ppf(1e-4, count) < total < chi2.ppf(1 - 1e-4, count)


def owner(unknown: Unknown) -> object:
    """As the drawn truth has it: a sensor's tilt is that of a stay."""
    if unknown.sensor is None:
        return unknown.seat
    return unknown.sensor if unknown.parameter == "gain" else (unknown.sensor, *unknown.within)


def test_scatter_from_test_to_test_is_found() -> None:
    found = [
        estimate_scatter(parts(drawn(Plan(rigs=2, tests=80, scatter=s), 4).records.records), [(), ()])[
            "accelerometer", "gain"
        ]
        for s in (0.2, 0.6)
    ]
    np.testing.assert_allclose(np.sqrt(found), (0.2, 0.6), rtol=0.3)


def test_a_drift_is_found_in_its_sensor_with_its_date_and_the_rest_is_cleared() -> None:
    found = assess_records(drawn(Plan(), 3, drift=4.0, culprit="S17").records)  # 4 × 0.5 %
    (member,) = [m for m in found.sensors if m.deviations]
    (change,) = member.deviations
    assert (member.name, member.state, change.parameter, change.rivals) == ("S17", State.RECALIBRATE, "gain", ())
    assert abs(change.value - 0.02) < change.U < 0.005
    assert change.earliest <= "2026-04-18" <= change.latest
    assert "S17" in sentence(member, change)
    assert sentence(member, change).endswith(": recalibrate")
    assert found.action


def test_a_ramp_is_found_too() -> None:
    found = assess_records(drawn(Plan(), 8, drift=6.0, culprit="S05", ramp=True).records)
    (member,) = [m for m in found.sensors if m.deviations]
    assert (member.name, member.deviations[0].shape) == ("S05", "ramp")
    assert abs(member.deviations[0].value - 0.03) < 2.0 * member.deviations[0].U


def test_a_change_inside_the_tolerance_is_watched() -> None:
    found = assess_records(drawn(Plan(tell=0.3, scatter=0.1), 3, drift=1.0, culprit="S17").records)
    (member,) = [m for m in found.sensors if m.deviations]
    assert (member.name, member.state) == ("S17", State.WATCH)
    assert not found.action


def test_one_bad_test_makes_no_drift() -> None:
    """The last test but two says that a gain is 10 % off: without it nothing is left."""
    campaign = drawn(Plan(rigs=1, channels=6, tests=60), 2, culprit="S03", outlier=57)
    found = assess_records(campaign.records)
    assert [m.name for m in found.sensors if m.deviations] == []
    assert any("T0057" in note for note in found.notes)


def test_nothing_to_tell_is_said() -> None:
    old = {"uri": "T1.csv", "test": {}, "result": {"verdict": "pass", "rig": {"name": "r"}, "findings": []}}
    found = assess([old])
    assert found.sensors == ()
    assert not found.action
    assert "no calibration from 1 recording:" in text_table(found)
    assert document(found)["tests"] == 0


def entry(number: int, rig_text: str, day: str | None) -> dict[str, Any]:
    """A recording of a simulated test, audited, as the lake has it."""
    import nineaudit as na
    from nineaudit.report.machine import result_document

    recording = simulate(parse_rig(rig_text), "general", seed=number, rate_hz=4000.0).recording
    test = {"number": f"T{number}"} | ({} if day is None else {"date": day})
    return {"uri": f"T{number}.csv", "test": test, "result": result_document(na.audit(recording))}


@pytest.fixture(scope="module")
def told() -> list[dict[str, Any]]:
    """Three tests, two dated: T10 before T9 by date."""
    text = preset_text("naap-3222")
    return [entry(9, text, "2026-02-01"), entry(10, text, "2026-01-01"), entry(2, text, None)]


def test_recordings_are_in_the_order_of_dates_else_of_numbers_and_that_is_said(told: list[dict[str, Any]]) -> None:
    dated = read_records(told)
    assert [r.label for r in dated.records] == ["2026-01-01", "2026-02-01"]
    assert "left out for want of a date: 1 recording" in dated.notes
    bare = [e | {"test": {"number": e["test"]["number"]}} for e in told]
    numbered = read_records(bare)
    assert [r.label for r in numbered.records] == ["T2", "T9", "T10"]
    assert any("no date" in note for note in numbered.notes)
    assert "for want of a serial number" in text_table(assess(told))


def test_a_scale_that_was_stated_anew_is_no_drift(told: list[dict[str, Any]]) -> None:
    """A rig that says 1 % more scale has readings 1 % smaller: the sensor is the same."""
    first = read_records(told[:2]).records[1]
    stated = told[0] | {"result": told[0]["result"] | {"sensors": _restated(told[0]["result"]["sensors"], 1.01)}}
    later = read_records([told[1], stated]).records[1]
    gains = [i for i, row in enumerate(first.rows) if row.parameter == "gain" and row.seat[1] == "a1y"]
    moved = np.linalg.lstsq(later.matrix, later.eta - first.eta, rcond=None)[0]
    np.testing.assert_allclose(later.matrix @ moved, later.matrix[:, gains[0]] * np.log(1.01) / 0.005, atol=1e-4)


def _restated(block: dict[str, Any], scale: float) -> dict[str, Any]:
    channels = [c | {"scale": scale * c["scale"]} if c["channel"] == "a1y" else c for c in block["channels"]]
    return block | {"channels": channels}


def test_the_statistic_of_a_change_is_standard_normal_without_one() -> None:
    """Z of the middle step of every sensor over seeded campaigns."""
    values = []
    for seed in range(30):
        records = drawn(Plan(rigs=1, channels=8, tests=48, scatter=0.3), 100 + seed).records.records
        (part,) = parts(records)
        found = scan(look(solve(part, {("accelerometer", "gain"): 0.09})), len(records))
        values += [f.z for f in found]
    worst = np.abs(values)
    assert len(worst) == 240
    assert (worst > threshold()).sum() == 0
    assert np.median(worst) < 3.0


@pytest.mark.slow
def test_false_alarms_are_fewer_than_one_in_a_thousand_sensors() -> None:
    campaigns, sensors = 60, 40
    accused = sum(
        m.state in (State.RECALIBRATE, State.WATCH, State.UNDECIDED)
        for seed in range(campaigns)
        for m in assess_records(drawn(Plan(tell=1.5), 20_000 + seed).records).sensors
    )
    assert accused <= binom.ppf(0.999, campaigns * sensors, 1e-3)


@pytest.mark.slow
def test_a_drift_of_2_percent_in_one_of_40_is_found_by_its_serial_number() -> None:
    right = wrong = 0
    for seed in range(40):
        culprit = f"S{np.random.default_rng(seed).integers(40):02d}"
        found = assess_records(drawn(Plan(tell=1.5), 30_000 + seed, 4.0, culprit).records)
        named = {m.name for m in found.sensors if m.state is State.RECALIBRATE}
        right += named == {culprit}
        wrong += bool(named - {culprit})
    assert right >= binom.ppf(0.01, 40, 0.95)
    assert wrong <= 1


def test_what_one_recording_says_is_as_uncertain_as_it_says() -> None:
    """η − Λ θ against the drawn errors of simulated instruments: N(0, Λ) in every direction that is seen."""
    rig = parse_rig(preset_text("naap-3222"))
    total, count = 0.0, 0
    for seed in range(4):
        made = simulate(rig, "general", seed=40 + seed, rate_hz=10_000.0)
        case = Case(made.recording)
        told = information(case.healthy, colour=slow_noise(case))
        true = np.array([_drawn_error(made, c, p) for c, p in zip(told.channel, told.parameter, strict=True)])
        values, vectors = np.linalg.eigh(told.matrix)
        seen = values > 0.01
        left = vectors.T @ (told.eta - told.matrix @ (true / told.prior))
        total += float((left[seen] ** 2 / values[seen]).sum())
        count += int(seen.sum())
    assert count > 80
    assert 0.7 < total / count < 1.4  # χ² of 100 degrees has a relative sd of 0.14; linearised about the fit


def _drawn_error(made: Simulation, channel: int, parameter: int) -> float:
    name = PARAMETERS[parameter]
    axis = made.recording.rig.array.axes[channel]
    if name == "gain":
        return float(made.drawn["gain"][channel])
    if name.startswith("tilt"):
        return float(perpendicular(axis)[int(name[-1]) - 1] @ (made.drawn["tilt"][channel] @ across(axis)))
    return float(made.drawn["position"][channel]["xyz".index(name[-1])])
