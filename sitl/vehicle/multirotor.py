"""True dynamics of the multirotor: rigid body, rate loop, thrust lag, drag, wind, ground."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sitl.compilation import kernel_for_any_types
from sitl.vehicle.ground_effect import ROTOR_OVER_FEET_M, ground_effect
from sitl.vehicle.rigid_body import State, from_euler, multiply, rotate, to_euler
from sitl.vehicle.wind_field import WindField

F64 = NDArray[np.float64]

GRAVITY_MS2 = 9.80665
RATE_LAG_S = 0.05
THRUST_LAG_S = 0.06
DRAG_PER_S = 0.25
MAX_THRUST_MS2 = 22.0

COLLISION_M = 0.5  # deeper in a surface, or lifted farther by it, than a contact of the skids allows
HARDEST_TOUCH_MS = 4.0
HOP_M = 0.3  # a take-off skips over the ground below this
NEW_FLIGHT_M = 2.0  # higher than any bounce

# x: 0-2 position enu, 3-5 velocity enu, 6-9 quaternion, 10-12 rates, 13 thrust, 14-16 acceleration


@kernel_for_any_types
def _step(x: F64, rates: F64, thrust: float, dt: float, ground: float, wind: F64) -> tuple[bool, float]:
    """Advance the body by dt; return whether it is on the ground, and how far the ground lifted it."""
    for i in range(3):
        x[10 + i] += (rates[i] - x[10 + i]) * min(1.0, dt / RATE_LAG_S)
    x[13] += (min(max(thrust, 0.0), MAX_THRUST_MS2) - x[13]) * min(1.0, dt / THRUST_LAG_S)
    q = x[6:10].copy()
    spin = np.array([0.0, x[10], x[11], x[12]])
    q = q + 0.5 * dt * multiply(q, spin)
    q /= np.sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3])
    lift = rotate(q, np.array([0.0, 0.0, -x[13] * ground_effect(x[2] - ground)]))
    ax = lift[1] - DRAG_PER_S * (x[3] - wind[0])
    ay = lift[0] - DRAG_PER_S * (x[4] - wind[1])
    az = -lift[2] - GRAVITY_MS2 - DRAG_PER_S * (x[5] - wind[2])
    standing = False
    lifted = 0.0
    if x[2] <= ground + 1e-3 and x[5] + az * dt <= 0.0:
        # Skids on the ground: no sliding, no sinking, level with it.
        standing = True
        x[2] = ground
        for i in range(3, 6):
            x[i] = 0.0
        x[10] = x[11] = x[12] = 0.0
        heading = np.arctan2(2 * (q[0] * q[3] + q[1] * q[2]), 1 - 2 * (q[2] * q[2] + q[3] * q[3]))
        q[:] = 0.0
        q[0], q[3] = np.cos(heading / 2), np.sin(heading / 2)
        ax = ay = az = 0.0
    else:
        x[0] += x[3] * dt + 0.5 * ax * dt * dt
        x[1] += x[4] * dt + 0.5 * ay * dt * dt
        x[2] += x[5] * dt + 0.5 * az * dt * dt
        x[3] += ax * dt
        x[4] += ay * dt
        x[5] += az * dt
        lifted = max(0.0, ground - x[2])
        x[2] += lifted
    x[6:10] = q
    x[14], x[15], x[16] = ax, ay, az
    return standing, lifted


class Vehicle:
    """True state of the vehicle, with touchdown and collision detection.

    Parameters
    ----------
    rng
        Source of the gusts.
    home_enu
        Initial position (m); z is the ground there.
    heading_rad
        Clockwise from north.
    wind_ms, wind_from_deg, gust_ms
        See `WindField`.

    Attributes
    ----------
    wind
        Wind at the vehicle.
    """

    def __init__(
        self,
        rng: np.random.Generator,
        home_enu: tuple[float, float, float],
        heading_rad: float = 0.0,
        wind_ms: float = 3.0,
        wind_from_deg: float | None = None,
        gust_ms: float | None = None,
    ) -> None:
        self._x = np.zeros(17)
        self._x[0:3] = home_enu
        self._x[6:10] = from_euler(0.0, 0.0, heading_rad)
        self.wind = WindField(rng, wind_ms, wind_from_deg, gust_ms)
        self.on_ground = True
        self.contact: dict[str, Any] | None = None
        """First contact of the last landing; None in flight and after a collision."""
        self.collision: dict[str, Any] | None = None
        """Place of a collision; the motors are dead from then on."""
        self._hopped = False
        self._lifted_m = 0.0
        self._clear_ground_m = float(home_enu[2])

    @property
    def truth(self) -> State:
        x = self._x.copy()
        return State(x[0:3], x[3:6], x[6:10], x[10:13], x[14:17])

    def update(self, dt_s: float, now_ns: int, demand: tuple[F64, float], ground_z_m: float) -> None:
        """Advance by `dt_s` under commanded body rates (rad/s) and thrust (m/s2).

        Records a touchdown and a collision. After a collision, the vehicle falls to the ground that was below
        it.
        """
        if self.collision is None and ground_z_m - self._x[2] > COLLISION_M:
            self._collide(now_ns)
        if self.collision is None:
            self._clear_ground_m = ground_z_m
        else:
            demand, ground_z_m = (np.zeros(3), 0.0), self._clear_ground_m
        rates, thrust = demand
        before = self._x.copy()
        wind = self.wind.advance(dt_s, float(self._x[2]) - ground_z_m + ROTOR_OVER_FEET_M)
        standing, lifted = _step(self._x, rates, thrust, dt_s, ground_z_m, wind)
        if self.collision is None:
            self._note(now_ns, before, standing, lifted, float(self._x[2]) - ground_z_m)
        self.on_ground = standing

    def strike(self, now_ns: int) -> None:
        """Collide here: the rotors met something."""
        if self.collision is None:
            self._collide(now_ns)

    def _note(self, now_ns: int, before: F64, standing: bool, lifted_m: float, height_m: float) -> None:
        """Distinguish flights, touchdowns and bounces."""
        self._lifted_m = self._lifted_m + lifted_m if height_m <= 0 and not standing else 0.0
        if self._lifted_m > COLLISION_M:
            self._collide(now_ns)
        self._hopped = self._hopped or height_m > HOP_M
        if height_m > NEW_FLIGHT_M:
            self.contact = None
        if not standing or self.on_ground or not self._hopped or self.contact is not None:
            return
        east, north, up = (float(v) for v in before[3:6])
        if math.hypot(east, north, up) > HARDEST_TOUCH_MS:
            self._collide(now_ns, before)
            return
        roll, pitch, yaw = to_euler(before[6:10])
        self._hopped = False
        self.contact = self._place(now_ns) | {
            "sink_ms": -up,
            "drift_ms": math.hypot(east, north),
            "tilt_deg": math.degrees(math.hypot(roll, pitch)),
            "heading_deg": math.degrees(yaw) % 360.0,
        }

    def _collide(self, now_ns: int, before: F64 | None = None) -> None:
        speed = np.sqrt(np.sum(np.square((self._x if before is None else before)[3:6])))
        self.collision = self._place(now_ns) | {"speed_ms": float(speed)}
        self.contact = None
        self._x[3:5] = 0.0

    def _place(self, now_ns: int) -> dict[str, Any]:
        e, n, u = (float(v) for v in self._x[0:3])
        return {"t_ns": now_ns, "e": e, "n": n, "u": u}
