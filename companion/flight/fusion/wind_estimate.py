"""Wind estimate: the autopilot's own where it sends one, else from the vehicle's tilt."""

from __future__ import annotations

import logging
import math
from collections import deque
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from companion.flight.fusion.wind_from_tilt import SPAN_NS, TiltWind
from companion.flight.geometry.wind import Wind, WindSource
from companion.flight.link.link import Link
from companion.flight.link.vehicle_state import Quaternion, Vector, VehicleState
from companion.flight.link.wind_messages import MESSAGES, ImplausibleWindError, wind_velocity_ms

log = logging.getLogger(__name__)

MULTIROTORS = frozenset(
    {
        mavlink.MAV_TYPE_QUADROTOR,
        mavlink.MAV_TYPE_HEXAROTOR,
        mavlink.MAV_TYPE_OCTOROTOR,
        mavlink.MAV_TYPE_TRICOPTER,
        mavlink.MAV_TYPE_DODECAROTOR,
        mavlink.MAV_TYPE_DECAROTOR,
    }
)
AIRBORNE = ("in_air", "landing")


Floats = NDArray[np.float64]

MEAN_S = 30.0
GUST_NS = 60_000_000_000
SETTLED_NS = 5_000_000_000
STALE_NS = 5_000_000_000


class WindAverage:
    """Exponential mean over 30 s, and gust, of one source.

    The gust is that of the WMO, the greatest mean over 3 s (WMO-No. 8, Part I, 5.1), here of the last minute
    instead of ten, because the present weather decides a landing. In the first 30 s, all of the time has
    the same weight.

    Parameters
    ----------
    tells_gusts
        False for a source that takes manoeuvres for gusts: the gust is then the mean.
    """

    def __init__(self, source: WindSource, *, tells_gusts: bool = True) -> None:
        self._source, self._tells_gusts = source, tells_gusts
        self._mean = np.zeros(2)
        self._begun_ns: int | None = None
        self._newest_ns = 0
        self._gusts: deque[tuple[int, float]] = deque()  # speeds that no later one exceeds

    def clear(self) -> None:
        """Discard the wind."""
        self._begun_ns = None
        self._gusts.clear()

    def add(self, towards_ms: Floats, now_ns: int) -> None:
        """Add a wind (2,) towards east, north, averaged over 3 s."""
        if self._begun_ns is None or not 0 <= now_ns - self._newest_ns <= STALE_NS:
            self.clear()
            self._begun_ns, self._mean = now_ns, towards_ms.copy()
        else:
            elapsed_s = (now_ns - self._newest_ns) * 1e-9
            weight = elapsed_s / min(MEAN_S, max((now_ns - self._begun_ns) * 1e-9, elapsed_s, 1e-3))
            self._mean = self._mean + weight * (towards_ms - self._mean)
        self._newest_ns = now_ns
        speed_ms = float(np.hypot(*towards_ms))
        while self._gusts and self._gusts[-1][1] <= speed_ms:
            self._gusts.pop()
        self._gusts.append((now_ns, speed_ms))

    def at(self, now_ns: int) -> Wind | None:
        """Return the wind; None in the first 5 s, and after 5 s without a new one."""
        begun_ns = self._begun_ns
        if begun_ns is None or now_ns - self._newest_ns > STALE_NS or self._newest_ns - begun_ns < SETTLED_NS:
            return None
        while now_ns - self._gusts[0][0] > GUST_NS:
            self._gusts.popleft()
        east_ms, north_ms = (float(v) for v in self._mean)
        speed_ms = float(np.hypot(east_ms, north_ms))
        gust_ms = max(self._gusts[0][1], speed_ms) if self._tells_gusts else speed_ms
        return Wind.of_velocity(east_ms, north_ms, gust_ms, self._source)


