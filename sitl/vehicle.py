"""The true multirotor: rigid body, rate loop, thrust lag, drag, wind, and the ground under its skids."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from sitl.jit import kernel
from sitl.state import State, from_euler, multiply, rotate, to_euler

F64 = NDArray[np.float64]

GRAVITY_MS2 = 9.80665
RATE_LAG_S = 0.05
THRUST_LAG_S = 0.06
DRAG_PER_S = 0.25
MAX_THRUST_MS2 = 22.0
GUST_TAU_S = 4.0

# x: 0-2 position enu, 3-5 velocity enu, 6-9 quaternion, 10-12 rates, 13 thrust, 14-16 acceleration


@kernel()
def _step(x: F64, rates: F64, thrust: float, dt: float, ground: float, wind: F64) -> bool:
    """Advance the body by dt; return whether it stands on the ground afterwards."""
    for i in range(3):
        x[10 + i] += (rates[i] - x[10 + i]) * min(1.0, dt / RATE_LAG_S)
    x[13] += (min(max(thrust, 0.0), MAX_THRUST_MS2) - x[13]) * min(1.0, dt / THRUST_LAG_S)
    q = x[6:10].copy()
    spin = np.array([0.0, x[10], x[11], x[12]])
    q = q + 0.5 * dt * multiply(q, spin)
    q /= np.sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3])
    lift = rotate(q, np.array([0.0, 0.0, -x[13]]))
    ax = lift[1] - DRAG_PER_S * (x[3] - wind[0])
    ay = lift[0] - DRAG_PER_S * (x[4] - wind[1])
    az = -lift[2] - GRAVITY_MS2 - DRAG_PER_S * (x[5] - wind[2])
    standing = False
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
        x[2] = max(x[2], ground)
    x[6:10] = q
    x[14], x[15], x[16] = ax, ay, az
    return standing


class Vehicle:
    """The true vehicle.

    Parameters
    ----------
    rng
        Source of the gusts.
    home_enu
        Where it stands (m); z is the ground there.
    heading_rad
        Clockwise from north.
    wind_ms
        Mean horizontal wind; its direction is drawn, and gusts of a third of it are added.
    """

    def __init__(
        self,
        rng: np.random.Generator,
        home_enu: tuple[float, float, float],
        heading_rad: float = 0.0,
        wind_ms: float = 3.0,
    ) -> None:
        self._x = np.zeros(17)
        self._x[0:3] = home_enu
        self._x[6:10] = from_euler(0.0, 0.0, heading_rad)
        self._rng = rng
        direction = rng.uniform(0, 2 * np.pi)
        self._mean_wind = wind_ms * np.array([np.cos(direction), np.sin(direction), 0.0])
        self._gust = np.zeros(3)
        self._gust_sigma = wind_ms / 3
        self._draws = np.zeros((0, 3))
        self._next_draw = 0
        self.on_ground = True
        self.contact: dict[str, Any] | None = None

    @property
    def truth(self) -> State:
        x = self._x.copy()
        return State(x[0:3], x[3:6], x[6:10], x[10:13], x[14:17])

    def step(self, dt_s: float, now_ns: int, demand: tuple[F64, float], ground_z_m: float) -> None:
        """Advance by dt under commanded body rates (rad/s) and thrust (m/s2); notes a touchdown."""
        rates, thrust = demand
        sinking = self._x[3:6].copy()
        roll, pitch, _ = to_euler(self._x[6:10]) if not self.on_ground else (0.0, 0.0, 0.0)
        standing = bool(_step(self._x, rates, thrust, dt_s, ground_z_m, self._wind(dt_s)))
        if standing and not self.on_ground:
            self.contact = {
                "t_ns": now_ns,
                "e": float(self._x[0]),
                "n": float(self._x[1]),
                "u": float(self._x[2]),
                "sink_ms": float(-sinking[2]),
                "drift_ms": float(np.hypot(sinking[0], sinking[1])),
                "tilt_deg": float(np.degrees(np.hypot(roll, pitch))),
            }
        self.on_ground = standing

    def _wind(self, dt_s: float) -> F64:
        if self._next_draw == len(self._draws):
            self._draws, self._next_draw = self._rng.standard_normal((4096, 3)), 0
        draw = self._draws[self._next_draw]
        self._next_draw += 1
        share = dt_s / GUST_TAU_S
        self._gust += -self._gust * share + self._gust_sigma * np.sqrt(2 * share) * draw
        return np.asarray(self._mean_wind + self._gust * (1.0, 1.0, 0.3))
