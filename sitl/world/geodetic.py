"""Geodetic coordinates of one point in a local frame: the inverse of a projection to the tangent plane."""

from __future__ import annotations

import math

# WGS-84: semi-major axis, semi-minor axis (m), squares of the first and of the second eccentricity.
A_M, B_M = 6378137.0, 6378137.0 * (1 - 1 / 298.257223563)
E2, E2_SECOND = 1 - (B_M / A_M) ** 2, (A_M / B_M) ** 2 - 1
ROUNDS = 2  # the first is good to a tenth of a millimetre below 10 km, the second to rounding


def geodetic_of(
    enu_m: tuple[float, float, float], origin_lla: tuple[float, float, float]
) -> tuple[float, float, float]:
    """Return latitude, longitude (degrees) and ellipsoidal height (m) of a point in an east, north, up frame.

    Bowring, Survey Review 181 (1976): tan(lat) from the parametric latitude. As `pymap3d.enu2geodetic`, which
    is made for arrays and takes a hundred times as long for one point; poles excluded.
    """
    east, north, up = enu_m
    lat, lon, height = math.radians(origin_lla[0]), math.radians(origin_lla[1]), origin_lla[2]
    sin_lat, cos_lat, sin_lon, cos_lon = math.sin(lat), math.cos(lat), math.sin(lon), math.cos(lon)
    normal = A_M / math.sqrt(1 - E2 * sin_lat**2)
    outward = (normal + height) * cos_lat + cos_lat * up - sin_lat * north
    x, y = outward * cos_lon - sin_lon * east, outward * sin_lon + cos_lon * east
    z = (normal * (1 - E2) + height) * sin_lat + sin_lat * up + cos_lat * north
    axis_m = math.hypot(x, y)
    parametric = math.atan2(z * A_M, axis_m * B_M)
    for _ in range(ROUNDS):
        lat = math.atan2(
            z + E2_SECOND * B_M * math.sin(parametric) ** 3, axis_m - E2 * A_M * math.cos(parametric) ** 3
        )
        parametric = math.atan2(B_M * math.sin(lat), A_M * math.cos(lat))
    sin_lat = math.sin(lat)
    above_m = axis_m * math.cos(lat) + z * sin_lat - A_M * math.sqrt(1 - E2 * sin_lat**2)
    return math.degrees(lat), math.degrees(math.atan2(y, x)), above_m
