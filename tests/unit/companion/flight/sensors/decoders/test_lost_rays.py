"""Rays without a return: their directions, against the manuals' angles and the simulator's pattern."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from companion.flight.sensors.decoders.livox_decoder import LivoxDecoder
from companion.flight.sensors.decoders.livox_scan_pattern import ScanPattern, reconstruct_directions
from companion.flight.sensors.decoders.ouster_decoder import OusterDecoder
from companion.flight.sensors.decoders.velodyne_decoder import VelodyneDecoder
from companion.flight.sensors.returns import RawReturns, join_raw
from sitl.sensors.mid360_pattern import directions
from tests.unit.companion.flight.sensors import ouster_packets, velodyne_packets
from tests.unit.companion.flight.sensors.ouster_packets import ouster_packet
from tests.unit.companion.flight.sensors.packets import Point, points_packet
from tests.unit.companion.flight.sensors.velodyne_packets import DUAL, VLP16, VLP32C, velodyne_packet

F64 = NDArray[np.float64]
VLP16_DEG = (-15, 1, -13, 3, -11, 5, -9, 7, -7, 9, -5, 11, -3, 13, -1, 15)
PERIOD_NS = 5_000  # between two pulses of a Mid-360
NOTHING: Point = (0, 0, 0, 0, 0)


def unit(azimuth_deg: float, elevation_deg: float) -> list[float]:
    """Return a direction forward, left, up; the azimuth grows to the right."""
    a, e = math.radians(azimuth_deg), math.radians(elevation_deg)
    return [math.cos(e) * math.cos(a), -math.cos(e) * math.sin(a), math.sin(e)]


def error_deg(found: NDArray[Any], true: NDArray[Any]) -> F64:
    return np.degrees(np.arcsin(np.minimum(1, np.linalg.norm(np.cross(found.astype(float), true), axis=1))))


def same(one: RawReturns, other: RawReturns) -> bool:
    return np.array_equal(one.lost, other.lost) and np.array_equal(one.lost_ns, other.lost_ns)


# ---- Velodyne -----------------------------------------------------------------------------------------


def test_every_fifteenth_lost_ray_of_a_vlp_16_has_the_direction_and_time_it_was_fired() -> None:
    raw = VelodyneDecoder().decode([velodyne_packet(azimuth=1000, step=40, stamp_us=5_000_000)])
    assert len(raw) == 0
    assert raw.lost_weight == 15
    expected, times = [], []
    for ray in range(0, 12 * 32, 15):
        firing, laser = divmod(ray, 16)
        elapsed_us = firing * 55.296 + laser * 2.304
        expected.append(unit(10.0 + 0.2 * elapsed_us / 55.296, VLP16_DEG[laser]))
        times.append(elapsed_us * 1000)
    np.testing.assert_allclose(raw.lost, expected, atol=1e-6)
    np.testing.assert_allclose(raw.lost_ns - raw.lost_ns[0], times, atol=1)
    assert len({laser % 16 for laser in range(0, 16 * 15, 15)}) == 16


def test_a_ray_with_one_of_two_returns_is_not_lost() -> None:
    def measure(block: int, _place: int) -> tuple[int, int]:
        return (5000, 9) if block % 4 < 2 and block % 2 == 0 else (0, 0)

    decoder = VelodyneDecoder()
    raw = decoder.decode([velodyne_packet(measure, mode=DUAL)])
    assert decoder.counters.no_return == 3 * 32
    assert len(raw.lost_ns) == math.ceil(96 / 15)


@pytest.mark.parametrize("model", [VLP16, VLP32C])
def test_lost_rays_do_not_depend_on_how_packets_are_batched(model: int) -> None:
    packets = [velodyne_packet(azimuth=480 * k, stamp_us=1327 * k, model=model) for k in range(7)]
    together, decoder = VelodyneDecoder().decode(packets), VelodyneDecoder()
    apart = join_raw([decoder.decode([packet]) for packet in packets])
    assert same(together, apart)
    np.testing.assert_allclose(np.linalg.norm(together.lost, axis=1), 1, atol=1e-6)


def test_lost_rays_do_not_change_returns() -> None:
    def half(block: int, place: int) -> tuple[int, int]:
        return (5000, 9) if (block + place) % 2 else (0, 0)

    raw = VelodyneDecoder().decode([velodyne_packet(half)])
    full = VelodyneDecoder().decode([velodyne_packet(lambda _b, _p: (5000, 9))])
    kept = np.array([(block + place) % 2 == 1 for block in range(12) for place in range(32)])
    np.testing.assert_array_equal(raw.xyz_m, full.xyz_m[kept])
    np.testing.assert_array_equal(raw.stamp_ns, full.stamp_ns[kept])
    assert velodyne_packets.nothing(0, 0) == (0, 0)


# ---- Ouster -------------------------------------------------------------------------------------------


@pytest.mark.skipif(bool(ouster_packets.MISSING), reason=ouster_packets.MISSING or "-")
def test_lost_pixels_of_an_ouster_have_the_angles_of_their_row_and_column() -> None:
    """The encoder turns clockwise seen from above, and its zero is backwards of the sensor's x axis."""
    decoder = OusterDecoder(ouster_packets.metadata())
    raw = decoder.decode([ouster_packet(column=32, stamp_ns=10**9)])
    k = int(raw.lost_weight)
    assert (len(raw), k) == (0, 5)  # 16 rows, 512 columns, 10 frames a second
    expected, times = [], []
    for pixel in range(0, 16 * 16, k):
        column, row = divmod(pixel, 16)
        expected.append(unit(180 + 360 * (32 + column) / 512, 45 - 6 * row))
        times.append(10**9 + column * 195_312)
    np.testing.assert_allclose(raw.lost, expected, atol=1e-5)
    assert raw.lost_ns.tolist() == times


