"""Simulated autopilot: ArduCopter's behaviour as far as a companion or a ground station can observe it."""

from __future__ import annotations

import logging
import math
from collections import deque
from collections.abc import Callable
from enum import IntEnum
from typing import Any

import numpy as np
import pymap3d
from numpy.typing import NDArray
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from sitl.autopilot.aiding.ekf2_aiding import Ekf2Aiding
from sitl.autopilot.airframe import Airframe, Kind
from sitl.autopilot.cascade_control import VelocityLoop, attitude_for, rate_command
from sitl.autopilot.commands import Commands
from sitl.autopilot.failsafe import PERIOD_NS, Failsafes
from sitl.autopilot.guidance.precland import PrecisionLanding
from sitl.autopilot.mission_items import FlightPlan, MissionServer, Rally
from sitl.autopilot.modes import NEEDS_POSITION, PILOTED, Mode, Navigator
from sitl.autopilot.parameters import with_defaults
from sitl.autopilot.position_aiding import PositionAiding
from sitl.autopilot.proximity import Proximity
from sitl.autopilot.radio_receiver import RadioReceiver
from sitl.autopilot.telemetry import Telemetry
from sitl.autopilot.wind_estimator import WindEstimator
from sitl.vehicle.multirotor import GRAVITY_MS2
from sitl.vehicle.rigid_body import State, to_euler
from sitl.world.geodetic import geodetic_of

F64 = NDArray[np.float64]
Demand = tuple[F64, float]

log = logging.getLogger(__name__)

MAX_TURN_RAD_S = math.radians(60.0)
MAX_LEAN_RAD = math.radians(20.0)
FULL_V, EMPTY_V = 16.8, 14.0
OUTER_LOOP_NS = 10_000_000
AVOID_FENCE, AVOID_PROXIMITY = 1, 2
LANDED_NS = 2_500_000_000  # ArduCopter SITL: 2.5 to 2.6 s from touchdown to disarmed
RANGEFINDER_NS = 500_000_000


