"""Inertial samples of a LiDAR: shape, plausibility, clock."""

from __future__ import annotations

import numpy as np
import pytest

from companion.flight.sensors.imu_samples import ImuSamples


def samples(rate: float = 0.1, force: float = 9.8) -> ImuSamples:
    return ImuSamples(np.array([5, 10]), np.full((2, 3), rate), np.full((2, 3), force))


def test_another_clock_changes_stamps_alone() -> None:
    shifted = samples().shifted(1000)
    assert shifted.stamp_ns.tolist() == [1005, 1010]
    assert shifted.rate_rads is not None
    np.testing.assert_array_equal(shifted.rate_rads, samples().rate_rads)
    assert len(shifted) == 2


@pytest.mark.parametrize(
    ("rate", "force", "plausible"),
    [
        (34.9, 313.0, True),
        (80.0, 9.8, False),
        (0.1, 700.0, False),
        (np.nan, 9.8, False),
        (0.0, np.inf, False),
    ],
)
def test_more_than_twice_the_range_is_not_plausible(rate: float, force: float, plausible: bool) -> None:
    assert samples(rate, force).is_plausible == plausible


def test_a_wrong_shape_is_named() -> None:
    with pytest.raises(ValueError, match="rate_rads"):
        ImuSamples(np.array([5]), np.zeros((2, 3)), np.zeros((1, 3)))


def test_arrays_are_read_only() -> None:
    with pytest.raises(ValueError, match="read-only"):
        samples().rate_rads[0, 0] = 1
