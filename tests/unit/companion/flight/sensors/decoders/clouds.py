"""Clouds of a ROS driver as they arrive: rmw_zenoh's attachment, then the message."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from rosbags.typesys import Stores, get_typestore

from companion.flight.rmw.attachment import Attachment

BEGIN_NS = 1_750_000_000_000_000_000
PERIOD_NS = 100_000_000
STORE: Any = get_typestore(Stores.ROS2_JAZZY)
CLOUD, FLOAT, UINT32 = "sensor_msgs/msg/PointCloud2", 7, 6
GID = b"a driver of ours"


@dataclass(frozen=True)
class Driver:
    """A driver that sends a cloud each tenth of a second, its points 1 ms apart, 20 m ahead and 1 m apart.

    time_field: name of the points' times (ns after the stamp), empty for none.
    """

    frame: str = "livox_frame"
    time_field: str = "t"
    points: int = 100
    gid: bytes = GID
    xyz: Any = field(default=None, compare=False)

    def message(self, number: int) -> Any:
        """Return the message of a number, from 1."""
        types = STORE.types
        point_field, header = types["sensor_msgs/msg/PointField"], types["std_msgs/msg/Header"]
        names = [*"xyz", "intensity", *([self.time_field] if self.time_field else [])]
        fields = [point_field(n, 4 * k, UINT32 if k == 4 else FLOAT, 1) for k, n in enumerate(names)]
        table = np.zeros(self.points, [(n, "<u4" if k == 4 else "<f4") for k, n in enumerate(names)])
        table["x"], table["y"], table["z"] = 20.0, np.arange(self.points), -1.0
        if self.xyz is not None:
            table["x"], table["y"], table["z"] = self.xyz.T
        table["intensity"] = 9
        if self.time_field:
            table[self.time_field] = np.arange(self.points) * 1_000_000
        stamp_ns = BEGIN_NS + number * PERIOD_NS
        stamp = types["builtin_interfaces/msg/Time"](stamp_ns // 10**9, stamp_ns % 10**9)
        data = np.frombuffer(table.tobytes(), np.uint8)
        step = table.dtype.itemsize
        return types[CLOUD](
            header(stamp, self.frame), 1, len(table), fields, False, step, len(data), data, True
        )

    def payload(self, number: int) -> bytes:
        """Return the message as CDR."""
        return bytes(STORE.serialize_cdr(self.message(number), CLOUD))

    def packet(self, number: int) -> bytes:
        """Return attachment and message."""
        return self.attachment(number) + self.payload(number)

    def attachment(self, number: int) -> bytes:
        """Return the attachment of a message."""
        return Attachment(number, BEGIN_NS + number * PERIOD_NS, self.gid).pack()

    def but(self, **changed: Any) -> Driver:
        """Return another driver."""
        return replace(self, **changed)
