"""Two decoders of ROS messages, neither of them the companion's: rosbags and mcap-ros2-support."""

from __future__ import annotations

from dataclasses import fields, is_dataclass
from typing import Any

import numpy as np
from mcap.records import Schema
from mcap_ros2.decoder import DecoderFactory
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from tests.unit.companion.flight.rmw.test_message_types import GRID_MAPS

STORE: Any = get_typestore(Stores.ROS2_KILTED)
for _name in ("grid_map_msgs/msg/GridMapInfo", "grid_map_msgs/msg/GridMap"):
    STORE.register(get_types_from_msg(GRID_MAPS[_name], _name))


def decoded(sample: Any) -> Any:
    """Return a sample's message by mcap-ros2-support, after rosbags has read the same from it."""
    name = _ros_type(str(sample.key_expr).split("/")[-2])
    data = bytes(sample.payload)
    by_rosbags = STORE.deserialize_cdr(data, name)
    text, _ = STORE.generate_msgdef(name, ros_version=2)
    schema = Schema(id=1, data=text.encode(), encoding="ros2msg", name=name)
    decode = DecoderFactory().decoder_for("cdr", schema)
    assert decode is not None
    by_mcap = decode(data)
    _compare(by_rosbags, by_mcap, name)
    return by_mcap


def _ros_type(dds: str) -> str:
    package, kind, _, short = dds.split("::")
    return f"{package}/{kind}/{short.removesuffix('_')}"


def _compare(a: Any, b: Any, where: str) -> None:
    if is_dataclass(a):
        for field in fields(a):
            if field.name != "__msgtype__" and not field.name.replace("_", "").isupper():  # a constant
                _compare(getattr(a, field.name), getattr(b, field.name), f"{where}.{field.name}")
    elif isinstance(a, str | bool):
        assert a == b, where
    elif hasattr(a, "__len__"):
        assert len(a) == len(b), where
        for one, other in zip(a, b, strict=True):
            _compare(one, other, where)
    else:
        np.testing.assert_equal(a, b[0] if isinstance(b, bytes) else b, where)
