"""Velodyne decoder against packets built from the manual, and against garbage."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from companion.flight.sensors.decoders.velodyne_decoder import VelodyneDecoder
from tests.unit.companion.flight.sensors.velodyne_packets import (
    DUAL,
    HI_RES,
    SINGLE,
    VLP16,
    VLP32C,
    only,
    velodyne_packet,
)

HOUR_US = 3_600_000_000
PACKET_US = 1327  # 24 firings of 55.296 us
# Elevation (deg) and vertical offset (mm) of lasers 0, 1, 14, 15 of a VLP-16: user manual, section 9.3.
LASERS = {0: (-15, 11.2), 1: (1, -0.7), 14: (-1, 0.7), 15: (15, -11.2)}


@pytest.mark.parametrize(
    ("azimuth", "forward", "left"), [(0, 1, 0), (9000, 0, -1), (27000, 0, 1), (18000, -1, 0)]
)
@pytest.mark.parametrize("laser", LASERS)
def test_a_return_is_forward_left_up(laser: int, azimuth: int, forward: float, left: float) -> None:
    raw = VelodyneDecoder().decode([velodyne_packet(only(0, laser), azimuth=azimuth, step=0)])
    elevation, offset_mm = LASERS[laser]
    flat = 10.0 * math.cos(math.radians(elevation))
    up = 10.0 * math.sin(math.radians(elevation)) + offset_mm / 1000
    np.testing.assert_allclose(raw.xyz_m, [[flat * forward, flat * left, up]], atol=1e-4)
    assert raw.intensity.tolist() == [77]
    assert raw.ring.tolist() == [(elevation + 15) // 2]
    assert (raw.xyz_m.dtype, raw.stamp_ns.dtype) == (np.float32, np.int64)


def test_the_azimuth_turns_on_while_the_lasers_fire() -> None:
    """Block 3's second firing is 55.296 us after its first, half of 0.4 degrees."""
    raw = VelodyneDecoder().decode([velodyne_packet(only(3, 16), azimuth=1000, step=40)])
    assert math.degrees(math.atan2(-raw.xyz_m[0, 1], raw.xyz_m[0, 0])) == pytest.approx(11.4, abs=0.011)


@pytest.mark.parametrize(("block", "azimuth_deg"), [(3, 11.4), (5, 12.2), (8, 193.4), (11, 194.6)])
def test_a_sector_that_the_sensor_leaves_out_does_not_smear_its_neighbours(
    block: int, azimuth_deg: float
) -> None:
    """Set to leave out 180 degrees, one packet of each turn jumps: between its blocks it turns as ever."""
    packet = bytearray(velodyne_packet(only(block, 16), azimuth=1000, step=40))
    for k in range(6, 12):
        packet[100 * k + 2 : 100 * k + 4] = (19_000 + 40 * k).to_bytes(2, "little")
    raw = VelodyneDecoder().decode([bytes(packet)])
    azimuth = math.degrees(math.atan2(-raw.xyz_m[0, 1], raw.xyz_m[0, 0])) % 360
    assert azimuth == pytest.approx(azimuth_deg, abs=0.011)


@pytest.mark.parametrize(
    ("model", "mode", "block", "place", "after_ns"),
    [
        (VLP16, SINGLE, 0, 0, 0),
        (VLP16, SINGLE, 0, 5, 5 * 2304),
        (VLP16, SINGLE, 11, 31, 23 * 55_296 + 15 * 2304),
        (VLP16, DUAL, 10, 16, 11 * 55_296),
        (VLP32C, SINGLE, 11, 31, 11 * 55_296 + 15 * 2304),
        (VLP32C, SINGLE, 4, 2, 4 * 55_296 + 2304),
        (VLP32C, DUAL, 11, 3, 5 * 55_296 + 2304),
    ],
)
def test_every_laser_has_the_time_it_fired(
    model: int, mode: int, block: int, place: int, after_ns: int
) -> None:
    packet = velodyne_packet(only(block, place), stamp_us=1_234_567, model=model, mode=mode)
    raw = VelodyneDecoder().decode(
        [velodyne_packet(stamp_us=1_230_000, model=model, mode=mode)] * 3 + [packet]
    )
    assert (raw.stamp_ns % (HOUR_US * 1000)).tolist() == [1_234_567_000 + after_ns]