class WindEstimate:
    """Wind from both sources.

    The autopilot's is filtered before it is sent; its gusts are averaged longer than 3 s. The tilt is used of
    multirotors alone: a helicopter's rotor tilts against its fuselage. It gives no gusts: PX4 tilts in
    manoeuvres as in gusts of 13 m/s.

    Parameters
    ----------
    drag_per_s
        See `TiltWind`; 0 estimates nothing from the tilt.

    Attributes
    ----------
    newest
        Last known wind, None before the first.
    implausible
        Number of messages dropped for impossible numbers.
    """

    def __init__(self, drag_per_s: float) -> None:
        self._tilt = TiltWind(drag_per_s) if drag_per_s > 0 else None
        self._reports: deque[tuple[int, float, float]] = deque()  # of 3 s
        self._of_autopilot = WindAverage("autopilot")
        self._of_tilt = WindAverage("tilt", tells_gusts=False)
        self._quat_wxyz: Quaternion | None = None
        self.newest: Wind | None = None
        self.implausible = 0

    def follow(self, link: Link) -> None:
        """Use the messages and poses of a link."""
        for name in MESSAGES:
            link.subscribe(name, lambda message, at_ns: self.on_message(message, link.vehicle, at_ns))
        link.inbox.on_attitude.subscribe(lambda _, quat, rates: self.on_attitude(quat))
        link.inbox.on_position.subscribe(
            lambda stamp_ns, lat, lon, alt, velocity: self.on_velocity(stamp_ns, velocity, link.vehicle)
        )
        link.inbox.on_reboot.subscribe(self.clear)

    def clear(self) -> None:
        """Discard everything: the autopilot rebooted."""
        self._reports.clear()
        self._of_autopilot.clear()
        self._stop_tilt()
        self._quat_wxyz = None

    def on_message(self, message: Any, vehicle: VehicleState, now_ns: int) -> None:
        """Use a message with the autopilot's wind."""
        try:
            velocity = wind_velocity_ms(message, vehicle.autopilot)
        except ImplausibleWindError as error:
            if not self.implausible:
                log.warning("the autopilot's wind is not believed: %s", error)
            self.implausible += 1
            return
        if velocity is None:
            return
        self._reports.append((now_ns, *velocity))
        while now_ns - self._reports[0][0] > SPAN_NS:
            self._reports.popleft()
        mean = np.array([report[1:] for report in self._reports]).mean(axis=0)
        self._of_autopilot.add(mean, now_ns)

    def on_attitude(self, quat_wxyz: Quaternion) -> None:
        """Use an attitude, body forward-right-down into north-east-down."""
        self._quat_wxyz = quat_wxyz

    def on_velocity(self, stamp_ns: int, velocity_ned_ms: Vector, vehicle: VehicleState) -> None:
        """Use a velocity with the newest attitude; on the ground and of other vehicles nothing is used."""
        flying = vehicle.armed and vehicle.landed in AIRBORNE and vehicle.vehicle_type in MULTIROTORS
        if self._tilt is None or self._quat_wxyz is None or not flying:
            self._stop_tilt()
            return
        north, east, down = velocity_ned_ms
        if not math.isfinite(north + east + down):
            return
        wind = self._tilt.add(stamp_ns, self._quat_wxyz, np.array([east, north, -down]))
        if wind is not None:
            self._of_tilt.add(wind, stamp_ns)

    def at(self, now_ns: int) -> Wind | None:
        """Return the wind now, None if it is unknown."""
        wind = self._of_autopilot.at(now_ns) or self._of_tilt.at(now_ns)
        self.newest = wind or self.newest
        return wind

    def summary(self) -> dict[str, Any]:
        """Return the last known wind for the flight summary."""
        wind = self.newest
        return {
            "from_deg": None if wind is None else round(math.degrees(wind.from_rad), 1),
            "speed_ms": None if wind is None else round(wind.speed_ms, 1),
            "gust_ms": None if wind is None else round(wind.gust_ms, 1),
            "source": None if wind is None else wind.source,
            "implausible": self.implausible,
        }

    def _stop_tilt(self) -> None:
        if self._tilt is not None:
            self._tilt.clear()
        self._of_tilt.clear()
