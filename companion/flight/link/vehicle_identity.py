"""Identification of the vehicle among the MAVLink systems on one line, without I/O."""

from __future__ import annotations

import logging
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from companion.flight.link.vehicle_class import type_name
from companion.runtime.errors import UsageError

log = logging.getLogger(__name__)

# Two heartbeats of each autopilot at 1 Hz, and half a second of delay.
LISTEN_NS = 2_500_000_000
# MAV_TYPE of senders of an autopilot's heartbeat that never land from the air with a LiDAR: stations, parts
# of a vehicle, ground and water vehicles. Numbers, because the dialect lacks the newest names.
NOT_AIRCRAFT = frozenset(
    {
        5,  # antenna tracker
        6,  # ground control station
        10,  # ground rover
        11,  # surface boat
        12,  # submarine
        18,  # onboard controller
        26,  # gimbal
        27,  # ADS-B
        30,  # camera
        31,  # charging station
        32,  # FLARM
        33,  # servo
        34,  # Open Drone ID
        36,  # battery
        37,  # parachute
        38,  # log
        39,  # OSD
        40,  # IMU
        41,  # GPS
        42,  # winch
        44,  # illuminator
        45,  # spacecraft
        46,  # ground quadruped
        48,  # gripper
        49,  # radio
    }
)
NAME_IT = "name the vehicle that carries the LiDAR by --system"


class AmbiguousVehicleError(UsageError):
    """Two systems may be the vehicle, and none was named by the user."""


@dataclass(frozen=True, slots=True)
class Candidate:
    """System with an autopilot. vehicle_type: MAV_TYPE. armed: as of the newest heartbeat."""

    system: int
    vehicle_type: int
    armed: bool

    def __str__(self) -> str:
        return f"system {self.system} ({type_name(self.vehicle_type)})"


def several(candidates: Iterable[Candidate]) -> str:
    """Return the error message for more than one candidate."""
    names = " and ".join(map(str, sorted(candidates, key=lambda candidate: candidate.system)))
    return f"{names} are heard: {NAME_IT}"


class VehicleIdentity:
    """Selection of the vehicle's system: the one named by the user, else the only aircraft heard.

    The first candidate is followed at once; it is the vehicle once it was the only one for `listen_ns`. Two
    candidates in that time are ambiguous permanently. One heard later changes nothing: in flight, another
    vehicle must never be commanded in place of the first.

    Parameters
    ----------
    named
        The vehicle's system; its type is then not checked.
    listen_ns
        Time to listen for a second candidate.
    remembered
        Vehicle of the previous run. If heard armed, it is the vehicle at once: that run then ended in flight,
        and this one must not wait or end because another vehicle is near.

    Attributes
    ----------
    named, remembered
        The constructor's arguments.
    system
        The system that is followed, None without one.
    confirmed
        Whether that system is confirmed as the vehicle.
    candidates, passed_over
        By system: aircraft heard; autopilots of other types.
    """

    def __init__(self, named: int | None = None, listen_ns: int = 0, remembered: int | None = None) -> None:
        self.named = named
        self._listen_ns = listen_ns
        self.remembered = remembered
        self._begun_ns = 0
        self._listened = False
        self.system: int | None = None
        self.confirmed = False
        self.candidates: dict[int, Candidate] = {}
        self.passed_over: dict[int, Candidate] = {}

    @property
    def ambiguous(self) -> bool:
        """True if two candidates were heard before one was confirmed as the vehicle.

        A remembered vehicle may be heard last, so then only after the listening time.
        """
        several_heard = not self.confirmed and self.named is None and len(self.candidates) > 1
        return several_heard and (self.remembered is None or self._listened)

    @property
    def known(self) -> int | None:
        """The vehicle's system if it was named or is confirmed."""
        return self.named or (self.system if self.confirmed else None)

    def error(self) -> AmbiguousVehicleError:
        """Return the user's error message for an ambiguous vehicle."""
        return AmbiguousVehicleError(several(self.candidates.values()))

    def on_heartbeat(self, message: Any, now_ns: int) -> Candidate | None:
        """Process an autopilot's heartbeat; return the candidate if it is new and not the vehicle."""
        armed = bool(message.base_mode & mavlink.MAV_MODE_FLAG_SAFETY_ARMED)
        heard = Candidate(message.get_srcSystem(), int(message.type), armed)
        if heard.system != self.named and heard.vehicle_type in NOT_AIRCRAFT:
            if heard.system not in self.passed_over:
                log.info("%s is no aircraft, and not taken for the vehicle", heard)
            self.passed_over[heard.system] = heard
            return None
        new = heard.system not in self.candidates
        self.candidates[heard.system] = heard
        if self.confirmed:
            return heard if new and heard.system != self.system else None
        if self.named is not None:
            if heard.system == self.named:
                self.system, self.confirmed = heard.system, True
        elif heard.system == self.remembered and heard.armed:
            self.system, self.confirmed = heard.system, True
        elif self.system is None:
            self.system, self._begun_ns = heard.system, now_ns
        return None

    def confirm(self, now_ns: int) -> bool:
        """Confirm the only candidate after the listening time; return whether the vehicle is confirmed."""
        if self.system is not None and not self.confirmed:
            self._listened = now_ns - self._begun_ns >= self._listen_ns
            self.confirmed = self._listened and not self.ambiguous
        return self.confirmed
