"""Every message that is read, with bad stamps and values, first and amidst good ones."""

from __future__ import annotations

import math
import struct
from dataclasses import fields, is_dataclass
from typing import Any

import numpy as np
import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from companion.flight.fusion.pose_history import PoseHistory
from companion.flight.link.command_server import CommandServer
from companion.flight.link.inbox import Inbox
from companion.flight.link.position_fix import PositionGate
from companion.flight.link.wire.codec import Codec
from companion.flight.sensors.mavlink_ranges import MavlinkRanges
from companion.flight.sensors.returns import Returns
from params import Parameters
from tests.unit.companion.flight.link.messages import ARMED, attitude, heartbeat, position, received

MS = 1_000_000
BAD_FLOATS = (math.nan, math.inf, -math.inf, 0.0, 3e38, -3e38)
# All that are read in flight; a HEARTBEAT of another mode is no bad value.
READ = [
    "ATTITUDE",
    "ATTITUDE_QUATERNION",
    "BATTERY_STATUS",
    "COMMAND_ACK",
    "CURRENT_MODE",
    "DISTANCE_SENSOR",
    "EKF_STATUS_REPORT",
    "ESTIMATOR_STATUS",
    "EXTENDED_SYS_STATE",
    "FENCE_STATUS",
    "GLOBAL_POSITION_INT",
    "GPS2_RAW",
    "GPS_RAW_INT",
    "HIGH_LATENCY2",
    "HOME_POSITION",
    "LOCAL_POSITION_NED",
    "MANUAL_CONTROL",
    "OBSTACLE_DISTANCE",
    "POSITION_TARGET_GLOBAL_INT",
    "POSITION_TARGET_LOCAL_NED",
    "RC_CHANNELS",
    "STATUSTEXT",
    "SYSTEM_TIME",
    "SYS_STATUS",
    "TIMESYNC",
    "WIND",
    "WIND_COV",
]
KINDS = [kind for kind in mavlink.mavlink_map.values() if kind.msgname in READ]


def bad(kind: Any, choice: int) -> Any | None:
    """Return a message whose numbers are all the n-th bad value of their type; None if it cannot be built."""
    values: list[Any] = []
    for name, count in zip(kind.fieldnames, kind.array_lengths, strict=True):
        of = kind.fieldtypes[kind.fieldnames.index(name)]
        if of == "char":
            values.append(b"x" * min(count or 1, 4))
            continue
        if of in ("float", "double"):
            value: Any = BAD_FLOATS[choice % len(BAD_FLOATS)]
        else:
            bits = 8 if of == "uint8_t_mavlink_version" else int("".join(c for c in of if c.isdigit()))
            low, high = (0, 2**bits - 1) if of.startswith("u") else (-(2 ** (bits - 1)), 2 ** (bits - 1) - 1)
            value = (0, high, low, 1, high - 1, low + 1)[choice % 6]
        ordered = kind.array_lengths[kind.ordered_fieldnames.index(name)]
        values.append([value] * ordered if ordered else value)
    try:
        return received(kind(*values))
    except (struct.error, TypeError, OverflowError):
        return None


class Listener:
    """An inbox with the history of poses and the ranges, as in flight."""

    def __init__(self) -> None:
        self.inbox = Inbox(Codec(191), CommandServer(), gate=PositionGate(None))
        self.history = PoseHistory(Parameters())
        self.batches: list[Returns] = []
        self.ranges = MavlinkRanges(Parameters(), self.inbox.clock, self.batches.append)
        self.inbox.on_certain.subscribe(self.history.limit_to_certain)
        self.inbox.on_attitude.subscribe(self.history.add_attitude)
        self.inbox.on_position.subscribe(self.history.add_position)
        self.inbox.on_reboot.subscribe(self.history.clear)
        self.at_ms = 0
        self.hear(heartbeat(base_mode=ARMED, custom_mode=4))

    def hear(self, message: Any) -> None:
        self.inbox.on_message(message, 10**9 + self.at_ms * MS)
        self.ranges.on_message(message, 10**9 + self.at_ms * MS)

    def fly(self, ms: int) -> None:
        for _ in range(0, ms, 40):
            self.at_ms += 40
            self.hear(attitude(60_000 + self.at_ms))
            self.hear(position(60_000 + self.at_ms, lat=470_000_000 + self.at_ms))


def numbers(value: Any) -> list[float]:
    """Return all numbers within a state."""
    if is_dataclass(value):
        return [number for field in fields(value) for number in numbers(getattr(value, field.name))]
    if isinstance(value, (tuple, list)):
        return [number for each in value for number in numbers(each)]
    return [value] if isinstance(value, float) else []


@pytest.mark.parametrize("kind", KINDS, ids=lambda kind: str(kind.msgname))
def test_bad_values_and_stamps_change_neither_pose_nor_map_nor_raise(kind: Any) -> None:
    for choice in range(6):
        message = bad(kind, choice)
        if message is None:
            continue
        for first in (True, False):
            listener = Listener()
            if not first:
                listener.fly(200)
            for _ in range(3):
                listener.hear(message)
            listener.fly(1600)
            vehicle, history = listener.inbox.vehicle, listener.history
            assert all(map(math.isfinite, numbers(vehicle)))
            assert vehicle.reboots == 0
            assert vehicle.position_lla == pytest.approx((47.0 + listener.at_ms * 1e-7, 8.0, 412.0))
            assert vehicle.attitude_wxyz == pytest.approx((1, 0, 0, 0))
            assert first or history.epoch == 0
            pose = history.latest(10**9 + listener.at_ms * MS)
            assert pose is not None
            assert np.isfinite(pose.position_enu_m).all()
            assert all(np.isfinite(batch.xyz_sensor_m).all() for batch in listener.batches)
