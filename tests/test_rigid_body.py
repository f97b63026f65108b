"""Laws of the rigid-body model and the constants of METHODS.md 3, 4 and 7.8."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from nineaudit.array import FloatArray
from nineaudit.errors import EstimationError
from nineaudit.physics import nap
from nineaudit.physics import rigid_body as rb

Geometry = tuple[FloatArray, FloatArray]
X, Y, Z = np.eye(3)
R = 0.05


def geometry(*sensors: tuple[FloatArray, FloatArray]) -> Geometry:
    return np.array([r for r, _ in sensors]), np.array([n for _, n in sensors])


def naap(rx: float = R, ry: float = R, rz: float = R) -> Geometry:
    centre = [(0 * X, X), (0 * X, Y), (0 * X, Z)]
    return geometry(*centre, (rx * X, Y), (rx * X, Z), (ry * Y, X), (ry * Y, Z), (rz * Z, X), (rz * Z, Y))


def triaxes(*points: FloatArray) -> Geometry:
    return geometry(*((p, n) for p in points for n in (X, Y, Z)))


def six() -> Geometry:
    return geometry((0 * X, X), (0 * X, Y), (0 * X, Z), (R * Y, X), (R * Y, Z), (R * X, Z))


def scattered(count: int = 12, seed: int = 4) -> Geometry:
    rng = np.random.default_rng(seed)
    axes = rng.normal(size=(count, 3))
    return rng.uniform(-0.1, 0.1, (count, 3)), axes / np.linalg.norm(axes, axis=1)[:, None]


def states(count: int = 20, seed: int = 5) -> tuple[FloatArray, FloatArray, FloatArray]:
    """a0, α, ω of unrelated instants: the sensor model holds sample by sample."""
    rng = np.random.default_rng(seed)
    return (
        rng.normal(0, 800, (count, 3)),
        rng.normal(0, 3000, (count, 3)),
        rng.normal(0, 30, (count, 3)),
    )


def readings(where: Geometry, a0: FloatArray, alpha: FloatArray, omega: FloatArray) -> FloatArray:
    return rb.predict(*where, np.ones(len(where[0]), dtype=bool), a0, alpha, omega)


def test_prediction_is_the_acceleration_of_the_point_along_the_axis() -> None:
    where, motion = scattered(), states()
    for i, (position, axis) in enumerate(zip(*where, strict=True)):
        expected = rb.acceleration_at(position, *motion) @ axis
        np.testing.assert_allclose(readings(where, *motion)[:, i], expected, rtol=1e-12, atol=1e-9)


def test_rate_sensors_read_omega_along_the_axis() -> None:
    positions, axes = scattered()
    a0, alpha, omega = states()
    got = rb.predict(positions, axes, np.zeros(len(axes), dtype=bool), a0, alpha, omega)
    np.testing.assert_allclose(got, omega @ axes.T, rtol=1e-14)


def test_jacobian_of_the_centripetal_term_is_its_finite_difference() -> None:
    where = scattered()
    omega = states()[2]
    jacobian = rb.centripetal_jacobian(*where, omega)
    for j, step in enumerate(1e-3 * np.eye(3)):  # the term is quadratic: central differences are exact
        difference = (rb.centripetal(*where, omega + step) - rb.centripetal(*where, omega - step)) / 2e-3
        np.testing.assert_allclose(jacobian[:, :, j], difference, atol=1e-9)


def test_readings_do_not_depend_on_how_the_body_frame_is_turned() -> None:
    positions, axes = scattered()
    motion = states()
    turn = Rotation.from_rotvec([0.4, -1.1, 0.7]).as_matrix()
    turned = (positions @ turn.T, axes @ turn.T)
    np.testing.assert_allclose(
        readings(turned, *(v @ turn.T for v in motion)), readings((positions, axes), *motion), atol=1e-9
    )


def test_readings_do_not_depend_on_where_the_origin_is() -> None:
    positions, axes = scattered()
    a0, alpha, omega = states()
    moved = np.array([0.02, -0.15, 0.3])
    at_moved = rb.acceleration_at(moved, a0, alpha, omega)
    np.testing.assert_allclose(
        readings((positions - moved, axes), at_moved, alpha, omega),
        readings((positions, axes), a0, alpha, omega),
        atol=1e-9,
    )


def test_product_matrix_gives_the_centripetal_term() -> None:
    where = scattered()
    omega = states()[2]
    x, y, z = omega.T
    products = np.stack([x * x, y * y, z * z, y * z, z * x, x * y], axis=1)
    np.testing.assert_allclose(products @ rb.product_matrix(*where).T, rb.centripetal(*where, omega), atol=1e-10)


@pytest.mark.parametrize("arms", [(R, R, R), (0.05, 0.06, 0.07), (-0.03, 0.08, 0.05)])
def test_product_free_alpha_of_the_nine_channel_array_is_padgaonkars(
    arms: tuple[float, float, float],
) -> None:
    found = rb.product_free_alpha(*naap(*arms))
    np.testing.assert_allclose(found, nap.alpha_rows(np.array(arms)), atol=1e-9 / min(map(abs, arms)))


@pytest.mark.parametrize("where", [naap(), triaxes(0 * X, R * X, R * Y, R * Z), scattered(24)])
def test_product_free_alpha_is_alpha_whatever_omega_and_the_origin(where: Geometry) -> None:
    a0, alpha, omega = states()
    for positions in (where[0], where[0] + [0.02, -0.15, 0.3]):
        rows = rb.product_free_alpha(positions, where[1])
        got = readings((positions, where[1]), a0, alpha, omega) @ rows.T
        np.testing.assert_allclose(got, alpha, atol=1e-7)


def test_product_free_alpha_has_the_least_noise_of_its_kind() -> None:
    where = triaxes(0 * X, R * X, R * Y, R * Z)
    rows = rb.product_free_alpha(*where)
    free = rb.parity(np.hstack([rb.design(*where), rb.product_matrix(*where)]))
    np.testing.assert_allclose(rows @ free.T, 0.0, atol=1e-10)  # nothing in it that serves neither condition


@pytest.mark.parametrize(
    ("where", "told"),
    [
        (six(), r"6 accelerometers, \[H Q\] of rank 6, leak 1"),
        (triaxes(0 * X, R * X, R * Y), r"9 accelerometers, \[H Q\] of rank 9"),
        (triaxes(0 * X, R * X), "6 accelerometers, H of rank 5"),
        (geometry((R * X, Y)), "1 accelerometer, H of rank 1"),
        ((np.zeros((0, 3)), np.zeros((0, 3))), "0 accelerometers, H of rank 0"),
    ],
)
def test_geometry_without_product_free_alpha_is_told_with_its_rank(where: Geometry, told: str) -> None:
    with pytest.raises(EstimationError, match=told):
        rb.product_free_alpha(*where)


def test_leak_lets_seismic_masses_sit_off_the_ideal_points() -> None:
    positions, axes = naap()
    positions = positions + np.random.default_rng(8).normal(0, 5e-4, positions.shape)
    with pytest.raises(EstimationError, match="leak"):
        rb.product_free_alpha(positions, axes)
    rows = rb.product_free_alpha(positions, axes, leak=0.05)
    np.testing.assert_allclose(rows @ rb.design(positions, axes), np.hstack([np.zeros((3, 3)), np.eye(3)]), atol=1e-9)
    assert np.abs(rows @ rb.product_matrix(positions, axes)).max() < 0.05


@pytest.mark.parametrize("where", [naap(), naap(0.05, 0.06, 0.07), scattered(), six(), triaxes(0 * X, R * X)])
def test_parity_rows_annihilate_the_design(where: Geometry) -> None:
    design = rb.design(*where)
    rows = rb.parity(design)
    assert len(rows) == len(design) - np.linalg.matrix_rank(design)
    np.testing.assert_allclose(rows @ design, 0.0, atol=1e-14)
    np.testing.assert_allclose(rows @ rows.T, np.eye(len(rows)), atol=1e-13)


def test_parity_of_the_nine_channel_array_is_its_three_constraints() -> None:
    arms = np.array([0.05, 0.06, 0.07])
    rows, parity = nap.product_rows(arms), rb.parity(rb.design(*naap(*arms)))
    np.testing.assert_allclose(rows @ parity.T @ parity, rows, atol=1e-12)


@pytest.mark.parametrize(
    ("where", "constant"),
    [(naap(), np.sqrt(5 / 6)), (six(), np.sqrt(2)), (triaxes(0 * X, R * X, R * Y, R * Z), 0.837)],
)
def test_noise_of_least_squares_alpha(where: Geometry, constant: float) -> None:
    """METHODS.md 4: sd α in σ/r, the noisiest of the three components."""
    noise = np.linalg.norm(np.linalg.pinv(rb.design(*where))[3:], axis=1) * R
    assert noise.max() == pytest.approx(constant, abs=5e-4)


def test_noise_of_product_free_alpha_is_one() -> None:
    np.testing.assert_allclose(np.linalg.norm(rb.product_free_alpha(*naap()), axis=1) * R, 1.0, rtol=1e-12)


def test_leverage_and_bound_of_the_nine_channel_array() -> None:
    """METHODS.md 3 and 7.8: detection 4/9 and 5/18, bound of a missing channel √(5/4) and √(13/5)."""
    design = rb.design(*naap())
    np.testing.assert_allclose(1.0 - rb.leverage(design), [4 / 9] * 3 + [5 / 18] * 6, rtol=1e-12)
    np.testing.assert_allclose(
        rb.missing_channel_bound(design), [np.sqrt(5 / 4)] * 3 + [np.sqrt(13 / 5)] * 6, rtol=1e-12
    )


def test_leverage_is_the_diagonal_of_the_hat_matrix_and_sums_to_the_rank() -> None:
    design = rb.design(*scattered())
    leverage = rb.leverage(design)
    np.testing.assert_allclose(leverage, np.diag(design @ np.linalg.pinv(design)), atol=1e-12)
    assert leverage.sum() == pytest.approx(6.0)


def test_nothing_checks_the_channels_of_a_six_accelerometer_array() -> None:
    design = rb.design(*six())
    assert rb.parity(design).shape == (0, 6)
    np.testing.assert_allclose(rb.leverage(design), 1.0)
    assert np.isinf(rb.missing_channel_bound(design)).all()
