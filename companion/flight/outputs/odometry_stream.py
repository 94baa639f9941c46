"""Stream of ODOMETRY: each estimate of the LiDAR once, and the companion's clock for ArduPilot."""

from __future__ import annotations

from typing import Any

from companion.flight.fusion.odometry.odometry_estimate import OdometryEstimate
from companion.flight.link.vehicle_state import VehicleState
from companion.flight.outputs.landing_target import local_origin_enu_m
from companion.flight.outputs.odometry_message import clock_message, odometry_message
from slz.frame import LocalFrame

# Both autopilots drop a sample that follows another too closely, ArduPilot in 20 ms (extNavIntervalMin_ms).
SHORTEST_NS = 33_000_000
# ArduPilot's clock of the link follows the least delay of 100 messages: ten of them in flight, at 10 Hz.
CLOCK_NS = 1_000_000_000
# On the ground it reports an odometry silent for 0.3 s as unhealthy, and does not arm.
CLOCK_ON_GROUND_NS = 100_000_000


class OdometryStream:
    """Selection of the messages that are due, without I/O.

    An estimate is sent once: a repeated one would be fused as a second measurement, or spoil the autopilot's
    estimate of the link's delay.
    """

    def __init__(self) -> None:
        self._stamp_ns: int | None = None
        self._clock_ns: int | None = None

    def due(
        self, vehicle: VehicleState, estimate: OdometryEstimate | None, frame: LocalFrame | None, now_ns: int
    ) -> list[Any]:
        """Return the messages to send now, the ODOMETRY last; empty if nothing is due."""
        message = self._odometry(vehicle, estimate, frame, now_ns)
        if message is None:
            waits = vehicle.autopilot == "ardupilot" and not vehicle.armed
            return self._clock(now_ns, CLOCK_ON_GROUND_NS) if waits else []
        clock = self._clock(now_ns, CLOCK_NS) if vehicle.autopilot == "ardupilot" else []
        return [*clock, message]

    def _odometry(
        self, vehicle: VehicleState, estimate: OdometryEstimate | None, frame: LocalFrame | None, now_ns: int
    ) -> Any | None:
        if estimate is None or frame is None:
            return None
        if self._stamp_ns is not None and estimate.stamp_ns - self._stamp_ns < SHORTEST_NS:
            return None
        message = odometry_message(vehicle, estimate, local_origin_enu_m(frame, vehicle), now_ns)
        if message is not None:
            self._stamp_ns = estimate.stamp_ns
        return message

    def _clock(self, now_ns: int, interval_ns: int) -> list[Any]:
        if self._clock_ns is not None and now_ns - self._clock_ns < interval_ns:
            return []
        self._clock_ns = now_ns
        return [clock_message(now_ns)]
