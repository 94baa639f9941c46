"""Short flight over the simulator's ground, in the recording formats of slz and other programs."""

from __future__ import annotations

import struct
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache
from operator import itemgetter
from pathlib import Path
from typing import Any

import dpkt
import laspy
import numpy as np
from numpy.typing import NDArray
from pymavlink.dialects.v20 import ardupilotmega as mavlink
from pyproj import CRS, Transformer
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.typesys import Stores, get_types_from_msg, get_typestore
from scipy.spatial.transform import Rotation

from companion.desk.replay.own_replay import Replay
from companion.desk.replay.recording_reader import Header, Raw
from companion.flight.mapping.window_event import WindowEvent
from companion.flight.recorder import foxglove_scene, journal
from companion.flight.recorder.recording_writer import MIB, Entry, McapWriter
from params import load
from sitl import scenes
from sitl.sensors.lidar_mount import Mount
from sitl.sensors.mid360 import Mid360
from slz import LocalFrame

Floats = NDArray[np.float64]
LANDING_MOUNT = Mount()
HOME = LocalFrame(47.4, 8.5, 400.0)
BEGIN_NS = 1_750_000_000_000_000_000  # time of day of the flight's beginning
SECONDS, RATE_HZ, POSE_MS, SCAN_MS = 5.0, 20_000, 40, 100
CLOUD_FIELDS = (("x", 0, 7), ("y", 4, 7), ("z", 8, 7), ("intensity", 12, 7), ("t", 16, 6))
CLOUD_STEP = 20
STEP_NS = 50_000_000
SET_NS = 2_020_000_000  # when the recorder's clock is set, since the beginning
STORE = get_typestore(Stores.ROS2_HUMBLE)
LIVOX, LIVOX_POINT = "livox_ros_driver2/msg/CustomMsg", "livox_ros_driver2/msg/CustomPoint"
LIVOX_TEXTS = {
    LIVOX_POINT: "uint32 offset_time\nfloat32 x\nfloat32 y\nfloat32 z\nuint8 reflectivity\nuint8 tag\n"
    "uint8 line",
    LIVOX: "std_msgs/Header header\nuint64 timebase\nuint32 point_num\nuint8 lidar_id\nuint8[3] rsvd\n"
    "CustomPoint[] points",
}
for name, text in LIVOX_TEXTS.items():
    STORE.register(get_types_from_msg(text, name))


def path(t: Floats | float) -> tuple[Floats, Floats]:
    """Return places ENU (n, 3) and quaternions (n, 4) w x y z, body FRD to NED, at seconds."""
    t = np.atleast_1d(np.asarray(t, np.float64))
    place = np.stack([20 * np.sin(0.3 * t), 4 * t - 10, 22 + 2 * np.sin(0.5 * t)], -1)
    angles = np.stack([0.3 * t, 0.1 * np.sin(0.9 * t), 0.1 * np.sin(0.7 * t + 0.5)], -1)
    x, y, z, w = Rotation.from_euler("ZYX", angles).as_quat().T
    return place, np.stack([w, x, y, z], -1)


def _pose_at(ns: NDArray[np.int64]) -> tuple[Floats, Floats]:
    return path(ns * 1e-9)


@cache
def packets(seed: int = 1) -> tuple[tuple[int, bytes], ...]:
    """Return the Mid-360's packets with their times since the beginning (ns)."""
    lidar = Mid360(np.random.default_rng(seed), point_rate_hz=RATE_HZ)
    world = scenes.build("plain", 1).world
    begins = range(0, round(SECONDS * 1e9), STEP_NS)
    return tuple(
        (begin + STEP_NS, packet)
        for begin in begins
        for packet in lidar.scan(begin, begin + STEP_NS, _pose_at, world)
    )


@cache
def returns(seed: int = 1) -> tuple[NDArray[np.float32], NDArray[np.int64]]:
    """Return the Mid-360's points (n, 3), forward, left, up, and their times since the beginning (ns)."""
    lidar = Mid360(np.random.default_rng(seed), point_rate_hz=RATE_HZ)
    shots = lidar.shots(0, round(SECONDS * 1e9), _pose_at, scenes.build("plain", 1).world)
    false = shots.echoes.ghost | shots.echoes.dust
    seen = (shots.echoes.range_m > 0) & ~(false & shots.echoes.marked)
    return lidar.points_m(shots)[seen].astype(np.float32), lidar.stamps_ns(shots)[seen]


