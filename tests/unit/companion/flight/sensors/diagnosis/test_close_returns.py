"""Dirt on the window against ground as near as that."""

from __future__ import annotations

import numpy as np
import pytest

from companion.flight.sensors.diagnosis import picture_faults
from companion.flight.sensors.diagnosis.close_returns import CloseReturns
from companion.flight.sensors.diagnosis.return_picture import LINES, SECTORS, Picture
from companion.flight.sensors.diagnosis.stream_look import StreamLook
from companion.flight.sensors.returns import RawReturns

NEAR_M = 0.3


def look_at(range_m: np.ndarray[tuple[int], np.dtype[np.float64]]) -> StreamLook:
    """Return a look at ranges over the azimuth, one a degree; NaN is no return."""
    picture = Picture(NEAR_M)
    azimuth = np.repeat(np.radians(np.arange(360) + 0.5), 70)
    across = np.repeat(range_m, 70)
    xyz = np.column_stack([across * np.cos(azimuth), across * np.sin(azimuth), 0 * across])
    xyz = xyz[np.isfinite(across)].astype(np.float32)
    n = len(xyz)
    bytes_of = np.ones(n, np.uint8)
    picture.add(RawReturns(xyz, np.zeros(n, np.int64), bytes_of, bytes_of, bytes_of, bytes_of))
    picture.look()
    counts = dict.fromkeys(StreamLook.__slots__, 0)
    more = {"azimuth_packets": np.zeros(0, np.int64), "seen": picture.seen, "near": picture.near}
    return StreamLook(**counts | more | {"close": picture.close, "lines": np.zeros(LINES, np.int64)})


def ground(height_m: float, beyond_m: float = 60.0) -> np.ndarray[tuple[int], np.dtype[np.float64]]:
    """Return the ranges of a head that turns about a level axis above level ground, azimuth 0 down."""
    down = np.cos(np.radians(np.arange(360) + 0.5))
    with np.errstate(divide="ignore"):
        range_m = np.where(down > 0, height_m / down, np.nan)
    return np.where((range_m < beyond_m) & (range_m > 0.1), range_m, np.nan)


def flown(*heights_m: float) -> CloseReturns:
    close = CloseReturns()
    for height_m in heights_m:
        for _ in range(45):
            close.add(look_at(ground(height_m)))
    return close


def soiled(range_m: np.ndarray[tuple[int], np.dtype[np.float64]]) -> StreamLook:
    dirty = range_m.copy()
    dirty[20:60] = 0.15
    return look_at(dirty)


@pytest.mark.parametrize("height_m", [0.12, 0.2, 0.25, 0.29])
def test_the_ground_at_a_landing_is_no_dirt_and_what_it_hides_no_cover(height_m: float) -> None:
    close = flown(20.0, 5.0, 1.0)
    usual = look_at(ground(1.0)).seen.astype(float)
    for landed in (ground(height_m), np.where(ground(height_m) < 0.2, np.nan, ground(height_m))):
        look = look_at(landed)
        assert picture_faults.dirty_window(look, close) is None
        assert picture_faults.covered_sector(look, usual, close) is None


@pytest.mark.parametrize("height_m", [0.2, 0.28])
def test_the_ground_before_the_start_is_no_dirt(height_m: float) -> None:
    assert picture_faults.dirty_window(look_at(ground(height_m)), flown(height_m)) is None


def test_on_the_ground_there_may_be_none_but_near_returns_and_in_the_air_dirt_is_named_again() -> None:
    close, landed, air = flown(20.0, 1.0), look_at(ground(0.2)), ground(20.0)
    assert picture_faults.dirty_window(landed, close) is None
    only_near = look_at(np.where(ground(0.2) < 0.25, ground(0.2), np.nan))
    close.add(only_near)
    assert picture_faults.dirty_window(only_near, close) is None
    for _ in range(5):
        close.add(look_at(air))
    assert picture_faults.dirty_window(soiled(air), close) is not None


def test_dirt_in_the_air_is_named_by_its_azimuths() -> None:
    why = picture_faults.dirty_window(soiled(ground(20.0)), flown(20.0))
    assert why is not None
    assert why.text == "LiDAR window dirty: 20 to 60 deg"


def test_dirt_from_the_beginning_is_named_where_nothing_else_is_near() -> None:
    close = CloseReturns()
    close.add(soiled(ground(20.0)))
    assert picture_faults.dirty_window(soiled(ground(20.0)), close) is not None


def test_dirt_that_comes_is_named_beside_parts_of_the_vehicle_that_are_always_there() -> None:
    legs = ground(20.0)
    legs[70:75] = 0.5
    close = CloseReturns()
    for _ in range(20):
        close.add(look_at(legs))
    assert picture_faults.dirty_window(look_at(legs), close) is None
    assert picture_faults.dirty_window(soiled(legs), close) is not None


def test_a_cover_in_the_air_is_named() -> None:
    covered = ground(20.0)
    covered[0:40] = np.nan
    usual = look_at(ground(20.0)).seen.astype(float)
    why = picture_faults.covered_sector(look_at(covered), usual, flown(20.0))
    assert why is not None
    assert len(usual) == SECTORS
    assert "0 to 40" in why.text
