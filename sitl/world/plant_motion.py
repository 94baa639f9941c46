"""Motion of plants: crowns that sway in the wind, and grass under a rotor.

A crown swings about its place near its natural frequency (J. R. Moore and D. A. Maguire, Trees 18, 2004: 0.2
to 1 Hz for trees of 5 to 20 m); the drag, and so the swing, grows with the square of the wind. Grass under a
rotor is pressed down and flutters; the share is a plausible choice, there is no data.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from sitl.world.primitives import Ellipsoid

F64 = NDArray[np.float64]

FULL_WIND_MS = 10.0
"""Wind at which a crown swings by its whole amplitude, and above which no further."""
QUANTUM_S = 0.02
"""Crowns stand still for so long: 4 cm at 0.5 m and 0.6 Hz."""
PRESSED = 0.6
FLUTTER_HZ = 6.0


@dataclass(frozen=True, slots=True)
class Sway:
    """Swing of a solid: greatest amplitude, direction counter-clockwise from east, frequency and phase."""

    amplitude_m: float
    bearing_rad: float
    hz: float
    phase_rad: float

    def offset_m(self, time_s: float, wind_ms: float) -> tuple[float, float]:
        """Return how far east and north of its place it is."""
        part = min(1.0, (wind_ms / FULL_WIND_MS) ** 2)
        away = part * self.amplitude_m * math.sin(2.0 * math.pi * self.hz * time_s + self.phase_rad)
        return away * math.cos(self.bearing_rad), away * math.sin(self.bearing_rad)


def swept(crown: Ellipsoid, sway: Sway) -> Ellipsoid:
    """Return an ellipsoid that holds a crown all through its swing.

    By support functions: one larger by the factor 1 + amplitude / radius holds the crown and its shift.
    """
    grow = 1.0 + sway.amplitude_m / min(crown.radius_x_m, crown.radius_y_m)
    return replace(
        crown,
        radius_x_m=grow * crown.radius_x_m,
        radius_y_m=grow * crown.radius_y_m,
        radius_z_m=grow * crown.radius_z_m,
    )


@dataclass(frozen=True, slots=True)
class Wash:
    """Downwash of a rotor on the ground: its middle, its radius, and the share by which it presses grass."""

    x_m: float
    y_m: float
    radius_m: float
    press: float

    @classmethod
    def below(cls, rotor_radius_m: float, x_m: float, y_m: float, over_m: float) -> Wash | None:
        """Return the wash of a rotor at a height over the ground; None from two diameters on."""
        press = PRESSED * (1.0 - max(0.0, over_m) / (4.0 * rotor_radius_m))
        return cls(x_m, y_m, 3.0 * rotor_radius_m, press) if press > 0.0 else None

    def pressed_m(self, leaf_m: F64, ground_m: F64, origins: F64, directions: F64, time_s: F64) -> F64:
        """Return ranges of leaves (n, parts) as the wash leaves them: on the way to the ground behind."""
        at = origins[:, np.newaxis, :2] + leaf_m[:, :, np.newaxis] * directions[:, np.newaxis, :2]
        x, y = at[:, :, 0], at[:, :, 1]
        with np.errstate(invalid="ignore"):
            inside = np.hypot(x - self.x_m, y - self.y_m) <= self.radius_m
            phase = 2.0 * math.pi * (FLUTTER_HZ * time_s[:, np.newaxis] + 1.7 * x + 2.3 * y)
            share = self.press * (0.75 + 0.25 * np.sin(phase))
            moved = leaf_m + share * (ground_m[:, np.newaxis] - leaf_m)
        return np.where(inside & np.isfinite(moved), moved, leaf_m)
