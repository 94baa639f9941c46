"""Failsafes of the autopilot: triggers, texts and resulting modes."""

from __future__ import annotations

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from sitl.autopilot.autopilot_view import AutopilotView
from sitl.autopilot.fence import Fence, FenceItems, names
from sitl.autopilot.modes import NEEDS_POSITION, Mode

WARNING, CRITICAL = mavlink.MAV_SEVERITY_WARNING, mavlink.MAV_SEVERITY_CRITICAL

PERIOD_NS = 100_000_000
EKF_CHECKS = 10
WITHOUT, LAND, RTL = 0, 1, 2
"""Actions by the numbers of BATT_FS_LOW_ACT."""


class Failsafes:
    """Failsafes for radio, ground station, battery, estimate and fence, checked at 10 Hz.

    Attributes
    ----------
    radio, ground_station, battery, ekf
        Whether each is triggered; the battery's stays triggered until a reboot.
    in_charge
        Whether the vehicle flies a failsafe's mode; false after any later change of mode.
    """

    def __init__(self, autopilot: AutopilotView) -> None:
        self._ap = autopilot
        self.fence = Fence(autopilot.parameters, FenceItems(autopilot))
        self.radio = self.ground_station = self.battery = self.ekf = False
        self.in_charge = False
        self.station_heard_ns: int | None = None
        self._ekf_bad = 0
        self._low_since_ns: int | None = None

    @property
    def any_triggered(self) -> bool:
        """True if HEARTBEAT reports a critical state; the fence does not count."""
        return self.radio or self.ground_station or self.battery or self.ekf

    def check(self) -> None:
        """Run all checks once."""
        self._check_radio()
        self._check_ground_station()
        self._check_battery()
        self._check_ekf()
        self._check_fence()

    # ---- triggers ----------------------------------------------------------------------------------

    def _check_radio(self) -> None:
        lost = self._ap.parameters["FS_THR_ENABLE"] > 0 and self._ap.receiver.lost(self._ap.now_ns)
        if lost and not self.radio:
            self.radio = True
            self._act("Radio", RTL)
        elif self.radio and not lost:
            self.radio = False
            self._ap.send_text("Radio Failsafe Cleared", WARNING)

    def _check_ground_station(self) -> None:
        p, heard_ns = self._ap.parameters, self.station_heard_ns
        if heard_ns is None or not (p["FS_GCS_ENABLE"] or self.ground_station):
            return
        lost = self._ap.now_ns - heard_ns > p["FS_GCS_TIMEOUT"] * 1e9
        if lost and not self.ground_station and self._ap.armed:
            self.ground_station = True
            self._act("GCS", RTL)
        elif self.ground_station and not lost:
            self.ground_station = False
            self._ap.send_text("GCS Failsafe Cleared", WARNING)

    def _check_battery(self) -> None:
        ap, p = self._ap, self._ap.parameters
        if self.battery or not ap.armed:
            return
        left_mah = p["BATT_CAPACITY"] - ap.battery_used_mah
        low = 0 < p["BATT_LOW_VOLT"] > ap.battery_v
        if not low:
            self._low_since_ns = None
        elif self._low_since_ns is None:
            self._low_since_ns = ap.now_ns
        long = self._low_since_ns is not None and (
            ap.now_ns - self._low_since_ns >= p["BATT_LOW_TIMER"] * 1e9
        )
        if long or 0 < p["BATT_LOW_MAH"] >= left_mah:
            self.battery = True
            ap.send_text(f"Battery 1 is low {ap.battery_v:.2f}V used {ap.battery_used_mah:.0f} mAh", WARNING)
            self._act("Battery", int(p["BATT_FS_LOW_ACT"]))

    def _check_ekf(self) -> None:
        if self._ap.aiding.absolute:
            self._ekf_bad = max(0, self._ekf_bad - 1)
        elif self._ap.armed:
            self._ekf_bad = min(EKF_CHECKS, self._ekf_bad + 1)
        if self.ekf and self._ekf_bad == 0:
            self.ekf = False
            self._ap.send_text("EKF Failsafe Cleared", CRITICAL)
        elif not self.ekf and self._ekf_bad == EKF_CHECKS:
            self.ekf = True
            self._ap.send_text("EKF variance", CRITICAL)
            self._without_position()

    def _check_fence(self) -> None:
        ap = self._ap
        if ap.estimate is None:
            return
        landing = ap.mode is Mode.LAND or not ap.airborne
        position, home = ap.estimate.pos_enu_m, ap.navigator.home_enu_m
        new = self.fence.check(position, home, ap.now_ns, ap.boot_ns // 1_000_000, landing=landing)
        if not new or not ap.airborne:
            return
        ap.send_text(f"{names(new)} fence breached", mavlink.MAV_SEVERITY_NOTICE)
        action = int(ap.parameters["FENCE_ACTION"])
        if action == 1:
            self._change_mode(Mode.RTL)
        elif action == 2:
            self._change_mode(Mode.LAND)

    # ---- actions -----------------------------------------------------------------------------------

    def _act(self, cause: str, action: int) -> None:
        ap = self._ap
        if not ap.armed:
            return
        if not ap.airborne:
            ap.send_text(f"{cause} Failsafe - Disarming", WARNING)
            ap.disarm()
            return
        ap.send_text(f"{cause} Failsafe", WARNING)
        if action != WITHOUT:
            self._change_mode(Mode.LAND if action == LAND else Mode.RTL)

    def _without_position(self) -> None:
        """Land without a position: at once if already landing, after a pause from other modes."""
        ap = self._ap
        if ap.mode is Mode.LAND or ap.mode not in NEEDS_POSITION:
            if ap.mode is Mode.LAND:
                ap.navigator.blind = self.in_charge = True
            ap.send_text("EKF Failsafe", CRITICAL)
            return
        self._change_mode(Mode.LAND)
        ap.send_text(f"EKF Failsafe: changed to {ap.mode.name} Mode", CRITICAL)

    def _change_mode(self, mode: Mode) -> None:
        """Change to RTL, or to LAND with a pause if RTL is refused."""
        ap = self._ap
        taken = mode is not Mode.LAND and ap.set_mode(mode)
        if not taken and ap.mode is not Mode.LAND:
            ap.set_mode(Mode.LAND)
            ap.navigator.pause(ap.now_ns)
        self.in_charge = True
