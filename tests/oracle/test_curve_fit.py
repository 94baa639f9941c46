"""The kernel's curve against NumPy's least squares."""

from __future__ import annotations

import numpy as np
import pytest

from slz.kernels.lines.curve_fit import FIELDS, SAG, USUAL_SAG, USUAL_SAG_SD, fit_returns


@pytest.mark.parametrize("seed", range(20))
def test_the_curve_is_that_of_least_squares(seed: int) -> None:
    rng = np.random.default_rng(seed)
    n, turn = int(rng.integers(6, 60)), rng.uniform(0, np.pi)
    way, sag = np.array([np.cos(turn), np.sin(turn)]), rng.uniform(0.001, 0.01)
    s = rng.uniform(-20, 20, n)
    sigma = rng.uniform(0.03, 0.2, n)
    aside = rng.normal(0, sigma)
    level = s[:, None] * way + aside[:, None] * [-way[1], way[0]] + rng.uniform(-900, 900, 2)
    points = np.column_stack([level, 12 + 0.05 * s + sag * s * s + rng.normal(0, sigma)])
    curve = np.empty(FIELDS)
    assert fit_returns(np.column_stack([points, sigma]), np.arange(n), curve)
    weight = sigma**-2
    place = weight @ level / weight.sum()
    _, axes = np.linalg.eigh(((level - place) * weight[:, None]).T @ (level - place))
    along = axes[:, 1] * np.sign(axes[:, 1] @ curve[2:4])
    np.testing.assert_allclose(curve[:2], place, atol=1e-6)
    np.testing.assert_allclose(curve[2:4], along, atol=1e-9)
    t = (level - place) @ along
    design = np.vstack([np.column_stack([np.ones(n), t, t * t]) / sigma[:, None], [0, 0, 1 / USUAL_SAG_SD]])
    right = np.append(points[:, 2] / sigma, USUAL_SAG / USUAL_SAG_SD)
    expected, *_ = np.linalg.lstsq(design, right, rcond=None)
    if expected[2] > 0:
        np.testing.assert_allclose(curve[4:7], expected, rtol=1e-5, atol=1e-6)
    else:
        assert curve[SAG] == 0


def test_returns_at_one_place_make_no_curve() -> None:
    curve = np.empty(FIELDS)
    assert not fit_returns(np.ones((5, 4)), np.arange(5), curve)
