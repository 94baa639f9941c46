"""Scheduler of messages sent to autopilot and ground stations at fixed rates."""

from __future__ import annotations

import asyncio
import math
from collections.abc import Callable
from typing import Any, Protocol

import numpy as np
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from companion.flight.fusion.odometry.odometry_estimate import OdometryEstimate
from companion.flight.fusion.pose_history import PoseHistory
from companion.flight.geometry.axes import Floats, level_frd_m
from companion.flight.geometry.pose import Pose
from companion.flight.link.link import Link
from companion.flight.mapping.clearance import BAND_M, band_m, obstacle_points_enu_m
from companion.flight.mapping.vehicle_surroundings import FARTHEST_M, Surroundings
from companion.flight.outputs.external_position.odometry_stream import OdometryStream
from companion.flight.outputs.landing_status import Status, status_messages
from companion.flight.outputs.landing_target import landing_target
from companion.flight.outputs.obstacle_distance import obstacle_distance
from companion.flight.outputs.obstacle_points import obstacle_points
from companion.runtime.clock import now_ns
from companion.runtime.ring_buffer import RingBuffer
from params import Parameters
from slz import Nearby

HEIGHT_HZ = 10.0
STATUS_HZ = 1.0
# Estimates are looked for at this rate, so that they are sent at their time.
ODOMETRY_LOOK_HZ = 100.0
ODOMETRY_HZ = 10.0
POINTS_EVERY = 3


MOST = 20_000  # samples kept, a quarter of an hour at 20 Hz


LONGEST_M = 120.0
LEAST_DOWN = 0.707


def downward_distance(height_m: float, boot_ms: int, down: float = 1.0) -> Any | None:
    """Return the message for a height above ground (m), None if it is unknown or out of range.

    Parameters
    ----------
    down
        Cosine of the vehicle's tilt. A rangefinder measures along the vehicle's own axis, and both autopilots
        multiply by this cosine; ArduPilot by no less than `LEAST_DOWN`, below which PX4 rejects the message.
    """
    height_m = height_m / max(LEAST_DOWN, down)
    if not math.isfinite(height_m) or not 0.0 <= height_m <= LONGEST_M:
        return None
    return mavlink.MAVLink_distance_sensor_message(
        boot_ms % 2**32,
        5,
        round(LONGEST_M * 100),
        round(height_m * 100),
        mavlink.MAV_DISTANCE_SENSOR_LASER,
        0,
        mavlink.MAV_SENSOR_ROTATION_PITCH_270,
        255,
    )


class Cadence:
    """Intervals between the messages of a stream.

    Parameters
    ----------
    hz
        Nominal rate; None for messages sent on demand.
    """

    def __init__(self, hz: float | None) -> None:
        self._period_ms = None if hz is None else 1e3 / hz
        self._last_ns: int | None = None
        self._intervals_ms = RingBuffer(MOST)
        self._ages_ms = RingBuffer(MOST)
        self.count = 0

    def record(self, now_ns: int, pose_age_ns: int | None = None) -> None:
        """Record the time of a message and the age of the newest pose sample behind it."""
        if self._last_ns is not None:
            self._intervals_ms.append((now_ns - self._last_ns) * 1e-6)
        if pose_age_ns is not None:
            self._ages_ms.append(pose_age_ns * 1e-6)
        self._last_ns = now_ns
        self.count += 1

    def pause(self) -> None:
        """Record a pause: the time until the next message does not count as an interval."""
        self._last_ns = None

    def summary(self) -> dict[str, Any]:
        """Return count, rate, and quantiles of jitter and pose age, as far as known."""
        out: dict[str, Any] = {"count": self.count}
        intervals = self._intervals_ms.array()
        if intervals.any():  # all are 0 if everything was sent at one instant
            out["hz"] = round(1e3 / float(intervals.mean()), 2)
            if self._period_ms is not None:
                out["jitter_ms"] = _quantiles(np.abs(intervals - self._period_ms))
        if self._ages_ms:
            out["pose_age_ms"] = _quantiles(self._ages_ms.array())
        return out


def _quantiles(values: Any) -> dict[str, float]:
    p50, p99, most = np.percentile(values, [50, 99, 100])
    return {"p50": round(float(p50), 2), "p99": round(float(p99), 2), "max": round(float(most), 2)}


