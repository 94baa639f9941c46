"""LiDAR alone, on a vehicle that another simulator flies."""

from __future__ import annotations

import json
import math
import socket
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pymap3d
import pytest
from numpy.typing import NDArray
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from sitl import scenes
from sitl.attached.attached_lidar import AttachedLidar
from sitl.scenes import Scene
from sitl.sensors.lidar_mount import Mount
from sitl.sensors.livox_packets import CARTESIAN_32, HEADER, HEADER_BYTES
from sitl.sensors.optics import Noise
from sitl.truth.touchdown import footing
from sitl.vehicle.rigid_body import from_euler
from sitl.wire.wire import MemoryWire, Peer
from tests.unit.sitl.autopilot_messages import HOME, IN_AIR, ON_GROUND, Sender, beside_home

F64 = NDArray[np.float64]
STEP_MS = 10
RATE_HZ = 20_000


@pytest.fixture(scope="module")
def scene() -> Scene:
    return scenes.build("plain", 1)


class Bench:
    """An autopilot on a wire in memory, and the socket that the LiDAR speaks to."""

    def __init__(self, scene: Scene, origin: tuple[float, float, float] | None = None) -> None:
        self.ear = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.ear.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4 << 20)
        self.ear.bind(("127.0.0.1", 0))
        self.ear.setblocking(False)
        self.wire, self.sender = MemoryWire(), Sender()
        self.said: list[str] = []
        self.attached = AttachedLidar(
            scene,
            self.wire,
            lidar_to=self.ear.getsockname(),
            point_rate_hz=RATE_HZ,
            origin_lla=origin,
            say=self.said.append,
        )
        self.attached.lidar.sensor.noise = Noise.none()
        self.boot_ms = 40_000
        self.now_s = 0.0

    def tell(self, *frames: bytes) -> None:
        for frame in frames:
            self.wire.send(frame)
        self.attached.advance(self.now_s)

    def pose(self, up: float, quat: F64 | None = None, east: float = 0.0, step_ms: int = STEP_MS) -> None:
        """Let time pass and send a true pose."""
        self.boot_ms += step_ms
        self.now_s += step_ms / 1000
        level = np.array([1.0, 0.0, 0.0, 0.0]) if quat is None else quat
        self.tell(
            self.sender.attitude(self.boot_ms, level),
            self.sender.sim_state(beside_home(east, 0.0, up + 0.1), level),
        )

    def packets(self) -> list[bytes]:
        got = []
        while True:
            try:
                got.append(self.ear.recv(4096))
            except BlockingIOError:
                return got

    def asked(self) -> list[int]:
        """Return the numbers of the messages it asked for."""
        codec = mavlink.MAVLink(None)
        messages = codec.parse_buffer(bytearray(b"".join(self.wire.received))) or []
        return [int(m.param1) for m in messages if m.get_type() == "COMMAND_LONG"]

    def close(self) -> None:
        self.attached.close()
        self.ear.close()


@pytest.fixture
def bench(scene: Scene) -> Iterator[Bench]:
    made = Bench(scene)
    yield made
    made.close()


