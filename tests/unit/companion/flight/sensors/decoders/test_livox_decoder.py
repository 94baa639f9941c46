"""Livox decoder against packets built from the protocol document, and against garbage."""

from __future__ import annotations

import math
from dataclasses import asdict

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from companion.flight.sensors.decoders.livox_decoder import LivoxDecoder
from tests.unit.companion.flight.sensors.packets import Point, imu_packet, points_packet

ONE: list[Point] = [(1000, 2000, -3000, 77, 0)]


def test_millimetres_become_metres_forward_left_up() -> None:
    raw = LivoxDecoder().decode([points_packet([(1234, -5678, 9, 200, 0), (-1, 0, 0, 3, 0)])])
    np.testing.assert_allclose(raw.xyz_m, [[1.234, -5.678, 0.009], [-0.001, 0, 0]], atol=1e-6)
    assert raw.intensity.tolist() == [200, 3]
    assert raw.xyz_m.dtype == np.float32
    assert raw.stamp_ns.dtype == np.int64


def test_centimetres_keep_their_sign() -> None:
    raw = LivoxDecoder().decode([points_packet([(-32768, 32767, -1, 1, 0)], kind=2)])
    np.testing.assert_allclose(raw.xyz_m, [[-327.68, 327.67, -0.01]], atol=1e-4)


@pytest.mark.parametrize(
    ("theta_deg", "phi_deg", "direction"),
    [
        (0, 0, (0, 0, 1)),  # zenith
        (90, 0, (1, 0, 0)),  # forward
        (90, 90, (0, 1, 0)),  # left
        (180, 0, (0, 0, -1)),
        (90, 270, (0, -1, 0)),
        (67.5, 0, (math.cos(math.radians(22.5)), 0, math.sin(math.radians(22.5)))),
    ],
)
def test_spherical_points_measure_theta_from_the_zenith(
    theta_deg: float, phi_deg: float, direction: tuple[float, ...]
) -> None:
    point = (20_000, round(theta_deg * 100), round(phi_deg * 100), 9, 0)
    raw = LivoxDecoder().decode([points_packet([point], kind=3)])
    np.testing.assert_allclose(raw.xyz_m[0], np.multiply(20.0, direction), atol=1e-4)


def test_points_are_spread_from_the_stamp_over_the_interval() -> None:
    packet = points_packet(ONE * 96, stamp_ns=7_000_000_000, interval_ns=475_000)
    stamps = LivoxDecoder().decode([packet]).stamp_ns
    assert stamps[0] == 7_000_000_000
    assert stamps[-1] == pytest.approx(7_000_475_000, abs=1)
    assert set(np.diff(stamps)) == {5000}


def test_a_single_point_has_the_stamp_of_its_packet() -> None:
    assert LivoxDecoder().decode([points_packet(ONE, interval_ns=500_000)]).stamp_ns.tolist() == [
        5_000_000_000
    ]


def test_stamps_follow_the_point_when_others_before_it_are_dropped() -> None:
    packet = points_packet([(0, 0, 0, 0, 0), (1, 1, 1, 0, 0b10), *ONE], interval_ns=200_000)
    assert LivoxDecoder().decode([packet]).stamp_ns.tolist() == [5_000_200_000]


def test_the_four_lines_fire_in_turn_and_each_ray_gives_one_return() -> None:
    raw = LivoxDecoder().decode([points_packet([*ONE * 3, (0, 0, 0, 0, 0), *ONE * 2])])
    assert raw.ring.tolist() == [0, 1, 2, 0, 1]
    assert set(raw.echo) == set(raw.echoes) == {1}


def test_a_batch_equals_its_packets_one_by_one() -> None:
    rng = np.random.default_rng(3)
    packets = []
    for i in range(12):
        kind = 1 + i % 3
        high = 9_000 if kind == 3 else 30_000
        drawn = rng.integers(0, high, (1 + 7 * i, 3)).tolist()
        points: list[Point] = [(a, b, c, i, 0) for a, b, c in drawn]
        packets.append(points_packet(points, kind=kind, stamp_ns=10**9 + i * 500_000, count=i))
    together = LivoxDecoder().decode(packets)
    alone = [LivoxDecoder().decode([packet]) for packet in packets]
    for name in ("xyz_m", "stamp_ns", "intensity", "ring", "echo", "echoes"):
        np.testing.assert_array_equal(
            getattr(together, name), np.concatenate([getattr(one, name) for one in alone])
        )


def test_points_without_a_return_are_dropped_and_counted() -> None:
    decoder = LivoxDecoder()
    raw = decoder.decode([points_packet([(0, 0, 0, 0, 0), *ONE]), points_packet([(0, 45, 90, 0, 0)], kind=3)])
    assert len(raw) == 1
    assert (decoder.counters.no_return, decoder.counters.returns) == (2, 1)


@pytest.mark.parametrize("shift", [0, 2, 4])
@pytest.mark.parametrize(("level", "kept"), [(0, True), (1, True), (2, False), (3, False)])
def test_low_confidence_in_any_group_of_the_tag_drops_a_return(shift: int, level: int, kept: bool) -> None:
    decoder = LivoxDecoder()
    assert len(decoder.decode([points_packet([(1, 2, 3, 4, level << shift)])])) == kept
    assert decoder.counters.low_confidence == (not kept)


