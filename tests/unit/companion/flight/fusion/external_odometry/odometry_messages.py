"""Messages of nav_msgs/Odometry as another program makes them."""

from __future__ import annotations

import struct
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray
from rosbags.typesys import Stores, get_typestore

Floats = NDArray[np.float64]
STORE: Any = get_typestore(Stores.ROS2_KILTED)
GID = b"an odometry node"
STATED = tuple(np.diag([0.02**2] * 3 + [0.005**2] * 3).ravel().tolist())


@dataclass(frozen=True)
class Told:
    """Message. stamp_ns: since 1970. covariance: of the pose, 36 numbers."""

    stamp_ns: int
    position_m: tuple[float, ...] = (1.0, 2.0, 3.0)
    xyzw: tuple[float, ...] = (0.0, 0.0, 0.0, 1.0)
    covariance: tuple[float, ...] = STATED
    frame: str = "odom"
    child: str = "base_link"
    number: int = 1
    gid: bytes = field(default=GID)

    def payload(self) -> bytes:
        """Return the message as CDR."""
        of = STORE.types
        stamp = of["builtin_interfaces/msg/Time"](*divmod(self.stamp_ns, 1_000_000_000))
        head = of["std_msgs/msg/Header"](stamp, self.frame)
        place = of["geometry_msgs/msg/Point"](*self.position_m)
        pose = of["geometry_msgs/msg/Pose"](place, of["geometry_msgs/msg/Quaternion"](*self.xyzw))
        there = of["geometry_msgs/msg/PoseWithCovariance"](pose, np.array(self.covariance, np.float64))
        still = of["geometry_msgs/msg/Vector3"](0.0, 0.0, 0.0)
        twist = of["geometry_msgs/msg/Twist"](still, still)
        moves = of["geometry_msgs/msg/TwistWithCovariance"](twist, np.zeros(36))
        message = of["nav_msgs/msg/Odometry"](head, self.child, there, moves)
        return bytes(STORE.serialize_cdr(message, "nav_msgs/msg/Odometry"))

    def attachment(self) -> bytes:
        """Return the attachment of rmw_zenoh."""
        return struct.pack("<qqB16s", self.number, self.stamp_ns, 16, self.gid)

    def packet(self) -> bytes:
        """Return attachment and message."""
        return self.attachment() + self.payload()
