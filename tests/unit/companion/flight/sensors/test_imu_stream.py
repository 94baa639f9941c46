"""Inertial samples in a stream of packets: clock, order, and that the points do not depend on them."""

from __future__ import annotations

import asyncio
import socket
from typing import Any

import numpy as np
import pytest

from companion.flight.recorder.journal import pack_batch, unpack_batch
from companion.flight.sensors.imu_samples import ImuSamples
from companion.flight.sensors.lidar_url import open_lidar, stream_for
from companion.flight.sensors.packet_stream import PacketStream
from companion.flight.sensors.returns import Returns
from companion.flight.sensors.sensor_registry import decoder_for
from companion.flight.sensors.udp_lidar import UdpLidar
from companion.runtime.errors import UsageError
from params import Parameters
from tests.unit.companion.flight.sensors.packets import Point, imu_packet, points_packet

MS, S = 1_000_000, 1_000_000_000
ONE: list[Point] = [(1000, 2000, -3000, 77, 0)]
ON_NS = 100 * S  # the companion's clock when the sensor's shows 0
DELAY_NS = MS


class Rig:
    """A Mid-360 whose packets arrive 1 ms after they were measured."""

    def __init__(self, **parameters: Any) -> None:
        self.order: list[Returns | ImuSamples] = []
        self.stream = PacketStream(
            decoder_for("livox"), Parameters(**parameters), self.order.append, lambda: 0
        )
        self.stream.on_imu.subscribe(self.order.append)

    @property
    def returns(self) -> list[Returns]:
        return [each for each in self.order if isinstance(each, Returns)]

    @property
    def samples(self) -> list[ImuSamples]:
        return [each for each in self.order if isinstance(each, ImuSamples)]

    def points(self, at_ns: int, host: str = "sensor") -> None:
        packet = points_packet(ONE, stamp_ns=at_ns, interval_ns=0, count=at_ns // MS % 60_000)
        self.stream.add_packet(packet, host, ON_NS + at_ns + DELAY_NS)

    def inertial(self, at_ns: int, host: str = "sensor", arrival_ns: int | None = None) -> None:
        packet = imu_packet([(0, 0, at_ns * 1e-12, 0, 0, 1)], stamp_ns=at_ns)
        self.stream.add_packet(packet, host, ON_NS + at_ns + DELAY_NS if arrival_ns is None else arrival_ns)

    def play(self, until_ns: int) -> None:
        """Send points every ms and inertial samples every 5 ms, in batches of 10 ms."""
        for at_ns in range(0, until_ns, MS):
            self.points(at_ns)
            if at_ns % (5 * MS) == 0:
                self.inertial(at_ns)
            if at_ns % (10 * MS) == 9 * MS:
                self.stream.flush(ON_NS + at_ns + DELAY_NS)

    def counted(self, name: str) -> int:
        return int(self.stream.statistics()[name] or 0)


def test_samples_are_on_the_clock_of_the_points() -> None:
    rig = Rig()
    rig.play(500 * MS)
    stamps = np.concatenate([each.stamp_ns for each in rig.samples])
    np.testing.assert_array_equal(stamps, ON_NS + DELAY_NS + np.arange(0, 500 * MS, 5 * MS))
    points = np.concatenate([each.stamp_ns for each in rig.returns])
    assert set(stamps) <= set(points)


@pytest.mark.parametrize("clock", ["free", "ptp"])
def test_samples_follow_the_same_mapping_as_the_points(clock: str) -> None:
    rig = Rig(lidar_clock=clock, lidar_delay_ms=3.0)
    rig.play(2 * S)
    points = {int(stamp) for each in rig.returns for stamp in each.stamp_ns}
    assert {int(stamp) for each in rig.samples for stamp in each.stamp_ns} <= points


def test_they_come_before_the_returns_that_arrived_with_them() -> None:
    rig = Rig()
    rig.play(20 * MS)
    assert [type(each) for each in rig.order] == [ImuSamples, ImuSamples, Returns] * 2


def test_the_returns_are_the_same_without_them() -> None:
    rig, alone = Rig(), Rig()
    rig.play(300 * MS)
    for at_ns in range(0, 300 * MS, MS):
        alone.points(at_ns)
        if at_ns % (10 * MS) == 9 * MS:
            alone.stream.flush(ON_NS + at_ns + DELAY_NS)
    assert len(rig.returns) == len(alone.returns) == 30
    for ours, theirs in zip(rig.returns, alone.returns, strict=True):
        np.testing.assert_array_equal(ours.stamp_ns, theirs.stamp_ns)
        np.testing.assert_array_equal(ours.xyz_sensor_m, theirs.xyz_sensor_m)


def test_samples_alone_do_not_keep_a_sensor_alive() -> None:
    rig = Rig()
    rig.play(20 * MS)
    alive_ns = rig.stream.last_arrival_ns
    for at_ns in range(20 * MS, 3 * S, 5 * MS):
        rig.inertial(at_ns)
        rig.stream.flush(ON_NS + at_ns + DELAY_NS)
    assert rig.stream.last_arrival_ns == alive_ns == ON_NS + 19 * MS + DELAY_NS
    assert len(rig.returns) == 2
    assert len(rig.samples) == 4 + 596


def test_samples_before_the_first_points_have_no_time() -> None:
    rig = Rig()
    rig.inertial(0)
    rig.stream.flush(ON_NS)
    assert (rig.samples, rig.counted("imu_undated"), rig.counted("foreign")) == ([], 1, 0)


def test_samples_of_another_sensor_are_not_used() -> None:
    rig = Rig()
    rig.points(0)
    rig.inertial(MS, host="another")
    rig.stream.flush(ON_NS + 5 * MS)
    assert (rig.samples, rig.counted("foreign")) == ([], 1)


def test_a_repeated_sample_is_used_once() -> None:
    rig = Rig()
    rig.points(0)
    rig.inertial(MS)
    rig.inertial(MS)
    rig.stream.flush(ON_NS + 5 * MS)
    assert (len(rig.samples), rig.counted("repeated")) == (1, 1)


@pytest.mark.parametrize("wrong_ns", [-600 * MS, 100 * MS, 3600 * S])
def test_a_sample_on_another_clock_is_dropped(wrong_ns: int) -> None:
    rig = Rig()
    rig.points(10 * S)
    rig.inertial(10 * S + wrong_ns, arrival_ns=ON_NS + 10 * S + DELAY_NS)
    rig.stream.flush(ON_NS + 11 * S)
    assert (rig.samples, rig.counted("imu_undated"), len(rig.returns)) == ([], 1, 1)


def test_a_bad_sample_spoils_no_batch() -> None:
    rig = Rig()
    rig.points(0)
    rig.stream.add_packet(imu_packet(crc=1), "sensor", ON_NS + 2 * MS)
    rig.stream.flush(ON_NS + 5 * MS)
    assert (rig.samples, len(rig.returns), rig.counted("bad_checksum")) == ([], 1, 1)


def test_samples_are_recorded_and_a_replay_gives_the_same_to_the_bit() -> None:
    rig, recorded = Rig(), []
    rig.stream.batches.subscribe(lambda batch: recorded.append(pack_batch(batch)))
    rig.play(300 * MS)
    order: list[Returns | ImuSamples] = []
    replayed = stream_for("livox", "", Parameters(), order.append, 0)
    replayed.on_imu.subscribe(order.append)
    for message in recorded:
        batch = unpack_batch(message)
        for arrival_ns, packet in batch:
            replayed.add_packet(packet, "", arrival_ns)
        replayed.flush(batch[-1][0])
    assert [type(each) for each in order] == [type(each) for each in rig.order]
    for before, after in zip(rig.order, order, strict=True):
        np.testing.assert_array_equal(before.stamp_ns, after.stamp_ns)
        if isinstance(before, ImuSamples) and isinstance(after, ImuSamples):
            np.testing.assert_array_equal(before.rate_rads, after.rate_rads)


# ---- ports ---------------------------------------------------------------------------------------------


def free_port() -> int:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


async def until_bound(port: int) -> None:
    """Wait until a port is in use."""
    for _ in range(100):
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
            try:
                probe.bind(("127.0.0.1", port))
            except OSError:
                return
        await asyncio.sleep(0)
    raise AssertionError(f"port {port} was never opened")


async def heard(url: str, port: int, imu_port: int) -> tuple[UdpLidar, list[ImuSamples]]:
    """Return the samples that a driver passes on which are sent to a port of their own."""
    lidar = open_lidar(url, Parameters(), lambda _: None)
    assert isinstance(lidar, UdpLidar)
    samples: list[ImuSamples] = []
    lidar.on_imu.subscribe(samples.append)
    running = asyncio.ensure_future(lidar.run())
    await until_bound(imu_port)
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sender:
        sender.sendto(points_packet(ONE, stamp_ns=10 * MS), ("127.0.0.1", port))
        while lidar.last_arrival_ns is None:
            await asyncio.sleep(0)
        sender.sendto(imu_packet(stamp_ns=11 * MS), ("127.0.0.1", imu_port))
        while not samples:
            await asyncio.sleep(0)
    running.cancel()
    await asyncio.gather(running, return_exceptions=True)
    return lidar, samples


def test_a_second_port_receives_the_samples() -> None:
    port, imu_port = free_port(), free_port()
    lidar, samples = asyncio.run(heard(f"livox:127.0.0.1:{port}?imu={imu_port}", port, imu_port))
    assert len(samples) == 1
    assert lidar.statistics()["imu"] == 1


def test_the_usual_port_is_as_far_away_as_the_maker_s() -> None:
    port = free_port() - 200
    asyncio.run(heard(f"livox:127.0.0.1:{port}", port, port + 100))


def test_the_points_do_not_need_the_second_port(caplog: pytest.LogCaptureFixture) -> None:
    port = free_port()

    async def scenario() -> None:
        lidar = open_lidar(f"livox:127.0.0.1:{port}?imu={taken}", Parameters(), lambda _: None)
        running = asyncio.ensure_future(lidar.run())
        await until_bound(port)
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sender:
            sender.sendto(points_packet(ONE, stamp_ns=10 * MS), ("127.0.0.1", port))
            while lidar.last_arrival_ns is None:
                await asyncio.sleep(0)
        running.cancel()
        await asyncio.gather(running, return_exceptions=True)

    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as other:
        other.bind(("127.0.0.1", 0))
        taken = other.getsockname()[1]
        asyncio.run(scenario())
    assert [f"{taken}: the port is in use" in line for line in caplog.messages if "inertial" in line] == [
        True
    ]


@pytest.mark.parametrize(
    "url",
    [
        "livox:127.0.0.1:56301?imu=0",
        "livox:127.0.0.1:56301?imu=x",
        "livox:127.0.0.1:56301?imu=",
        "livox:127.0.0.1:56301?imu=1&imu=2",
        "velodyne:127.0.0.1?imu=5",
    ],
)
def test_a_wrong_port_is_one_clear_line(url: str) -> None:
    with pytest.raises(UsageError, match="imu=") as error:
        open_lidar(url, Parameters(), print)
    assert "\n" not in str(error.value)


def test_a_port_stands_beside_other_options() -> None:
    lidar = open_lidar("livox:0.0.0.0:56301?sensor=192.168.1.100&imu=5000", Parameters(), print)
    assert isinstance(lidar, UdpLidar)
    assert lidar.session is not None
    with pytest.raises(UsageError, match="none.json"):
        open_lidar("ouster:0.0.0.0?meta=none.json&imu=5000", Parameters(), print)


# Inertial samples of a LiDAR: shape, plausibility, clock.


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
