"""UDP drivers on real sockets and simulated time."""

from __future__ import annotations

import asyncio
import errno
import socket
from collections.abc import Awaitable, Callable, Iterator
from typing import Any

import pytest

from companion.flight.sensors.decoders.livox_session import LivoxSession
from companion.flight.sensors.lidar_url import open_lidar
from companion.flight.sensors.returns import Returns
from companion.flight.sensors.udp_lidar import UdpLidar
from companion.runtime.errors import CompanionError, UsageError
from companion.runtime.lockstep_loop import CLOCK_OFFSET_NS, LockstepLoop
from params import Parameters
from tests.unit.companion.flight.sensors.packets import Point, points_packet

MS = 1_000_000
ONE: list[Point] = [(1000, 2000, -3000, 77, 0)]
Scenario = Callable[[UdpLidar, socket.socket, list[Returns]], Awaitable[None]]


@pytest.fixture
def port() -> int:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


@pytest.fixture
def play(port: int) -> Iterator[Callable[..., None]]:
    """Run a scenario beside a driver, on a clock that goes on by a millisecond whenever nothing is to do."""
    clock = [0]

    def advance() -> int:
        clock[0] += MS
        return clock[0]

    loop = LockstepLoop(advance)
    sender = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    sender.connect(("127.0.0.1", port))

    async def both(scenario: Scenario, host: str) -> None:
        batches: list[Returns] = []
        driver = open_lidar(f"livox:{host}:{port}", Parameters(), batches.append)
        running = asyncio.ensure_future(driver.run())
        await asyncio.sleep(0.002)
        try:
            await scenario(driver, sender, batches)
        finally:
            running.cancel()
            await asyncio.gather(running, return_exceptions=True)

    yield lambda scenario, host="127.0.0.1": loop.run_until_complete(both(scenario, host))
    sender.close()
    loop.close()


@pytest.mark.parametrize(
    ("url", "says"),
    [
        ("livox:0.0.0.0", "port"),
        ("livox:0.0.0.0:0", "port"),
        ("livox:0.0.0.0:65536", "port"),
        ("livox:0.0.0.0:x", "port"),
        ("livox:0.0.0.0:²", "port"),
        ("livox:", "port"),
        ("", "livox:HOST:PORT"),
        ("velodyne:0.0.0.0:0", "port"),
        ("velodyne:0.0.0.0:x", "port"),
        ("cloud.laz", "livox:HOST:PORT"),
        ("livox:255.255.255.255:56301", "use 0.0.0.0"),
    ],
)
def test_a_wrong_url_is_one_clear_line(url: str, says: str) -> None:
    with pytest.raises(UsageError, match=says) as error:
        open_lidar(url, Parameters(), print)
    assert "\n" not in str(error.value)


def test_a_port_in_use_is_one_clear_line(port: int) -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as other:
        other.bind(("127.0.0.1", port))
        with pytest.raises(UsageError, match=f"{port}.*in use"):
            asyncio.run(open_lidar(f"livox:127.0.0.1:{port}", Parameters(), print).run())


def bound(url: str) -> tuple[str, int]:
    """Return the address that a driver binds its socket to."""
    asked: list[tuple[str, int]] = []

    class Refusing(socket.socket):
        def bind(self, address: Any) -> None:
            asked.append(address)
            raise OSError(errno.EACCES, "refused")

    with pytest.MonkeyPatch.context() as patch:
        driver = open_lidar(url, Parameters(), print)

        async def run() -> None:
            patch.setattr(socket, "socket", Refusing)  # from here on: the loop has sockets of its own
            with pytest.raises(UsageError):
                await driver.run()

        asyncio.run(run())
    (address,) = asked
    return address


@pytest.mark.parametrize(
    ("url", "address"),
    [
        ("velodyne:192.0.2.1:4000", ("192.0.2.1", 4000)),
        ("velodyne:192.0.2.1", ("192.0.2.1", 2368)),
        ("velodyne:192.0.2.1:", ("192.0.2.1", 2368)),
        ("velodyne::4000", ("0.0.0.0", 4000)),
        ("velodyne:", ("0.0.0.0", 2368)),
    ],
)
def test_a_maker_s_own_port_may_be_left_out(url: str, address: tuple[str, int]) -> None:
    assert bound(url) == address


def test_a_host_may_be_left_out(port: int) -> None:
    assert bound(f"livox::{port}") == ("0.0.0.0", port)


def test_an_address_that_is_not_here_is_one_clear_line(port: int) -> None:
    with pytest.raises(UsageError, match="192\\.0\\.2\\.1.*not the sensor's"):
        asyncio.run(open_lidar(f"livox:192.0.2.1:{port}", Parameters(), print).run())


