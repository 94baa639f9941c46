"""Bags with missing, illegible or irrelevant type definitions."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mcap.writer import CompressionType, Writer
from rosbags.typesys import Stores, get_typestore

from companion.desk.replay.recording_type import recording_type_of
from companion.desk.replay.ros.bag_file import CLOUD, BagFile
from companion.flight.sensors.decoders.point_cloud import StampedCloud
from companion.runtime.errors import UsageError
from tests.unit.companion.desk.replay import flights
from tests.unit.companion.desk.replay.flights import BEGIN_NS, STORE
from tests.unit.companion.flight.sensors.decoders.test_point_cloud import AFTER, POINTS

ODOMETRY = "nav_msgs/msg/Odometry"
STANDARD = "the library's own"
STORE1 = get_typestore(Stores.ROS1_NOETIC)


def write_mcap(path: Path, text: str, encoding: str = "ros2msg", profile: str = "ros2") -> Path:
    """Write a cloud, a pose and a message of another program, with so much of a definition of each."""
    good: dict[str, Any] = {
        CLOUD: flights.cloud(POINTS, AFTER, BEGIN_NS),
        ODOMETRY: flights.pose(ODOMETRY, 0),
    }
    with path.open("wb") as file:
        writer = Writer(file)
        writer.start(profile=profile, library="test")
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


# ---- bags as tools and power losses leave them -----------------------------------------------------------


def many(
    path: Path,
    profile: str = "ros2",
    ros1: bool = False,
    count: int = 40,
    chunk_bytes: int = 1,
    packing: CompressionType = CompressionType.ZSTD,
) -> Path:
    """Write poses, by default 40 in chunks of one message each."""
    kind = ODOMETRY.replace("/msg/", "/") if ros1 else ODOMETRY
    with path.open("wb") as file:
        writer = Writer(file, chunk_size=chunk_bytes, compression=packing)
        writer.start(profile=profile, library="test")
        text = STORE1.generate_msgdef(ODOMETRY, ros_version=1)[0] if ros1 else ""
        schema = writer.register_schema(kind, "ros1msg" if ros1 else "ros2msg", text.encode())
        channel = writer.register_channel("/odom", "ros1" if ros1 else "cdr", schema)
        if chunk_bytes > 1:
            noise = writer.register_channel("/noise", "cdr", schema)
        rng = np.random.default_rng(1)
        for k in range(count):
            raw = bytes(STORE.serialize_cdr(flights.pose(ODOMETRY, k * 1_000_000), ODOMETRY))
            if ros1:
                raw = bytes(STORE.cdr_to_ros1(raw, ODOMETRY))
            writer.add_message(channel, BEGIN_NS + k, raw, BEGIN_NS + k)
            if chunk_bytes > 1:  # what cannot be packed, so that the file's end is within the chunk
                writer.add_message(noise, BEGIN_NS + k, rng.bytes(600), BEGIN_NS + k)
        writer.finish()
    return path


def times(bag: BagFile) -> list[int]:
    return [at_ns - BEGIN_NS for at_ns, *_ in bag.messages(("/odom",))]


@pytest.mark.parametrize("profile", ["", "cameras", "ros2"])
@pytest.mark.parametrize("encoding", ["ros2msg", ""])
def test_schemas_and_encodings_tell_a_bag_whatever_its_profile(
    tmp_path: Path, profile: str, encoding: str
) -> None:
    text = STANDARD if encoding else ""
    path = write_mcap(tmp_path / "flight.mcap", text, encoding, profile)
    assert recording_type_of(path) == "bag"
    bag = BagFile(path)
    assert bag.types == {"/points": CLOUD, "/odom": ODOMETRY, "/status": "maker_msgs/msg/Status"}
    (_, _, _, cloud), (_, _, _, pose) = bag.messages(("/points", "/odom"))
    assert cloud.table["t"].tolist() == AFTER[::-1].tolist()
    assert pose.pose.pose.position.z == pytest.approx(22.0)
    assert (bag.bad, bag.cut) == (0, "")


def test_messages_of_ros_1_in_an_mcap_are_read(tmp_path: Path) -> None:
    path = many(tmp_path / "flight.mcap", "ros1", ros1=True)
    assert recording_type_of(path) == "bag"
    bag = BagFile(path)
    assert bag.types == {"/odom": ODOMETRY}
    assert times(bag) == list(range(40))
    assert (bag.bad, bag.cut) == (0, "")


@pytest.mark.parametrize("profile", ["", "ros2"])
@pytest.mark.parametrize("share", [0.25, 0.4, 0.55])
def test_a_bag_that_is_cut_off_is_read_up_to_its_end(tmp_path: Path, profile: str, share: float) -> None:
    path = many(tmp_path / "flight.mcap", profile)
    whole = path.read_bytes()
    path.write_bytes(whole[: int(len(whole) * share)])
    assert recording_type_of(path) == "bag"
    bag = BagFile(path)
    found = times(bag)
    assert 5 < len(found) < 40
    assert found == list(range(len(found)))
    assert "it ends in the middle, as after a loss of power" in bag.cut


@pytest.mark.parametrize("packing", [CompressionType.NONE, CompressionType.LZ4, CompressionType.ZSTD])
def test_a_chunk_that_the_end_of_the_file_cuts_is_read_up_to_there(
    tmp_path: Path, packing: CompressionType
) -> None:
    path = many(tmp_path / "flight.mcap", count=600, chunk_bytes=1 << 22, packing=packing)
    whole = path.read_bytes()
    path.write_bytes(whole[: int(0.6 * len(whole))])
    bag = BagFile(path)
    found = times(bag)
    assert 100 < len(found) < 600
    assert found == list(range(len(found)))
    assert "it ends in the middle, as after a loss of power" in bag.cut


@pytest.mark.parametrize("lost", [0, 60])
def test_a_damaged_chunk_costs_itself_alone(tmp_path: Path, lost: int) -> None:
    path = many(tmp_path / "flight.mcap")
    data = bytearray(path.read_bytes())
    del data[len(data) - lost :]
    raw = bytes(STORE.serialize_cdr(flights.pose(ODOMETRY, 7_000_000), ODOMETRY))
    at = data.find(raw[100:200])
    if at < 0:  # compressed: any byte of the middle of the eighth chunk
        at = data.find(b"zstd", 700) + 40
    data[at] ^= 0xFF
    path.write_bytes(data)
    bag = BagFile(path)
    assert len(times(bag)) == 39
    assert "1 of its chunks are damaged" in bag.cut or "ends in the middle" in bag.cut


@pytest.mark.parametrize("described", [None, ""])
def test_a_folder_without_a_description_and_with_one_file_is_that_file(
    tmp_path: Path, described: str | None
) -> None:
    many(tmp_path / "flight_0.mcap")
    if described is not None:
        (tmp_path / "metadata.yaml").write_text(described)
    assert recording_type_of(tmp_path) == "bag"
    assert times(BagFile(tmp_path)) == list(range(40))


def test_a_folder_without_a_description_and_with_several_files_or_none_says_what_to_do(
    tmp_path: Path,
) -> None:
    with pytest.raises(UsageError, match=r"metadata\.yaml is missing, and it holds no \.mcap or \.db3 file"):
        BagFile(tmp_path)
    for k in range(2):
        many(tmp_path / f"flight_{k}.mcap")
    with pytest.raises(UsageError, match="it holds 2 files of a bag: make it again by `ros2 bag reindex`"):
        BagFile(tmp_path)


@pytest.mark.parametrize("data", [b"", b"no MCAP", b"\x89MCAP0\r\n"])
def test_a_file_that_is_none_is_refused_in_one_line(tmp_path: Path, data: bytes) -> None:
    path = tmp_path / "flight.mcap"
    path.write_bytes(data)
    with pytest.raises(UsageError, match="it is no ROS bag, or damaged"):
        BagFile(path)
