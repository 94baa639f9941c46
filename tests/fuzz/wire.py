"""Fuzz harnesses of MAVLink and sensor packets: nothing may be raised, and returns must be numbers."""

from __future__ import annotations

import functools
import hashlib
import json
import struct
import zlib
from collections.abc import Callable, Sequence
from pathlib import Path
from random import Random
from typing import Any

import numpy as np
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from companion.flight.fusion.external_odometry.external_odometry import ExternalOdometry
from companion.flight.fusion.external_odometry.odometry_input import OdometryInput
from companion.flight.fusion.external_odometry.odometry_topic import OdometryTopic
from companion.flight.fusion.pose_history import PoseHistory
from companion.flight.link.command_server import CommandReply, OperatorCommand
from companion.flight.link.link import Link
from companion.flight.link.wire.framing import message_id
from companion.flight.link.wire.signing import Signing
from companion.flight.sensors.decoders.lightware_protocol import encode as lightware_frame
from companion.flight.sensors.decoders.lightware_stream import LightwareStream
from companion.flight.sensors.decoders.livox_protocol import LivoxControl
from companion.flight.sensors.imu_samples import ImuSamples
from companion.flight.sensors.mavlink_ranges import MavlinkRanges
from companion.flight.sensors.packet_stream import PacketStream
from companion.flight.sensors.returns import Returns
from companion.flight.sensors.sensor_registry import decoder_for
from companion.flight.services.services import Services
from companion.flight.services.settings import Settings
from params import Parameters
from sitl.sensors.flash.flash_sensor import FlashSensor
from sitl.sensors.radar.radar_sensor import RadarSensor
from sitl.world.primitives import Ground, Kind
from sitl.world.world import World
from tests.fuzz.harness import Harness, Target
from tests.unit.companion.flight.fusion.external_odometry.odometry_messages import Told
from tests.unit.companion.flight.sensors import ouster_packets, velodyne_packets
from tests.unit.companion.flight.sensors.decoders.clouds import Driver
from tests.unit.companion.flight.sensors.packets import imu_packet, points_packet
from tests.unit.companion.flight.sensors.recordings import DATA

KEY = bytes(range(32))
STEP_NS = 5_000_000
HEARD = (
    "HEARTBEAT",
    "SYS_STATUS",
    "BATTERY_STATUS",
    "HOME_POSITION",
    "GLOBAL_POSITION_INT",
    "LOCAL_POSITION_NED",
    "ATTITUDE_QUATERNION",
    "EXTENDED_SYS_STATE",
    "TIMESYNC",
    "COMMAND_ACK",
    "COMMAND_LONG",
    "COMMAND_INT",
    "PARAM_REQUEST_LIST",
    "PARAM_REQUEST_READ",
    "PARAM_SET",
    "MISSION_COUNT",
    "MISSION_REQUEST",
    "MISSION_REQUEST_INT",
    "MISSION_ITEM_INT",
    "MISSION_ACK",
    "DISTANCE_SENSOR",
    "OBSTACLE_DISTANCE",
    "STATUSTEXT",
)


class FuzzedLink:
    """A link with all that listens to it, fed by hand."""

    def __init__(self, signing: Signing | None) -> None:
        parameters = Parameters(rally="on")
        settings = Settings(parameters)
        self.link = Link("udpin:127.0.0.1:14550", parameters, signing)
        self.services = Services(self.link, settings)
        self.link.on_command(self._answer)
        self.history = PoseHistory(parameters)
        self.link.inbox.on_attitude.subscribe(self.history.add_attitude)
        self.link.inbox.on_position.subscribe(self.history.add_position)
        self.link.subscribe("*", MavlinkRanges(parameters, self.link.inbox.clock, sound).on_message)
        self.now_ns = 10**12

    def _answer(self, command: OperatorCommand) -> CommandReply:
        return CommandReply.accepted() if command.params[0] == 0 else CommandReply.denied("SLZ: no")

    def __call__(self, data: bytes) -> None:
        self.now_ns += STEP_NS
        for message in self.link._codec.decode(data):
            self.link._on_message(message, self.now_ns)
        self.services.parameters.poll(self.now_ns)
        pose = self.history.latest(self.now_ns)
        if pose is not None and not np.isfinite([*pose.position_enu_m, *pose.velocity_enu_ms]).all():
            raise AssertionError(f"a pose is no number: {pose}")


