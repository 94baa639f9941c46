"""A flight of the simulated PX4 without sockets, controlled by messages."""

from __future__ import annotations

import math
from typing import Self

import numpy as np
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from sitl.autopilot.px4.px4_autopilot import Px4Autopilot
from sitl.autopilot.px4.px4_modes import Px4Mode
from tests.unit.sitl.autopilot.targeted_flight import TargetedFlight
from tests.unit.sitl.bench_flight import ORIGIN, Bench

ACCEPTED, REJECTED = mavlink.MAV_RESULT_ACCEPTED, mavlink.MAV_RESULT_TEMPORARILY_REJECTED
NAN = math.nan
LOCAL_NED, BODY_FRD = mavlink.MAV_FRAME_LOCAL_NED, mavlink.MAV_FRAME_BODY_FRD
VELOCITY = 0b110111000111
QUICK = {"MPC_XY_CRUISE": 8.0, "MPC_Z_VEL_MAX_DN": 2.5, "MPC_Z_V_AUTO_UP": 5.0, "MPC_TKO_SPEED": 5.0}


class Px4Flight(TargetedFlight):
    """Vehicle that holds at a height over home (0, 0), with a ground station.

    Attributes
    ----------
    target
        Place (east, north) that is streamed as LANDING_TARGET at 20 Hz while it is set.
    velocity
        Setpoint (east, north, up) that is streamed while it is set.
    """

    def __init__(self, height_m: float = 0.0, east_m: float = 0.0, **parameters: float) -> None:
        super().__init__(Bench(wind_ms=0.0, autopilot=Px4Autopilot))
        assert isinstance(self.bench.autopilot, Px4Autopilot)
        self.autopilot = self.bench.autopilot
        self.autopilot.parameters.update(QUICK | parameters)
        self.velocity: tuple[float, float, float] | None = None
        self.has_station = True
        self.states: list[str] = []
        self.run(5.2)
        if height_m:
            self.take_off(height_m).until(lambda: self.mode == "AUTO.LOITER")
            self.run(1.0)
        if east_m:
            self.reposition(east_m, 0.0, height_m).until(lambda: self.away_m((east_m, 0)) < 0.3)
        self.forget()

    def forget(self) -> Self:
        for record in (self.heights, self.states, self.bench.sent):
            del record[:]
        return self

    # ---- orders -------------------------------------------------------------------------------------

    def command(self, number: int, *values: float) -> int:
        return self.bench.command(number, *values)

    def take_off(self, height_m: float) -> Self:
        above_sea = ORIGIN[2] + height_m
        assert self.command(mavlink.MAV_CMD_NAV_TAKEOFF, 0, 0, 0, NAN, NAN, NAN, above_sea) == ACCEPTED
        assert self.command(mavlink.MAV_CMD_COMPONENT_ARM_DISARM, 1) == ACCEPTED
        return self

    def ask(self, mode: Px4Mode) -> int:
        main, sub = mode >> 16 & 0xFF, mode >> 24
        return self.command(mavlink.MAV_CMD_DO_SET_MODE, 1, main, sub)

    def enter(self, mode: Px4Mode) -> Self:
        assert self.ask(mode) == ACCEPTED
        return self.run(0.05)

    def reposition(self, east_m: float, north_m: float, up_m: float) -> Self:
        lat, lon, _ = self.autopilot.lla(np.array([east_m, north_m, 0.0]))
        values = -1, 1, 0, NAN, lat, lon, ORIGIN[2] + up_m
        assert self.command(mavlink.MAV_CMD_DO_REPOSITION, *values) == ACCEPTED
        return self

    # ---- messages of every step -----------------------------------------------------------------------

    def tell(self) -> None:
        if self.has_station:
            self.bench.tell(mavlink.MAVLink_heartbeat_message(mavlink.MAV_TYPE_GCS, 8, 0, 0, 4, 3))
        if self.target is not None:
            self.tell_target()
        if self.velocity is not None:
            self.bench.velocity(*self.velocity)
        self.heights.append(self.height_m)
        state = self.autopilot.navigator.precland.state.name
        if not self.states or self.states[-1] != state:
            self.states.append(state)

    def tell_target(self, frame: int = LOCAL_NED) -> None:
        east, north = self.target or (0.0, 0.0)
        self.bench.tell(
            mavlink.MAVLink_landing_target_message(
                0, 0, frame, 0, 0, 0, 0, 0, north, east, 0, [1, 0, 0, 0], 2, 1
            )
        )