def test_the_reserved_bits_of_the_tag_say_nothing() -> None:
    assert len(LivoxDecoder().decode([points_packet([(1, 2, 3, 4, 0b11000000)])])) == 1


def test_inertial_packets_are_counted_and_give_nothing() -> None:
    decoder = LivoxDecoder()
    assert len(decoder.decode([imu_packet()])) == 0
    assert (decoder.counters.imu, decoder.counters.malformed, decoder.counters.packets) == (1, 0, 0)


@pytest.mark.parametrize(
    ("packet", "counter"),
    [
        (b"", "malformed"),
        (points_packet(ONE)[:35], "malformed"),
        (points_packet(ONE)[:-1], "malformed"),
        (points_packet(ONE) + b"\0", "malformed"),
        (points_packet(ONE, version=1), "malformed"),
        (points_packet(ONE, kind=4), "malformed"),
        (points_packet([]), "malformed"),
        (points_packet(ONE, dots=2), "malformed"),
        (points_packet(ONE, stamp_ns=2**64 - 1), "malformed"),
        (points_packet(ONE, crc=1), "bad_checksum"),
    ],
)
def test_a_bad_packet_is_counted_and_the_good_one_after_it_is_read(packet: bytes, counter: str) -> None:
    decoder = LivoxDecoder()
    assert len(decoder.decode([packet, points_packet(ONE)])) == 1
    counters = asdict(decoder.counters)
    assert counters[counter] == 1
    assert counters["malformed"] + counters["bad_checksum"] == 1


def test_every_flipped_bit_behind_the_checksum_is_found() -> None:
    packet = points_packet(ONE)
    for bit in range(28 * 8, len(packet) * 8):
        spoiled = bytearray(packet)
        spoiled[bit // 8] ^= 1 << bit % 8
        assert LivoxDecoder().check(bytes(spoiled)) is None


def test_a_packet_without_checksum_is_taken_and_counted() -> None:
    decoder = LivoxDecoder()
    assert len(decoder.decode([points_packet(ONE, crc=0)])) == 1
    assert decoder.counters.unchecked == 1


@pytest.mark.parametrize(
    ("counts", "lost"),
    [
        ([0, 1, 2, 3], 0),
        ([5, 6, 9, 10], 2),
        ([65534, 65535, 0, 1], 0),  # a counter without an end goes round
        ([65534, 1], 2),
        ([205, 206, 207, 0, 1], 0),  # a counter that begins anew in every frame
        ([206, 207, 2, 3], 2),
        ([100, 101, 103, 102, 104], 0),  # one packet overtook another
        ([100, 101, 101, 102], 0),  # sent twice by the network
    ],
)
def test_lost_packets_are_counted(counts: list[int], lost: int) -> None:
    decoder = LivoxDecoder()
    decoder.decode([points_packet(ONE, count=count) for count in counts])
    assert decoder.counters.lost_packets == lost


@given(st.lists(st.binary(max_size=80), max_size=8))
def test_garbage_never_raises(packets: list[bytes]) -> None:
    decoder = LivoxDecoder()
    assert len(decoder.decode(packets)) == 0
    assert decoder.counters.malformed + decoder.counters.bad_checksum + decoder.counters.imu == len(packets)


@settings(max_examples=200)
@given(
    kind=st.integers(0, 5),
    version=st.sampled_from([0, 0, 0, 1]),
    stamp_ns=st.integers(0, 2**64 - 1),
    interval_ns=st.integers(0, 65535).map(lambda n: n * 100),
    count=st.integers(0, 65535),
    frame=st.integers(0, 255),
    dots=st.none() | st.integers(0, 65535),
    points=st.lists(
        st.tuples(*[st.integers(0, 32767)] * 3, st.integers(0, 255), st.integers(0, 255)), max_size=6
    ),
)
def test_any_header_is_decoded_or_counted(points: list[Point], **fields: int) -> None:
    decoder = LivoxDecoder()
    raw = decoder.decode([points_packet(points, **fields)])
    c = decoder.counters
    assert c.packets + c.imu + c.malformed + c.bad_checksum == 1
    assert len(raw) == c.returns <= len(points)
    assert np.isfinite(raw.xyz_m).all()
    assert (raw.stamp_ns >= 0).all()


def test_packets_may_be_checked_together_before_they_are_taken() -> None:
    packets = [points_packet([(1000 * n, 0, 0, n, 0)], stamp_ns=10**9 * n, count=n) for n in range(1, 4)]
    decoder = LivoxDecoder()
    assert all(decoder.check(packet) for packet in packets)
    for packet in packets:
        decoder.add_packet(packet)
    raw = decoder.drain()
    assert raw.xyz_m[:, 0].tolist() == [1.0, 2.0, 3.0]
    assert raw.stamp_ns.tolist() == [10**9, 2 * 10**9, 3 * 10**9]
    assert decoder.counters.lost_packets == 0