def sound(returns: Returns) -> None:
    """Pass returns that a map can use: numbers, with stamps that fit."""
    if not np.isfinite(returns.xyz_sensor_m).all():
        raise AssertionError("returns that are no numbers")
    if len(returns) and not (
        -(2**62) < int(returns.stamp_ns.min()) <= int(returns.stamp_ns.max()) < 2**63 - 2**60
    ):
        raise AssertionError("stamps near the end of time")


def mavlink_frames() -> Sequence[bytes]:
    """Return a frame of each message that is heard, from the vehicle, and orders of a station."""
    vehicle, station = mavlink.MAVLink(None, srcSystem=1, srcComponent=1), mavlink.MAVLink(None, 255, 190)
    rng = Random(1)
    frames = [bytes(mavlink.MAVLink_heartbeat_message(2, 3, 217, 4, 4, 3).pack(vehicle))]
    for kind in mavlink.mavlink_map.values():
        if kind.msgname in HEARD:
            for sender in (vehicle, station):
                raw = rng.randbytes(kind.unpacker.size)
                frames.append(framed(kind.id, raw, sender.srcSystem, sender.srcComponent, rng))
    return frames


def framed(number: int, payload: bytes, system: int, component: int, rng: Random) -> bytes:
    """Return a MAVLink 2 frame with its checksum."""
    head = bytes([len(payload), 0, 0, rng.randrange(256), system, component]) + number.to_bytes(3, "little")
    crc = mavlink.x25crc(head + payload + bytes([mavlink.mavlink_map[number].crc_extra])).crc
    return b"\xfd" + head + payload + struct.pack("<H", crc)


def mended_frame(data: bytes, rng: Random) -> bytes:
    """Return a frame of a message that is heard, with these bytes as what it tells; often aimed at us."""
    number = int.from_bytes(data[7:10], "little")
    if number not in mavlink.mavlink_map or rng.random() < 0.2:
        number = rng.choice(_HEARD_NUMBERS)
    kind = mavlink.mavlink_map[number]
    payload = bytearray(data[10 : 10 + kind.unpacker.size]) or bytearray(1)
    for name, value in (("target_system", 1), ("target_component", 191)):
        if name in kind.fieldnames and rng.random() < 0.8:
            at = kind.ordered_fieldnames.index(name)
            if (place := _offset(kind, at)) < len(payload):
                payload[place] = value
    sender = rng.choice(((1, 1), (1, 1), (255, 190), (rng.randrange(256), rng.randrange(256))))
    return framed(number, bytes(payload), *sender, rng)


def signed_frame(data: bytes, rng: Random) -> bytes:
    """Return the same with a signature that holds, most of the time with a time that goes on."""
    frame = bytearray(mended_frame(data, rng))
    frame[2] = 1
    crc = mavlink.x25crc(bytes(frame[1:-2]) + bytes([mavlink.mavlink_map[message_id(frame)].crc_extra])).crc
    frame[-2:] = struct.pack("<H", crc)
    _ticks[0] += rng.choice((1, 1, 1, 0, 2**20))
    frame += bytes([rng.choice((0, 0, 0, rng.randrange(256)))]) + (_ticks[0] % 2**48).to_bytes(6, "little")
    return bytes(frame + hashlib.sha256(KEY + frame).digest()[:6])


_ticks = [10**12]


@functools.cache
def _offset(kind: Any, index: int) -> int:
    """Return where a field begins in the payload."""
    sizes = {"char": 1, "uint8_t": 1, "int8_t": 1, "uint16_t": 2, "int16_t": 2, "uint32_t": 4, "int32_t": 4}
    sizes |= {"float": 4, "uint64_t": 8, "int64_t": 8, "double": 8}
    at = 0
    for name, length in zip(kind.ordered_fieldnames[:index], kind.array_lengths[:index], strict=True):
        at += sizes[kind.fieldtypes[kind.fieldnames.index(name)]] * max(1, length)
    return at


_HEARD_NUMBERS = [kind.id for kind in mavlink.mavlink_map.values() if kind.msgname in HEARD]


class FuzzedSensor:
    """A stream of packets of one sensor, decoded after every few."""

    def __init__(self, kind: str, metadata: str = "") -> None:
        self.stream = PacketStream(decoder_for(kind, metadata), Parameters(), sound, lambda: 0)
        self.stream.on_imu(self._inertial)
        self.now_ns = 10**12

    def __call__(self, data: bytes) -> None:
        self.now_ns += STEP_NS
        before = self.stream.last_arrival_ns
        self.stream.add_packet(data, "192.168.1.100", self.now_ns)
        if self.stream.last_arrival_ns == before and not sum(
            v for v in self.stream.statistics().values() if v
        ):
            raise AssertionError("a packet that is neither taken nor counted")
        if len(self.stream) >= 3:
            self.stream.flush(self.now_ns)

    def _inertial(self, samples: ImuSamples) -> None:
        """Pass samples within the range of such a unit, near the time of their arrival."""
        if not samples.is_plausible or not len(samples):
            raise AssertionError("inertial samples of no unit")
        if abs(int(samples.stamp_ns[-1]) - self.now_ns) > 10**9:
            raise AssertionError("inertial samples of another time")


