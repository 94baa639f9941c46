"""Where a Mid-360 points with its n-th pulse.

The maker publishes no formula. What is known: four laser lines fire in turn; a turning mirror sweeps
them around the z axis some 180 times a second while the elevation swings through the field of view ten
times a second, and the two never come back into step, so the gaps of one frame are filled by the next.

The approximation: azimuth falls at 182.4 revolutions a second; elevation is 22.5 + 24.5 cos(2 pi 10 t) deg,
slowed at the turning points less than a pure cosine; the four lines sit on a fan 10 deg long that turns with
the mirror, so each line adds up to 5 deg of elevation. The extremes are exactly -7 and +52 deg.
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
# A third harmonic bends the cosine towards a triangle: fewer pulses wasted at the two edges.
_THIRD = 0.07


def angles_rad(index: I64, elapsed_ns: I64) -> tuple[F64, F64]:
    """Return azimuth (any turn) and elevation of pulses, radians.

    Parameters
    ----------
    index
        Number of the pulse; its remainder by four is the laser line.
    elapsed_ns
        Sensor time since power-up.
    """
    time_s = elapsed_ns * 1e-9
    mirror = 2.0 * np.pi * ((MIRROR_HZ * time_s) % 1.0)
    swing = 2.0 * np.pi * ((SWING_HZ * time_s) % 1.0)
    fan_deg = FAN_DEG[index % LINES]
    shape = (np.cos(swing) + _THIRD * np.cos(3.0 * swing)) / (1.0 + _THIRD)
    elevation = np.radians(_MIDDLE_DEG + _SWING_DEG * shape + fan_deg * np.cos(mirror))
    azimuth = -mirror + np.radians(fan_deg) * np.sin(mirror) / np.cos(elevation)
    return azimuth, elevation


def directions(index: I64, elapsed_ns: I64) -> F64:
    """Return unit vectors (n, 3) in the sensor frame (x forward, y left, z up)."""
    azimuth, elevation = angles_rad(index, elapsed_ns)
    flat = np.cos(elevation)
    return np.column_stack([flat * np.cos(azimuth), flat * np.sin(azimuth), np.sin(elevation)])
