"""Airframe: multirotor, fixed wing or VTOL, as messages report it, and the flight on a wing."""

from __future__ import annotations

import math
from enum import Enum

import numpy as np
from numpy.typing import NDArray
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from sitl.vehicle.rigid_body import State, to_euler

F64 = NDArray[np.float64]

CRUISE_MS, SINK_MS = 9.6, 0.16  # PX4's VTOL in OFFBOARD with velocity setpoints
TRANSITION_NS = 3_000_000_000


class Kind(Enum):
    """Airframes by their MAV_TYPE."""

    MULTIROTOR = mavlink.MAV_TYPE_QUADROTOR
    FIXED_WING = mavlink.MAV_TYPE_FIXED_WING
    VTOL = 22  # MAV_TYPE_VTOL_FIXEDROTOR, newer than the dialect


class Airframe:
    """Kind of the vehicle, and its state of flight.

    A fixed wing is on its wing as soon as it has taken off, a VTOL after `fly_on`. On the wing it flies
    straight on at cruise speed and sinks, whatever velocity is asked. No wing is simulated: the rotors carry
    it.

    Attributes
    ----------
    kind
        What HEARTBEAT reports.
    """

    def __init__(self, kind: Kind = Kind.MULTIROTOR) -> None:
        self.kind = kind
        self._since_ns: int | None = None
        self._course_rad = 0.0
        self._now_ns = 0

    @property
    def on_wing(self) -> bool:
        """True if it flies on its wing, or is in transition."""
        return self._since_ns is not None

    def fly_on(self, estimate: State, now_ns: int) -> None:
        """Leave the hover for the flight on the wing, along the heading."""
        self._since_ns, self._course_rad = now_ns, to_euler(estimate.quat_wxyz)[2]

    def hover(self) -> None:
        """Return to the hover."""
        self._since_ns = None

    def velocity(self, asked_enu_ms: F64, now_ns: int) -> F64:
        """Return the velocity (3,) that is flown: the one asked in the hover."""
        self._now_ns = now_ns
        if self._since_ns is None:
            return asked_enu_ms
        east, north = math.sin(self._course_rad), math.cos(self._course_rad)
        return np.array([CRUISE_MS * east, CRUISE_MS * north, -SINK_MS])

    @property
    def vtol_state(self) -> int:
        """MAV_VTOL_STATE of EXTENDED_SYS_STATE: ArduCopter reports a VTOL that hovers, ArduPlane none."""
        if self.kind is Kind.FIXED_WING:
            return int(mavlink.MAV_VTOL_STATE_UNDEFINED)
        if self._since_ns is None:
            return int(mavlink.MAV_VTOL_STATE_MC)
        young = self._now_ns - self._since_ns < TRANSITION_NS
        return int(mavlink.MAV_VTOL_STATE_TRANSITION_TO_FW if young else mavlink.MAV_VTOL_STATE_FW)