def sensor(kind: str, metadata: Callable[[], str] = str) -> Callable[[Path], Target]:
    return lambda _folder: FuzzedSensor(kind, metadata())


def livox() -> Sequence[bytes]:
    points = [(100 * k, k, 5, k, 0) for k in range(96)]
    return [points_packet(points[:n], kind=kind) for kind in (1, 2, 3) for n in (1, 96)] + [imu_packet()]


def mended_livox(data: bytes, rng: Random) -> bytes:
    """Make length, number of points and checksum right, each most of the time."""
    out = bytearray(data.ljust(36, b"\0"))
    if rng.random() < 0.9:
        out[0] = 0
        size = {0: 24, 1: 14, 2: 8, 3: 10}.get(out[10])
        if size is None:
            out[10], size = 1, 14
        count = (len(out) - 36) // size
        del out[36 + count * size :]
        struct.pack_into("<H", out, 1, len(out))
        struct.pack_into("<H", out, 5, count)
    struct.pack_into("<I", out, 24, zlib.crc32(out[28:]))
    return bytes(out)


def velodyne() -> Sequence[bytes]:
    v = velodyne_packets
    return [v.velodyne_packet(lambda b, p: (1000 + 10 * p, b), mode=mode, model=model, flag=flag)
            for mode in (v.SINGLE, v.DUAL) for model in (v.VLP16, v.VLP32C) for flag in (0xEEFF, 0xDDFF)] + [
        bytes(206) + b"$GPRMC," + bytes(299)]  # fmt: skip


def ouster() -> Sequence[bytes]:
    o = ouster_packets
    points = [o.ouster_packet(lambda r, c: (1000 + 10 * r, c), column=16 * k, frame=k) for k in range(3)]
    return [*points, o.new_imu_packet(stamp_ns=5_001_000_000)]


def ouster_legacy() -> Sequence[bytes]:
    o = ouster_packets
    points = [o.ouster_packet(lambda r, c: (1000 * r, c), profile=o.LEGACY, column=16 * k) for k in range(3)]
    return [*points, o.legacy_imu_packet(stamp_ns=5_001_000_000)]


def ros2() -> Sequence[bytes]:
    driver = Driver(points=20)
    others = driver.but(time_field="offset_time"), driver.but(time_field=""), driver.but(frame="map")
    return [*(driver.packet(number) for number in range(1, 15)), *(other.packet(15) for other in others)]


def odometry() -> Sequence[bytes]:
    at_ns = 1_700_000_000_000_000_000
    ways = [(0.3 * k, 0.0, 2.0) for k in range(40)]
    told = [Told(at_ns + k * 50_000_000, way, number=k + 1) for k, way in enumerate(ways)]
    unsure = Told(at_ns + 3_000_000_000, covariance=(-1.0,) * 36, number=41)
    return [one.packet() for one in (*told, unsure)]


class FuzzedOdometry:
    """An odometry beside an autopilot that flies east, fed by hand."""

    def __init__(self) -> None:
        self._now_ns = 1_000_000_000
        self._history = PoseHistory(Parameters())
        self._input = OdometryInput.open(
            OdometryTopic("/odom"),
            ExternalOdometry(self._history, OdometryTopic("/odom").child_frame(Parameters()), lambda: False),
            cloud_offset_ns=lambda _stamp_ns: None,
            wall_offset_ns=lambda: 1_700_000_000_000_000_000 - 1_000_000_000,
        )

    def __call__(self, data: bytes) -> None:
        self._now_ns += STEP_NS * 10
        seconds = self._now_ns * 1e-9
        self._history.add_attitude(self._now_ns, (0.7071, 0.0, 0.0, 0.7071), (0.0, 0.0, 0.0))
        self._history.add_position(self._now_ns, 47.0, 8.0 + 8e-5 * seconds, 500.0, (0.0, 6.0, 0.0))
        self._input.stream.add_packet(data, self._now_ns)
        pose = self._history.latest(self._now_ns)
        assert pose is not None
        assert np.isfinite(pose.position_enu_m).all()
        assert np.isfinite(pose.velocity_enu_ms).all()
        assert abs(float(np.linalg.norm(pose.quat_wxyz)) - 1) < 1e-6


