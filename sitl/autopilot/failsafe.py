"""Failsafes of the autopilot: triggers, texts and resulting modes."""

from __future__ import annotations

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from sitl.autopilot.autopilot_view import AutopilotView
from sitl.autopilot.fence import Fence, FenceItems, names
from sitl.autopilot.modes import AUTONOMOUS, NEEDS_POSITION, Mode

WARNING, CRITICAL = mavlink.MAV_SEVERITY_WARNING, mavlink.MAV_SEVERITY_CRITICAL

PERIOD_NS = 100_000_000
EKF_CHECKS = 10
WITHOUT, LAND, RTL, SMART_RTL, SMART_RTL_OR_LAND, TERMINATE, DO_LAND_START, BRAKE = range(8)
"""Actions by the numbers of BATT_FS_LOW_ACT."""
RADIO_ACTIONS = (WITHOUT, RTL, RTL, LAND, SMART_RTL, SMART_RTL_OR_LAND, DO_LAND_START, BRAKE)
"""Actions by FS_THR_ENABLE."""
STATION_ACTIONS = (WITHOUT, RTL, RTL, SMART_RTL, SMART_RTL_OR_LAND, LAND, DO_LAND_START, BRAKE)
"""Actions by FS_GCS_ENABLE."""
RADIO_IN_AUTO, STATION_IN_AUTO, RADIO_IN_GUIDED, LANDING_GOES_ON, STATION_WITH_PILOT = 1, 2, 4, 8, 16
"""Bits of FS_OPTIONS: what goes on in spite of a failsafe."""
MODES: dict[int, tuple[Mode | str, ...]] = {
    RTL: (Mode.RTL,),
    SMART_RTL: (Mode.SMART_RTL, "SmartRTL Unavailable, Trying RTL Mode", Mode.RTL),
    SMART_RTL_OR_LAND: (Mode.SMART_RTL, "SmartRTL Unavailable, Using Land Mode"),
    DO_LAND_START: ("Trying RTL Mode", Mode.RTL),
    BRAKE: (Mode.BRAKE, "Trying Land Mode"),
}
"""Modes to try in turn before LAND, and the texts between them (events.cpp)."""
FENCE_ACTIONS = (
    (),
    (Mode.RTL, Mode.LAND),
    (Mode.LAND,),
    (Mode.SMART_RTL, Mode.RTL, Mode.LAND),
    (Mode.BRAKE, Mode.LAND),
    (Mode.SMART_RTL, Mode.LAND),
)
"""Modes to try in turn, by FENCE_ACTION."""
GIVE_UP_M = 100.0
"""Distance beyond a fence from which the vehicle lands, whatever FENCE_ACTION is."""


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
            self._lose_link("Radio", RADIO_ACTIONS[int(self._ap.parameters["FS_THR_ENABLE"])])
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
            self._lose_link("GCS", STATION_ACTIONS[int(p["FS_GCS_ENABLE"])])
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
            action = int(p["BATT_FS_LOW_ACT"])
            goes_on = self._option(LANDING_GOES_ON) and self._is_landing and action != WITHOUT
            self._act("Battery", LAND if goes_on else action, "Continuing Landing" if goes_on else "")

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
        landing = self._is_landing or not ap.airborne
        position, home = ap.estimate.pos_enu_m, ap.navigator.home_enu_m
        new = self.fence.check(position, home, ap.now_ns, ap.boot_ns // 1_000_000, landing=landing)
        if not new or not ap.airborne:
            return
        ap.send_text(f"{names(new)} fence breached", mavlink.MAV_SEVERITY_NOTICE)
        modes = FENCE_ACTIONS[int(ap.parameters["FENCE_ACTION"])]
        if modes and self.fence.distance_beyond_m(new, position, home) > GIVE_UP_M:
            modes = (Mode.LAND,)
        self._change_mode(*modes)

    # ---- actions -----------------------------------------------------------------------------------

    @property
    def _is_landing(self) -> bool:
        return self._ap.navigator.is_landing(self._ap.mode)

    def _option(self, bit: int) -> bool:
        return bool(int(self._ap.parameters["FS_OPTIONS"]) & bit)

    def _lose_link(self, cause: str, action: int) -> None:
        """Act on the loss of radio or ground station (failsafe_radio_on_event, failsafe_gcs_on_event)."""
        mode, radio = self._ap.mode, cause == "Radio"
        battery_lands = self.battery and int(self._ap.parameters["BATT_FS_LOW_ACT"]) == LAND
        if self._is_landing and battery_lands:
            self._act(f"{cause} + Battery", LAND, "Continuing Landing")
        elif self._is_landing and self._option(LANDING_GOES_ON):
            self._act(cause, LAND, "Continuing Landing")
        elif mode is Mode.AUTO and self._option(RADIO_IN_AUTO if radio else STATION_IN_AUTO):
            self._act(cause, WITHOUT, "Continuing Auto" if radio else "Continuing Auto Mode")
        elif radio and mode is Mode.GUIDED and self._option(RADIO_IN_GUIDED):
            self._act(cause, WITHOUT, "Continuing Guided Mode")
        elif not radio and mode not in AUTONOMOUS and self._option(STATION_WITH_PILOT):
            self._act(cause, WITHOUT, "Continuing Pilot Control")
        else:
            self._act(cause, action)

    def _act(self, cause: str, action: int, instead: str = "") -> None:
        """Announce a failsafe and change the mode (do_failsafe_action); on the ground disarm."""
        ap = self._ap
        if not ap.armed:
            return
        if not ap.airborne:
            ap.send_text(f"{cause.split()[0]} Failsafe - Disarming", WARNING)
            ap.disarm()
            return
        ap.send_text(f"{cause} Failsafe{' - ' if instead else ''}{instead}", WARNING)
        if action == LAND:
            self._land_after_pause()
        elif action == TERMINATE:
            ap.disarm(force=True)
        elif action != WITHOUT:
            self._try_modes(*MODES[action])

    def _without_position(self) -> None:
        """Land without a position: at once if already landing, after a pause from other modes."""
        ap = self._ap
        if ap.mode is Mode.LAND or ap.mode not in NEEDS_POSITION:
            if ap.mode is Mode.LAND:
                ap.navigator.landing.blind = self.in_charge = True
            ap.send_text("EKF Failsafe", CRITICAL)
            return
        self._land_after_pause()
        ap.send_text(f"EKF Failsafe: changed to {ap.mode.name} Mode", CRITICAL)

    def _land_after_pause(self) -> None:
        """Change to LAND, whose first four seconds hold the height (set_mode_land_with_pause)."""
        self._ap.set_mode(Mode.LAND)
        self._ap.navigator.landing.pause()
        self.in_charge = True

    def _try_modes(self, *modes_and_texts: Mode | str) -> None:
        """Change to the first mode that is not refused, and say what is tried next; LAND pauses."""
        for one in modes_and_texts:
            if isinstance(one, str):
                self._ap.send_text(one, WARNING)
            elif self._change_mode(one):
                return
        self._land_after_pause()

    def _change_mode(self, *modes: Mode) -> bool:
        """Change to the first of some modes that is not refused."""
        taken = any(self._ap.set_mode(mode) for mode in modes)
        self.in_charge = self.in_charge or taken
        return taken