@pytest.mark.skipif(bool(ouster_packets.MISSING), reason=ouster_packets.MISSING or "-")
def test_a_pixel_with_a_second_return_alone_is_not_lost() -> None:
    decoder = OusterDecoder(ouster_packets.metadata(ouster_packets.DUAL))
    packet = ouster_packet(second=lambda _r, _c: (9000, 5), profile=ouster_packets.DUAL)
    raw = decoder.decode([packet])
    assert (len(raw), len(raw.lost_ns)) == (256, 0)


# ---- Livox --------------------------------------------------------------------------------------------


def test_spherical_points_without_a_depth_keep_their_angles() -> None:
    points: list[Point] = [(0, 4500 + 100 * i, 9000, 0, 0) for i in range(23)]
    raw = LivoxDecoder().decode([points_packet(points, kind=3, interval_ns=220_000)])
    theta = np.radians([45, 56, 67])
    np.testing.assert_allclose(
        raw.lost, np.column_stack([np.zeros(3), np.sin(theta), np.cos(theta)]), atol=1e-6
    )
    assert (raw.lost_ns - raw.lost_ns[0]).tolist() == [0, 110_000, 220_000]
    assert raw.lost_weight == 11


def test_zeros_alone_have_no_direction_and_are_counted() -> None:
    decoder = LivoxDecoder()
    raw = decoder.decode([points_packet([NOTHING] * 23), points_packet([NOTHING] * 10, kind=3)])
    assert raw.lost.shape == (0, 3)
    assert (decoder.counters.no_return, decoder.counters.no_direction) == (33, 0)
    later = decoder.decode([points_packet([(1000, 2000, 3000, 9, 0)] * 40, stamp_ns=6 * 10**9)])
    assert (len(later), len(later.lost_ns), decoder.counters.no_direction) == (40, 0, 3)


def test_a_return_of_low_confidence_is_not_lost() -> None:
    decoder = LivoxDecoder()
    raw = decoder.decode([points_packet([(1000, 1000, 1000, 1, 0b10)] * 20, kind=3)])
    assert (len(raw), len(raw.lost_ns), decoder.counters.no_direction) == (0, 0, 0)


def mid360(seconds: float, share: float, first: int = 13) -> tuple[list[bytes], int]:
    """Return packets of which a share of the rays ahead gives no return, and the number of those rays."""
    rng = np.random.default_rng(5)
    index = first + np.arange(round(seconds * 1e9 / PERIOD_NS / 96) * 96)
    unit_flu = directions(index - first, index * PERIOD_NS)
    lost = (unit_flu[:, 0] > 0) & (rng.random(len(index)) < share)
    mm = np.rint(unit_flu * rng.uniform(5_000, 40_000, (len(index), 1))).astype(int)
    mm[lost] = 0
    packets = [
        points_packet(
            [(x, y, z, 9, 0) for x, y, z in mm[k : k + 96].tolist()],
            stamp_ns=int(index[k]) * PERIOD_NS,
            interval_ns=95 * PERIOD_NS,
            count=k // 96,
        )
        for k in range(0, len(index), 96)
    ]
    return packets, int(lost.sum())