class HasTarget(Protocol):
    """Holder of the landing point (3,) of the map frame for LANDING_TARGET; None for none."""

    target_enu_m: Floats | None


class HasEstimate(Protocol):
    """Source of the newest pose on the map, None without one."""

    @property
    def estimate(self) -> OdometryEstimate | None:
        """Newest estimate."""


class MessageSchedule:
    """Sender of each message at its own rate, with the newest pose and the newest report.

    Parameters
    ----------
    surroundings
        Obstacles and ground around the vehicle.
    ranges
        Whether to send ranges and obstacles: False if the LiDAR's data come through the autopilot, which
        forwards what it receives, so that the map would confirm itself.
    commands
        Holder of the landing point.
    odometry
        Source of estimates of the place, which are sent if `parameters.odometry` is "autopilot".

    Attributes
    ----------
    height_m
        Height above ground as last sent, None while unknown.
    """

    def __init__(
        self,
        link: Link,
        history: PoseHistory,
        surroundings: Surroundings,
        parameters: Parameters,
        status: Callable[[], Status],
        commands: HasTarget,
        odometry: HasEstimate | None = None,
        *,
        ranges: bool = True,
    ) -> None:
        self._link = link
        self._history = history
        self._surroundings = surroundings
        self._parameters = parameters
        self._status, self._commands = status, commands
        self._ranges = ranges
        self._odometry = odometry
        self._odometry_stream = OdometryStream()
        self._batch_ms = 0
        self._turn = 0
        self.height_m: float | None = None
        self._cadences = {
            "LANDING_TARGET": Cadence(parameters.landing_target_hz),
            "OBSTACLE_DISTANCE": Cadence(parameters.obstacle_hz),
            "OBSTACLE_DISTANCE_3D": Cadence(None),
            "DISTANCE_SENSOR": Cadence(HEIGHT_HZ),
            "ODOMETRY": Cadence(ODOMETRY_HZ),
        }

    async def run(self) -> None:
        """Send until cancelled."""
        p = self._parameters
        streams: list[tuple[str, Callable[[], float], Callable[[], None]]] = [
            ("landing target", lambda: p.landing_target_hz, self.send_target),
            ("obstacles", lambda: p.obstacle_hz, self.send_obstacles),
            ("height", lambda: HEIGHT_HZ, self.send_height),
            ("status", lambda: STATUS_HZ, self.send_status),
        ]
        if p.odometry == "autopilot":  # which stays as it was at the start
            streams.append(("odometry", lambda: ODOMETRY_LOOK_HZ, self.send_odometry))
        async with asyncio.TaskGroup() as group:
            for name, hz, send in streams:
                group.create_task(_every(hz, send), name=name)

    def statistics(self) -> dict[str, Any]:
        """Return the cadence of each stream by message name."""
        return {name: cadence.summary() for name, cadence in self._cadences.items()}

    # ---- the streams ----------------------------------------------------------------------------

    def send_target(self) -> None:
        """Send the landing target, if there is one."""
        at_ns = now_ns()
        target_enu_m = self._commands.target_enu_m
        pose = None if target_enu_m is None else self._history.latest(at_ns)
        message = None
        if pose is not None and target_enu_m is not None:
            message = landing_target(
                self._link.vehicle,
                target_enu_m,
                pose,
                at_ns,
                pose_timeout_s=self._parameters.pose_timeout_s,
                frame=self._history.frame,
                correction=self._history.correction,
            )
        self._send("LANDING_TARGET", message)

    def send_obstacles(self) -> None:
        """Send the obstacles around the vehicle; nothing while the LiDAR is silent, which must be noticed."""
        pose = self._pose_of_fresh_scans()
        if pose is None:
            self._send("OBSTACLE_DISTANCE", None)
            return
        p, around = self._parameters, self._surroundings.nearby()
        at_ns = now_ns()
        reach_m = min(p.lidar_max_m, FARTHEST_M)
        if self._link.vehicle.landed == "on_ground":  # the ground would count as obstacle and forbid arming
            nothing = np.empty((0, 3))
            band = -BAND_M, BAND_M
            message = obstacle_distance(nothing, at_ns, min_m=p.lidar_min_m, max_m=reach_m, band_m=band)
            self._send("OBSTACLE_DISTANCE", message)
            return
        band = band_m(self._surroundings.height_m(pose.position_enu_m, at_ns), p.relief_m)
        if self._turn % POINTS_EVERY == 0:
            self._send_points(pose, around, band[1], reach_m)
        self._turn += 1
        columns = np.empty((0, 3))
        if around is not None:
            columns = level_frd_m(around.columns_enu_m(float(pose.position_enu_m[2]) - band[1]), pose)
        wires = level_frd_m(self._surroundings.wires_enu_m(pose.position_enu_m, reach_m), pose)
        message = obstacle_distance(
            np.concatenate([self._surroundings.returns.level_frd_m(pose, at_ns), wires]),
            at_ns,
            min_m=p.lidar_min_m,
            max_m=reach_m,
            band_m=band,
            columns_frd_m=columns,
            cell_m=0.0 if around is None else around.cell_m,
        )
        self._send("OBSTACLE_DISTANCE", message)

    def _send_points(self, pose: Pose, around: Nearby | None, low_m: float, reach_m: float) -> None:
        """Send a batch of points, if they are used; distances must follow: some versions forget them."""
        if not self._link.vehicle.autopilot.takes_obstacle_points:
            return
        report = self._surroundings.latest.newest
        selected = None if report is None else report.selected
        points = obstacle_points_enu_m(pose.position_enu_m, around, selected, low_m)
        points = np.concatenate([points, self._surroundings.wires_enu_m(pose.position_enu_m, reach_m)])
        self._batch_ms = max(self._batch_ms + 1, self._boot_ms())
        least_m = self._parameters.lidar_min_m
        for message in obstacle_points(points, pose, self._batch_ms, min_m=least_m, max_m=reach_m):
            self._send("OBSTACLE_DISTANCE_3D", message)

    def send_height(self) -> None:
        """Send the height above ground while it is known."""
        pose = self._pose_of_fresh_scans()
        height = self.height_m = (
            None if pose is None else self._surroundings.height_m(pose.position_enu_m, now_ns())
        )
        message = None
        if pose is not None and height is not None:
            message = downward_distance(height, self._boot_ms(), -float(pose.rotation_enu_from_frd[2, 2]))
        self._send("DISTANCE_SENSOR", message)

    def send_status(self) -> None:
        """Send the landing status to ground stations."""
        for message in status_messages(self._status(), self._boot_ms()):
            self._link.send(message)

    def send_odometry(self) -> None:
        """Send each estimate of the LiDAR odometry once, if it shall aid the autopilot."""
        if self._parameters.odometry != "autopilot":
            return
        estimate = None if self._odometry is None else self._odometry.estimate
        due = self._odometry_stream.due(self._link.vehicle, estimate, self._history.frame, now_ns())
        for message in due:
            if message.get_type() == "ODOMETRY":
                self._send("ODOMETRY", message)
            else:
                self._link.send(message)

    # ---- parts ----------------------------------------------------------------------------------

    def _send(self, name: str, message: Any | None) -> None:
        cadence = self._cadences[name]
        if message is None:
            cadence.pause()
            return
        self._link.send(message)
        at_ns, newest_ns = now_ns(), self._history.bracketed_until_ns
        cadence.record(at_ns, None if newest_ns is None else at_ns - newest_ns)

    def _pose_of_fresh_scans(self) -> Pose | None:
        if not self._ranges:
            return None
        at_ns, newest_ns = now_ns(), self._surroundings.returns.newest_ns
        if newest_ns is None or at_ns - newest_ns > self._parameters.lidar_timeout_s * 1e9:
            return None
        return self._history.latest(at_ns)

    def _boot_ms(self) -> int:
        return self._link.vehicle.boot_ms or 0


async def _every(hz: Callable[[], float], act: Callable[[], None]) -> None:
    """Call `act` at multiples of the period from now, re-read each time; missed ones are skipped."""
    loop = asyncio.get_running_loop()
    due_s = loop.time()
    while True:
        act()
        period_s = 1 / hz()
        due_s += period_s
        late_s = loop.time() - due_s
        if late_s > 0:
            due_s += period_s * (late_s // period_s)
        await asyncio.sleep(due_s - loop.time())
