"""Packet stream of any sensor: clock jumps, repetition, order, and sensors of the wrong kind."""

from __future__ import annotations

import logging
import random
from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from companion.flight.sensors.packet_identification import identify_packet
from companion.flight.sensors.packet_stream import PacketStream
from companion.flight.sensors.returns import RawReturns, Returns
from companion.flight.sensors.sensor_registry import decoder_for
from params import Parameters
from tests.unit.companion.flight.sensors import ouster_packets
from tests.unit.companion.flight.sensors.packets import imu_packet, points_packet
from tests.unit.companion.flight.sensors.velodyne_packets import DUAL, VLP32C, only, velodyne_packet

MS, S = 1_000_000, 1_000_000_000
EPOCH_NS = 100 * S


def livox(number: int, at_ns: int) -> bytes:
    return points_packet([(1000 + number, 2, 3, 4, 0)], stamp_ns=at_ns, interval_ns=0, count=number)


def velodyne(number: int, at_ns: int) -> bytes:
    return velodyne_packet(only(0, 0, 1000 + number), stamp_us=at_ns // 1000 % 3_600_000_000)


def ouster(number: int, at_ns: int) -> bytes:
    return ouster_packets.ouster_packet(
        ouster_packets.only(0, 0, 1000 + number),
        stamp_ns=at_ns,
        column_ns=1,
        frame=number // 32,
        column=number % 32 * 16,
    )


Packet = Callable[[int, int], bytes]
"""Number and time on the sensor's clock -> a packet of one return, taken at that time."""
SENSORS: dict[str, Packet] = {"livox": livox, "velodyne": velodyne}
METADATA = {"ouster": ouster_packets.metadata()}
if not ouster_packets.MISSING:
    SENSORS["ouster"] = ouster
SLOW = settings(derandomize=True, max_examples=12, deadline=None)
kinds = pytest.mark.parametrize("kind", SENSORS)


class Rig:
    """A stream whose packets arrive 1 ms after they were measured."""

    def __init__(self, kind: str) -> None:
        self.packet = SENSORS[kind]
        self.batches: list[Returns] = []
        self.stream = PacketStream(
            decoder_for(kind, METADATA.get(kind, "")), Parameters(), self.batches.append
        )

    def send(self, number: int, at_ns: int, arrival_ns: int) -> None:
        self.stream.add_packet(self.packet(number, at_ns), "sensor", arrival_ns)

    def stamps_ns(self) -> list[int]:
        return [int(stamp) for batch in self.batches for stamp in batch.stamp_ns]

    def counted(self, name: str) -> int:
        return int(self.stream.statistics()[name] or 0)


@kinds
@pytest.mark.parametrize("jump_ns", [-1 * S, 1 * S, -3 * S, 100 * S])
def test_a_jump_of_the_sensor_s_clock_moves_no_point(kind: str, jump_ns: int) -> None:
    rig, arrivals = Rig(kind), []
    for i in range(400):
        measured_ns = EPOCH_NS + i * 5 * MS
        arrivals.append(500 * S + i * 5 * MS)
        rig.send(i, measured_ns + (jump_ns if i >= 203 else 0), arrivals[-1])
        if i % 4 == 3:
            rig.stream.flush(arrivals[-1])
    late_ns = np.array(arrivals) - np.array(rig.stamps_ns())
    assert rig.counted("clock_resets") == 1
    assert len(late_ns) == 400
    assert np.abs(late_ns).max() < 2 * MS  # the return is the first of a packet that goes on


@kinds
@SLOW
@given(seed=st.integers(0, 2**32), share=st.floats(0, 0.5))
def test_a_packet_delivered_twice_is_taken_once(kind: str, seed: int, share: float) -> None:
    rig, rng = Rig(kind), random.Random(seed)
    twice = 0
    for i in range(100):
        arrival_ns = 500 * S + i * MS
        rig.send(i, EPOCH_NS + i * MS, arrival_ns)
        if rng.random() < share:
            back = rng.randrange(min(i + 1, 10))
            twice += 1
            rig.send(i - back, EPOCH_NS + (i - back) * MS, arrival_ns + 1000)
    rig.stream.flush(600 * S)
    assert len(rig.stamps_ns()) == len(set(rig.stamps_ns())) == 100
    assert rig.counted("repeated") == twice
    assert rig.counted("clock_resets") == 0


@kinds
def test_packets_of_one_stamp_are_told_apart_and_each_is_taken_once(kind: str) -> None:
    rig = Rig(kind)
    for number, at_ms in ((0, 0), (1, 5), (2, 5), (3, 4), (1, 5), (2, 5), (3, 4), (0, 0)):
        rig.send(number, EPOCH_NS + at_ms * MS, 500 * S + 9 * MS)
    rig.stream.flush(600 * S)
    assert rig.counted("repeated") == 4
    assert len(rig.stamps_ns()) == 4


@kinds
@SLOW
@given(seed=st.integers(0, 2**32))
def test_packets_in_another_order_give_the_same_points(kind: str, seed: int) -> None:
    rng = random.Random(seed)
    order = sorted(range(60), key=lambda i: i + rng.uniform(0, 5))  # none overtakes more than five others
    clouds = []
    for sequence in (range(60), order):
        rig = Rig(kind)
        for arrival, i in enumerate(sequence):
            rig.send(i, EPOCH_NS + i * 2 * MS, 500 * S + arrival * 2 * MS)
        rig.stream.flush(600 * S)
        assert rig.counted("clock_resets") == 0
        (batch,) = rig.batches
        by_time = np.argsort(batch.stamp_ns)
        clouds.append((batch.xyz_sensor_m[by_time], np.diff(batch.stamp_ns[by_time])))
    np.testing.assert_array_equal(clouds[0][0], clouds[1][0])
    np.testing.assert_array_equal(clouds[0][1], clouds[1][1])


@kinds
@SLOW
@given(spoilt=st.lists(st.tuples(st.integers(0, 49), st.integers(0, 10**6), st.booleans()), max_size=20))
def test_truncated_and_flipped_packets_never_raise(kind: str, spoilt: list[tuple[int, int, bool]]) -> None:
    rig = Rig(kind)
    for i in range(50):
        packet = bytearray(rig.packet(i, EPOCH_NS + i * MS))
        for number, where, cut in spoilt:
            if number == i and packet:
                if cut:
                    del packet[where % len(packet) :]
                else:
                    packet[where // 8 % len(packet)] ^= 1 << where % 8
        rig.stream.add_packet(bytes(packet), "sensor", 500 * S + i * MS)
    rig.stream.flush(600 * S)
    assert all(np.isfinite(batch.xyz_sensor_m).all() for batch in rig.batches)
    assert len(rig.stamps_ns()) == rig.counted("returns")


def named() -> list[tuple[str, bytes]]:
    """Return packets of every maker with their kind."""
    return [
        ("livox", livox(0, EPOCH_NS)),
        ("livox", imu_packet()),
        ("velodyne", velodyne(0, EPOCH_NS)),
        ("velodyne", velodyne_packet(mode=DUAL, model=VLP32C)),
        ("velodyne", bytes(206) + b"$GPRMC" + bytes(300)),
        ("ouster", bytes(12_608)),
        ("ouster", b"\1\0" + bytes(24_830)),
    ]


@pytest.mark.parametrize(("kind", "packet"), named())
def test_a_packet_tells_its_maker(kind: str, packet: bytes) -> None:
    assert identify_packet(packet) == kind
    assert identify_packet(packet[:-1]) is None


@kinds
@pytest.mark.parametrize(("sender", "packet"), named())
def test_another_maker_s_sensor_is_counted_and_named_in_one_line(
    kind: str, sender: str, packet: bytes, caplog: pytest.LogCaptureFixture
) -> None:
    rig = Rig(kind)
    with caplog.at_level(logging.ERROR):
        for i in range(5):
            rig.stream.add_packet(packet, "10.0.0.9", 500 * S + i * MS)
    rig.stream.flush(501 * S)
    wrong = sender != kind
    assert rig.counted("wrong_sensor") == (5 if wrong else 0)
    assert [("10.0.0.9" in line, f"is {sender}: meant" in line) for line in caplog.messages] == (
        [(True, True)] if wrong else []
    )


class Raising:
    """A Livox decoder that raises in one of its methods at some packets."""

    def __init__(self, method: str, at: Callable[[bytes], bool]) -> None:
        self._own, self._at, self._kept = decoder_for("livox"), at, list[bytes]()
        self._method = method
        self.counters, self.kind, self.metadata = self._own.counters, "livox", ""

    def check(self, packet: bytes) -> int | None:
        self._try("check", [packet])
        return self._own.check(packet)

    def add_packet(self, packet: bytes) -> None:
        self._try("add_packet", [packet])
        self._kept.append(packet)
        self._own.add_packet(packet)

    def drain(self) -> RawReturns:
        kept, self._kept = self._kept, []
        raw = self._own.drain()
        self._try("drain", kept)
        return raw

    def __len__(self) -> int:
        return len(self._own)

    def _try(self, method: str, packets: list[bytes]) -> None:
        if method == self._method and any(map(self._at, packets)):
            raise IndexError("of a column")


METHODS = pytest.mark.parametrize("method", ["check", "add_packet", "drain"])


@METHODS
def test_packets_at_which_a_decoder_raises_are_counted_and_the_others_taken(
    method: str, caplog: pytest.LogCaptureFixture
) -> None:
    rig = Rig("livox")
    bad = {rig.packet(i, EPOCH_NS + i * MS) for i in (3, 7)}
    rig.stream = PacketStream(Raising(method, bad.__contains__), Parameters(), rig.batches.append)
    for i in range(10):
        rig.send(i, EPOCH_NS + i * MS, 500 * S + i * MS)
        rig.stream.flush(500 * S + i * MS)
    assert len(rig.stamps_ns()) == 8
    assert rig.counted("failed") == 2
    assert [record.levelname for record in caplog.records if "fails" in record.getMessage()] == ["ERROR"]
    assert "IndexError: of a column" in caplog.text
    assert rig.stream.last_arrival_ns == 500 * S + 9 * MS


@METHODS
def test_a_decoder_that_raises_at_every_packet_has_a_silent_sensor(method: str) -> None:
    rig = Rig("livox")
    first = rig.packet(0, EPOCH_NS)
    rig.stream = PacketStream(
        Raising(method, lambda packet: packet != first), Parameters(), rig.batches.append
    )
    for i in range(100):
        rig.send(i, EPOCH_NS + i * MS, 500 * S + i * MS)
        rig.stream.flush(500 * S + i * MS)
    assert rig.counted("failed") == 99
    assert rig.stream.last_arrival_ns == 500 * S


def test_returns_of_a_synchronised_sensor_have_its_own_stamps_whatever_their_way_took() -> None:
    wall_ns, batches = 1_790_000_000 * S, list[Returns]()
    parameters = Parameters(lidar_clock="ptp")
    stream = PacketStream(decoder_for("livox"), parameters, batches.append, lambda: wall_ns)
    measured = [EPOCH_NS + k * 10 * MS for k in range(20)]
    for k, at_ns in enumerate(measured):
        arrival_ns = at_ns + (2 + k % 5) * MS
        stream.add_packet(livox(k, wall_ns + at_ns), "sensor", arrival_ns)
        stream.flush(arrival_ns)
    assert [int(stamp) for batch in batches for stamp in batch.stamp_ns] == measured


def test_lost_rays_of_a_batch_without_any_return_go_with_the_next_batch() -> None:
    batches: list[Returns] = []
    stream = PacketStream(decoder_for("velodyne"), Parameters(), batches.append)
    for number in range(4):
        packet = (
            velodyne_packet(only(0, 0), stamp_us=1327 * number)
            if number == 3
            else velodyne_packet(stamp_us=1327 * number)
        )
        stream.add_packet(packet, "a", 10**9 + 1_327_000 * number)
        stream.flush(10**9 + 1_327_000 * number)
    (batch,) = batches
    assert len(batch) == 1
    assert len(batch.lost_ns) == -(-(4 * 384 - 1) // 15)
    assert np.ptp(batch.lost_ns) == pytest.approx(4 * 1_327_000, rel=0.1)
    assert abs(int(batch.lost_ns.max()) - int(batch.stamp_ns[0])) < 1_400_000
