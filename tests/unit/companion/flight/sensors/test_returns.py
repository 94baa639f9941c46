"""Refusals of a batch of returns."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from companion.flight.sensors.returns import RawReturns, Returns, join, join_raw, nothing, thinning

LOST = {"lost": np.array([[0, 0, -1], [1, 0, 0]], np.float32), "lost_ns": np.array([7, 9])}


def columns(n: int) -> dict[str, Any]:
    counts = {name: np.arange(1, n + 1, dtype=np.uint8) for name in ("intensity", "ring", "echo", "echoes")}
    return {"xyz_sensor_m": np.ones((n, 3), np.float32), "stamp_ns": np.arange(n, dtype=np.int64), **counts}


def batch(n: int) -> Returns:
    return Returns(**columns(n))


@pytest.mark.parametrize(
    "wrong",
    [
        {"xyz_sensor_m": np.ones((2, 3))},
        {"xyz_sensor_m": np.ones((3, 3), np.float32)},
        {"xyz_sensor_m": np.ones((2, 2), np.float32)},
        {"xyz_sensor_m": np.ones((4, 3), np.float32)[::2]},
        {"stamp_ns": np.zeros(2)},
        {"intensity": np.zeros(3, np.uint8)},
        {"ring": np.zeros(2)},
        {"echo": np.zeros(1, np.uint8)},
        {"echoes": np.zeros(4, np.uint8)[::2]},
        {"intensity": np.zeros(2)},
        {"lost": np.zeros((1, 3), np.float32)},
        {"lost": np.zeros((2, 3)), "lost_ns": np.zeros(2, np.int64)},
        {"lost_ns": np.zeros((1, 1), np.int64)},
    ],
)
def test_arrays_that_do_not_fit_are_refused(wrong: dict[str, Any]) -> None:
    with pytest.raises(ValueError, match="must be"):
        Returns(**(columns(2) | wrong))


def test_nobody_changes_returns_later() -> None:
    with pytest.raises(ValueError, match="read-only"):
        batch(2).xyz_sensor_m[0, 0] = 5


def test_join_keeps_the_order_of_every_column() -> None:
    joined = join([batch(2), batch(3)])
    assert joined.stamp_ns.tolist() == [0, 1, 0, 1, 2]
    for name in ("intensity", "ring", "echo", "echoes"):
        assert getattr(joined, name).tolist() == [1, 2, 1, 2, 3]


def test_a_part_keeps_the_order_of_every_column() -> None:
    part = batch(4).select(np.array([True, False, False, True]))
    assert [part.stamp_ns.tolist(), part.ring.tolist(), part.echo.tolist()] == [[0, 3], [1, 4], [1, 4]]
    assert batch(4).select(slice(1, None, 2)).intensity.tolist() == [2, 4]


def test_joined_returns_bear_the_least_pitch_of_any_and_so_does_a_part_of_them() -> None:
    steady = RawReturns(*columns(2).values(), most_pitch_rad=0.2).shifted(0)
    joined = join([batch(2), steady, batch(1)])
    assert joined.most_pitch_rad == joined.select(slice(0, 1)).most_pitch_rad == 0.2
    assert batch(2).most_pitch_rad == np.inf


def test_plain_returns_have_neither_intensity_nor_number() -> None:
    plain = Returns.plain(np.ones((2, 3), np.float32), np.zeros(2, np.int64))
    assert np.isnan(plain.intensity).all()
    assert (plain.ring.tolist(), plain.echo.tolist(), plain.echoes.tolist()) == ([0, 0], [0, 0], [0, 0])
    assert not plain.has_attributes
    assert batch(2).has_attributes


def test_another_clock_changes_nothing_but_the_stamps() -> None:
    xyz, stamps, *rest = columns(2).values()
    returns = RawReturns(xyz, stamps, *rest).shifted(10**18)
    assert returns.stamp_ns.tolist() == [10**18, 10**18 + 1]
    assert [returns.intensity, returns.ring, returns.echo, returns.echoes] == rest


def test_a_selection_keeps_all_lost_rays() -> None:
    returns = Returns(**columns(4), **LOST, lost_weight=11.0, most_pitch_rad=0.1)
    part = returns.select(slice(0, 1))
    assert (len(part), part.lost_weight, part.most_pitch_rad) == (1, 11.0, 0.1)
    np.testing.assert_array_equal(part.lost, LOST["lost"])
    assert part.lost_ns.tolist() == [7, 9]


def test_lost_rays_are_joined_and_their_stamps_shifted() -> None:
    xyz, stamps, *rest = columns(1).values()
    raw = RawReturns(xyz, stamps, *rest, **LOST, lost_weight=11.0)
    none = nothing()
    joined = join_raw([none, raw, raw])
    assert len(joined) == 2
    shifted = joined.shifted(10)
    assert shifted.lost_ns.tolist() == [17, 19, 17, 19]
    np.testing.assert_array_equal(shifted.lost, np.vstack([LOST["lost"]] * 2))
    assert shifted.lost_weight == 11.0
    assert join([shifted, batch(1)]).lost_ns.tolist() == [17, 19, 17, 19]
    assert not batch(2).lost_ns.size


def test_intensities_of_any_scale_are_joined() -> None:
    wide = replace(batch(1), intensity=np.array([40_000.0], np.float32))
    joined = join([wide, batch(1)])
    assert joined.intensity.dtype == np.float32
    assert joined.intensity.tolist() == [40_000, 1]


def test_a_ray_in_some_is_odd_and_leaves_few_enough() -> None:
    for rays_per_s in (0, 19_999, 20_001, 200_000, 289_352, 2_621_440):
        k = thinning(rays_per_s)
        assert k % 2 == 1
        assert rays_per_s / k <= 20_000
