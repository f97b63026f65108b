"""Constants of the equal-arm NAAP and of other layouts, and growth of a fed-back error of ω (METHODS 1.3, 4, 7.8)."""

from __future__ import annotations

from typing import Final

import numpy as np

from nineaudit.array import FloatArray
from nineaudit.physics import nap, rigid_body
from nineaudit.rig import parse_rig, preset_text
from nineaudit.selftest.published import Published

_ARM: Final = 0.05
_DIRECTIONS: Final = 20_000
_SOURCE: Final = "constants, METHODS 7.8"
_EXACT: Final = 1e-9
_ROUNDING: Final = "an algebraic identity: rounding of the arithmetic"
_PRINTED: Final = "half of the last printed digit"
Geometry = tuple[FloatArray, FloatArray]


def checks() -> list[Published]:
    """Noise of α, shares of a fault that can be seen, bounds of a missing channel, growth of errors."""
    return [*_noise(), *_shares(), *_rebuilt(), *_growth()]


def _of_preset(preset: str, arms: tuple[float, ...] | None = None, less: str | None = None) -> Geometry:
    """Positions and axes of the accelerometers; `arms` in mm, `less` one channel."""
    array = parse_rig(preset_text(preset, arms)).array
    kept = [i for i, s in enumerate(array.sensors) if s.kind == "accelerometer" and s.channel != less]
    return array.positions[kept], array.axes[kept]


def _noise() -> list[Published]:
    """sd α over σ/r: the longest row of K = H⁺, α part, or of L (METHODS 4)."""

    def squares(preset: str) -> float:
        rows = np.linalg.pinv(rigid_body.design(*_of_preset(preset)))[3:]
        return float(np.linalg.norm(rows, axis=1).max() * _ARM)

    free = rigid_body.product_free_alpha(*_of_preset("naap-3222"))
    padgaonkar = float(np.linalg.norm(free, axis=1).max() * _ARM)
    alpha = "sd α over σ/r"
    return [
        _identity(f"{alpha}, NAAP, least squares", "√(5/6)", squares("naap-3222"), np.sqrt(5 / 6)),
        _identity(f"{alpha}, NAAP, Padgaonkar", 1.0, padgaonkar, 1.0),
        Published(_SOURCE, f"{alpha}, 3-2-1", 1.414, squares("3-2-1"), 1.414, 5e-4, _PRINTED),
        Published(_SOURCE, f"{alpha}, 12 accelerometers", 0.837, squares("triax-4"), 0.837, 5e-4, _PRINTED),
    ]


def _shares() -> list[Published]:
    """λ₀ over Σe²/σ² is 1 − h_kk; a missing channel is known to √(h/(1−h)) (METHODS 3, 4)."""
    design = rigid_body.design(*_of_preset("naap-3222"))
    seen, bound = 1.0 - rigid_body.leverage(design), rigid_body.missing_channel_bound(design)
    centre, arm = nap.CHANNELS.index("a0x"), nap.CHANNELS.index("a1y")
    return [
        _identity("share of an arm channel's fault that is seen", "5/18", seen[arm], 5 / 18),
        _identity("share of a centre channel's fault that is seen", "4/9", seen[centre], 4 / 9),
        _identity("bound of a missing arm channel over σ", "√(13/5)", bound[arm], np.sqrt(13 / 5)),
        _identity("bound of a missing centre channel over σ", "√(5/4)", bound[centre], np.sqrt(5 / 4)),
    ]


def _rebuilt() -> list[Published]:
    """Noise of the closed forms over σ, ω ≈ 0 (METHODS 1.1, 4)."""
    arms = np.full(3, _ARM)
    return [
        _identity("closed form of an arm channel, noise over σ", "√3", nap.noise_gain("a1y", arms), np.sqrt(3.0)),
        _identity("closed form of a centre channel, noise over σ", "√1.5", nap.noise_gain("a0x", arms), np.sqrt(1.5)),
    ]


def _identity(quantity: str, printed: float | str, ours: float, expected: float) -> Published:
    return Published(_SOURCE, quantity, printed, float(ours), float(expected), _EXACT, _ROUNDING)


def growth(where: Geometry, rows: FloatArray | None = None) -> float:
    """Growth of δω per rad turned, the fastest over all directions of a constant rotation.

    α = K (y − q(ω)) integrated forward with an error of the ω that is fed back:

        dδω/dt = −K ∂q/∂ω(ω) δω,    K the α rows of H⁺, or `rows`                    (METHODS 1.3)

    For ω = |ω| u it is the largest real part of the eigenvalues of −K ∂q/∂ω(u).
    """
    k = np.linalg.pinv(rigid_body.design(*where))[3:] if rows is None else rows
    feedback = -k @ rigid_body.centripetal_jacobian(*where, _sphere(_DIRECTIONS))
    return float(np.linalg.eigvals(feedback).real.max())


def _sphere(count: int) -> FloatArray:
    """(count+6,3) directions: a Fibonacci lattice, about √(4π/count) apart, and the axes."""
    i = np.arange(count) + 0.5
    height, turn = 1.0 - 2.0 * i / count, np.pi * (1.0 + np.sqrt(5.0)) * i
    ring = np.sqrt(1.0 - height**2)
    return np.vstack([np.column_stack([ring * np.cos(turn), ring * np.sin(turn), height]), np.eye(3), -np.eye(3)])


def _growth() -> list[Published]:
    source, naap = "stability, METHODS 1.3", _of_preset("naap-3222")
    less = [growth(_of_preset("naap-3222", (50.0, 55.0, 60.0), c)) for c in nap.CHANNELS]
    alem = _of_preset("triax-3", (76.2, 101.6, 127.0))
    free = growth(naap, nap.alpha_rows(np.full(3, _ARM)))
    spacing = "half of the last printed digit, and the square of the spacing of the directions that are tried"
    limit = 5e-3 + 4 * np.pi / _DIRECTIONS
    per_rad = "growth of a fed-back error per rad"
    return [
        Published(source, f"{per_rad}, 3-2-1", 1.0, growth(_of_preset("3-2-1")), 1.0, 0.05, _PRINTED),
        Published(source, f"{per_rad}, NAAP, least squares", 0.47, growth(naap), 0.47, limit, spacing),
        Published(source, f"{per_rad}, NAAP less one, least", 0.49, min(less), 0.49, limit, spacing),
        Published(source, f"{per_rad}, NAAP less one, most", 0.89, max(less), 0.89, limit, spacing),
        Published(source, f"{per_rad}, triaxes at 3, 4, 5 in", 0.53, growth(alem), 0.53, limit, spacing),
        Published(source, f"{per_rad}, Padgaonkar's α", 0.0, free, 0.0, _EXACT, _ROUNDING),
    ]
