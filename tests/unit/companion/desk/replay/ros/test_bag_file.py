"""Bags with missing, illegible or irrelevant type definitions."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from mcap.writer import Writer

from companion.desk.replay.ros.bag_file import CLOUD, BagFile
from companion.flight.sensors.decoders.point_cloud import StampedCloud
from companion.runtime.errors import UsageError
from tests.unit.companion.desk.replay import flights
from tests.unit.companion.desk.replay.flights import BEGIN_NS, STORE
from tests.unit.companion.flight.sensors.decoders.test_point_cloud import AFTER, POINTS

ODOMETRY = "nav_msgs/msg/Odometry"
STANDARD = "the library's own"


def write_mcap(path: Path, text: str, encoding: str = "ros2msg") -> Path:
    """Write a cloud, a pose and a message of another program, with so much of a definition of each."""
    good: dict[str, Any] = {
        CLOUD: flights.cloud(POINTS, AFTER, BEGIN_NS),
        ODOMETRY: flights.pose(ODOMETRY, 0),
    }
    with path.open("wb") as file:
        writer = Writer(file)
        writer.start(profile="ros2", library="test")
        for topic, kind in (("/points", CLOUD), ("/odom", ODOMETRY), ("/status", "maker_msgs/msg/Status")):
            known = kind in good and text == STANDARD
            data = STORE.generate_msgdef(kind, ros_version=2)[0] if known else text.format(kind)
            schema = writer.register_schema(kind, encoding, data.encode())
            channel = writer.register_channel(topic, "cdr", schema)
            raw = bytes(STORE.serialize_cdr(good[kind], kind)) if kind in good else b"\0\1\0\0"
            writer.add_message(channel, BEGIN_NS, raw, BEGIN_NS)
        writer.finish()
    return path


@pytest.mark.parametrize(
    ("text", "encoding"),
    [
        (STANDARD, "ros2msg"),
        ("{}\n", "ros2msg"),
        ("", "ros2msg"),
        ("", ""),
        ("float64 [\n", "ros2msg"),
        ("{}", "ros2idl"),
    ],
)
def test_a_standard_type_is_read_whatever_the_bag_says_of_it(
    tmp_path: Path, text: str, encoding: str
) -> None:
    bag = BagFile(write_mcap(tmp_path / "flight.mcap", text, encoding))
    assert bag.types == {"/points": CLOUD, "/odom": ODOMETRY, "/status": "maker_msgs/msg/Status"}
    (_, stamp_ns, _, cloud), (_, _, _, pose) = bag.messages(("/points", "/odom"))
    assert bag.bad == 0
    assert isinstance(cloud, StampedCloud)
    assert (cloud.stamp_ns, stamp_ns, cloud.frame) == (BEGIN_NS, BEGIN_NS, "lidar")
    assert cloud.table["t"].tolist() == AFTER[::-1].tolist()
    assert pose.pose.pose.position.z == pytest.approx(22.0)


def test_a_legible_definition_that_is_another_s_makes_its_messages_unreadable(tmp_path: Path) -> None:
    bag = BagFile(write_mcap(tmp_path / "flight.mcap", "uint8 other\n"))
    assert list(bag.messages(("/points", "/odom"))) == []
    assert bag.bad == 2


def test_a_file_that_is_no_bag_is_one_line(tmp_path: Path) -> None:
    path = tmp_path / "flight.bag"
    path.write_bytes(b"#ROSBAG V2.0\n")
    with pytest.raises(UsageError, match="it is no ROS bag, or damaged"):
        BagFile(path)
