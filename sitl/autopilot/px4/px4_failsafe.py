"""Failsafes of PX4: causes, their parameters and the resulting mode (commander/failsafe/failsafe.cpp)."""

from __future__ import annotations

from collections.abc import Iterator
from enum import IntEnum
from typing import Protocol

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from sitl.autopilot.autopilot_view import AutopilotView
from sitl.autopilot.failsafe import Failsafes
from sitl.autopilot.fence import FenceItems
from sitl.autopilot.px4.failsafe_actions import Action, ActionSelector, Cause, Clear, Takeover
from sitl.autopilot.px4.px4_fence import Px4Fence
from sitl.autopilot.px4.px4_modes import NEEDS_POSITION, Px4Mode
from sitl.autopilot.px4.px4_navigator import Px4Navigator

LINK_ACTIONS = {1: Action.HOLD, 2: Action.RTL, 3: Action.LAND, 5: Action.TERMINATE, 6: Action.DISARM}
"""Actions by NAV_RCL_ACT and NAV_DLL_ACT."""
FENCE_ACTIONS = {
    0: Action.NONE,
    2: Action.HOLD,
    3: Action.RTL,
    4: Action.TERMINATE,
    5: Action.LAND,
}
"""Actions by GF_ACTION; others warn."""
OFFBOARD_ACTIONS = {
    1: Action.ALTITUDE,
    2: Action.STABILIZED,
    3: Action.RTL,
    4: Action.LAND,
    5: Action.HOLD,
    6: Action.TERMINATE,
    7: Action.DISARM,
}
"""Actions by COM_OBL_RC_ACT; others are Position mode."""
MODES = {
    Action.POSITION: Px4Mode.POSCTL,
    Action.ALTITUDE: Px4Mode.ALTCTL,
    Action.STABILIZED: Px4Mode.STABILIZED,
    Action.HOLD: Px4Mode.AUTO_LOITER,
    Action.RTL: Px4Mode.AUTO_RTL,
    Action.LAND: Px4Mode.AUTO_LAND,
    Action.DESCEND: Px4Mode.AUTO_LAND,
}
IN_HOLD, IN_OFFBOARD = 2, 4
"""Bits of COM_RCL_EXCEPT and COM_DLL_EXCEPT."""
NO_STICKS = 4  # COM_RC_IN_MODE


class BatteryWarning(IntEnum):
    """State of charge (battery_status.msg)."""

    NONE = 0
    LOW = 1
    CRITICAL = 2
    EMERGENCY = 3


class Px4View(AutopilotView, Protocol):
    """Members that only the parts of PX4 use."""

    intended: Px4Mode

    @property
    def navigator(self) -> Px4Navigator: ...

    def fly(self, mode: Px4Mode) -> None: ...


