"""Geodetic coordinates of one point against pymap3d."""

from __future__ import annotations

import numpy as np
import pymap3d
import pytest

from sitl.world.geodetic import geodetic_of


@pytest.mark.parametrize(
    "origin", [(47.4, 8.5, 488.0), (-35.4, 149.2, 584.0), (0.0, 179.0, 0.0), (78.2, -15.6, 9000.0)]
)
@pytest.mark.parametrize("reach_m", [0.0, 100.0, 20_000.0])
def test_it_is_that_of_pymap3d_to_a_micrometre(origin: tuple[float, float, float], reach_m: float) -> None:
    for enu in np.random.default_rng(1).uniform(-reach_m, reach_m, (20, 3)):
        found, expected = geodetic_of(tuple(enu), origin), pymap3d.enu2geodetic(*enu, *origin)
        np.testing.assert_allclose(found[:2], expected[:2], rtol=0, atol=1e-11)
        assert found[2] == pytest.approx(float(expected[2]), abs=1e-6)
        back = pymap3d.geodetic2enu(*found, *origin)
        np.testing.assert_allclose(back, enu, atol=1e-6)