# ---- our own recording ------------------------------------------------------------------------------------

OFFSET_NS = BEGIN_NS - 60_000_000_000  # of the companion's clock, a minute old
PARAMETERS = load("quadcopter", ["cell_m=0.5", "zone_m=200"])
HEADER = Header("livox", PARAMETERS.model_dump(mode="json"), OFFSET_NS)


def recorded() -> list[Raw]:
    """Return what a flight's recording holds, on the companion's clock, without windows and reports."""
    begun_ns = BEGIN_NS - OFFSET_NS
    found = [Raw(journal.MAVLINK_IN, begun_ns + at, frame) for at, frame in _telemetry(angles=False)]
    found += [
        Raw(journal.LIDAR, begun_ns + at, journal.pack_batch([(begun_ns + at, packet)]))
        for at, packet in packets()
    ]
    return sorted(found, key=lambda message: message.at_ns)


def with_windows(messages: list[Raw], scans: int = 20) -> list[Raw]:
    """Return a flight in which so many scans were a window, with what came of each.

    The program that made the recording is the one under test: a replay does the same again.
    """
    found: list[Raw] = []
    flight, done = Replay(HEADER, PARAMETERS), 0
    for message in messages:
        found.append(message)
        flight.process_message(message)
        event = window(message.at_ns, done + 1, done + scans)
        report = flight.process_message(event) if message.topic == journal.LIDAR else None
        if report is not None:  # so many scans have come
            found += [event, Raw(journal.REPORT, message.at_ns, journal.report_document(report))]
            done += scans
    return found


def window(at_ns: int, first: int, last: int, anew: bool = False, **changed: float) -> Raw:
    """Return the event of a window of some scans; changed: parameters changed in flight before it."""
    number = first // (last - first + 1)
    event = WindowEvent(number, ((first, last),), anew=anew, changed=tuple(changed.items()))
    return Raw(journal.EVENT, at_ns, journal.pack_window(event))


def write_own(out: Path, messages: list[Raw]) -> Path:
    """Write a recording as `slz run --record` does."""
    metadata = {
        "version": str(journal.VERSION),
        "lidar": HEADER.lidar,
        "parameters": PARAMETERS.model_dump_json(),
        "clock_offset_ns": str(OFFSET_NS),
    }
    writer = McapWriter(out, foxglove_scene.channels, 100 * MIB, metadata)
    for message in messages:
        writer.put(Entry(message.topic, OFFSET_NS + message.at_ns, message.data, len(message.data)))
    writer.close()
    return out


# ---- telemetry log and capture --------------------------------------------------------------------------


