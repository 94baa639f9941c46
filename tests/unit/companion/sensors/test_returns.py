"""What a batch of returns refuses."""

from __future__ import annotations

import numpy as np
import pytest

from companion.sensors.returns import Returns, join


def batch(n: int) -> Returns:
    return Returns(np.ones((n, 3), np.float32), np.arange(n, dtype=np.int64), np.zeros(n, np.uint8))


@pytest.mark.parametrize(
    ("xyz", "stamps", "intensity"),
    [
        (np.ones((2, 3)), np.zeros(2, np.int64), np.zeros(2, np.uint8)),
        (np.ones((3, 3), np.float32), np.zeros(2, np.int64), np.zeros(2, np.uint8)),
        (np.ones((2, 2), np.float32), np.zeros(2, np.int64), np.zeros(2, np.uint8)),
        (np.ones((2, 3), np.float32), np.zeros(2), np.zeros(2, np.uint8)),
        (np.ones((2, 3), np.float32), np.zeros(2, np.int64), np.zeros(3, np.uint8)),
        (np.ones((4, 3), np.float32)[::2], np.zeros(2, np.int64), np.zeros(2, np.uint8)),
    ],
)
def test_arrays_that_do_not_fit_are_refused(xyz: object, stamps: object, intensity: object) -> None:
    with pytest.raises(ValueError, match="must be"):
        Returns(xyz, stamps, intensity)  # type: ignore[arg-type]


def test_nobody_changes_returns_later() -> None:
    with pytest.raises(ValueError, match="read-only"):
        batch(2).xyz_sensor_m[0, 0] = 5


def test_join_keeps_the_order() -> None:
    joined = join([batch(2), batch(3)])
    assert joined.stamp_ns.tolist() == [0, 1, 0, 1, 2]
