"""Conversion of ROS pose messages to the poses of an autopilot.

ROS uses east, north, up and forward, left, up (REP 103); poses here rotate forward, right, down to north,
east, down. Few publishers state the axes of velocities reliably, so velocities are derived from positions.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

from companion.flight.fusion.pose_history import PoseHistory

Place = tuple[float, float, float]
Wxyz = tuple[float, float, float, float]
HALF = math.sqrt(0.5)
NO_FIX, NO_ORIENTATION = -1, -1.0
ZERO = (0.0, 0.0, 0.0)
PAUSE_NS = 10_000_000_000


def ned_from_frd(x: float, y: float, z: float, w: float) -> Wxyz:
    """Return the quaternion w, x, y, z of FRD body to NED, from that of ROS, FLU body to ENU."""
    # half a turn about the diagonal of north and east, then half a turn of the body about forward
    a, b, c, d = _product((0.0, HALF, HALF, 0.0), (w, x, y, z))
    return _product((a, b, c, d), (0.0, 1.0, 0.0, 0.0))


class LocalPoses:
    """Adapter of local-frame poses (PoseStamped, Odometry) to a history whose map frame has their origin."""

    def __init__(self, history: PoseHistory) -> None:
        self._history = history
        self._frame = history.frame  # kept, since the map's frame may change later
        self._velocity = _Velocity(self._placed)
        self.refused = 0

    def add_message(self, message: Any, stamp_ns: int) -> None:
        """Add the pose of a message."""
        pose = message.pose.pose if hasattr(message.pose, "pose") else message.pose
        place = pose.position.x, pose.position.y, pose.position.z
        q = pose.orientation
        if not (_sound(*place) and _sound(q.x, q.y, q.z, q.w)):
            self.refused += 1
            return
        self._velocity.add(stamp_ns, place, place)
        self._history.add_attitude(stamp_ns, ned_from_frd(q.x, q.y, q.z, q.w), ZERO)

    def finish(self) -> None:
        """Add the last position."""
        self._velocity.finish()

    def _placed(self, stamp_ns: int, place: Place, velocity_enu: Place) -> None:
        if self._frame is None:
            raise RuntimeError("poses of a local frame need an origin")
        lat, lon, alt = (float(v) for v in self._frame.lla(place))
        east, north, up = velocity_enu
        self._history.add_position(stamp_ns, lat, lon, alt, (north, east, -up))


class GlobalPoses:
    """Adapter of fixes (NavSatFix) and orientations (Imu) to a history."""

    def __init__(self, history: PoseHistory) -> None:
        self._history = history
        self._velocity = _Velocity(self._placed)
        self._scale: Place | None = None
        self.refused = 0

    def add_message(self, message: Any, stamp_ns: int) -> None:
        """Add the fix or orientation of a message."""
        if hasattr(message, "latitude"):
            self._fix(message, stamp_ns)
            return
        q = message.orientation
        if message.orientation_covariance[0] == NO_ORIENTATION or not _sound(q.x, q.y, q.z, q.w):
            self.refused += 1
            return
        self._history.add_attitude(stamp_ns, ned_from_frd(q.x, q.y, q.z, q.w), ZERO)

    def finish(self) -> None:
        """Add the last fix."""
        self._velocity.finish()

    def _fix(self, message: Any, stamp_ns: int) -> None:
        lla = message.latitude, message.longitude, message.altitude
        if message.status.status == NO_FIX or not _sound(*lla) or abs(lla[0]) > 90 or abs(lla[1]) > 180:
            self.refused += 1
            return
        if self._scale is None:  # metres per degree, exact enough for velocities
            self._scale = 111_320 * math.cos(math.radians(lla[0])), 111_320, 1.0
        metres = lla[1] * self._scale[0], lla[0] * self._scale[1], lla[2]
        self._velocity.add(stamp_ns, lla, metres)

    def _placed(self, stamp_ns: int, place: Place, velocity_enu: Place) -> None:
        east, north, up = velocity_enu
        self._history.add_position(stamp_ns, *place, (north, east, -up))


class _Velocity:
    """Central-difference velocity: each position waits for its successor."""

    def __init__(self, placed: Callable[[int, Place, Place], None]) -> None:
        self._placed = placed
        self._before: tuple[int, Place] | None = None
        self._last: tuple[int, Place, Place] | None = None

    def add(self, stamp_ns: int, place: Place, metres: Place) -> None:
        """Add a position, in the units of the callback and in metres east, north, up."""
        if self._last is not None and stamp_ns <= self._last[0]:
            return
        if self._last is not None and stamp_ns - self._last[0] > PAUSE_NS:
            self.finish()
            self._before = None
        if self._last is not None:
            last_ns, last_place, last_metres = self._last
            before_ns, before = self._before or (last_ns, last_metres)
            self._placed(last_ns, last_place, _rate(before, metres, stamp_ns - before_ns))
            self._before = last_ns, last_metres
        self._last = stamp_ns, place, metres

    def finish(self) -> None:
        """Pass on the last position, with the velocity from its predecessor."""
        if self._last is not None and self._before is not None:
            stamp_ns, place, metres = self._last
            self._placed(stamp_ns, place, _rate(self._before[1], metres, stamp_ns - self._before[0]))
        self._last = None


def _rate(a: Place, b: Place, nanoseconds: int) -> Place:
    east, north, up = ((v - u) / (nanoseconds * 1e-9) for u, v in zip(a, b, strict=True))
    return east, north, up


def _sound(*numbers: float) -> bool:
    return all(math.isfinite(number) for number in numbers)


def _product(p: Wxyz, q: Wxyz) -> Wxyz:
    a, b, c, d = p
    w, x, y, z = q
    return (
        a * w - b * x - c * y - d * z,
        a * x + b * w + c * z - d * y,
        a * y - b * z + c * w + d * x,
        a * z + b * y - c * x + d * w,
    )