def write_tlog(
    out: Path,
    angles: bool = False,
    shift_ns: int = 0,
    old: bool = False,
    again_ns: tuple[int, ...] = (),
    early_ns: int = 0,
) -> Path:
    """Write what a ground station logs: heartbeats, attitudes as quaternions or angles, positions.

    again_ns: times after which each frame comes once more. early_ns: added to the times before `SET_NS`, when
    the recorder's clock was set.
    """
    log = bytearray()
    frames = _telemetry(angles, old)
    frames += [(at_ns + late_ns, frame) for late_ns in again_ns for at_ns, frame in frames]
    for at_ns, frame in sorted(frames, key=itemgetter(0)):
        told_ns = BEGIN_NS + shift_ns + at_ns + early_ns * (at_ns < SET_NS)
        log.extend(struct.pack(">Q", told_ns // 1000) + frame)
    out.write_bytes(log)
    return out


def _telemetry(angles: bool, old: bool = False) -> list[tuple[int, bytes]]:
    """Return frames, of MAVLink 1 if they are old, with their times since the beginning (ns)."""
    sender = mavlink.MAVLink(None, srcSystem=1, srcComponent=1)
    station = mavlink.MAVLink(None, srcSystem=255, srcComponent=190)
    found: list[tuple[int, bytes]] = []

    def put(message: Any, at_ns: int, by: Any = sender) -> None:
        found.append((at_ns, bytes(message.pack(by, force_mavlink1=old))))
        by.seq = (by.seq + 1) % 256

    put(mavlink.MAVLink_heartbeat_message(6, 8, 0, 0, 4, 3), -600_000_000, station)
    put(mavlink.MAVLink_heartbeat_message(2, 3, 217, 4, 4, 3), -500_000_000)
    for ms in range(-400, round(SECONDS * 1000) + 400, POSE_MS):
        place, quat = (value[0] for value in path(ms * 1e-3))
        ahead, behind = path(ms * 1e-3 + 0.01)[0][0], path(ms * 1e-3 - 0.01)[0][0]
        east, north, up = (ahead - behind) / 0.02
        w, x, y, z = (float(v) for v in quat)
        lat, lon, alt = (float(v) for v in HOME.lla(place))
        boot_ms = ms + 60_000
        if angles:
            yaw, pitch, roll = Rotation.from_quat([x, y, z, w]).as_euler("ZYX")
            attitude = mavlink.MAVLink_attitude_message(boot_ms, roll, pitch, yaw, 0, 0, 0)
        else:
            attitude = mavlink.MAVLink_attitude_quaternion_message(boot_ms, w, x, y, z, 0, 0, 0)
        put(attitude, ms * 1_000_000)
        cm = (round(north * 100), round(east * 100), round(-up * 100))
        position = mavlink.MAVLink_global_position_int_message(
            boot_ms, round(lat * 1e7), round(lon * 1e7), round(alt * 1e3), 20_000, *cm, 65535
        )
        put(position, ms * 1_000_000)
    return found


def write_pcap(out: Path, cut_up: bool = False, shift_ns: int = 0, early_ns: int = 0) -> Path:
    """Write the packets as Ethernet frames, with others between; or each cut up in two fragments.

    early_ns: as in `write_tlog`.
    """
    with out.open("wb") as file:
        writer = dpkt.pcap.Writer(file)
        for k, (taken_ns, data) in enumerate(packets()):
            at_ns = taken_ns + shift_ns + early_ns * (taken_ns < SET_NS)
            udp = bytes(dpkt.udp.UDP(sport=56300, dport=56301, data=data, ulen=8 + len(data)))
            pieces = [(0, 0, udp)] if not cut_up else [(1, 0, udp[:800]), (0, 100, udp[800:])]
            for more, offset, piece in pieces:
                ip = dpkt.ip.IP(
                    src=b"\x0a\x00\x00\x01", dst=b"\x0a\x00\x00\x02", p=17, id=k % 65536, data=piece
                )
                ip.mf, ip.offset = more, offset
                ip.len = 20 + len(piece)
                _put(writer, ip, at_ns)
            if k % 100 == 0:
                _put(writer, dpkt.ip.IP(src=bytes(4), dst=bytes(4), p=6, data=bytes(20)), at_ns)
    return out


def _put(writer: Any, ip: Any, at_ns: int) -> None:
    frame = dpkt.ethernet.Ethernet(src=bytes(6), dst=bytes(6), type=0x0800, data=bytes(ip))
    writer.writepkt(bytes(frame), (BEGIN_NS + at_ns) * 1e-9)


# ---- clouds beside a log ----------------------------------------------------------------------------


def write_laz(
    out: Path, week: bool = False, timed: bool = True, crs: str = "EPSG:32632", up_m: float = 0.0
) -> Path:
    """Write the ground seen as a georeferenced cloud, with times of GPS since 1980 or of the week.

    crs: one in metres of that zone. up_m: added to the heights.
    """
    points, stamps = returns()
    place, quat = path(stamps * 1e-9)
    body = points.astype(np.float64) @ LANDING_MOUNT.rotation_frd_from_sensor().T + LANDING_MOUNT.lever_frd_m
    w, x, y, z = quat.T
    ned = Rotation.from_quat(np.stack([x, y, z, w], -1)).apply(body)
    lat, lon, alt = HOME.lla(place + ned[:, [1, 0, 2]] * [1, 1, -1]).T
    header = laspy.LasHeader(point_format=6 if timed else 0, version="1.4")
    header.add_crs(CRS.from_user_input(crs))
    header.global_encoding.gps_time_type = laspy.header.GpsTimeType(int(not week))
    header.scales, header.offsets = [0.001] * 3, [4e5, 5e6, 0]
    las = laspy.LasData(header)
    las.x, las.y = Transformer.from_crs(4326, 32632, always_xy=True).transform(lon, lat)
    las.z = alt + up_m
    if timed:
        gps_s = (BEGIN_NS // 10**9 - 315_964_800 + 18) + stamps * 1e-9
        las.gps_time = gps_s % 604_800 if week else gps_s - 1e9
    las.write(out)
    return out


def write_pcds(folder: Path, early_ns: int = 0) -> Path:
    """Write a PCD file for each tenth of a second, named by its middle; early_ns: as in `write_tlog`."""
    folder.mkdir()
    points, stamps = returns()
    for k in range(round(SECONDS * 10)):
        part = points[(stamps >= k * 10**8) & (stamps < (k + 1) * 10**8)]
        at_ns = BEGIN_NS + k * 10**8 + 50_000_000
        at_ns += early_ns * (at_ns - BEGIN_NS < SET_NS)
        head = (
            "VERSION 0.7\nFIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nCOUNT 1 1 1\n"
            f"WIDTH {len(part)}\nHEIGHT 1\nPOINTS {len(part)}\nDATA binary\n"
        )
        file = folder / f"{at_ns // 10**9}.{at_ns % 10**9:09d}.pcd"
        file.write_bytes(head.encode() + part.astype("<f4").tobytes())
    return folder


# ---- bags -----------------------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class Bag:
    """What to write: poses as odometry, pose or fix; frames of points and body; one message that is none."""

    poses: str = "odometry"
    points_frame: str = "lidar"
    timed: bool = True
    mcap: bool = False
    second_cloud: bool = False


def write_bag(out: Path, what: Bag = Bag()) -> Path:
    """Write a bag of clouds at 10 Hz and poses at 25 Hz, in the order of a robot's recorder."""
    plugin = StoragePlugin.MCAP if what.mcap else StoragePlugin.SQLITE3
    kinds = {
        "odometry": {"/odom": "nav_msgs/msg/Odometry"},
        "pose": {"/pose": "geometry_msgs/msg/PoseStamped"},
        "fix": {"/fix": "sensor_msgs/msg/NavSatFix", "/imu": "sensor_msgs/msg/Imu"},
    }[what.poses]
    clouds = ["/points", "/other"] if what.second_cloud else ["/points"]
    with Writer(out, version=9, storage_plugin=plugin) as writer:
        kinds |= dict.fromkeys(clouds, "sensor_msgs/msg/PointCloud2")
        lines = {topic: writer.add_connection(topic, kind, typestore=STORE) for topic, kind in kinds.items()}
        for at_ns, topic, message in sorted(_messages(what, kinds), key=lambda entry: entry[0]):
            kind = kinds[topic]
            writer.write(lines[topic], BEGIN_NS + at_ns, STORE.serialize_cdr(message, kind))
    return out


def write_messages(out: Path, lines: dict[str, tuple[str, list[tuple[int, Any]]]]) -> Path:
    """Write a bag of messages by topic, with their type and times (ns); bytes are written as they are."""
    with Writer(out, version=9, storage_plugin=StoragePlugin.SQLITE3) as writer:
        for topic, (kind, messages) in lines.items():
            line = writer.add_connection(topic, kind, typestore=STORE)
            for at_ns, message in messages:
                raw = message if isinstance(message, bytes) else STORE.serialize_cdr(message, kind)
                writer.write(line, at_ns, raw)
    return out


def _messages(what: Bag, kinds: dict[str, str]) -> Iterator[tuple[int, str, Any]]:
    points, times = returns()
    for begin in range(0, round(SECONDS * 1e9), SCAN_MS * 1_000_000):
        some = (times >= begin) & (times < begin + SCAN_MS * 1_000_000)
        message = cloud(points[some], times[some] - begin, BEGIN_NS + begin, what)
        late = begin + SCAN_MS * 1_000_000 + 15_000_000
        for topic in kinds:
            if kinds[topic].endswith("PointCloud2"):
                yield late, topic, message
    for ms in range(-400, round(SECONDS * 1000) + 400, POSE_MS):
        for topic, kind in kinds.items():
            if not kind.endswith("PointCloud2"):
                yield ms * 1_000_000, topic, pose(kind, ms)


def _types(*names: str) -> list[Any]:
    return [STORE.types[name] for name in names]


def _header(at_ns: int, frame: str) -> Any:
    time, header = _types("builtin_interfaces/msg/Time", "std_msgs/msg/Header")
    return header(time(at_ns // 10**9, at_ns % 10**9), frame)


def cloud(points: NDArray[np.float32], after_ns: NDArray[np.int64], at_ns: int, what: Bag = Bag()) -> Any:
    """Return a PointCloud2, its points backwards in time."""
    kind, field = _types("sensor_msgs/msg/PointCloud2", "sensor_msgs/msg/PointField")
    fields = [field(*entry, 1) for entry in CLOUD_FIELDS if what.timed or entry[0] != "t"]
    table = np.zeros(len(points), [("x", "<f4"), ("y", "<f4"), ("z", "<f4"), ("i", "<f4"), ("t", "<u4")])
    for k, name in enumerate("xyz"):
        table[name] = points[::-1, k]
    table["t"] = after_ns[::-1]
    data = np.frombuffer(table.tobytes(), np.uint8)
    header = _header(at_ns, what.points_frame)
    return kind(header, 1, len(points), fields, False, CLOUD_STEP, len(data), data, True)


def livox_cloud(points: NDArray[np.float32], after_ns: NDArray[np.int64], at_ns: int) -> Any:
    """Return Livox's CustomMsg of points that are measured some time after its timebase."""
    kind, point = _types(LIVOX, LIVOX_POINT)
    table = [
        point(after, *place, 50, 0, 0)
        for after, place in zip(after_ns.tolist(), points.tolist(), strict=True)
    ]
    return kind(_header(at_ns, "lidar"), at_ns, len(table), 1, np.zeros(3, np.uint8), table)


@cache
def _place_and_turn(ms: int) -> tuple[Floats, tuple[float, ...]]:
    """Return place ENU and quaternion x y z w, body FLU to ENU: every bag tells them again."""
    place, (w, x, y, z) = (value[0] for value in path(ms * 1e-3))
    ned_from_frd = Rotation.from_quat([x, y, z, w]).as_matrix()
    enu_from_flu = np.array([[0, 1, 0], [1, 0, 0], [0, 0, -1]]) @ ned_from_frd @ np.diag([1, -1, -1])
    return place, tuple(Rotation.from_matrix(enu_from_flu).as_quat().tolist())


def pose(kind: str, ms: int) -> Any:
    """Return a message that tells a pose, or a part of one, some milliseconds after the beginning."""
    place, turned = _place_and_turn(ms)
    header = _header(BEGIN_NS + ms * 1_000_000, "odom")
    point, quaternion, place_and_turn = _types(
        "geometry_msgs/msg/Point", "geometry_msgs/msg/Quaternion", "geometry_msgs/msg/Pose"
    )
    turn = quaternion(*turned)
    zeros = np.zeros(36)
    match kind.rpartition("/")[2]:
        case "PoseStamped":
            (stamped,) = _types(kind)
            return stamped(header, place_and_turn(point(*map(float, place)), turn))
        case "PoseWithCovarianceStamped":
            stamped, with_covariance = _types(kind, "geometry_msgs/msg/PoseWithCovariance")
            return stamped(header, with_covariance(place_and_turn(point(*map(float, place)), turn), zeros))
        case "Odometry":
            odometry, with_pose, with_twist, twist, vector = _types(
                kind,
                "geometry_msgs/msg/PoseWithCovariance",
                "geometry_msgs/msg/TwistWithCovariance",
                "geometry_msgs/msg/Twist",
                "geometry_msgs/msg/Vector3",
            )
            still = with_twist(twist(vector(0.0, 0.0, 0.0), vector(0.0, 0.0, 0.0)), zeros)
            where = with_pose(place_and_turn(point(*map(float, place)), turn), zeros)
            return odometry(header, "base_link", where, still)
        case "NavSatFix":
            fix, status = _types(kind, "sensor_msgs/msg/NavSatStatus")
            lla = (float(v) for v in HOME.lla(place))
            return fix(header, status(0, 1), *lla, np.zeros(9), 0)
        case _:
            imu, vector = _types(kind, "geometry_msgs/msg/Vector3")
            zero, none = vector(0.0, 0.0, 0.0), np.zeros(9)
            return imu(header, turn, none, zero, none, zero, none)