class Autopilot:
    """Autopilot with modes, arming, guidance, precision landing, failsafes, parameters and messages.

    Parameters
    ----------
    origin_lla
        Latitude, longitude (degrees) and altitude (m) of the world's origin.
    parameters
        Values that differ from `sitl.autopilot.parameters.DEFAULTS`.
    boot_offset_ns
        Time since boot at the simulation's zero.
    ready_after_s
        Simulated seconds until the position estimate permits arming.
    """

    sysid = 1
    compid = 1
    first_mode: IntEnum = Mode.STABILIZE
    companion_modes: tuple[IntEnum, ...] = (Mode.LAND, Mode.GUIDED)
    """Modes in which a companion leads the vehicle."""

    def __init__(
        self,
        origin_lla: tuple[float, float, float],
        parameters: dict[str, float] | None = None,
        *,
        boot_offset_ns: int = 3_217_000_000,
        ready_after_s: float = 5.0,
    ) -> None:
        self.origin_lla = origin_lla
        self.parameters = self._with_defaults(parameters or {})
        self.boot_offset_ns = boot_offset_ns
        self.mode: IntEnum = self.first_mode
        self.armed = False
        self.airborne = False
        self.battery_pct = 100.0
        self.late_ns: Callable[[], int] = lambda: 0
        self.battery_sag_v = 0.0
        self.truth_source: Callable[[], State] | None = None
        self.precland = PrecisionLanding()
        self.proximity = Proximity()
        self.aiding = Ekf2Aiding(self.parameters) if self.has_ekf2 else PositionAiding(self.parameters)
        self.receiver = RadioReceiver()
        self.wind = WindEstimator()
        self.airframe = Airframe()
        self.target_enu_ms = np.zeros(3)
        self.rally, self.plan = Rally(self), FlightPlan(self)
        self._compose()
        self.faults = 0
        """Number of messages that raised an exception in a handler and were dropped."""
        self.mode_changes: list[tuple[int, str]] = []
        self.estimate: State | None = None
        self.rangefinder: tuple[int, float] | None = None
        self._ready_ns = round(ready_after_s * 1e9)
        self._now_ns = 0
        self._estimate_ns = 0
        self._outgoing: deque[tuple[int | None, Any]] = deque()
        self._velocity = VelocityLoop()
        self._yaw_rad: float | None = None
        self._wanted: tuple[F64, float] = (np.array([1.0, 0.0, 0.0, 0.0]), 0.0)
        self._next_outer_ns = 0
        self._next_check_ns = 0
        self._settled_since_ns: int | None = None
        self._silent_until_ns = 0

    def _with_defaults(self, parameters: dict[str, float]) -> dict[str, float]:
        return with_defaults(parameters)

    def _compose(self) -> None:
        """Make the parts in which one autopilot differs from another."""
        self.navigator = Navigator(self.parameters, self.precland)
        self.failsafes = Failsafes(self)
        self.telemetry = Telemetry(self, self.failsafes)
        self.missions = MissionServer(self, self.plan, self.rally, self.failsafes.fence.items)
        self.commands = Commands(self, self.telemetry, self.failsafes, self.missions)

    # ---- state and messages -----------------------------------------------------------------------

    @property
    def has_ekf2(self) -> bool:
        """True if the filter is PX4's."""
        return bool(self.parameters.get("EKF2_EN", 0.0))

    @property
    def mode_name(self) -> str:
        return self.mode.name

    @property
    def landing_target_enu_m(self) -> F64 | None:
        """Latest accepted LANDING_TARGET in the estimate's frame."""
        return self.precland.latest_enu_m

    @property
    def now_ns(self) -> int:
        return self._now_ns

    @property
    def boot_ns(self) -> int:
        """Time since boot."""
        return self._now_ns + self.boot_offset_ns

    @property
    def clock_ns(self) -> int:
        """Time since boot on its clock, which advances while a busy computer delays the simulation."""
        return self.boot_ns + self.late_ns()

    @property
    def estimate_boot_ns(self) -> int:
        """Time since boot of the current estimate, one tick older than the messages with it."""
        return self._estimate_ns + self.boot_offset_ns

    @property
    def settled(self) -> bool:
        """True if the estimator has settled after its start."""
        return self._now_ns >= self._ready_ns

    @property
    def position_ok(self) -> bool:
        """True if the position estimate permits arming and navigation."""
        return self.settled and self.aiding.absolute and not self.failsafes.ekf

    @property
    def battery_v(self) -> float:
        """Voltage of the battery."""
        return EMPTY_V + (FULL_V - EMPTY_V) * self.battery_pct / 100 - self.battery_sag_v

    @property
    def battery_used_mah(self) -> float:
        """Charge drawn from the battery."""
        return (100.0 - self.battery_pct) / 100 * self.parameters["BATT_CAPACITY"]

    def add_link(self, link: int) -> None:
        """Start the default streams on a link."""
        self.telemetry.add_link(link, self._now_ns)

    def receive(self, message: Any, link: int, now_ns: int) -> None:
        """Process a message for this autopilot or a broadcast."""
        self._now_ns = max(self._now_ns, now_ns)
        if self._now_ns < self._silent_until_ns:
            return
        self.add_link(link)
        try:
            self.commands.receive(message, link)
        except Exception:  # no message of a peer may stop the simulation
            self.faults += 1
            log.exception("a %s was dropped", message.get_type())

    def send(self, message: Any, link: int | None = None) -> None:
        """Queue a message for one link, or for all."""
        self._outgoing.append((link, message))

    def send_text(self, text: str, severity: int = mavlink.MAV_SEVERITY_INFO) -> None:
        """Send a STATUSTEXT to all links."""
        self.send(mavlink.MAVLink_statustext_message(severity, text.encode()[:50], 0, 0))

    def take_outgoing(self, now_ns: int) -> list[tuple[int | None, Any]]:
        """Return the messages to send now: link or None for all, and the message."""
        self._now_ns = max(self._now_ns, now_ns)
        if self._now_ns < self._silent_until_ns:
            return []
        self.telemetry.emit(self._now_ns)
        self.missions.on_tick(self._now_ns)
        out = list(self._outgoing)
        self._outgoing.clear()
        return out

    def lla(self, enu_m: F64) -> tuple[float, float, float]:
        """Return latitude, longitude, altitude of a point in the estimate's frame."""
        east, north, up = enu_m.tolist()
        return geodetic_of((east, north, up), self.origin_lla)

    def enu_m(self, lat_deg: float, lon_deg: float, alt_m: float) -> F64:
        """Return a geodetic point in the estimate's frame."""
        return np.array(pymap3d.geodetic2enu(lat_deg, lon_deg, alt_m, *self.origin_lla), np.float64)

    @property
    def height_above_home_m(self) -> float:
        return (
            0.0 if self.estimate is None else float(self.estimate.pos_enu_m[2] - self.navigator.home_enu_m[2])
        )

    # ---- actions and control -----------------------------------------------------------------------

    def set_mode(self, mode: IntEnum) -> bool:
        """Change the mode; GUIDED, RTL and others that need a position are refused without one."""
        if self.estimate is None or (mode in NEEDS_POSITION and not self.position_ok):
            return self._refuse(mode, "requires position")
        if mode is not self.mode:
            if mode is Mode.AUTO and self.armed and not self.airborne and not self.plan.starts_with_takeoff:
                self.send_text("Auto: Missing Takeoff Cmd", mavlink.MAV_SEVERITY_CRITICAL)
                return self._refuse(mode, "init failed")
            if (mode is Mode.AUTO and not self.plan.items) or (
                mode is Mode.SMART_RTL and not self.navigator.path_return.is_available
            ):
                return self._refuse(mode, "init failed")
            self.mode = mode
            self.navigator.rally_enu_m = self.rally.points_enu_m()
            self.navigator.mission.legs = self.plan.legs()
            self.navigator.enter(mode, self.estimate)
            self.navigator.landing.blind = mode is Mode.LAND and not self.position_ok
            self.failsafes.in_charge = False
            self.failsafes.fence.recover(self._now_ns)
            self.mode_changes.append((self._now_ns, mode.name))
            self.telemetry.due_now(mavlink.MAVLINK_MSG_ID_HEARTBEAT)
        return True

    def _refuse(self, mode: IntEnum, reason: str) -> bool:
        self.send_text(f"Mode change to {mode.name} failed: {reason}", mavlink.MAV_SEVERITY_WARNING)
        return False

    def arm(self) -> str | None:
        """Arm; return the reason for a refusal."""
        if self.armed:
            return None
        if not self.position_ok:
            return "Arm: Need Position Estimate"
        if self.mode in (Mode.LAND, Mode.RTL, Mode.SMART_RTL, Mode.AUTO, Mode.BRAKE):
            return f"Arm: {self.mode.name} mode not armable"
        if self.parameters["PRX1_TYPE"] == 2 and not self.proximity.fresh(self._now_ns):
            return "Arm: PRX1: No Data"
        if self.aiding.external.enabled and not self.aiding.external.is_healthy(self._now_ns):
            return "Arm: VisOdom: not healthy"
        if self.estimate is not None:
            self.navigator.home_enu_m = self.estimate.pos_enu_m.copy()
            self.navigator.path_return.begin_path(self.estimate.pos_enu_m)
            self._velocity.reset(np.zeros(3))
        self.armed = True
        self._yaw_rad = None
        self._settled_since_ns = None
        self.telemetry.due_now(mavlink.MAVLINK_MSG_ID_HEARTBEAT)
        self.telemetry.due_now(mavlink.MAVLINK_MSG_ID_HOME_POSITION)
        self.send_text("Arming motors")
        return None

    def disarm(self, *, force: bool = False) -> str | None:
        """Disarm; return the reason for a refusal."""
        if self.airborne and not force:
            return "Disarm: vehicle is flying"
        if self.armed:
            self.armed = False
            self.airborne = False
            self.navigator.mission.restart()
            self.send_text("Disarming motors")
            self.telemetry.due_now(mavlink.MAVLINK_MSG_ID_HEARTBEAT)
        return None

    def crash(self) -> None:
        """Stop the motors, like the crash check."""
        if self.armed:
            self.disarm(force=True)
            self.send_text("Crash: Disarming", mavlink.MAV_SEVERITY_EMERGENCY)

    def pause_clock(self, elapsed_ns: int) -> None:
        """Pause for a time: the time since boot does not advance."""
        self.boot_offset_ns -= elapsed_ns

    def reboot(self, silent_s: float) -> None:
        """Restart in flight, as after a watchdog reset: armed and in the same mode, all other state is lost.

        It neither receives nor sends for `silent_s`; the time since boot restarts at zero now.
        """
        self._silent_until_ns = self._now_ns + round(silent_s * 1e9)
        self.boot_offset_ns = -self._now_ns
        self.rangefinder = None
        self._outgoing.clear()
        self._lose_state()
        self.aiding.restart()
        self.wind.restart()
        if self.estimate is not None:
            self.navigator.enter(self.mode, self.estimate)

    def _lose_state(self) -> None:
        """Lose what a reboot loses; the items of the fence are stored for good."""
        self.precland = PrecisionLanding()
        self.navigator.landing.replace_precland(self.precland)
        self.proximity = Proximity()
        items = self.failsafes.fence.items
        self.failsafes = Failsafes(self)
        self.failsafes.fence.items = items
        self.telemetry.restart()

    def follow_reset(self, jump_enu_m: F64) -> None:
        """Move every target with a reset of the position estimate, so that the vehicle keeps its place."""
        self.navigator.move(jump_enu_m)
        self.precland.move(jump_enu_m)

    def take_off(self, height_m: float) -> str | None:
        """Climb to a height above home; return the reason for a refusal."""
        if self.mode is not Mode.GUIDED:
            return "Takeoff: GUIDED needed"
        if not self.armed or self.estimate is None:
            return "Takeoff: not armed"
        if self.airborne:
            return "Takeoff: already flying"
        self.navigator.enter(Mode.GUIDED, self.estimate)
        self.navigator.takeoff_up_m = float(self.navigator.home_enu_m[2]) + height_m
        return None

    def update(self, dt_s: float, now_ns: int, estimate: State, on_ground: bool) -> Demand:
        """Return the commanded body rates (rad/s) and thrust (m/s2)."""
        self._now_ns = now_ns
        first = self.estimate is None
        self.estimate, self._estimate_ns = estimate, now_ns
        self.aiding.remember(now_ns, estimate)
        if first:
            self.navigator.home_enu_m = estimate.pos_enu_m.copy()
            self.navigator.enter(self.mode, estimate)
        if now_ns >= self._next_check_ns:
            self._next_check_ns = now_ns + PERIOD_NS
            self._check()
        if not self.armed:
            self.airborne = False
            return np.zeros(3), 0.0
        if now_ns >= self._next_outer_ns:
            self._next_outer_ns = now_ns + OUTER_LOOP_NS
            range_m = self.range_down_m()
            self._observe(now_ns, estimate, range_m)
            self._outer(now_ns, estimate, on_ground, range_m)
        quat, thrust = self._wanted
        return rate_command(estimate.quat_wxyz, quat), thrust

    def _observe(self, now_ns: int, estimate: State, range_m: float | None) -> None:
        """Update what the modes react to, before they command."""
        self.precland.remember(now_ns, estimate)
        self.precland.check_sight(estimate.pos_enu_m, now_ns, range_m, self.parameters)

    def _check(self) -> None:
        """Run the checks of 10 Hz, armed or not."""
        jump_enu_m = self.aiding.take_reset()
        if jump_enu_m is not None:
            self.follow_reset(jump_enu_m)
        self.failsafes.check()
        if self.estimate is not None:
            drag = self.parameters["EK3_DRAG_MCOEF"]
            self.wind.update(PERIOD_NS * 1e-9, self.estimate, self.airborne, drag)
        for severity, text in self.precland.status_texts(self._now_ns):
            self.send_text(text, severity)
        for number in self.navigator.mission.take_reached():
            self.send(mavlink.MAVLink_mission_item_reached_message(number))
            self.send_text(f"Reached command #{number}")

    def _outer(self, now_ns: int, estimate: State, on_ground: bool, range_m: float | None) -> None:
        dt_s = OUTER_LOOP_NS * 1e-9
        self.battery_pct = max(0.0, self.battery_pct - 100 * dt_s / (20 * 60))
        self.airborne = self.airborne or not on_ground
        wants_up = self.navigator.is_taking_off(self.mode)
        if on_ground and not wants_up:
            self._on_ground(now_ns)
            self._velocity.reset(np.zeros(3))
            self._wanted = (_level(estimate), 2.0 if self.armed else 0.0)
            return
        self._settled_since_ns = None
        self.navigator.sticks = self.receiver.sticks(now_ns)
        self.navigator.radio_lost = self.failsafes.radio
        velocity = self.navigator.velocity(self.mode, estimate, now_ns, range_m)
        if self.airframe.kind is Kind.FIXED_WING and not (wants_up or self.airframe.on_wing):
            self.airframe.fly_on(estimate, now_ns)
        velocity = self.target_enu_ms = self._avoid(velocity, estimate)
        velocity = self.airframe.velocity(velocity, now_ns)
        level = self._without_position()
        if level:
            velocity = np.array([*estimate.vel_enu_ms[:2], velocity[2]])
        ahead = None if self.airframe.on_wing else self.navigator.feedforward_enu_ms2(self.mode)
        most_ms2 = self.navigator.parameters["WPNAV_ACCEL"] / 100 if ahead is None else math.inf
        acceleration = self._velocity.acceleration(velocity, estimate, dt_s, most_ms2)
        if ahead is not None:
            acceleration += ahead
        if level:
            acceleration[:2] = self._lean(estimate)
        self._wanted = attitude_for(acceleration, self._slew_yaw(estimate, dt_s))

    def _without_position(self) -> bool:
        """Return whether the mode flies level, or leans with the sticks, for lack of a position."""
        if self.mode is Mode.LAND:
            return self.navigator.blind
        return self.mode not in NEEDS_POSITION and self.settled and not self.aiding.absolute

    def _lean(self, estimate: State) -> F64:
        """Return the horizontal acceleration (2,) east, north for the roll and pitch sticks."""
        sticks, yaw = self.navigator.sticks, to_euler(estimate.quat_wxyz)[2]
        most = GRAVITY_MS2 * math.tan(MAX_LEAN_RAD)
        right, ahead = most * sticks.right, most * sticks.forward
        east = ahead * math.sin(yaw) + right * math.cos(yaw)
        return np.array([east, ahead * math.cos(yaw) - right * math.sin(yaw)])

    def _on_ground(self, now_ns: int) -> None:
        """Disarm after `LANDED_NS` on the ground in a landing mode, else after DISARM_DELAY."""
        if self._settled_since_ns is None:
            self._settled_since_ns = now_ns
        settled_ns = now_ns - self._settled_since_ns
        if settled_ns <= LANDED_NS:
            return
        self.airborne = False
        delay_ns = self.parameters["DISARM_DELAY"] * 1e9
        if self.navigator.is_landing(self.mode) or 0 < delay_ns < settled_ns:
            self.disarm()

    def _avoid(self, velocity: F64, estimate: State) -> F64:
        """Limit a GUIDED velocity before fence and obstacles; a GUIDED position target flies through them."""
        p, guided = self.parameters, self.navigator.guided
        if (
            self.mode is not Mode.GUIDED
            or guided.velocity_enu_ms is None
            or guided.position_enu_m is not None
        ):
            return velocity
        if int(p["AVOID_ENABLE"]) & AVOID_FENCE:
            home = self.navigator.home_enu_m
            velocity = self.failsafes.fence.limited(velocity, estimate.pos_enu_m, home)
        if p["PRX1_TYPE"] != 2 or not int(p["AVOID_ENABLE"]) & AVOID_PROXIMITY:
            return velocity
        yaw_rad = to_euler(estimate.quat_wxyz)[2]
        return self.proximity.limited(velocity, yaw_rad, p["AVOID_MARGIN"], self._now_ns)

    def range_down_m(self) -> float | None:
        """Return the rangefinder's distance, None if it is off, late or out of range."""
        p = self.parameters
        if p["RNGFND1_TYPE"] == 10 and self.rangefinder is not None:
            stamp, distance = self.rangefinder
            fresh = self._now_ns - stamp < RANGEFINDER_NS
            if fresh and p["RNGFND1_MIN"] <= distance <= p["RNGFND1_MAX"]:
                return distance
        return None

    def _slew_yaw(self, estimate: State, dt_s: float) -> float:
        """Slew the commanded heading towards GUIDED's target, at most 60 degrees per second."""
        if self._yaw_rad is None:
            self._yaw_rad = to_euler(estimate.quat_wxyz)[2]
        guided = self.navigator.guided
        if self.mode is Mode.GUIDED:
            if guided.yaw_rate_rad_s is not None:
                if self._now_ns - guided.stamp_ns <= self.parameters["GUID_TIMEOUT"] * 1e9:
                    rate = max(-MAX_TURN_RAD_S, min(MAX_TURN_RAD_S, guided.yaw_rate_rad_s))
                    self._yaw_rad += rate * dt_s
            elif guided.yaw_rad is not None:
                error = math.remainder(guided.yaw_rad - self._yaw_rad, 2 * math.pi)
                step = MAX_TURN_RAD_S * dt_s
                self._yaw_rad += max(-step, min(step, error))
        elif self.mode in PILOTED:
            self._yaw_rad += MAX_TURN_RAD_S * self.navigator.sticks.clockwise * dt_s
        return self._yaw_rad


def _level(estimate: State) -> F64:
    _, _, yaw = to_euler(estimate.quat_wxyz)
    return np.array([math.cos(yaw / 2), 0.0, 0.0, math.sin(yaw / 2)])
