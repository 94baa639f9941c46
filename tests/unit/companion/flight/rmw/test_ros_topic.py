"""Key expressions and liveliness tokens, against those of rmw_zenoh's design.md and of other programs."""

from __future__ import annotations

import pytest

from companion.flight.rmw.ros_topic import LATCHED, SENSOR_DATA, NodeName, Qos, Topic, dds_type, topic_key

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
