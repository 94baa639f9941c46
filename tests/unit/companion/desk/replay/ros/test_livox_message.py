"""Livox's CustomMsg, from bags of ROS 1 and ROS 2 and from invalid bytes."""

from __future__ import annotations

import struct
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rosbags.rosbag1 import Writer as Writer1
from rosbags.rosbag2 import StoragePlugin
from rosbags.rosbag2 import Writer as Writer2
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from companion.desk.replay.recording_type import RecordingOptions, open_recording
from companion.desk.replay.ros.livox_message import MESSAGES, parse
from companion.flight.sensors.decoders.point_cloud import BadCloudError
from tests.unit.companion.desk.replay import flights
from tests.unit.companion.desk.replay.flights import BEGIN_NS, HOME

POINT = "uint32 offset_time\nfloat32 x\nfloat32 y\nfloat32 z\nuint8 reflectivity\nuint8 tag\nuint8 line\n"
MESSAGE = (
    "std_msgs/Header header\nuint64 timebase\nuint32 point_num\nuint8 lidar_id\nuint8[3] rsvd\n"
    "CustomPoint[] points\n"
)
OLD, NEW = "livox_ros_driver/msg/CustomMsg", "livox_ros_driver2/msg/CustomMsg"
NORMAL, MODERATE, LOW = 0b000000, 0b000101, 0b001000
ODOMETRY = "nav_msgs/msg/Odometry"


def store(ros2: bool, kind: str) -> Any:
    found = get_typestore(Stores.ROS2_HUMBLE if ros2 else Stores.ROS1_NOETIC)
    found.register(get_types_from_msg(POINT, kind.replace("Msg", "Point")))
    found.register(get_types_from_msg(MESSAGE, kind))
    return found


def message(types: Any, kind: str, at_ns: int, frame: str = "livox", tags: tuple[int, ...] = (0,) * 3) -> Any:
    """Return as many points as tags, 3 ms apart, at (1, 2, 20), (2, 2, 20) and so on."""
    header, time, point = (
        types.types[name]
        for name in ("std_msgs/msg/Header", "builtin_interfaces/msg/Time", kind.replace("Msg", "Point"))
    )
    stamp = {"stamp": time(at_ns // 10**9, at_ns % 10**9), "frame_id": frame}
    count = {"seq": 7} if "seq" in header.__dataclass_fields__ else {}
    points = [point(3_000_000 * k, 1.0 + k, 2.0, 20.0, 50 + k, tag, k % 4) for k, tag in enumerate(tags)]
    return types.types[kind](header(**count, **stamp), at_ns, len(points), 1, np.zeros(3, np.uint8), points)


def serialised(ros2: bool, kind: str, **given: Any) -> bytes:
    types = store(ros2, kind)
    wanted = message(types, kind, BEGIN_NS, **given)
    return bytes(types.serialize_cdr(wanted, kind) if ros2 else types.serialize_ros1(wanted, kind))


@pytest.mark.parametrize(
    "frame", ["", "a", "livox", "livox_frame"]
)  # the number of letters shifts what follows
@pytest.mark.parametrize("kind", MESSAGES)
@pytest.mark.parametrize("ros2", [False, True])
def test_points_are_those_that_were_serialised(ros2: bool, kind: str, frame: str) -> None:
    cloud = parse(serialised(ros2, kind, frame=frame), kind, ros2)
    assert (cloud.stamp_ns, cloud.frame, cloud.doubtful) == (BEGIN_NS, frame, 0)
    assert cloud.table["offset_time"].tolist() == [0, 3_000_000, 6_000_000]
    assert cloud.table["x"].tolist() == [1, 2, 3]
    assert cloud.table["z"].tolist() == [20, 20, 20]
    assert cloud.table["reflectivity"].tolist() == [50, 51, 52]
    assert cloud.table["line"].tolist() == [0, 1, 2]


def test_numbers_may_have_either_byte_order() -> None:
    types = store(True, NEW)
    wanted = message(types, NEW, BEGIN_NS)
    raw = bytes(types.serialize_cdr(wanted, NEW, little_endian=False))
    assert parse(raw, NEW, True).table["x"].tolist() == [1, 2, 3]


def test_points_of_low_confidence_are_left_out_where_tags_tell_it() -> None:
    tags = (NORMAL, LOW, MODERATE)
    cloud = parse(serialised(True, NEW, tags=tags), NEW, True)
    assert (cloud.table["x"].tolist(), cloud.doubtful) == ([1, 3], 1)
    old = parse(serialised(True, OLD, tags=tags), OLD, True)  # whose tags count returns
    assert (len(old.table), old.doubtful) == (3, 0)


@pytest.mark.parametrize("ros2", [False, True])
def test_bytes_that_are_no_such_message_are_refused(ros2: bool) -> None:
    raw = serialised(ros2, NEW)
    for length in range(len(raw) - 3):
        with pytest.raises(BadCloudError):
            parse(raw[:length], NEW, ros2)
    most = raw.replace(struct.pack("<I", 3), struct.pack("<I", 2**32 - 1))
    with pytest.raises(BadCloudError, match="4294967295 points are not in"):
        parse(most, NEW, ros2)


def test_a_message_without_points_has_none() -> None:
    for ros2 in (False, True):
        assert len(parse(serialised(ros2, NEW, tags=()), NEW, ros2).table) == 0


@pytest.mark.parametrize("kind", [OLD, NEW])
@pytest.mark.parametrize("ros2", [False, True])
def test_a_bag_of_them_is_replayed(tmp_path: Path, ros2: bool, kind: str) -> None:
    types = store(ros2, kind)
    path = tmp_path / ("bag" if ros2 else "flight.bag")
    written: Any = Writer2(path, version=9, storage_plugin=StoragePlugin.SQLITE3) if ros2 else Writer1(path)
    with written as writer:
        odom, points = (
            writer.add_connection(topic, name, typestore=types)
            for topic, name in (("/odom", ODOMETRY), ("/livox/lidar", kind))
        )
        for ms in range(-100, 700, 50):
            pose = flights.pose(ODOMETRY, ms)
            if not ros2:
                pose.header = types.types["std_msgs/msg/Header"](0, pose.header.stamp, pose.header.frame_id)
            pack = types.serialize_cdr if ros2 else types.serialize_ros1
            writer.write(odom, BEGIN_NS + ms * 10**6, pack(pose, ODOMETRY))
        for ms in range(0, 500, 100):
            stamp = BEGIN_NS + ms * 10**6
            some = message(types, kind, stamp, tags=(0,) * 32)
            writer.write(points, stamp, pack(some, kind))
    origin = f"{HOME.lat_deg},{HOME.lon_deg},{HOME.alt_m}"
    feed, rerun = open_recording(path, ("lidar_pitch_deg=0",), RecordingOptions(origin=origin))
    for _, act in feed.steps(rerun):
        rerun.hand_over(act)
    assert (rerun.returns, feed.bad) == (5 * 32, 0)
    assert feed.summary()["points"] == "/livox/lidar"
    assert feed.summary()["point_times"] == "offset_time: ns since the stamp"
    assert rerun.span_ns == (BEGIN_NS, BEGIN_NS + 493_000_000)
