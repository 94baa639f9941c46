"""Parser of livox_ros_driver/CustomMsg and livox_ros_driver2/CustomMsg from serialised bytes.

A header, uint64 timebase, uint32 point_num, uint8 lidar_id, uint8[3] rsvd, CustomPoint[] points; a point is
uint32 offset_time (ns), float32 x, y, z (m), uint8 reflectivity, tag, line. ROS 1 packs them without gaps,
ROS 2 aligns each number to its own size (CDR). The points become one array, without an object per point.
"""

from __future__ import annotations

import struct

import numpy as np

from companion.flight.sensors.decoders.livox_points import DOUBTFUL
from companion.flight.sensors.decoders.point_cloud import BadCloudError, StampedCloud, Table

# The message whose tags are those of the Mid-360, and those of older sensors, whose tags count returns.
MID360 = "livox_ros_driver2/msg/CustomMsg"
MESSAGES = (MID360, "livox_ros_driver/msg/CustomMsg", "livox_interfaces/msg/CustomMsg")
FIELDS = ("offset_time", "x", "y", "z", "reflectivity", "tag", "line")
FORMS = ("u4", "f4", "f4", "f4", "u1", "u1", "u1")
OFFSETS = (0, 4, 8, 12, 16, 17, 18)
POINT_BYTES, ALIGNED_BYTES = 19, 20
AFTER_TIMEBASE = 8  # point_num, lidar_id, rsvd
LITTLE = 1


def parse(raw: bytes, kind: str, ros2: bool) -> StampedCloud:
    """Return the points of a message; for the Mid-360 without those of low confidence, as in flight.

    Raises
    ------
    BadCloudError
        It is shorter than it states.
    """
    try:
        cloud = _aligned(memoryview(raw)[4:], "<" if raw[1] == LITTLE else ">") if ros2 else _packed(raw)
    except (struct.error, IndexError, UnicodeDecodeError, ValueError) as error:
        raise BadCloudError(f"its bytes are not those of a {kind}: {error}") from None
    if kind != MID360:
        return cloud
    sure = cloud.table["tag"] & DOUBTFUL == 0
    return StampedCloud(cloud.stamp_ns, cloud.frame, cloud.table[sure], int(len(sure) - sure.sum()))


def _packed(raw: bytes) -> StampedCloud:
    """Parse the serialisation of ROS 1."""
    _, seconds, nanoseconds, length = struct.unpack_from("<IIII", raw)
    at = 16 + length
    frame = raw[16:at].decode()
    at += 8 + AFTER_TIMEBASE
    (n,) = struct.unpack_from("<I", raw, at)
    return StampedCloud(seconds * 10**9 + nanoseconds, frame, _table(raw[at + 4 :], n, POINT_BYTES, "<"))


def _aligned(body: memoryview, order: str) -> StampedCloud:
    """Parse the serialisation of ROS 2, after its encapsulation."""
    seconds, nanoseconds, length = struct.unpack_from(order + "iII", body)
    at = 12 + length
    frame = bytes(body[12:at]).rstrip(b"\0").decode()
    at += -at % 8 + 8 + AFTER_TIMEBASE
    (n,) = struct.unpack_from(order + "I", body, at)
    return StampedCloud(seconds * 10**9 + nanoseconds, frame, _table(body[at + 4 :], n, ALIGNED_BYTES, order))


def _table(data: bytes | memoryview, n: int, step: int, order: str) -> Table:
    """Return n points at a stride of `step` bytes; the last has no padding."""
    needed = (n - 1) * step + POINT_BYTES if n else 0
    if len(data) < needed:
        raise ValueError(f"{n} points are not in {len(data)} bytes")
    padded = bytes(data[:needed]).ljust(n * step, b"\0")
    forms = [order + form for form in FORMS]
    return np.frombuffer(
        padded, np.dtype({"names": FIELDS, "formats": forms, "offsets": OFFSETS, "itemsize": step})
    )