def test_a_long_batch_keeps_its_times_exact() -> None:
    stamps = [7_000_000 + PACKET_US * i for i in range(700)]
    raw = VelodyneDecoder().decode([velodyne_packet(only(2, 3), stamp_us=stamp) for stamp in stamps])
    after = 4 * 55_296 + 3 * 2304
    assert (raw.stamp_ns % (HOUR_US * 1000)).tolist() == [stamp * 1000 + after for stamp in stamps]


@pytest.mark.parametrize("lost", [0, 1, 1000, 1_000_000])
def test_time_goes_on_over_the_turn_of_the_hour(lost: int) -> None:
    decoder = VelodyneDecoder()
    before = decoder.decode([velodyne_packet(only(0, 0), stamp_us=HOUR_US - 700)])
    after = decoder.decode([velodyne_packet(only(0, 0), stamp_us=PACKET_US * (1 + lost) - 700)])
    assert int(after.stamp_ns[0] - before.stamp_ns[0]) == PACKET_US * (1 + lost) * 1000


def test_a_packet_overtaken_at_the_turn_of_the_hour_is_of_the_hour_before() -> None:
    decoder = VelodyneDecoder()
    raw = decoder.decode([velodyne_packet(only(0, 0), stamp_us=us) for us in (600, HOUR_US - 727)])
    assert int(raw.stamp_ns[1] - raw.stamp_ns[0]) == -1_327_000
    assert (raw.stamp_ns > 0).all()


def test_the_stamp_of_the_last_point_is_known_before_decoding() -> None:
    decoder, packet = VelodyneDecoder(), velodyne_packet(only(11, 31))
    assert decoder.check(packet) == decoder.decode([packet]).stamp_ns[0]


