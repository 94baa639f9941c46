"""Type hashes, against those that ROS 2 and others' software publish, and against an own computation."""

from __future__ import annotations

import pytest
from zenoh.ext import Int64, z_serialize

from companion.flight.rmw.attachment import Attachment, unpack
from companion.flight.rmw.message_types import GRID_MAP, LITTLE_ENDIAN, message_types
from companion.flight.rmw.ros_topic import LATCHED, SENSOR_DATA, NodeName, Qos, Topic, dds_type, topic_key
from tests.unit.companion.flight.rmw.type_hash import type_hash

# As read in rmw_zenoh's design.md, in `ros2 topic info -v` of Jazzy, in metadata of Jazzy's bags, and in the
# tests of other programs that speak rmw_zenoh.
PUBLISHED = {
    "std_msgs/msg/String": "df668c740482bbd48fb39d76a70dfd4bd59db1288021743503259e948f6b1a18",
    "sensor_msgs/msg/PointCloud2": "9198cabf7da3796ae6fe19c4cb3bdd3525492988c70522628af5daa124bae2b5",
    "nav_msgs/msg/Odometry": "3cc97dc7fb7502f8714462c526d369e35b603cfc34d946e3f2eda2766dfec6e0",
    "geometry_msgs/msg/PoseStamped": "10f3786d7d40fd2b54367835614bff85d4ad3b5dab62bf8bca0cc232d73b4cd8",
    "geometry_msgs/msg/Pose": "d501954e9476cea2996984e812054b68026ae0bfae789d9a10b23daf35cc90fa",
    "visualization_msgs/msg/MarkerArray": "86cb8800b6fb05b5eff1abd7a56f62a5641d3ae9a1c29e78e67e704f1d067dcf",
    "diagnostic_msgs/msg/DiagnosticArray": "5a8a36efb05fb25070fa0fb3810290c0e6cd4862b54a8fb975a1ee8dc55a333e",
    "tf2_msgs/msg/TFMessage": "e369d0f05a23ae52508854b66f6aa0437f3449d652e8cbf22d5abe85d020f087",
    "builtin_interfaces/msg/Time": "b106235e25a4c5ed35098aa0a61a3ee9c9b18d197f398b0e4206cea9acf9c197",
}
# The messages of grid_map's branches for ROS 2 (humble to rolling), and those that they hold.
GRID_MAPS = {
    "grid_map_msgs/msg/GridMap": """
        std_msgs/Header header
        grid_map_msgs/GridMapInfo info
        string[] layers
        string[] basic_layers
        std_msgs/Float32MultiArray[] data
        uint16 outer_start_index
        uint16 inner_start_index
    """,
    "grid_map_msgs/msg/GridMapInfo": """
        float64 resolution
        float64 length_x
        float64 length_y
        geometry_msgs/Pose pose
    """,
    "std_msgs/msg/Header": "builtin_interfaces/Time stamp\nstring frame_id",
    "builtin_interfaces/msg/Time": "int32 sec\nuint32 nanosec",
    "std_msgs/msg/Float32MultiArray": "std_msgs/MultiArrayLayout layout\nfloat32[] data",
    "std_msgs/msg/MultiArrayLayout": "std_msgs/MultiArrayDimension[] dim\nuint32 data_offset",
    "std_msgs/msg/MultiArrayDimension": "string label\nuint32 size\nuint32 stride",
    "geometry_msgs/msg/Pose": "geometry_msgs/Point position\ngeometry_msgs/Quaternion orientation",
    "geometry_msgs/msg/PoseStamped": "std_msgs/Header header\ngeometry_msgs/Pose pose",
    "geometry_msgs/msg/Point": "float64 x\nfloat64 y\nfloat64 z",
    "geometry_msgs/msg/Quaternion": "float64 x\nfloat64 y\nfloat64 z\nfloat64 w",
}


@pytest.mark.parametrize("name", PUBLISHED)
def test_hashes_are_the_published_ones(name: str) -> None:
    assert message_types().hash(name) == f"RIHS01_{PUBLISHED[name]}"


