"""MAVLink frames as sent by a running autopilot, for tests of their receivers."""

from __future__ import annotations

from typing import Any

import numpy as np
import pymap3d
from numpy.typing import NDArray
from pymavlink.dialects.v20 import ardupilotmega as mavlink

F64 = NDArray[np.float64]
HOME = (-35.363262, 149.165237, 584.0)
LEVEL = np.array([1.0, 0.0, 0.0, 0.0])
ON_GROUND, IN_AIR = mavlink.MAV_LANDED_STATE_ON_GROUND, mavlink.MAV_LANDED_STATE_IN_AIR


class Sender:
    """An autopilot's packer."""

    def __init__(self, kind: int = mavlink.MAV_AUTOPILOT_ARDUPILOTMEGA, system: int = 1) -> None:
        self._codec: Any = mavlink.MAVLink(None, srcSystem=system, srcComponent=1)
        self._kind = kind

    def pack(self, message: Any) -> bytes:
        data = bytes(message.pack(self._codec))
        self._codec.seq = (self._codec.seq + 1) % 256
        return data

    def heartbeat(self, armed: bool = False, mode: int = 4) -> bytes:
        base = mavlink.MAV_MODE_FLAG_SAFETY_ARMED if armed else 0
        return self.pack(mavlink.MAVLink_heartbeat_message(2, self._kind, base, mode, 4, 3))

    def landed(self, state: int) -> bytes:
        return self.pack(mavlink.MAVLink_extended_sys_state_message(0, state))

    def home(self, lla: tuple[float, float, float] = HOME) -> bytes:
        lat, lon, alt = lla
        level = [1.0, 0.0, 0.0, 0.0]
        return self.pack(
            mavlink.MAVLink_home_position_message(
                round(lat * 1e7), round(lon * 1e7), round(alt * 1000), 0, 0, 0, level, 0, 0, 0
            )
        )

    def attitude(self, boot_ms: int, quat: F64 = LEVEL, rates: tuple[float, ...] = (0.0, 0.0, 0.0)) -> bytes:
        return self.pack(mavlink.MAVLink_attitude_quaternion_message(boot_ms, *quat, *rates))

    def sim_state(self, lla: tuple[float, float, float], quat: F64 = LEVEL) -> bytes:
        lat, lon, alt = lla
        zeros = [0.0] * 9
        return self.pack(
            mavlink.MAVLink_sim_state_message(
                *quat, *zeros, 0.0, 0.0, alt, 0.0, 0.0, 0.0, 0.0, 0.0, round(lat * 1e7), round(lon * 1e7)
            )
        )

    def global_position(self, boot_ms: int, lla: tuple[float, float, float]) -> bytes:
        lat, lon, alt = lla
        place = round(lat * 1e7), round(lon * 1e7), round(alt * 1000)
        return self.pack(mavlink.MAVLink_global_position_int_message(boot_ms, *place, 0, 0, 0, 0, 0))

    def hil_state(self, boot_us: int, lla: tuple[float, float, float], quat: F64 = LEVEL) -> bytes:
        lat, lon, alt = lla
        place = round(lat * 1e7), round(lon * 1e7), round(alt * 1000)
        return self.pack(
            mavlink.MAVLink_hil_state_quaternion_message(
                boot_us, list(quat), 0.0, 0.0, 0.0, *place, 0, 0, 0, 0, 0, 0, 0, 0
            )
        )


def beside_home(east: float, north: float, up: float) -> tuple[float, float, float]:
    """Return latitude, longitude (degrees) and altitude (m) of a place in metres from home."""
    lat, lon, alt = pymap3d.enu2geodetic(east, north, up, *HOME)
    return float(lat), float(lon), float(alt)
