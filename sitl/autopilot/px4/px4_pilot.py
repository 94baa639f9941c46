"""Scripted ground station for PX4: asks for a take-off, arms, and then only monitors."""

from __future__ import annotations

import math
from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from sitl.autopilot.pilot import Pilot
from sitl.autopilot.px4.px4_modes import Px4Mode


class Px4Pilot(Pilot):
    """System 255 on a wire of its own, with PX4's modes; it is done when it holds at its height."""

    holding_modes = (Px4Mode.AUTO_LOITER, Px4Mode.POSCTL, Px4Mode.ALTCTL)
    _home_m: float | None = None

    def set_mode(self, mode: int) -> None:
        """Request a flight mode by its custom_mode."""
        main, sub = mode >> 16 & 0xFF, mode >> 24
        flag = mavlink.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED
        self.command(mavlink.MAV_CMD_DO_SET_MODE, flag, main, sub)

    def _script(self) -> None:
        if self.landed_state == mavlink.MAV_LANDED_STATE_IN_AIR and self.armed:
            self.done = True
        elif self._home_m is None or (self.armed and self.mode == Px4Mode.AUTO_TAKEOFF):
            return
        elif not self.armed and (mavlink.MAV_CMD_NAV_TAKEOFF, 0) in self.acks:
            self.acks.clear()
            self.command(mavlink.MAV_CMD_COMPONENT_ARM_DISARM, 1)
        else:
            here = (math.nan,) * 3  # heading, latitude, longitude
            self.command(mavlink.MAV_CMD_NAV_TAKEOFF, 0, 0, 0, *here, self._home_m + self._height_m)

    def _read(self, message: Any) -> None:
        super()._read(message)
        if message.get_type() == "GLOBAL_POSITION_INT" and message.get_srcComponent() == 1:
            self._home_m = (message.alt - message.relative_alt) / 1000
