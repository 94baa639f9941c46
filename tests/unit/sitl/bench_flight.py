"""Vehicle, estimator and autopilot over flat ground, controlled by messages."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from sitl.autopilot.autopilot import Autopilot
from sitl.autopilot.estimator import EstimateErrors, Estimator
from sitl.vehicle.multirotor import Vehicle
from sitl.vehicle.rigid_body import State, ned, rotate

TICK_NS = 10_000_000  # coarser than by default, for time
ORIGIN = (47.0, 8.0, 400.0)


class Bench:
    """A flight without sockets."""

    def __init__(
        self,
        errors: EstimateErrors | None = None,
        wind_ms: float = 3.0,
        seed: int = 1,
        wind_from_deg: float | None = None,
        gust_ms: float | None = None,
        tick_ns: int = TICK_NS,
        autopilot: type[Autopilot] = Autopilot,
    ) -> None:
        self.tick_ns = tick_ns
        rng = np.random.default_rng(seed)
        self.vehicle = Vehicle(rng, (0.0, 0.0, 0.0), 0.7, wind_ms, wind_from_deg, gust_ms)
        self.autopilot = autopilot(ORIGIN)
        self.estimator = Estimator(rng, errors or EstimateErrors.none(), self.autopilot.aiding)
        self.autopilot.add_link(0)
        self.now_ns = 0
        self.sent: list[Any] = []
        self.ground_m = 0.0

    @property
    def truth(self) -> State:
        return self.vehicle.truth

    def tick(self) -> None:
        dt = self.tick_ns * 1e-9
        estimate = self.estimator.update(dt, self.vehicle.truth)
        demand = self.autopilot.update(dt, self.now_ns, estimate, self.vehicle.on_ground)
        self.now_ns += self.tick_ns
        self.vehicle.update(dt, self.now_ns, demand, self.ground_m)
        self.sent += [message for _, message in self.autopilot.take_outgoing(self.now_ns)]

    def run(self, seconds: float, each: Callable[[], None] | None = None, every_s: float = 0.05) -> Bench:
        ticks, period = round(seconds * 1e9 / self.tick_ns), round(every_s * 1e9 / self.tick_ns)
        for tick in range(ticks):
            if each is not None and tick % period == 0:
                each()
            self.tick()
        return self

    def tell(self, message: Any) -> Bench:
        message.pack(mavlink.MAVLink(None, 255, 190))
        self.autopilot.receive(message, 0, self.now_ns)
        return self

    def command(self, number: int, *p: float) -> int:
        """Send a command; return the result of its acknowledgement."""
        values = [*p, *[0.0] * (7 - len(p))]
        self.tell(mavlink.MAVLink_command_long_message(1, 1, number, 0, *values))
        acks = [m for _, m in self.autopilot.take_outgoing(self.now_ns) if m.get_type() == "COMMAND_ACK"]
        return int(acks[-1].result)

    def airborne(self, height_m: float = 20.0) -> Bench:
        return self.run(6).airborne_with(None, height_m)

    def airborne_with(self, each: Callable[[], None] | None, height_m: float = 10.0) -> Bench:
        """Take off, telling it something all the while."""
        if each is not None:
            each()
        assert self.command(mavlink.MAV_CMD_DO_SET_MODE, 1, 4) == 0
        assert self.command(mavlink.MAV_CMD_COMPONENT_ARM_DISARM, 1) == 0
        assert self.command(mavlink.MAV_CMD_NAV_TAKEOFF, 0, 0, 0, 0, 0, 0, height_m) == 0
        return self.run(height_m / 2.5 + 8, each)

    def velocity(self, east: float, north: float, up: float) -> None:
        self.tell(
            mavlink.MAVLink_set_position_target_local_ned_message(
                0, 1, 1, 1, 0b110111000111, 0, 0, 0, north, east, -up, 0, 0, 0, 0, 0
            )
        )

    def landing_target(self, east: float, north: float, up: float = 0.0, *, frame: int = 12) -> None:
        estimate = self.autopilot.estimate
        assert estimate is not None
        offset = ned(np.array([east, north, up]) - estimate.pos_enu_m)
        q = estimate.quat_wxyz * np.array([1, -1, -1, -1])
        body = rotate(q, offset)
        distance = float(np.sqrt(body @ body))
        self.tell(
            mavlink.MAVLink_landing_target_message(
                self.now_ns // 1000, 0, frame, 0, 0, distance, 0, 0, *body, [1, 0, 0, 0], 2, 1
            )
        )
