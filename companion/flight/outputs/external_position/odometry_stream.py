"""Stream of ODOMETRY: each estimate of the LiDAR once, and the companion's clock for ArduPilot."""

from __future__ import annotations

from collections import deque
from typing import Any

from companion.flight.fusion.odometry.odometry_estimate import OdometryEstimate
from companion.flight.link.vehicle_state import VehicleState
from companion.flight.outputs.external_position.odometry_message import (
    clock_message,
    earliest_ns,
    odometry_message,
)
from companion.flight.outputs.landing_target import local_origin_enu_m
from slz.frame import LocalFrame

# Both autopilots drop a sample that follows another too closely, ArduPilot in 20 ms (extNavIntervalMin_ms).
SHORTEST_NS = 33_000_000
# ArduPilot's clock of the link follows the least delay of 100 messages: ten of them in flight, at 10 Hz.
CLOCK_NS = 1_000_000_000
# On the ground it reports an odometry silent for 0.3 s as unhealthy, and does not arm.
CLOCK_ON_GROUND_NS = 100_000_000
# Estimates that wait for their time: 0.2 s at 30 Hz, and some that are late.
WAITING = 10


class OdometryStream:
    """Selection of the messages that are due, without I/O.

    An estimate is sent once, because a repeated one would be fused as a second measurement, and to ArduPilot
    not before its time (`earliest_ns`).
    """

    def __init__(self) -> None:
        self._taken_ns: int | None = None
        self._waiting: deque[OdometryEstimate] = deque(maxlen=WAITING)
        self._clock_ns: int | None = None

    def due(
        self, vehicle: VehicleState, estimate: OdometryEstimate | None, frame: LocalFrame | None, now_ns: int
    ) -> list[Any]:
        """Return the messages to send now, ODOMETRY last; empty if nothing is due."""
        self._take(estimate)
        odometry = [] if frame is None else self._odometry(vehicle, frame, now_ns)
        accepted = vehicle.autopilot.external_position
        if accepted is None or not accepted.needs_clock:
            return odometry
        if odometry:
            return [*self._clock(now_ns, CLOCK_NS), *odometry]
        return [] if vehicle.armed else self._clock(now_ns, CLOCK_ON_GROUND_NS)

    def _take(self, estimate: OdometryEstimate | None) -> None:
        if estimate is None:
            return
        if self._taken_ns is None or estimate.stamp_ns - self._taken_ns >= SHORTEST_NS:
            self._taken_ns = estimate.stamp_ns
            self._waiting.append(estimate)

    def _odometry(self, vehicle: VehicleState, frame: LocalFrame, now_ns: int) -> list[Any]:
        messages = []
        while self._waiting and earliest_ns(vehicle, self._waiting[0]) <= now_ns:
            estimate = self._waiting.popleft()
            messages.append(odometry_message(vehicle, estimate, local_origin_enu_m(frame, vehicle), now_ns))
        return [message for message in messages if message is not None]

    def _clock(self, now_ns: int, interval_ns: int) -> list[Any]:
        if self._clock_ns is not None and now_ns - self._clock_ns < interval_ns:
            return []
        self._clock_ns = now_ns
        return [clock_message(now_ns)]