@pytest.mark.parametrize(
    ("last", "strongest", "echoes", "metres"),
    [
        (5000, 4000, [2, 1], [10.0, 8.0]),  # the leaf is bright, the ground behind it last
        (5000, 6000, [1, 2], [10.0, 12.0]),  # the last is the strongest: the second strongest in its place
        (5000, 5000, [1], [10.0]),
        (5000, 0, [1], [10.0]),
        (0, 4000, [1], [8.0]),
    ],
)
def test_both_returns_of_a_ray_are_numbered_by_distance(
    last: int, strongest: int, echoes: list[int], metres: list[float]
) -> None:
    def measure(block: int, place: int) -> tuple[int, int]:
        return (strongest if block % 2 else last, 9) if (block // 2, place) == (2, 1) else (0, 0)

    decoder = VelodyneDecoder()
    raw = decoder.decode([velodyne_packet(measure, mode=DUAL)])
    assert raw.echo.tolist() == echoes
    assert set(raw.echoes) == {len(echoes)}
    np.testing.assert_allclose(np.linalg.norm(raw.xyz_m, axis=1), metres, atol=0.002)
    assert (decoder.counters.returns, decoder.counters.no_return) == (len(echoes), 191)


def test_range_is_counted_in_two_millimetres_by_the_small_and_four_by_the_large() -> None:
    for model, quantum in ((VLP16, 0.002), (HI_RES, 0.002), (VLP32C, 0.004)):
        raw = VelodyneDecoder().decode([velodyne_packet(only(0, 14, 20_000), model=model)])
        assert np.linalg.norm(raw.xyz_m) == pytest.approx(20_000 * quantum, abs=0.012)


def test_rings_of_a_vlp_32c_rise_with_elevation() -> None:
    raw = VelodyneDecoder().decode([velodyne_packet(lambda b, p: (5000, 1), model=VLP32C)])
    elevation = np.arctan2(raw.xyz_m[:, 2], np.hypot(raw.xyz_m[:, 0], raw.xyz_m[:, 1]))
    lowest = [elevation[raw.ring == ring].min() for ring in range(32)]
    assert lowest == sorted(lowest)
    assert len(raw) == 384


def test_a_batch_equals_its_packets_one_by_one() -> None:
    def measure(block: int, place: int) -> tuple[int, int]:
        return (1000 + 37 * block + 11 * place if (block + place) % 3 else 0), place

    packets = [
        velodyne_packet(measure, stamp_us=9_000 + i * PACKET_US, azimuth=i * 480, mode=mode, model=model)
        for i, (mode, model) in enumerate([(SINGLE, VLP16), (DUAL, VLP16), (SINGLE, VLP32C), (DUAL, VLP16)])
    ]
    together, alone = VelodyneDecoder().decode(packets), [VelodyneDecoder().decode([p]) for p in packets]
    for name in ("xyz_m", "stamp_ns", "intensity", "ring", "echo", "echoes"):
        expected = np.concatenate([getattr(one, name) for one in alone])
        np.testing.assert_array_equal(getattr(together, name), expected)


@pytest.mark.parametrize("size", [512, 554])
def test_position_packets_are_counted_apart(size: int) -> None:
    decoder = VelodyneDecoder()
    assert len(decoder.decode([bytes(size)])) == 0
    assert (decoder.counters.position, decoder.counters.malformed, decoder.counters.packets) == (1, 0, 0)


GOOD = velodyne_packet(only(5, 5))


@pytest.mark.parametrize(
    "packet",
    [
        b"",
        GOOD[:-1],
        GOOD + b"\0",
        velodyne_packet(flag=0xDDFF),
        GOOD[:1100] + b"\0\0" + GOOD[1102:],
        GOOD[:302] + (36_000).to_bytes(2, "little") + GOOD[304:],
        velodyne_packet(mode=0x3A),
        velodyne_packet(model=0x21),
        velodyne_packet(stamp_us=HOUR_US),
    ],
)
def test_a_bad_packet_is_counted_and_the_good_one_after_it_is_read(packet: bytes) -> None:
    decoder = VelodyneDecoder()
    assert len(decoder.decode([packet, GOOD])) == 1
    assert (decoder.counters.malformed, decoder.counters.packets) == (1, 1)


@settings(derandomize=True, max_examples=60, deadline=None)
@given(size=st.integers(0, 1206), flips=st.lists(st.integers(0, 1206 * 8 - 1), max_size=8))
def test_truncated_and_flipped_packets_never_raise(size: int, flips: list[int]) -> None:
    packet = bytearray(GOOD)
    for bit in flips:
        packet[bit // 8] ^= 1 << bit % 8
    decoder = VelodyneDecoder()
    raw = decoder.decode([bytes(packet[:size]), bytes(packet)])
    c = decoder.counters
    assert c.packets + c.position + c.malformed == 2
    assert len(raw) == c.returns
    assert np.isfinite(raw.xyz_m).all()
    assert (raw.stamp_ns >= 0).all()


@pytest.mark.parametrize(
    ("steps", "lost"),
    [
        ([0, 1, 2, 3], 0),
        ([0, 1, 4, 5], 2),
        ([0, 2, 1, 3], 0),  # one overtook another
        ([0, 1, 1, 2], 0),  # sent twice by the network
        ([0, 2000], 0),  # switched off and on
        ([2000, 0, 1], 0),
    ],
)
@pytest.mark.parametrize("mode", [SINGLE, DUAL])
def test_lost_packets_are_counted_by_time(steps: list[int], lost: int, mode: int) -> None:
    decoder = VelodyneDecoder()
    period_us = 1327.104 if mode == SINGLE else 663.552
    stamps = [5_000_000 + round(step * period_us) for step in steps]
    decoder.decode([velodyne_packet(stamp_us=stamp, mode=mode) for stamp in stamps])
    assert decoder.counters.lost_packets == lost


def test_without_a_packet_there_is_nothing() -> None:
    assert len(VelodyneDecoder().drain()) == 0
