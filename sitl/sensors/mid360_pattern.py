"""Scan pattern of a Mid-360: the direction of its n-th pulse.

The maker publishes no formula. Known facts: four laser lines fire in turn; a rotating mirror sweeps them
around the z axis at about 180 Hz while the elevation oscillates over the field of view at 10 Hz, and the two
never come back into step, so the next frame fills the gaps of the last.

Approximation: the azimuth decreases at 182.4 revolutions a second; the elevation is 22.5 + 24.5
cos(2 pi 10 t) deg, dwelling less at the turning points than a pure cosine; the four lines are on a fan 10 deg
long that turns with the mirror, so each line adds up to 5 deg of elevation. The extremes are exactly -7 and
+52 deg.

The elevation phase advances by an irrational share of a turn in each frame, so no two frames repeat.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

F64 = NDArray[np.float64]
I64 = NDArray[np.int64]

ELEVATION_MIN_DEG, ELEVATION_MAX_DEG = -7.0, 52.0
MIRROR_HZ = 182.4
SWING_HZ = 10.0 + 0.1 * 0.6180339887
FAN_DEG = np.array([-5.0, -5.0 / 3.0, 5.0 / 3.0, 5.0])
LINES = 4

_MIDDLE_DEG = (ELEVATION_MIN_DEG + ELEVATION_MAX_DEG) / 2
_SWING_DEG = (ELEVATION_MAX_DEG - ELEVATION_MIN_DEG) / 2 - FAN_DEG[-1]
# A third harmonic shapes the cosine towards a triangle, so that fewer pulses are wasted at the two edges.
_THIRD = 0.07


def angles_rad(index: I64, elapsed_ns: I64) -> tuple[F64, F64, F64]:
    """Return azimuth (any turn) and elevation of pulses, radians, and the cosine of the elevation.

    Parameters
    ----------
    index
        Number of the pulse; its remainder modulo four is the laser line.
    elapsed_ns
        Sensor time since power-up.
    """
    time_s = elapsed_ns * 1e-9
    mirror, swing = (
        2.0 * np.pi * (turns - np.floor(turns)) for turns in (MIRROR_HZ * time_s, SWING_HZ * time_s)
    )
    fan_deg = FAN_DEG[index & (LINES - 1)]
    shape = (np.cos(swing) + _THIRD * np.cos(3.0 * swing)) / (1.0 + _THIRD)
    elevation = np.radians(_MIDDLE_DEG + _SWING_DEG * shape + fan_deg * np.cos(mirror))
    flat = np.cos(elevation)
    azimuth = -mirror + np.radians(fan_deg) * np.sin(mirror) / flat
    return azimuth, elevation, flat


def directions(index: I64, elapsed_ns: I64) -> F64:
    """Return unit vectors (n, 3) in the sensor frame (x forward, y left, z up)."""
    azimuth, elevation, flat = angles_rad(index, elapsed_ns)
    return np.column_stack([flat * np.cos(azimuth), flat * np.sin(azimuth), np.sin(elevation)])
