"""Registration of a window to the map, robust to standing and moving objects."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

import params
from slz import SAFE, UNSAFE, LocalFrame, Pipeline, Window

FRAME = LocalFrame(47.0, 8.0, 400.0)
SENSOR = np.array([0.0, 0.0, 20.0])


def hilly(seed: int, n: int = 20_000) -> NDArray[np.float64]:
    rng = np.random.default_rng(seed)
    xy = rng.uniform(-12, 12, (n, 2))
    z = 0.08 * xy[:, 0] + 0.5 * np.sin(xy[:, 1] / 5) + rng.normal(0, 0.02, n)
    return np.column_stack([xy, z])


def tilted(
    points: NDArray[np.float64], up_m: float, east: float = 0.0, north: float = 0.0
) -> NDArray[np.float64]:
    return points + np.column_stack(
        [np.zeros((len(points), 2)), up_m + east * points[:, 0] + north * points[:, 1]]
    )


def pipeline(*settings: str) -> Pipeline:
    own = [
        "zone_m=60",
        "angle_noise_deg=0",
        "min_boundary_points=10",
        "safe_slope_deg=20",
        "gear=none",
        *settings,
    ]
    return Pipeline(params.load("quadcopter", own), (0.0, 0.0))


def fly(pipe: Pipeline, *clouds: NDArray[np.float64]) -> None:
    for second, cloud in enumerate(clouds):
        stamps = second * 1_000_000_000 + np.linspace(0, 9e8, len(cloud)).astype(np.int64)
        pipe.process(Window(cloud, stamps, SENSOR, FRAME, int(stamps[0]), int(stamps[-1])))


def heights(pipe: Pipeline) -> NDArray[np.float32]:
    maps = pipe.maps()
    assert maps is not None
    return maps.height_m


def largest_relief_m(pipe: Pipeline) -> float:
    maps = pipe.maps()
    assert maps is not None
    return float(np.nanmax(maps.relief_m))


@pytest.mark.parametrize(
    ("up", "east", "north"), [(0.2, 0, 0), (-0.3, 0.01, -0.008), (0.0, -0.015, 0.01), (0.0, 0.04, 0.02)]
)
def test_drift_and_tilt_leave_no_step(up: float, east: float, north: float) -> None:
    still, moved, loose = pipeline(), pipeline(), pipeline("register_m=0")
    fly(still, *(hilly(seed) for seed in range(4)))
    drifting = [tilted(hilly(seed), up * seed / 3, east * seed / 3, north * seed / 3) for seed in range(4)]
    fly(moved, *drifting)
    fly(loose, *drifting)
    assert largest_relief_m(moved) < largest_relief_m(still) + 0.03 < largest_relief_m(loose)


def test_heights_follow_the_newest_window() -> None:
    pipe = pipeline()
    fly(pipe, *(tilted(hilly(seed), 0.1 * seed) for seed in range(6)))
    reference = pipeline()
    fly(reference, tilted(hilly(9), 0.5))
    error = heights(pipe)[40:80, 40:80] - heights(reference)[40:80, 40:80]
    assert abs(np.nanmedian(error)) < 0.01


def test_a_car_that_covers_a_third_of_the_view_is_seen_and_does_not_lift_the_map() -> None:
    pipe = pipeline()
    cloud = hilly(1)
    cloud[cloud[:, 0] > 4, 2] += 1.5
    fly(pipe, hilly(0), cloud)
    maps = pipe.maps()
    assert maps is not None

    def state(east: float, north: float) -> int:
        row, col = maps.grid.index(east, north)
        return int(maps.state[row - maps.box.row0, col - maps.box.col0])

    assert state(7, 0) == UNSAFE
    assert state(-5, 0) == SAFE
    row, col = maps.grid.index(-5, 0)
    assert maps.height_m[row - maps.box.row0, col - maps.box.col0] == pytest.approx(-0.4, abs=0.05)


def test_a_jump_greater_than_the_limit_is_not_followed() -> None:
    pipe = pipeline("register_m=0.3")
    fly(pipe, hilly(0), tilted(hilly(1), 1.0))
    assert largest_relief_m(pipe) > 0.9


def test_a_sensor_that_turned_in_its_mount_is_not_followed() -> None:
    pipe = pipeline()
    fly(pipe, hilly(0), tilted(hilly(1), 0.0, np.tan(np.radians(5))))
    assert largest_relief_m(pipe) > 0.4


def test_a_stored_cloud_without_a_sensor_is_taken_as_it_is() -> None:
    pipe = pipeline()
    for second in range(2):
        cloud = tilted(hilly(second), 0.2 * second)
        stamps = np.full(len(cloud), second * 1_000_000_000)
        pipe.process(Window(cloud, stamps, np.full(3, np.nan), FRAME, int(stamps[0]), int(stamps[0])))
    assert largest_relief_m(pipe) > 0.2
