"""LightWare's protocol, against the simulated sensor."""

from __future__ import annotations

import struct

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from companion.flight.sensors.decoders.lightware_protocol import LightwareDecoder, encode, requests
from companion.flight.sensors.decoders.lightware_stream import LightwareStream
from companion.flight.sensors.returns import Returns
from params import Parameters
from sitl.sensors.sf45 import Sf45, frame

FRAMES = st.lists(st.tuples(st.integers(20, 5000), st.integers(-17000, 17000)), min_size=1, max_size=8)


def sent(readings: list[tuple[int, int]]) -> bytes:
    return b"".join(frame(44, struct.pack("<hh", *reading)) for reading in readings)


@given(FRAMES, st.integers(1, 20))
def test_readings_come_out_as_they_were_sent_in_pieces_of_any_size(
    readings: list[tuple[int, int]], size: int
) -> None:
    data = sent(readings)
    decoder = LightwareDecoder()
    points = np.concatenate([decoder.feed(data[k : k + size])[0] for k in range(0, len(data), size)])
    distance_cm = np.hypot(points[:, 0], points[:, 1]) * 100
    clockwise = -np.degrees(np.arctan2(points[:, 1], points[:, 0])) * 100
    np.testing.assert_allclose(distance_cm, [d for d, _ in readings], rtol=1e-5)
    np.testing.assert_allclose(clockwise, [a for _, a in readings], atol=0.1)
    assert decoder.counters.returns == len(readings)


@given(FRAMES, st.integers(0, 10_000), st.integers(0, 7))
def test_a_flipped_bit_costs_its_frame_and_at_most_the_next(
    readings: list[tuple[int, int]], at: int, bit: int
) -> None:
    data = bytearray(sent(readings)) + sent([(100, 0)] * 120)
    data[at % (len(data) - 1200)] ^= 1 << bit
    decoder = LightwareDecoder()
    points, _ = decoder.feed(bytes(data))
    assert len(readings) + 120 - len(points) <= 8  # a length of up to 64 bytes is waited for
    assert set(np.round(np.hypot(points[:, 0], points[:, 1]) * 100).astype(int)) <= {
        100,
        *(d for d, _ in readings),
    }


@given(st.binary(max_size=300))
def test_garbage_is_skipped(data: bytes) -> None:
    decoder = LightwareDecoder()
    decoder.feed(data)
    decoder.feed(bytes(1100))
    assert len(decoder.feed(sent([(250, 0)]))[0]) <= 1


@pytest.mark.parametrize("cm", [-100, 0])
def test_what_did_not_come_back_is_no_return(cm: int) -> None:
    decoder = LightwareDecoder()
    assert not len(decoder.feed(sent([(cm, 0)]))[0])
    assert decoder.counters.no_return == 1


def test_points_are_numbered_among_all_readings_of_their_piece() -> None:
    decoder = LightwareDecoder()
    piece = sent([(-100, 0), (250, 0)]) + encode(66, b"\x0c") + sent([(0, 0), (300, 0)])
    for _ in range(2):
        points, numbers = decoder.feed(piece)
        assert points[:, 0].tolist() == [2.5, 3.0]
        assert numbers.tolist() == [1, 3]


@pytest.mark.parametrize("seen", [range(5), range(15, 20), (0, 19), range(20)])
def test_readings_without_a_return_are_dated_with_the_others(seen: range | tuple[int, ...]) -> None:
    """A thousand a second in pieces of twenty, of which some came back."""
    ms, batches = 1_000_000, list[Returns]()
    stream = LightwareStream(Parameters(lidar_delay_ms=0.0), batches.append)
    piece = sent([(1000 if k in seen else -100, 0) for k in range(20)])
    for arrival_ns in range(10**12, 10**12 + 3_000 * ms, 20 * ms):
        stream.add_packet(piece, "", arrival_ns)
        stream.flush(arrival_ns)
    assert ((batches[-1].stamp_ns - arrival_ns) // ms).tolist() == [k - 19 for k in seen]


def test_pieces_without_any_return_keep_the_dates_of_the_next_apart() -> None:
    ms, batches = 1_000_000, list[Returns]()
    stream = LightwareStream(Parameters(lidar_delay_ms=0.0), batches.append)
    for arrival_ms, cm in ((100, 1000), (115, -100), (120, 1000)):
        stream.add_packet(sent([(cm, 0)] * 5), "", arrival_ms * ms)
        stream.flush(arrival_ms * ms)
    assert len(batches) == 2
    assert (batches[1].stamp_ns // ms).tolist() == [116, 117, 118, 119, 120]


def test_a_rangefinder_without_an_angle_looks_ahead() -> None:
    points, _ = LightwareDecoder().feed(frame(44, struct.pack("<h", 250)))
    np.testing.assert_allclose(points, [[2.5, 0, 0]])


def test_the_requests_make_the_sensor_scan_and_stream() -> None:
    sensor = Sf45(np.random.default_rng(1), scanning=False)
    answers = sensor.receive(b"\xaa garbage" + b"".join(requests()))
    assert sensor.streaming
    assert sensor.scanning
    assert (sensor.rate, sensor.fields) == (12, 0x101)
    assert answers.startswith(encode(66, b"\x0c"))