class Px4Failsafes(Failsafes):
    """Causes, and the state machine between the pilot's choice of a mode and the one that is flown.

    Attributes
    ----------
    actions
        Selection of the action.
    warning
        Worst state of charge since the arming.
    """

    def __init__(self, autopilot: Px4View) -> None:
        super().__init__(autopilot)
        self._px4 = autopilot
        self.fence: Px4Fence = Px4Fence(autopilot.parameters, FenceItems(autopilot))
        self.actions = ActionSelector()
        self.warning = self._warning_at_arming = BatteryWarning.NONE
        self._was_armed = self._is_rc_optional = False
        self._checked_ns = 0

    @property
    def any_triggered(self) -> bool:
        """True if HEARTBEAT reports a critical state: a failsafe flies."""
        return self.actions.in_failsafe

    def check(self) -> None:
        """Run all checks once, and fly what results."""
        self.update(mode_changed=False)

    def update(self, *, mode_changed: bool, sticks: bool = False) -> None:
        """Run the state machine (FailsafeBase::update).

        Parameters
        ----------
        mode_changed
            Whether the pilot has just chosen a mode.
        sticks
            Whether the pilot moves the sticks to take over.
        """
        ap, actions = self._px4, self.actions
        elapsed_s, self._checked_ns = (ap.now_ns - self._checked_ns) * 1e-9, ap.now_ns
        self._measure()
        if ap.armed is not self._was_armed:
            self._was_armed, self._is_rc_optional = ap.armed, self.radio
            self._warning_at_arming = self.warning
            actions.clear_after(takeover_too=True)
        self._is_rc_optional = self._is_rc_optional and self.radio
        if mode_changed or actions.is_taken_over:
            actions.clear_after()
        start_delay_s = ap.parameters["COM_FAIL_ACT_T"]
        can_hold = self.can_run(Px4Mode.AUTO_LOITER)
        actions.observe(self._causes() if ap.armed else (), elapsed_s, start_delay_s, can_hold)
        before, was_taken_over = actions.selected, actions.is_taken_over
        action, delayed = actions.select(mode_changed=mode_changed, sticks=sticks)
        if actions.is_taken_over and not was_taken_over and sticks:
            ap.intended = Px4Mode.POSCTL
        if actions.is_taken_over:
            action = max(action, self._fallback_action(ap.intended))
        action = self._softened(self._possible(action), delayed)
        actions.selected = action
        if action > max(before, Action.WARN):
            waits = action is Action.HOLD and delayed is not Action.NONE
            text = f": entering Hold for {round(actions.delay_s)} seconds" if waits else ""
            ap.send_text(f"Failsafe activated{text}\t", mavlink.MAV_SEVERITY_CRITICAL)
        self._fly(action)

    def can_run(self, mode: Px4Mode) -> bool:
        """Return whether a mode can be flown now (modeCanRun)."""
        if mode is Px4Mode.OFFBOARD:
            return self._px4.navigator.offboard.has_signal(self._px4.now_ns, self._px4.position_ok)
        return mode not in NEEDS_POSITION or self._px4.position_ok

    # ---- causes -------------------------------------------------------------------------------------

    def _measure(self) -> None:
        """Read radio, ground station and battery."""
        ap, p = self._px4, self._px4.parameters
        self.radio = ap.receiver.lost(ap.now_ns)
        heard_ns = self.station_heard_ns
        self.ground_station = heard_ns is not None and ap.now_ns - heard_ns > p["COM_DL_LOSS_T"] * 1e9
        cell_v = ap.battery_v / p["BAT1_N_CELLS"]
        left = (cell_v - p["BAT1_V_EMPTY"]) / max(1e-6, p["BAT1_V_CHARGED"] - p["BAT1_V_EMPTY"])
        names = ("BAT_LOW_THR", "BAT_CRIT_THR", "BAT_EMERGEN_THR")
        warning = BatteryWarning(sum(left < p[name] for name in names))
        self.warning = max(self.warning, warning) if ap.armed else warning
        self.battery = self.warning > BatteryWarning.NONE

    def _causes(self) -> Iterator[Cause]:
        """Yield what has failed (Failsafe::checkStateAndMode)."""
        ap, p, intended = self._px4, self._px4.parameters, self._px4.intended
        has_sticks = p["COM_RC_IN_MODE"] != NO_STICKS and not self._is_rc_optional
        if self.radio and has_sticks and not self._is_excepted("COM_RCL_EXCEPT"):
            yield self._link_loss("manual control", int(p["NAV_RCL_ACT"]))
        landing = intended in (Px4Mode.AUTO_LAND, Px4Mode.AUTO_PRECLAND)
        if (
            self.ground_station
            and p["NAV_DLL_ACT"]
            and not landing
            and not self._is_excepted("COM_DLL_EXCEPT")
        ):
            yield self._link_loss("ground station", int(p["NAV_DLL_ACT"]))
        if ap.estimate is not None and self.fence.look(ap.estimate.pos_enu_m, ap.navigator.home_enu_m):
            yield self._fence_breach(int(p["GF_ACTION"]))
        if self.warning > BatteryWarning.NONE:
            yield Cause(f"battery {self.warning.name.lower()}", self._battery_action())
        fallback = self._fallback_action(intended)
        if fallback is not Action.NONE:
            yield Cause("mode", fallback, takeover=Takeover.ALWAYS)

    def _is_excepted(self, name: str) -> bool:
        bits, intended = int(self._px4.parameters[name]), self._px4.intended
        holds = intended in (Px4Mode.AUTO_LOITER, Px4Mode.AUTO_TAKEOFF)
        return bool((holds and bits & IN_HOLD) or (intended is Px4Mode.OFFBOARD and bits & IN_OFFBOARD))

    @staticmethod
    def _link_loss(name: str, number: int) -> Cause:
        action = LINK_ACTIONS.get(number, Action.NONE)
        if action is Action.TERMINATE:
            return Cause(name, action, Clear.NEVER, Takeover.NEVER)
        if action is Action.DISARM:
            return Cause(name, action, takeover=Takeover.NEVER)
        return Cause(name, action, Clear.ON_MODE_CHANGE)

    @staticmethod
    def _fence_breach(number: int) -> Cause:
        action = FENCE_ACTIONS.get(number, Action.WARN)
        if action is Action.TERMINATE:
            return Cause("fence", action, Clear.NEVER, Takeover.NEVER)
        if action < Action.HOLD:
            return Cause("fence", action)
        takeover = Takeover.MODE_SWITCH if action is Action.HOLD else Takeover.AUTO
        return Cause("fence", action, Clear.ON_MODE_CHANGE, takeover)

    def _battery_action(self) -> Action:
        """Return the action of a low battery (fromBatteryWarningActParam); one low at arming only warns."""
        number = int(self._px4.parameters["COM_LOW_BAT_ACT"])
        if self.warning is BatteryWarning.LOW or self.warning <= self._warning_at_arming:
            return Action.WARN
        returns = number == 1 or (number == 3 and self.warning is BatteryWarning.CRITICAL)
        if returns:
            return Action.RTL
        return Action.LAND if number in (2, 3) else Action.WARN

    def _fallback_action(self, intended: Px4Mode) -> Action:
        """Return the action for a chosen mode that cannot run (checkModeFallback)."""
        if intended is Px4Mode.OFFBOARD and not self.can_run(intended):
            return OFFBOARD_ACTIONS.get(int(self._px4.parameters["COM_OBL_RC_ACT"]), Action.POSITION)
        if intended is Px4Mode.POSCTL and not self.can_run(intended):
            return Action.ALTITUDE
        return Action.NONE if self.can_run(intended) else Action.RTL

    # ---- the resulting mode ---------------------------------------------------------------------------

    def _possible(self, action: Action) -> Action:
        """Return the action, or the next worse one whose mode can run."""
        order = (Action.POSITION, Action.ALTITUDE, Action.STABILIZED, Action.HOLD, Action.RTL, Action.LAND)
        if action not in order:
            return action
        for one in order[order.index(action) :]:
            stays = one is not Action.LAND or self._px4.position_ok
            if self.can_run(MODES[one]) and stays:
                return one
        return Action.DESCEND

    def _softened(self, action: Action, delayed: Action) -> Action:
        """Return a warning instead of a return or landing that the pilot has begun."""
        asked, intended = {action, delayed}, self._px4.intended
        ends = {
            Px4Mode.AUTO_LAND: {Action.RTL},
            Px4Mode.AUTO_RTL: {Action.RTL},
            Px4Mode.AUTO_PRECLAND: {Action.RTL, Action.LAND},
        }.get(intended, set())
        return Action.WARN if asked & ends and self.can_run(intended) else action

    def _fly(self, action: Action) -> None:
        ap = self._px4
        if action in (Action.DISARM, Action.TERMINATE):
            ap.disarm(force=True)
            return
        ap.fly(MODES.get(action, ap.intended))
        lands = ap.mode is Px4Mode.AUTO_LAND
        ap.navigator.is_blind = lands and not ap.position_ok and ap.armed