@pytest.mark.parametrize("name", GRID_MAPS)
def test_hashes_of_grid_maps_are_those_of_their_definitions(name: str) -> None:
    assert message_types().hash(name) == type_hash(name, GRID_MAPS)
    if name in PUBLISHED:  # the own computation is right
        assert type_hash(name, GRID_MAPS) == f"RIHS01_{PUBLISHED[name]}"


def test_a_message_is_plain_little_endian_cdr() -> None:
    types = message_types()
    time = types.make("builtin_interfaces/msg/Time", 1, 2)
    assert types.serialise(time) == LITTLE_ENDIAN + b"\1\0\0\0\2\0\0\0"
    assert types.deserialise(types.serialise(time), "builtin_interfaces/msg/Time") == time
    assert types.hash(GRID_MAP).startswith("RIHS01_")


# Attachments, against the bytes of Zenoh's own serialiser, which rmw_zenoh uses.


GID = bytes(range(16))


def test_bytes_are_those_of_zenoh_s_serialiser() -> None:
    made = Attachment(5, 1_750_000_000_123_456_789, GID)
    assert made.pack() == bytes(z_serialize((Int64(5), Int64(1_750_000_000_123_456_789), GID)))
    assert unpack(made.pack()) == made


def test_anything_else_is_no_attachment() -> None:
    packed = Attachment(5, 7, GID).pack()
    for length in range(len(packed)):
        assert unpack(packed[:length]) is None
    assert unpack(packed + b"\0") is None
    assert unpack(packed[:16] + b"\x0f" + packed[17:]) is None


# Key expressions and liveliness tokens, against those of rmw_zenoh's design.md and of other programs.


STRING = "RIHS01_df668c740482bbd48fb39d76a70dfd4bd59db1288021743503259e948f6b1a18"
LISTENER = NodeName(2, "aac3178e146ba6f1fc6e6a4085e77f21", "listener")
TALKER = NodeName(2, "8b20917502ee955ac4476e0266340d5c", "talker")


def test_keys_are_those_of_the_design_document() -> None:
    chatter = Topic("/chatter", "std_msgs/msg/String", Qos(10))
    in_namespace = Topic("/robot1/chatter", "std_msgs/msg/String", Qos(10))
    assert topic_key(0, chatter, STRING) == f"0/chatter/std_msgs::msg::dds_::String_/{STRING}"
    assert topic_key(0, in_namespace, STRING) == f"0/robot1/chatter/std_msgs::msg::dds_::String_/{STRING}"
    assert dds_type("sensor_msgs/msg/PointCloud2") == "sensor_msgs::msg::dds_::PointCloud2_"


def test_tokens_are_those_of_the_design_document() -> None:
    assert LISTENER.token() == "@ros2_lv/2/aac3178e146ba6f1fc6e6a4085e77f21/0/0/NN/%/%/listener"
    heard, said = (Topic("/chatter", "std_msgs/msg/String", Qos(depth)) for depth in (10, 7))
    assert LISTENER.endpoint_token(heard, STRING, 10, "MS") == (
        "@ros2_lv/2/aac3178e146ba6f1fc6e6a4085e77f21/0/10/MS/%/%/listener/%chatter/"
        f"std_msgs::msg::dds_::String_/{STRING}/::,10:,:,:,,"
    )
    assert TALKER.endpoint_token(said, STRING, 10, "MP") == (
        "@ros2_lv/2/8b20917502ee955ac4476e0266340d5c/0/10/MP/%/%/talker/%chatter/"
        f"std_msgs::msg::dds_::String_/{STRING}/::,7:,:,:,,"
    )


@pytest.mark.parametrize(
    ("qos", "token"),
    [
        (LATCHED, ":1:,1:,:,:,,"),  # of /robot_description and /tf_static, as published by ROS
        (SENSOR_DATA, "2::,5:,:,:,,"),  # of a camera's image_raw
        (Qos(100), "::,100:,:,:,,"),  # of /tf
        (Qos(42), "::,:,:,:,,"),  # rmw_zenoh's default
    ],
)
def test_quality_of_service_is_noted_as_others_note_it(qos: Qos, token: str) -> None:
    assert qos.token() == token
