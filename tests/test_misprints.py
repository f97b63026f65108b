"""docs/where-the-papers-are-wrong.md: the errors stated are those of the printed forms; the right ones are exact."""

from __future__ import annotations

import re
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from nineaudit.physics import rigid_body
from nineaudit.selftest import (
    Misprint,
    alem77_misprints,
    all_misprints,
    becker75_misprints,
    takhounts_clipping,
    takhounts_misprints,
)
from nineaudit.selftest.misprints import relative

PAGE = Path(__file__).parents[1] / "docs" / "where-the-papers-are-wrong.md"
NAMED = {
    "Takhounts 2009": "22a, 23, 25, 27, 28b, 30a, 30b, 32a, 32b, 29, 31, 33, 37 row 2",
    "Martin 1998": "2, 5, 6, 7, 12, 13, 18, 19",
    "Alem77": "15, 19 [1,1], 22 row 2, 22 [3,1]",
    "Becker75": "6, 15 line 2, 23",
    "Hu 1977": "C⁻¹",
}
"""Equations that METHODS 1.2 names."""
EVERY = sorted(f"{source} {equation}" for source, names in NAMED.items() for equation in names.split(", "))


@cache
def misprints() -> dict[str, Misprint]:
    return {f"{m.source} {m.equation}": m for m in all_misprints()}


def test_every_misprint_that_is_named_is_computed() -> None:
    assert sorted(misprints()) == EVERY


@pytest.mark.parametrize("name", EVERY)
def test_right_form_is_exact_and_the_printed_one_is_not(name: str) -> None:
    m = misprints()[name]
    assert relative(m.put_right, m.truth) < m.rounding
    assert relative(m.wrong, m.truth) > 0.01


@pytest.mark.parametrize("name", EVERY)
def test_page_states_both_forms_and_the_error(name: str) -> None:
    m = misprints()[name]
    author = re.match("[A-Za-z]+", m.source)
    assert author is not None
    (section,) = (part for part in PAGE.read_text(encoding="utf-8").split("\n## ") if part.startswith(author[0]))
    assert f"\n| {m.equation} | {m.printed} | {m.right} | {m.error} |" in section


def test_weight_of_the_covariance_is_noisier_than_its_inverse() -> None:
    """Gauss and Markov: no unbiased weight beats V⁻¹; the page says by how much V is worse."""
    found = alem77_misprints.weight()
    assert found.ours > 1.0
    assert f"{found.ours:.1f} times the noise of α" in PAGE.read_text(encoding="utf-8")


def test_no_other_product_fits_line_2_of_eq_15() -> None:
    """Of e1e2, e2e3 and e1e3 only the last leaves nothing: the scheme's own difference of α decides."""
    m = misprints()["Becker75 15 line 2"]
    e = 0.1 * becker75_misprints.random_instants(16).omega
    linear = m.put_right - e[:, 0] * e[:, 2]
    left = {pair: relative(linear + e[:, pair[0]] * e[:, pair[1]], m.truth) for pair in ((0, 1), (1, 2), (0, 2))}
    assert min(left[0, 1], left[1, 2]) > 0.05
    assert left[0, 2] < 1e-12


def test_array_of_eq_22a_does_not_see_turning_about_z() -> None:
    assert takhounts_misprints.rank_as_listed() == 5
    along_their_arms = rigid_body.design(np.eye(3) * 0.05, np.eye(3))
    np.testing.assert_array_equal(along_their_arms[:, 3:], 0.0)


def test_page_states_what_the_clipping_survey_finds() -> None:
    found = np.array(takhounts_clipping.survey())
    page = " ".join(PAGE.read_text(encoding="utf-8").split())
    low, high, median = found.min(axis=0), found.max(axis=0), np.median(found, axis=0)
    said = f"{low[1]:.1f} to {float(f'{high[1]:.2g}'):.0f} for the next (median {median[1]:.0f}"
    assert said in page
    assert f"{low[2]:.0f} to {high[2]:.0f} % before the repair (median {median[2]:.0f})" in page