@pytest.mark.parametrize("share", [0.5, 0.9, 1.0])
@pytest.mark.parametrize("together", [21, 42])
def test_directions_of_zeros_are_reconstructed_whole_sectors_too(share: float, together: int) -> None:
    """A batch of 10 or 20 ms cuts sectors in two: their rays wait for the returns of the next one."""
    packets, n_lost = mid360(0.4, share)
    decoder = LivoxDecoder()
    raw = join_raw([decoder.decode(packets[k : k + together]) for k in range(0, len(packets), together)])
    n = -(-n_lost // 11)
    assert 0.985 * n <= len(raw.lost) <= n - decoder.counters.no_direction
    index = raw.lost_ns // PERIOD_NS
    error = error_deg(raw.lost, directions(index - 13, raw.lost_ns))
    assert np.median(error) < 0.1
    assert np.percentile(error, 95) < 0.7


@pytest.mark.parametrize("share", [0.5, 0.9])
def test_reconstructed_directions_are_within_half_a_degree(share: float) -> None:
    rng = np.random.default_rng(2)
    index = np.arange(20_000)
    true, stamp_ns, ring = (
        directions(index, index * PERIOD_NS),
        index * PERIOD_NS,
        (index % 4).astype(np.uint8),
    )
    lost = (true[:, 1] > 0) & (rng.random(len(index)) < share)
    xyz = (true[~lost] * rng.uniform(5, 40, (np.count_nonzero(~lost), 1))).astype(np.float32)
    found = reconstruct_directions(xyz, stamp_ns[~lost], ring[~lost], stamp_ns[lost], ring[lost])
    known = np.isfinite(found[:, 0])
    assert known.mean() > 0.99
    error = error_deg(found[known], true[lost][known])
    assert np.median(error) < 0.05
    assert np.percentile(error, 95) < 0.3
    assert error.max() < 2
    shuffled = rng.permutation(len(xyz))
    again = reconstruct_directions(
        xyz[shuffled], stamp_ns[~lost][shuffled], ring[~lost][shuffled], stamp_ns[lost], ring[lost]
    )
    np.testing.assert_array_equal(again, found)


def test_returns_that_follow_no_pattern_give_no_direction() -> None:
    rng = np.random.default_rng(3)
    index = np.arange(4_000)
    true = directions(index, index * PERIOD_NS)
    xyz = (true + rng.normal(0, 0.2, true.shape)).astype(np.float32) * 20
    ring, lost = (index % 4).astype(np.uint8), index % 5 == 0
    found = reconstruct_directions(
        xyz[~lost], index[~lost] * PERIOD_NS, ring[~lost], index[lost] * PERIOD_NS, ring[lost]
    )
    assert np.isnan(found).all()
    still = np.tile(np.float32([5, 0, 0]), (4_000, 1))
    found = reconstruct_directions(
        still[~lost], index[~lost] * PERIOD_NS, ring[~lost], index[lost] * PERIOD_NS, ring[lost]
    )
    assert np.isnan(found).all()


def test_a_ray_far_from_any_return_has_no_direction() -> None:
    index = np.arange(8_000)
    true, ring = directions(index, index * PERIOD_NS), (index % 4).astype(np.uint8)
    gap = (index > 3_000) & (index <= 3_880)  # 4.4 ms, 0.8 turns
    stamp_ns = index * PERIOD_NS
    found = reconstruct_directions(
        (true[~gap] * 20).astype(np.float32), stamp_ns[~gap], ring[~gap], stamp_ns[gap], ring[gap]
    )
    unknown = np.isnan(found[:, 0])
    assert unknown[:200].all()
    assert unknown[-200:].all()
    assert not unknown[400:480].any()


def test_rays_in_another_order_have_the_same_directions_and_an_old_clock_is_forgotten() -> None:
    index = np.arange(8_000)
    true, stamp_ns, ring = (
        directions(index, index * PERIOD_NS),
        index * PERIOD_NS,
        (index % 4).astype(np.uint8),
    )
    lost = index % 3 == 0
    returns = (true[~lost] * 20).astype(np.float32), stamp_ns[~lost], ring[~lost]
    found = reconstruct_directions(*returns, stamp_ns[lost], ring[lost])
    back = reconstruct_directions(*returns, stamp_ns[lost][::-1].copy(), ring[lost][::-1].copy())
    np.testing.assert_array_equal(back[::-1], found)
    pattern, nowhere = ScanPattern(), np.full((int(lost.sum()), 3), np.nan, np.float32)
    hour_ns = 3_600 * 10**9
    pattern.direct(
        returns[0], returns[1] + hour_ns, returns[2], nowhere, stamp_ns[lost] + hour_ns, ring[lost]
    )
    for _ in range(2):
        again, _, _ = pattern.direct(*returns, nowhere, stamp_ns[lost], ring[lost])
    assert len(again) > 0.95 * len(nowhere)
    assert pattern.waiting < 0.05 * len(nowhere)
