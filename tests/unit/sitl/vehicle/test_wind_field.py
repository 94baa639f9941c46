"""True wind: direction, profile over height, and gusts."""

import math

import numpy as np
import pytest

from sitl.vehicle.wind_field import GUST_TAU_S, WindField, wind_profile

DT_S = 0.05


def field(seed: int = 1, **how: float) -> WindField:
    return WindField(np.random.default_rng(seed), **how)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("from_deg", "towards"), [(0.0, (0, -1)), (90.0, (-1, 0)), (180.0, (0, 1)), (270.0, (1, 0))]
)
def test_it_blows_away_from_where_it_comes(from_deg: float, towards: tuple[float, float]) -> None:
    mean = field(mean_ms=5.0, from_deg=from_deg).mean_enu_ms
    np.testing.assert_allclose(mean, [5.0 * towards[0], 5.0 * towards[1], 0.0], atol=1e-9)


def test_the_stated_mean_is_that_ten_metres_over_the_ground() -> None:
    calm = field(mean_ms=8.0, from_deg=270.0, gust_ms=0.0)
    assert calm.advance(DT_S, 10.0)[0] == pytest.approx(8.0)
    assert (
        calm.advance(DT_S, 2.0)[0] == pytest.approx(8.0 * wind_profile(2.0)) == pytest.approx(5.8, abs=0.01)
    )


def test_wind_is_less_near_the_ground_and_none_on_it() -> None:
    shares = [wind_profile(height) for height in (-1.0, 0.0, 0.5, 2.0, 10.0, 30.0, 100.0, 500.0)]
    assert shares[:2] == [0.0, 0.0]
    assert shares == sorted(shares)
    assert shares[3] == pytest.approx(math.log(1 + 2 / 0.03) / math.log(1 + 10 / 0.03))
    assert shares[5] == pytest.approx(1.19, abs=0.01)
    assert shares[6] == shares[7]


def test_gusts_have_the_stated_deviation_and_a_third_of_the_mean_by_default() -> None:
    for how, deviation in (({"gust_ms": 2.0}, 2.0), ({}, 3.0)):
        blowing = field(mean_ms=9.0, from_deg=0.0, **how)
        seen = np.array([blowing.advance(DT_S, 10.0) for _ in range(round(2000 * GUST_TAU_S / DT_S))])
        assert np.std(seen[:, :2], axis=0) == pytest.approx([deviation] * 2, rel=0.1)
        assert np.std(seen[:, 2]) == pytest.approx(0.3 * deviation, rel=0.1)


def test_a_given_direction_leaves_the_gusts_of_a_seed_as_they_are() -> None:
    drawn, given = field(mean_ms=6.0), field(mean_ms=6.0, from_deg=120.0)
    gusts = [f.advance(DT_S, 10.0) - f.mean_enu_ms for f in (drawn, given)]
    np.testing.assert_allclose(gusts[0], gusts[1])
