"""Simulated PX4: the same vehicle, estimator and controllers, with PX4's modes, messages and failsafes."""

from __future__ import annotations

import math
from enum import IntEnum

import numpy as np
from numpy.typing import NDArray
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from sitl.autopilot.autopilot import MAX_TURN_RAD_S, OUTER_LOOP_NS, RANGEFINDER_NS, Autopilot
from sitl.autopilot.failsafe import PERIOD_NS
from sitl.autopilot.mission_items import MissionServer
from sitl.autopilot.px4.current_mode_message import CURRENT_MODE
from sitl.autopilot.px4.px4_commands import Px4Commands
from sitl.autopilot.px4.px4_failsafe import Px4Failsafes
from sitl.autopilot.px4.px4_modes import AUTO, PREVENTS_ARMING, Px4Mode
from sitl.autopilot.px4.px4_navigator import Px4Navigator
from sitl.autopilot.px4.px4_parameters import px4_defaults
from sitl.autopilot.px4.px4_telemetry import Px4Telemetry
from sitl.autopilot.px4.stick_movement import StickMovement
from sitl.vehicle.rigid_body import State, to_euler

F64 = NDArray[np.float64]

DRAG_PER_S = 0.23
AUTO_BIT, OFFBOARD_BIT = 1, 2  # of COM_RC_OVERRIDE