def test_packets_of_ten_milliseconds_come_as_one_batch_on_the_companion_clock(
    play: Callable[[Scenario], None],
) -> None:
    async def scenario(driver: UdpLidar, sender: socket.socket, batches: list[Returns]) -> None:
        for i in range(5):
            sender.send(points_packet(ONE * 2, stamp_ns=50_000 * MS + i * MS, interval_ns=MS // 2, count=i))
            await asyncio.sleep(0.001)
        assert not batches
        await asyncio.sleep(0.02)
        (batch,) = batches
        assert len(batch) == 10
        age_ns = round(asyncio.get_running_loop().time() * 1e9) - batch.stamp_ns
        assert (batch.stamp_ns > CLOCK_OFFSET_NS).all()
        assert (age_ns > 15 * MS).all()
        assert (age_ns < 40 * MS).all()
        assert driver.statistics()["packets"] == 5

    play(scenario)


def test_many_packets_do_not_wait_for_the_timer(play: Callable[[Scenario], None]) -> None:
    async def scenario(driver: UdpLidar, sender: socket.socket, batches: list[Returns]) -> None:
        for i in range(64):
            sender.send(points_packet(ONE, stamp_ns=50_000 * MS + i * 1000, count=i))
        before = asyncio.get_running_loop().time()
        while not batches:
            await asyncio.sleep(0.001)
        assert asyncio.get_running_loop().time() - before < 0.009
        assert len(batches[0]) == 64

    play(scenario)


def test_garbage_neither_stops_the_driver_nor_turns_its_clock(play: Callable[[Scenario], None]) -> None:
    async def scenario(driver: UdpLidar, sender: socket.socket, batches: list[Returns]) -> None:
        sender.send(points_packet(ONE, stamp_ns=50_000 * MS))
        await asyncio.sleep(0.02)
        sender.send(b"")
        sender.send(b"nonsense")
        sender.send(points_packet(ONE, stamp_ns=90_000_000 * MS, crc=1))
        await asyncio.sleep(0.02)
        sender.send(points_packet(ONE, stamp_ns=50_040 * MS, count=1))
        await asyncio.sleep(0.02)
        statistics = driver.statistics()
        assert [len(batch) for batch in batches] == [1, 1]
        assert (statistics["malformed"], statistics["bad_checksum"]) == (2, 1)
        assert statistics["clock_resets"] == 0
        assert int(batches[1].stamp_ns[0] - batches[0].stamp_ns[0]) == pytest.approx(40 * MS, abs=2 * MS)

    play(scenario)


def test_packets_before_a_restart_of_the_sensor_keep_the_old_offset(play: Callable[[Scenario], None]) -> None:
    async def scenario(driver: UdpLidar, sender: socket.socket, batches: list[Returns]) -> None:
        sender.send(points_packet(ONE, stamp_ns=50_000 * MS))
        sender.send(points_packet(ONE, stamp_ns=100 * MS))
        await asyncio.sleep(0.03)
        assert driver.statistics()["clock_resets"] == 1
        spans = [int(batch.stamp_ns[0]) for batch in batches]
        assert len(spans) == 2
        assert abs(spans[1] - spans[0]) < 5 * MS

    play(scenario)


def test_a_second_sensor_is_heard_only_when_the_first_is_silent(play: Callable[[Scenario], None]) -> None:
    async def scenario(driver: UdpLidar, sender: socket.socket, batches: list[Returns]) -> None:
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as second:
            second.bind(("127.0.0.2", 0))
            second.connect(sender.getpeername())
            sender.send(points_packet(ONE, stamp_ns=50_000 * MS))
            await asyncio.sleep(0.02)
            second.send(points_packet(ONE * 2, stamp_ns=900 * MS))
            await asyncio.sleep(0.02)
            assert [len(batch) for batch in batches] == [1]
            assert driver.statistics()["foreign"] == 1
            await asyncio.sleep(1.1)
            second.send(points_packet(ONE * 2, stamp_ns=2000 * MS))
            await asyncio.sleep(0.02)
            assert [len(batch) for batch in batches] == [1, 2]

    play(scenario)


def test_the_rate_is_that_of_the_last_second(play: Callable[[Scenario], None]) -> None:
    async def scenario(driver: UdpLidar, sender: socket.socket, batches: list[Returns]) -> None:
        for i in range(60):
            sender.send(points_packet(ONE * 20, stamp_ns=50_000 * MS + i * 20 * MS, count=i))
            await asyncio.sleep(0.02)
        assert driver.statistics()["rate_hz"] == pytest.approx(1000, rel=0.1)

    play(scenario)


def test_a_failing_receiver_ends_the_run_with_its_error(port: int) -> None:
    def fail(_: Returns) -> None:
        raise RuntimeError("pipeline is broken")

    async def scenario() -> None:
        driver = open_lidar(f"livox:127.0.0.1:{port}", Parameters(), fail)
        running = asyncio.ensure_future(driver.run())
        await asyncio.sleep(0)
        for i in range(64):
            driver.datagram_received(
                points_packet(ONE, stamp_ns=10**9 + i * 1000, count=i), ("127.0.0.1", 56300)
            )
        await running

    with pytest.raises(RuntimeError, match="pipeline is broken"):
        asyncio.run(scenario())


def opened(port: int) -> UdpLidar:
    driver = open_lidar(f"livox:127.0.0.1:{port}", Parameters(), print)
    assert isinstance(driver, UdpLidar)
    return driver


def test_of_several_faults_the_first_ends_the_run(port: int, monkeypatch: pytest.MonkeyPatch) -> None:
    async def scenario() -> None:
        driver = opened(port)
        running = asyncio.ensure_future(driver.run())
        await asyncio.sleep(0)
        faults = iter([ZeroDivisionError("first"), ZeroDivisionError("second")])

        def fail(*_: object) -> None:
            raise next(faults)

        monkeypatch.setattr(driver.stream, "add_packet", fail)
        for _ in range(2):
            driver.datagram_received(b"x", ("127.0.0.1", 56300))
        await running

    with pytest.raises(ZeroDivisionError, match="first"):
        asyncio.run(scenario())


def test_a_socket_that_fails_ends_the_run_with_its_address(port: int) -> None:
    async def scenario() -> None:
        driver = opened(port)
        running = asyncio.ensure_future(driver.run())
        await asyncio.sleep(0)
        driver.connection_lost(OSError("Network is down"))
        await running

    with pytest.raises(CompanionError, match=f"LiDAR socket 127.0.0.1:{port} failed: Network is down"):
        asyncio.run(scenario())


def test_a_session_that_cannot_be_held_ends_the_run_and_frees_the_port(port: int) -> None:
    async def scenario() -> None:
        driver = opened(port)
        driver.session = LivoxSession("255.255.255.255", port, lambda: None)
        await driver.run()

    for _ in range(2):
        with pytest.raises(
            UsageError, match=r"LiDAR at 255\.255\.255\.255: .*; is the network card set up\?"
        ):
            asyncio.run(scenario())


def test_the_sensor_that_the_url_names_is_the_one_that_is_heard() -> None:
    """Another one of the network that sends here first would be placed with this one's mount."""
    batches: list[Returns] = []
    lidar = open_lidar("livox:0.0.0.0:56301?sensor=192.168.1.100", Parameters(), batches.append)
    assert isinstance(lidar, UdpLidar)
    for k, host in enumerate(("192.168.1.77", "192.168.1.100", "192.168.1.77"), start=100):
        lidar.stream.add_packet(points_packet(ONE, stamp_ns=k * 10 * MS), host, k * 10 * MS)
    lidar.stream.flush(2000 * MS)
    assert sum(map(len, batches)) == 1
    assert lidar.statistics()["foreign"] == 2


def test_a_host_that_is_a_multicast_group_is_joined(play: Callable[..., None], port: int) -> None:
    async def scenario(driver: UdpLidar, _: socket.socket, batches: list[Returns]) -> None:
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sender:
            sender.setsockopt(socket.IPPROTO_IP, socket.IP_MULTICAST_IF, socket.inet_aton("127.0.0.1"))
            sender.sendto(points_packet(ONE, stamp_ns=5_000 * MS), ("239.1.1.5", port))
        await asyncio.sleep(0.05)
        assert driver.statistics()["packets"] == 1
        assert sum(map(len, batches)) == 1

    play(scenario, "239.1.1.5")


def test_a_broadcast_arrives_where_all_addresses_are_bound(play: Callable[..., None], port: int) -> None:
    async def scenario(driver: UdpLidar, _: socket.socket, batches: list[Returns]) -> None:
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sender:
            sender.setsockopt(socket.SOL_SOCKET, socket.SO_BROADCAST, 1)
            sender.sendto(points_packet(ONE, stamp_ns=5_000 * MS), ("127.255.255.255", port))
        await asyncio.sleep(0.05)
        assert driver.statistics()["packets"] == 1
        assert sum(map(len, batches)) == 1

    play(scenario, "0.0.0.0")
