"""Real PX4 SITL for flights, in PX4's own simulator SIH."""

from __future__ import annotations

import math
import time
from collections.abc import Mapping
from importlib import resources
from typing import Any

import pymap3d
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from tests.e2e.field import HOME, Field, Pilot

MODES = {
    "POSCTL": (3, 0),
    "AUTO.TAKEOFF": (4, 2),
    "AUTO.LOITER": (4, 3),
    "AUTO.RTL": (4, 5),
    "AUTO.LAND": (4, 6),
    "AUTO.PRECLAND": (4, 9),
    "OFFBOARD": (6, 0),
}
RALLY = mavlink.MAV_MISSION_TYPE_RALLY
# Ports of PX4's links in SITL: what it listens on for a ground station, and where it sends to.
GROUND_STATION_PORT = 18570
COMPANION_PORT = 14540
TRUTH_PORT = 19410
# SIH waits 64 us too long in each step of 4 ms: 1.6 % slow, which is much for a clock to be followed.
SPEED = "1.016"
# What the companion must know of that: the tilt still errs by half a degree to a whole one.
SIH_NOISE = "angle_noise_deg=0.8", "height_noise_m=0.1"


class Px4Pilot(Pilot):
    """Takes off in AUTO.TAKEOFF; setting OFFBOARD is the hand-over."""

    def __init__(self, url: str, limit_s: float = 60.0) -> None:
        super().__init__(url, limit_s)
        self.home_m = HOME[2]
        self.place = HOME[:2]
        self._rally: list[Any] = []
        self._rally_count: int | None = None

    def take(self, message: Any) -> None:
        super().take(message)
        if message.get_type() == "GLOBAL_POSITION_INT":
            self.home_m = (message.alt - message.relative_alt) / 1000
            self.place = message.lat * 1e-7, message.lon * 1e-7
        elif message.get_type() == "MISSION_COUNT" and message.mission_type == RALLY:
            self._rally_count = message.count
        elif message.get_type() == "MISSION_ITEM_INT" and message.mission_type == RALLY:
            self._rally.append(message)

    def mode_name(self, heartbeat: Any) -> str:
        pair = (heartbeat.custom_mode >> 16) & 0xFF, heartbeat.custom_mode >> 24
        return next((name for name, known in MODES.items() if known == pair), f"MODE{pair}")

    def set_mode(self, name: str) -> None:
        main, sub = (float(value) for value in MODES[name])
        self.command(mavlink.MAV_CMD_DO_SET_MODE, mavlink.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED, main, sub)

    def ask_to_fly(self, height_m: float) -> None:
        if not self.accepted(mavlink.MAV_CMD_NAV_TAKEOFF):
            here = (math.nan,) * 3  # heading, latitude, longitude
            self.command(mavlink.MAV_CMD_NAV_TAKEOFF, 0.0, 0.0, 0.0, *here, self.home_m + height_m)
        elif not self.armed:
            self.acks.pop(mavlink.MAV_CMD_NAV_TAKEOFF, None)
            self.command(mavlink.MAV_CMD_COMPONENT_ARM_DISARM, 1.0)

    def rally_points(self) -> list[Any]:
        """Download the rally points."""
        self._rally, self._rally_count = [], None
        send = self._port.mav
        send.mission_request_list_send(self.system, 1, RALLY)
        self.wait(lambda: self._rally_count is not None, 3.0)
        for number in range(self._rally_count or 0):
            send.mission_request_int_send(self.system, 1, number, RALLY)
            self.wait(lambda: len(self._rally) > number, 3.0)  # noqa: B023 - within this turn
        send.mission_ack_send(self.system, 1, mavlink.MAV_MISSION_ACCEPTED, RALLY)
        return self._rally

    def away_m(self, place: tuple[float, float]) -> float:
        """Return the distance over ground from a place (degrees)."""
        return _apart_m(self.place, place)

    def from_home_m(self, place: tuple[float, float]) -> float:
        """Return the distance over ground between a place (degrees) and home."""
        return _apart_m(HOME[:2], place)

    def go_to(self, lat: float, lon: float, height_m: float) -> None:
        """Fly over a place and hold there."""
        speed, yaw, radius = -1.0, math.nan, 0.0
        values = speed, float(mavlink.MAV_DO_REPOSITION_FLAGS_CHANGE_MODE), radius, yaw
        up_m = self.home_m + height_m
        place = round(lat * 1e7), round(lon * 1e7), up_m  # above the sea, whatever the frame says
        number, frame = mavlink.MAV_CMD_DO_REPOSITION, mavlink.MAV_FRAME_GLOBAL
        self._port.mav.command_int_send(self.system, 1, frame, number, 0, 0, *values, *place)
        self.until(lambda: self.away_m((lat, lon)) < 2.0, 120, "arrival")

    def hand_over(self) -> None:
        """Set OFFBOARD, again and again: it is refused until the companion is ready and sends setpoints."""
        self.until(lambda: self.mode != "AUTO.TAKEOFF", 60, "end of the take-off")
        end = time.monotonic() + 120
        while self.mode != "OFFBOARD" and time.monotonic() < end:
            self.set_mode("OFFBOARD")
            self.wait(lambda: self.mode == "OFFBOARD", 2.0)
        self.until(lambda: self.mode == "OFFBOARD", 1, "OFFBOARD")


def _apart_m(a: tuple[float, float], b: tuple[float, float]) -> float:
    e, n, _ = pymap3d.geodetic2enu(*a, HOME[2], *b, HOME[2])
    return math.hypot(float(e), float(n))


class Px4Field(Field):
    """A flight with PX4; the binary is `bin/px4` of a build folder, beside which its `etc` lies."""

    landing_mode, guided_mode = "AUTO.PRECLAND", "OFFBOARD"

    def autopilot_words(self) -> list[str]:
        etc = self.binary.parent.parent / "etc"
        return [str(self.binary), "-d", "-i", str(self.instance), str(etc)]

    def autopilot_environment(self) -> Mapping[str, str]:
        place = dict(zip(("PX4_HOME_LAT", "PX4_HOME_LON", "PX4_HOME_ALT"), map(str, HOME), strict=True))
        files = file_parameters("px4.params") | file_parameters("px4_sih.params")
        ours = {f"PX4_PARAM_{name}": value for name, value in files.items()}
        return {"PX4_SIM_MODEL": "sihsim_quadx", "PX4_SIM_SPEED_FACTOR": SPEED, **place, **ours}

    def new_pilot(self) -> Pilot:
        return Px4Pilot(f"udpout:127.0.0.1:{GROUND_STATION_PORT + self.instance}")

    def urls(self) -> tuple[str, str]:
        truth, companion = TRUTH_PORT + self.instance, COMPANION_PORT + self.instance
        return f"udpin:127.0.0.1:{truth}", f"udpin:127.0.0.1:{companion}"


def file_parameters(name: str) -> dict[str, str]:
    """Return what a parameter file of ours sets, by name."""
    text = resources.files("params").joinpath(f"autopilot/{name}").read_text("utf-8")
    rows = [line.split("\t") for line in text.splitlines() if line and not line.startswith("#")]
    return {name: value for _, _, name, value, _ in rows}