class Px4Autopilot(Autopilot):
    """PX4: a pilot's choice of a mode, and the mode that the failsafes make of it.

    Attributes
    ----------
    intended
        Mode that the pilot chose; `mode` is flown.
    """

    first_mode = Px4Mode.MANUAL
    companion_modes = (Px4Mode.AUTO_PRECLAND, Px4Mode.OFFBOARD)
    navigator: Px4Navigator
    failsafes: Px4Failsafes
    telemetry: Px4Telemetry
    commands: Px4Commands

    def _with_defaults(self, parameters: dict[str, float]) -> dict[str, float]:
        return px4_defaults(parameters)

    def _compose(self) -> None:
        self.intended = Px4Mode.MANUAL
        self._after_disarm = Px4Mode.MANUAL
        self._sticks = StickMovement()
        self._has_flown = False
        self.navigator = Px4Navigator(self.parameters)
        self.failsafes = Px4Failsafes(self)
        self.telemetry = Px4Telemetry(self, self.failsafes)
        self.missions = MissionServer(self, self.rally, self.failsafes.fence.items)
        self.commands = Px4Commands(self, self.telemetry, self.failsafes, self.missions)

    @property
    def mode_name(self) -> str:
        return Px4Mode(self.mode).title

    @property
    def landing_target_enu_m(self) -> F64 | None:
        target = self.navigator.precland.target
        return None if target is None else target.place_enu_m

    @property
    def battery_used_mah(self) -> float:
        return (100.0 - self.battery_pct) / 100 * self.parameters["BAT1_CAPACITY"]

    def send_text(self, text: str, severity: int = mavlink.MAV_SEVERITY_INFO) -> None:
        """Send a STATUSTEXT to the links on which a ground station was heard."""
        for link in sorted(self.commands.station_links):
            self.send(mavlink.MAVLink_statustext_message(severity, text.encode()[:50], 0, 0), link)

    # ---- actions ------------------------------------------------------------------------------------

    def set_mode(self, mode: IntEnum) -> bool:
        """Choose a mode (UserModeIntention::change): refused if it cannot run, AUTO.LAND never."""
        chosen = Px4Mode(mode)
        always = not self.armed or chosen is Px4Mode.AUTO_LAND
        if self.estimate is None or not (always or self.failsafes.can_run(chosen)):
            return False
        self.intended = chosen
        if chosen not in PREVENTS_ARMING and chosen is not Px4Mode.AUTO_TAKEOFF:
            self._after_disarm = chosen
        self.failsafes.update(mode_changed=True)
        return True

    def fly(self, mode: Px4Mode) -> None:
        """Fly a mode, chosen by the pilot or by a failsafe."""
        if mode is self.mode or self.estimate is None:
            return
        self.mode = mode
        self.navigator.rally_enu_m = self.rally.points_enu_m()
        self.navigator.enter(mode, self.estimate)
        self.mode_changes.append((self._now_ns, mode.title))
        self.telemetry.due_now(CURRENT_MODE)

    def arm(self) -> str | None:
        """Arm; return the reason for a refusal."""
        if self.armed:
            return None
        if self.estimate is None or not self.position_ok:
            return "Arming denied: Resolve system health failures first\t"
        if self.intended in PREVENTS_ARMING:
            return "Arming denied: Mode not suitable\t"
        self.navigator.home_enu_m = self.estimate.pos_enu_m.copy()
        self._velocity.reset(np.zeros(3))
        self._yaw_rad = self._settled_since_ns = None
        self.armed = True
        self.failsafes.update(mode_changed=False)
        self.navigator.enter(self.mode, self.estimate)
        self.telemetry.due_now(CURRENT_MODE)
        self.telemetry.due_now(mavlink.MAVLINK_MSG_ID_HOME_POSITION)
        self.send_text("Armed by external command\t")
        return None

    def disarm(self, *, force: bool = False) -> str | None:
        """Disarm, and return to the last mode that permits arming; return the reason for a refusal."""
        if self.airborne and not force:
            return "Disarming denied: not landed\t"
        if self.armed:
            self.armed = self.airborne = False
            self.navigator.takeoff_alt_m = None
            self.intended = self._after_disarm
            self.send_text("Disarmed by landing\t")
            self.fly(self.intended)
            self.telemetry.due_now(CURRENT_MODE)
        return None

    def take_off(self, height_m: float) -> str | None:
        """Climb to a height above home; return the reason for a refusal."""
        self.navigator.takeoff_alt_m = float(self.navigator.home_enu_m[2]) + height_m
        return (
            None if self.set_mode(Px4Mode.AUTO_TAKEOFF) else "Switching to mode 'Takeoff' is not possible\t"
        )

    def follow_reset(self, jump_enu_m: F64) -> None:
        """Move the setpoint with a reset of the position estimate; a target stays where it was sent."""
        self.navigator.move(jump_enu_m)

    def _lose_state(self) -> None:
        home, items, intended = self.navigator.home_enu_m, self.failsafes.fence.items, self.intended
        self._compose()
        self.navigator.home_enu_m, self.failsafes.fence.items, self.intended = home, items, intended

    # ---- control ------------------------------------------------------------------------------------

    def _check(self) -> None:
        jump_enu_m = self.aiding.take_reset()
        if jump_enu_m is not None:
            self.follow_reset(jump_enu_m)
        self.failsafes.check()
        if self.estimate is not None:
            self.navigator.note_origin(self.estimate)
            self.wind.update(PERIOD_NS * 1e-9, self.estimate, self.airborne, DRAG_PER_S)
        if self.navigator.took_off and self.intended is Px4Mode.AUTO_TAKEOFF:
            self.set_mode(Px4Mode.AUTO_LOITER)

    def _observe(self, now_ns: int, estimate: State, range_m: float | None) -> None:
        """Hand over to the pilot who moves the sticks (Commander::manualControlCheck)."""
        if self.failsafes.radio:
            self._sticks.reset()
            return
        threshold = self.parameters["COM_RC_STICK_OV"] / 100
        moving = self._sticks.update(self.receiver.sticks(now_ns), OUTER_LOOP_NS * 1e-9) > threshold
        bits = int(self.parameters["COM_RC_OVERRIDE"])
        may = bits & AUTO_BIT if self.mode in AUTO else self.mode is Px4Mode.OFFBOARD and bits & OFFBOARD_BIT
        if not moving or not may:
            return
        if self.failsafes.actions.in_failsafe:
            self.failsafes.update(mode_changed=False, sticks=True)
        elif self.set_mode(Px4Mode.POSCTL):
            self.send_text("Pilot took over using sticks\t")

    def _on_ground(self, now_ns: int) -> None:
        """Detect the landing, and disarm COM_DISARM_LAND later, or COM_DISARM_PRFLT without a flight."""
        p = self.parameters
        if self._settled_since_ns is None:
            self._settled_since_ns, self._has_flown = now_ns, self.airborne
        settled_s = (now_ns - self._settled_since_ns) * 1e-9
        if settled_s < p["LNDMC_TRIG_TIME"]:
            return
        self.airborne = False
        delay_s = p["LNDMC_TRIG_TIME"] + p["COM_DISARM_LAND"] if self._has_flown else p["COM_DISARM_PRFLT"]
        if 0 < delay_s < settled_s:
            self.disarm()

    def _avoid(self, velocity: F64, estimate: State) -> F64:
        return velocity

    def _without_position(self) -> bool:
        if self.mode is Px4Mode.AUTO_LAND:
            return self.navigator.is_blind
        return self.settled and not self.aiding.absolute

    def range_down_m(self) -> float | None:
        """Return the rangefinder's distance, None if it is late or out of range."""
        if self.rangefinder is None:
            return None
        stamp_ns, distance_m = self.rangefinder
        is_fresh = self._now_ns - stamp_ns < RANGEFINDER_NS
        return distance_m if is_fresh and math.isfinite(distance_m) else None

    def _slew_yaw(self, estimate: State, dt_s: float) -> float:
        """Slew the commanded heading: of OFFBOARD, of the sticks, or along the way."""
        yaw = to_euler(estimate.quat_wxyz)[2] if self._yaw_rad is None else self._yaw_rad
        step, offboard = MAX_TURN_RAD_S * dt_s, self.navigator.offboard
        goal = self.navigator.course_rad(self.mode, estimate)
        if self.mode is Px4Mode.OFFBOARD:
            goal = None if math.isnan(offboard.yaw_rad) else offboard.yaw_rad
            if math.isfinite(offboard.yaw_rate_rad_s):
                yaw += max(-step, min(step, offboard.yaw_rate_rad_s * dt_s))
                goal = None
        elif self.mode not in AUTO:
            yaw += step * self.navigator.sticks.clockwise
        if goal is not None:
            error = math.remainder(goal - yaw, 2 * math.pi)
            yaw += max(-step, min(step, error))
        self._yaw_rad = yaw
        return yaw