def _ground() -> World:
    z = np.zeros((41, 41))
    return World(Ground(-80.0, -80.0, 4.0, z, np.full((40, 40), Kind.GRASS, np.uint8)))


def _above(stamps: Any) -> tuple[Any, Any]:
    t = np.asarray(stamps) * 1e-9
    return np.column_stack([0 * t, t, 20 + 0 * t]), np.tile([1.0, 0, 0, 0], (len(t), 1))


@functools.cache
def flash() -> Sequence[bytes]:
    return FlashSensor(np.random.default_rng(1)).scan(0, 130_000_000, _above, _ground())[:24]


@functools.cache
def radar() -> Sequence[bytes]:
    return RadarSensor(np.random.default_rng(1)).scan(0, 900_000_000, _above, _ground())[:9]


def lightware() -> Sequence[bytes]:
    return [lightware_frame(44, struct.pack("<hh", 100 * k, 500 * k), write=False) * 3 for k in range(5)]


class FuzzedLine:
    """A serial LightWare."""

    def __init__(self, _folder: Path) -> None:
        self.stream = LightwareStream(Parameters(), sound)
        self.now_ns = 10**12

    def __call__(self, data: bytes) -> None:
        self.now_ns += STEP_NS
        self.stream.add_packet(data, "", self.now_ns)
        self.stream.flush(self.now_ns)


def mended_lightware(data: bytes, _rng: Random) -> bytes:
    """Make a frame of the bytes."""
    return lightware_frame(data[3] if len(data) > 3 else 44, data[4:64], write=False)


class FuzzedControl:
    """The Mid-360's answers."""

    def __init__(self, _folder: Path) -> None:
        self.control = LivoxControl("192.168.1.50", 56301, 56401)
        self.now_ns = 10**12

    def __call__(self, data: bytes) -> None:
        self.now_ns += 10**9
        self.control.due(self.now_ns, None if self.now_ns % (3 * 10**9) else self.now_ns)
        self.control.on_datagram(data)


def control() -> Sequence[bytes]:
    from companion.flight.sensors.decoders.livox_protocol import ANSWER, SET_PARAMETERS, Frame, encode

    return [
        encode(Frame(SET_PARAMETERS, n, ANSWER, data), 1)
        for n in (1, 2)
        for data in (b"\0\0\0", b"\3\6\0", b"")
    ]


def _real(name: str) -> str:
    """Return a sensor's metadata from the recordings, or ours where there is none."""
    path = DATA / name
    return path.read_text() if path.is_file() else json.dumps(json.loads(ouster_packets.metadata()))


HARNESSES = (
    Harness("mavlink", mavlink_frames, lambda _f: FuzzedLink(None), mended_frame),
    Harness("mavlink-signed", mavlink_frames, lambda _f: FuzzedLink(Signing(KEY, 0)), signed_frame),
    Harness("livox", livox, sensor("livox"), mended_livox),
    Harness("livox-control", control, FuzzedControl),
    Harness("velodyne", velodyne, sensor("velodyne")),
    Harness(
        "ouster",
        ouster,
        sensor("ouster", lambda: ouster_packets.metadata(imu_profile=ouster_packets.NEW_IMU)),
        cost=4,
    ),
    Harness(
        "ouster-legacy",
        ouster_legacy,
        sensor("ouster", lambda: ouster_packets.metadata(ouster_packets.LEGACY)),
        cost=4,
    ),
    Harness(
        "ouster-metadata",
        lambda: [ouster_packets.metadata().encode()],
        lambda _f: metadata_target,
        words=(b"null", b"[]", b"{}", b"-1", b'"', b"0"),
        cost=20,
    ),
    Harness("ros2", ros2, sensor("ros2", lambda: "instant")),
    Harness("ros2-timed", ros2, sensor("ros2")),
    Harness("ros2-odometry", odometry, lambda _f: FuzzedOdometry()),
    Harness("lightware", lightware, FuzzedLine, mended_lightware),
    Harness("flash", flash, sensor("flash"), cost=20),
    Harness("radar", radar, sensor("radar"), cost=20),
)


def metadata_target(data: bytes) -> None:
    """Try a sensor's metadata."""
    from companion.runtime.errors import UsageError

    try:
        decoder_for("ouster", data.decode("utf-8", "replace"))
    except UsageError as error:
        one_line(error)


def one_line(error: Exception) -> None:
    """Pass an error that fits one line."""
    if "\n" in str(error) or not str(error):
        raise AssertionError(f"an error of several lines, or none: {str(error)!r}")
