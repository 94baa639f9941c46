"""ROS message types: classes, serialisation (CDR) and type hashes, by the library rosbags."""

from __future__ import annotations

from functools import cache
from typing import Any

GRID_MAP = "grid_map_msgs/msg/GridMap"
# The branches of grid_map for ROS 2; its GridMapInfo of ROS 1 holds the header instead.
_GRID_MAP = """\
std_msgs/Header header
grid_map_msgs/GridMapInfo info
string[] layers
string[] basic_layers
std_msgs/Float32MultiArray[] data
uint16 outer_start_index
uint16 inner_start_index
"""
_GRID_MAP_INFO = """\
float64 resolution
float64 length_x
float64 length_y
geometry_msgs/Pose pose
"""
LITTLE_ENDIAN = b"\0\1\0\0"  # encapsulation of plain CDR


class MessageTypes:
    """Types of the messages that the companion reads and writes."""

    def __init__(self) -> None:
        from rosbags.typesys import Stores, get_types_from_msg, get_typestore

        store: Any = get_typestore(Stores.ROS2_JAZZY)
        for text, name in ((_GRID_MAP_INFO, "grid_map_msgs/msg/GridMapInfo"), (_GRID_MAP, GRID_MAP)):
            store.register(get_types_from_msg(text, name))
        self._store = store

    def hash(self, name: str) -> str:
        """Return the type hash RIHS01 (REP 2016) of a type."""
        return str(self._store.hash_rihs01(name))

    def make(self, name: str, *values: object) -> Any:
        """Return a message with the values of its fields, in their order."""
        return self._store.types[name](*values)

    def serialise(self, message: Any) -> bytes:
        """Return a message as CDR, little-endian."""
        return bytes(self._store.serialize_cdr(message, message.__msgtype__))

    def deserialise(self, data: bytes, name: str) -> Any:
        """Return the message in bytes; anything may be raised where they are no message of that type."""
        return self._store.deserialize_cdr(data, name)


@cache
def message_types() -> MessageTypes:
    """Return the types, made once."""
    return MessageTypes()