def points(packets: list[bytes]) -> tuple[NDArray[np.int64], F64]:
    """Return sensor stamps (n,) ns and points (n, 3) m in the sensor's frame."""
    stamps, xyz = [], []
    for packet in packets:
        interval, dots = HEADER.unpack(packet[: HEADER.size])[2:4]
        first = int.from_bytes(packet[28:36], "little")
        body = np.frombuffer(packet, CARTESIAN_32, dots, HEADER_BYTES)
        stamps.append(first + np.arange(dots) * (interval * 100 // (dots - 1)))
        xyz.append(body["xyz"] / 1000.0)
    return np.concatenate(stamps).astype(np.int64), np.concatenate(xyz)


def test_points_of_a_turning_vehicle_lie_on_the_ground(scene: Scene) -> None:
    """De-skewed with the pose of their own moments, they make a plane again; with one pose they do not."""
    x, y, _ = scene.home_enu
    z = scene.world.height_m(x, y)
    origin = tuple(float(v) for v in pymap3d.enu2geodetic(-x, -y, -z, *HOME))
    bench = Bench(scene, origin)  # type: ignore[arg-type]
    bench.tell(bench.sender.heartbeat(armed=True))

    def roll(boot_ms: float) -> float:
        return 0.15 * math.sin(2 * math.pi * boot_ms / 1000)

    for _ in range(60):
        half = roll(bench.boot_ms + STEP_MS) / 2
        bench.pose(15.0, np.array([math.cos(half), math.sin(half), 0.0, 0.0]))
    stamps, xyz = points(bench.packets())
    bench.close()
    boot_ms = 40_010 + (stamps - bench.attached.lidar.sensor.clock.offset_ns) * 1e-6
    hit = np.linalg.norm(xyz, axis=1) > 0
    body = xyz @ Mount().rotation_frd_from_sensor().T + np.array(Mount().lever_frd_m)

    def depth(at_ms: F64) -> F64:
        angle = 0.15 * np.sin(2 * np.pi * at_ms / 1000)
        out: F64 = np.sin(angle) * body[:, 1] + np.cos(angle) * body[:, 2]
        return out

    near = hit & (np.abs(body[:, 0]) < 8) & (np.abs(body[:, 1]) < 8)
    assert near.sum() > 500
    error = depth(boot_ms)[near] - 15.1  # the ground is rough by a centimetre
    assert abs(error.mean()) < 0.03
    assert error.std() < 0.015
    speed = 0.15 * 2 * math.pi * np.cos(2 * np.pi * boot_ms[near] / 1000) * body[near, 1]
    late_s = np.polyfit(speed, error, 1)[0]
    assert abs(late_s) < 1e-3
    assert np.std(depth(np.full(len(xyz), 40_100.0))[near]) > 0.1


def test_the_scene_lies_under_home_at_the_height_of_the_ground(bench: Bench, scene: Scene) -> None:
    bench.tell(bench.sender.heartbeat(), bench.sender.home((HOME[0], HOME[1], HOME[2] + 3.0)))
    bench.pose(up=0.0)
    assert bench.attached.origin_lla is not None
    east, north, up = pymap3d.geodetic2enu(*HOME, *bench.attached.origin_lla)
    x, y, _ = scene.home_enu
    assert (east, north) == pytest.approx((x, y), abs=0.02)
    # The autopilot's home is 3 m wrong; the vehicle stands on the ground.
    assert up == pytest.approx(scene.world.height_m(x, y), abs=0.01)


def test_in_flight_the_autopilot_s_home_tells_the_ground(bench: Bench, scene: Scene) -> None:
    bench.tell(bench.sender.heartbeat(armed=True), bench.sender.home())
    bench.pose(up=25.0)
    assert bench.attached.origin_lla is not None
    up = pymap3d.geodetic2enu(*HOME, *bench.attached.origin_lla)[2]
    assert up == pytest.approx(scene.world.height_m(*scene.home_enu[:2]), abs=0.01)


def test_without_a_home_it_waits_two_seconds_then_takes_the_vehicle_s_place(bench: Bench) -> None:
    bench.tell(bench.sender.heartbeat())
    bench.pose(up=0.0)
    assert not bench.attached.ready
    bench.pose(up=0.0, step_ms=2100)
    assert bench.attached.ready


def test_streams_are_asked_for_until_they_come(bench: Bench) -> None:
    bench.tell()
    assert bench.asked() == []
    bench.tell(bench.sender.heartbeat())
    first = bench.asked()
    assert mavlink.MAVLINK_MSG_ID_SIM_STATE in first
    bench.now_s += 1.5
    bench.tell()
    assert bench.asked() == first * 2
    bench.tell(bench.sender.home(), bench.sender.landed(ON_GROUND))
    bench.pose(up=0.0)
    bench.now_s += 1.5
    bench.tell()
    assert len(bench.asked()) <= 3 * len(first)


def test_a_reboot_of_the_autopilot_does_not_turn_the_sensor_s_clock_back(bench: Bench) -> None:
    bench.tell(bench.sender.heartbeat(), bench.sender.home())
    for _ in range(20):
        bench.pose(up=10.0)
    before, _ = points(bench.packets())
    origin = bench.attached.origin_lla
    bench.boot_ms = 100
    for _ in range(20):
        bench.pose(up=10.0)
    after, _ = points(bench.packets())
    assert after[0] > before[-1]
    assert bench.attached.origin_lla == origin


def test_a_new_connection_is_asked_anew(bench: Bench) -> None:
    bench.tell(bench.sender.heartbeat(), bench.sender.home(), bench.sender.landed(ON_GROUND))
    for _ in range(5):
        bench.pose(up=0.0)
    bench.wire.received.clear()
    bench.wire.peers[0] = Peer(bench.wire.received.append)
    bench.tell(bench.sender.heartbeat())
    assert mavlink.MAVLINK_MSG_ID_SIM_STATE in bench.asked()


def test_scans_of_a_gap_are_left_out(bench: Bench) -> None:
    bench.tell(bench.sender.heartbeat(), bench.sender.home())
    for _ in range(10):
        bench.pose(up=10.0)
    bench.packets()
    bench.pose(up=10.0, step_ms=5000)
    assert bench.packets() == []
    assert bench.attached.skipped_ns == pytest.approx(5e9, rel=0.01)
    bench.pose(up=10.0)
    assert bench.packets()


def test_a_program_that_was_stopped_finds_the_sensor_s_clock_where_it_was(bench: Bench) -> None:
    """What waited meanwhile was not sent late: a clock pulled by it runs wrong for half a minute."""
    bench.tell(bench.sender.heartbeat(), bench.sender.home())

    def behind_ms() -> float:
        stamps, _ = points(bench.packets())
        return (bench.now_s * 1e9 - (int(stamps[-1]) - bench.attached.lidar.sensor.clock.offset_ns)) * 1e-6

    for _ in range(100):
        bench.pose(up=10.0)
    before = behind_ms()
    advance, bench.attached.advance = bench.attached.advance, lambda now_s: False
    for _ in range(200):
        bench.pose(up=10.0)
    bench.attached.advance = advance
    bench.tell()
    bench.tell()
    for _ in range(300):
        bench.pose(up=10.0)
    assert abs(behind_ms() - before) < 3.0


def test_silence_is_said_once_and_so_is_its_end(bench: Bench) -> None:
    bench.tell(bench.sender.heartbeat(), bench.sender.home())
    bench.pose(up=0.0)
    for _ in range(3):
        bench.now_s += 4
        bench.tell()
    bench.pose(up=0.0)
    assert [line.split(":")[0] for line in bench.said] == [
        "ArduPilot, system 1",
        "no pose from memory",
        "ArduPilot, system 1",
    ]


def test_the_log_holds_the_true_touchdown(bench: Bench, tmp_path: Path, scene: Scene) -> None:
    bench.tell(bench.sender.heartbeat(), bench.sender.home(), bench.sender.landed(ON_GROUND))
    bench.pose(up=0.0)
    bench.tell(bench.sender.heartbeat(armed=True), bench.sender.landed(IN_AIR))
    for up in (0.5, 2.0, 6.0, 2.0, 0.0):
        bench.pose(up=up, east=4.0)
    bench.tell(bench.sender.landed(ON_GROUND))
    bench.pose(up=0.0, east=4.5, quat=from_euler(0.0, 0.0, np.radians(70.0)))
    assert bench.attached.origin_lla is not None
    bench.attached.log.write(tmp_path, bench.attached.origin_lla)
    flight = json.loads((tmp_path / "flight.json").read_text("utf-8"))
    assert len(flight["touchdowns"]) == 1
    assert flight["touchdown"]["e"] - scene.home_enu[0] == pytest.approx(4.5, abs=0.02)
    assert flight["touchdown"]["heading_deg"] == pytest.approx(70.0, abs=0.1)
    standing = footing(scene.world, flight["touchdown"])
    assert flight["touchdown"]["footing"] == standing._asdict()
    assert flight["takeoff"]["u"] - scene.world.height_m(*scene.home_enu[:2]) == pytest.approx(2.1, abs=0.05)


def test_a_flight_that_is_followed_from_the_air_on_has_its_touchdown(bench: Bench) -> None:
    armed = bench.sender.heartbeat(armed=True)
    bench.tell(armed, bench.sender.home(), bench.sender.landed(IN_AIR))
    for up in (6.0, 2.0, 0.0):
        bench.pose(up=up)
    bench.tell(bench.sender.landed(ON_GROUND))
    bench.pose(up=0.0, east=1.5)
    assert bench.attached.log.takeoff is None
    assert len(bench.attached.log.touchdowns) == 1


def test_the_share_of_level_ground_is_that_of_the_scene(bench: Bench) -> None:
    assert 0.05 < bench.attached.flat_share() < 0.95
