"""Local east-north-up (ENU) frames on the WGS-84 ellipsoid, and the sources' spherical approximation."""

from __future__ import annotations

import functools
import math
from dataclasses import dataclass
from typing import Any

import numpy as np
import pymap3d
from numpy.typing import ArrayLike, NDArray

EARTH_RADIUS_M = 6_378_137.0
WGS84 = pymap3d.Ellipsoid.from_name("wgs84")
Floats = NDArray[np.float64]


def is_known(enu_m: Floats) -> bool:
    """Return whether a position is known: all its coordinates are finite."""
    return all(map(math.isfinite, enu_m.tolist()))


@dataclass(frozen=True, slots=True)
class LocalFrame:
    """East-north-up tangent plane at a geodetic origin (WGS-84; degrees, metres)."""

    lat_deg: float
    lon_deg: float
    alt_m: float

    def __post_init__(self) -> None:
        if not (-90 <= self.lat_deg <= 90 and -180 <= self.lon_deg <= 180 and np.isfinite(self.alt_m)):
            raise ValueError(f"frame origin {self.lat_deg}, {self.lon_deg}, {self.alt_m} is not on the Earth")

    def enu_m(self, lat_deg: ArrayLike, lon_deg: ArrayLike, alt_m: ArrayLike) -> Floats:
        """Return (..., 3) east, north, up of geodetic coordinates."""
        (x, y, z), sin_lat, cos_lat, sin_lon, cos_lon = _origin(self.lat_deg, self.lon_deg, self.alt_m)
        there = pymap3d.geodetic2ecef(lat_deg, lon_deg, alt_m, WGS84)
        u, v, w = there[0] - x, there[1] - y, there[2] - z
        level = cos_lon * u + sin_lon * v  # from here on as `pymap3d.uvw2enu`
        enu = np.empty((*np.shape(level), 3))
        enu[..., 0] = -sin_lon * u + cos_lon * v
        enu[..., 1] = -sin_lat * level + cos_lat * w
        enu[..., 2] = cos_lat * level + sin_lat * w
        return enu

    def lla(self, enu_m: ArrayLike) -> Floats:
        """Return (..., 3) latitude, longitude (degrees) and altitude (m) of east, north, up."""
        enu = np.asarray(enu_m, dtype=np.float64)
        return np.stack(
            pymap3d.enu2geodetic(
                enu[..., 0], enu[..., 1], enu[..., 2], self.lat_deg, self.lon_deg, self.alt_m
            ),
            axis=-1,
        )

    def turn_rad(self, lat_deg: float, lon_deg: float) -> float:
        """Return the rotation angle between the ENU axes at a geodetic position and the frame's axes."""
        apart = np.linalg.norm(_axes(self.lat_deg, self.lon_deg) - _axes(lat_deg, lon_deg))
        return 2 * math.asin(min(1.0, float(apart) / math.sqrt(8)))

    def shifted(self, east_m: float, north_m: float) -> LocalFrame:
        """Return the frame whose origin is moved east and north of this one, at the same altitude."""
        lat, lon, _ = self.lla([east_m, north_m, 0.0])
        return LocalFrame(float(lat), float(lon), self.alt_m)

    def spherical_enu_m(self, lat_deg: ArrayLike, lon_deg: ArrayLike, alt_m: ArrayLike) -> Floats:
        """Return east, north, up from the sources' spherical formula.

        The sources print X and Y swapped; x is east here. Kept to measure the error of the approximation: its
        radius of curvature is off by up to 0.7 %.
        """
        lat, lon, alt = np.deg2rad(lat_deg), np.deg2rad(lon_deg), np.asarray(alt_m, dtype=np.float64)
        radius = EARTH_RADIUS_M + alt
        north = (lat - np.deg2rad(self.lat_deg)) * radius  # SLZ thesis, Eq. (3.15); SLZ paper, Eq. (10)
        # SLZ thesis, Eq. (3.16); SLZ paper, Eq. (11)
        east = (lon - np.deg2rad(self.lon_deg)) * radius * np.cos(lat)
        return np.stack(np.broadcast_arrays(east, north, alt - self.alt_m), axis=-1)

    def spherical_lla(self, enu_m: ArrayLike) -> Floats:
        """Return geodetic coordinates from the sources' spherical formula."""
        enu = np.asarray(enu_m, dtype=np.float64)
        alt = enu[..., 2] + self.alt_m
        # SLZ thesis, Eq. (4.1); SLZ paper, Eq. (12)
        lat = np.deg2rad(self.lat_deg) + enu[..., 1] / (EARTH_RADIUS_M + alt)
        # SLZ thesis, Eq. (4.2); SLZ paper, Eq. (13)
        lon = np.deg2rad(self.lon_deg) + enu[..., 0] / ((EARTH_RADIUS_M + alt) * np.cos(lat))
        return np.stack([np.rad2deg(lat), np.rad2deg(lon), alt], axis=-1)


@dataclass(frozen=True, slots=True)
class MapFrame(LocalFrame):
    """Frame of one map.

    number: differs between successive maps with the same origin, as after a jump of the position estimate.
    """

    number: int

    @classmethod
    def of(cls, frame: LocalFrame, number: int) -> MapFrame:
        return cls(frame.lat_deg, frame.lon_deg, frame.alt_m, number)


@functools.lru_cache(maxsize=64)
def _origin(lat_deg: float, lon_deg: float, alt_m: float) -> tuple[Any, ...]:
    """Return the Earth-centred place of an origin, and sine and cosine of its latitude and longitude."""
    lat, lon = np.radians(lat_deg), np.radians(lon_deg)
    place = pymap3d.geodetic2ecef(lat_deg, lon_deg, alt_m, WGS84)
    return place, np.sin(lat), np.cos(lat), np.sin(lon), np.cos(lon)


def _axes(lat_deg: float, lon_deg: float) -> Floats:
    """Return the unit vectors (rows) east, north, up of a geodetic position, in Earth-centred axes (ECEF)."""
    lat, lon = math.radians(lat_deg), math.radians(lon_deg)
    sin_lat, cos_lat, sin_lon, cos_lon = math.sin(lat), math.cos(lat), math.sin(lon), math.cos(lon)
    return np.array(
        [
            [-sin_lon, cos_lon, 0.0],
            [-sin_lat * cos_lon, -sin_lat * sin_lon, cos_lat],
            [cos_lat * cos_lon, cos_lat * sin_lon, sin_lat],
        ]
    )
