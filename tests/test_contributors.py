"""Which channel brings how much uncertainty, by source: the same budget as its rows, seen by channel."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from nineaudit.auditing import audit
from nineaudit.case import Case
from nineaudit.estimate import budget
from nineaudit.estimate.budget import Beyond, ByChannel
from nineaudit.estimate.functional import smoothed
from nineaudit.estimate.outputs import peak_alpha
from nineaudit.report import annex
from nineaudit.report.page import render
from nineaudit.rig import Rig, parse_rig
from nineaudit.simulate import simulate

OF_CHANNELS = ("gain", "zero", "alignment", "position", "timing", "noise", "quantisation")


def rig_of(preset: str) -> Rig:
    return parse_rig(f'[rig]\npreset = "{preset}"\n[recording]\npre_trigger = [-0.02, -0.001]\n')


def parts_of(rig: Rig, motion: str = "sled") -> tuple[budget.AlphaBudget, ByChannel]:
    found = Case(simulate(rig, motion, seed=3).recording).alpha_budget
    return found, found.parts


@pytest.mark.parametrize("preset", ["naap-3222", "naap-gyro", "3-2-1", "rgla"])
def test_the_squares_of_a_source_add_up_to_its_row(preset: str) -> None:
    found, parts = parts_of(rig_of(preset))
    assert set(parts) == set(OF_CHANNELS)
    for source, u in parts.items():
        assert np.sqrt((u**2).sum()) == pytest.approx(found.rows[source], rel=1e-12, abs=1e-12)
    whole = sum(float((u**2).sum()) for u in parts.values())
    assert whole + found.rows["filters"] ** 2 + found.rows["integration"] ** 2 == pytest.approx(found.total**2)


@pytest.mark.parametrize("channel", ["a1y", "a3x"])
def test_a_channel_brings_what_the_budget_has_when_it_alone_is_uncertain(channel: str) -> None:
    """The share of one channel's gain is the row of gain of a rig in which no other gain is uncertain."""
    rig = rig_of("naap-3222")
    recording = simulate(rig, "sled", seed=3).recording
    index = rig.array.index(channel)
    part = float(Case(recording).alpha_budget.parts["gain"][index])
    assert part > 0
    only = replace(
        rig.array,
        sensors=tuple(s if s.channel == channel else replace(s, u_gain=0.0) for s in rig.array.sensors),
    )
    alone = Case(replace(recording, rig=replace(rig, array=only))).alpha_budget
    assert alone.rows["gain"] == pytest.approx(part, rel=1e-9)


def test_noise_of_the_fit_is_that_of_its_channels() -> None:
    """What calibration leaves of the variance of a fit is Σ c²/w², so that each channel's part of it is its own."""
    case = Case(simulate(rig_of("rgla"), "sled", seed=3).recording)
    way, time = smoothed(case.healthy), case.condensed.time
    gradient = peak_alpha().gradient(way.motion, time)
    by_reading, weight = way.coefficients(gradient), way.known.fit.data.weight
    own = np.where(weight > 0, by_reading / np.where(weight > 0, weight, 1.0), 0.0)
    found = way.by_channel(by_reading, gradient)["noise"]
    np.testing.assert_allclose(found, np.linalg.norm(own, axis=0), rtol=1e-6)


def test_noise_that_rounding_is_part_of_is_shared_out_without_negative_parts() -> None:
    case = Case(simulate(rig_of("naap-3222"), "sled", seed=3).recording)
    way = smoothed(case.healthy)
    gradient = peak_alpha().gradient(way.motion, case.condensed.time)
    plain = case.beyond(way.motion)
    errors = Beyond(
        np.where(np.arange(9) == 3, 2.0, 0.0) * case.condensed.sigma, np.ones(9, dtype=bool), plain.mismatch,
        plain.step, plain.classes,
    )  # fmt: skip
    parts, rows = budget.by_channel(way, gradient, errors), budget.rows(way, gradient, errors)
    assert parts["noise"][3] == 0.0
    assert (parts["noise"] >= 0).all()
    assert np.linalg.norm(parts["noise"]) == pytest.approx(rows["noise"], rel=1e-12)


def test_the_report_names_the_largest_contributors_and_sums_up_the_others() -> None:
    done = audit(simulate(rig_of("naap-3222"), "sled", seed=3).recording)
    shown = annex.budget(done)
    assert shown is not None
    rows, found = shown["contributors"], done.budget
    assert found is not None
    assert len(rows) == annex.CONTRIBUTORS + 1
    named = [(done.recording.channels[k], s, u) for s, part in found.parts.items() for k, u in enumerate(part)]
    channel, source, largest = max(named, key=lambda row: row[2])
    assert (rows[0]["channel"], rows[0]["source"]) == (channel, source)
    assert float(rows[0]["bar"].rstrip("%")) == pytest.approx(100 * (largest / found.total) ** 2, abs=0.06)
    assert rows[-1]["channel"] == "all others"
    assert sum(float(row["bar"].rstrip("%")) for row in rows) == pytest.approx(100.0, abs=0.6)
    assert f"<td>{source}</td>" in render(done)
