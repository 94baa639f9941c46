"""Small LAS files of invented ground."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import laspy
import numpy as np
from numpy.typing import NDArray
from pyproj import CRS, Transformer

LON, LAT = -123.07, 44.05  # where the ground lies
FIELD_M = (60.0, 40.0)


def field(spacing_m: float = 0.4, seed: int = 1) -> NDArray[np.float64]:
    """Return (n, 3) metres of a flat field of 60 m x 40 m with a block of 4 m x 4 m x 3 m on it.

    The block's centre is at 20, 20 from the south-west corner; its walls hold no returns.
    """
    rng = np.random.default_rng(seed)
    east, north = np.meshgrid(*(np.arange(spacing_m / 2, side, spacing_m) for side in FIELD_M))
    points = np.column_stack([east.ravel(), north.ravel(), np.zeros(east.size)])
    points[:, :2] += rng.uniform(-0.1, 0.1, (len(points), 2)) * spacing_m
    points[:, 2] = 100 + rng.normal(0, 0.01, len(points))
    points[(np.abs(points[:, :2] - 20) < 2).all(axis=1), 2] += 3
    return points


def placed(points_m: NDArray[np.float64], crs: str, height_m: float = 1.0) -> NDArray[np.float64]:
    """Return metres, east and north of LON, LAT, as coordinates of a CRS; height_m is the unit of z."""
    local = CRS.from_proj4(f"+proj=tmerc +lat_0={LAT} +lon_0={LON} +k=1 +ellps=GRS80")
    there = Transformer.from_crs(local, CRS(crs).to_2d(), always_xy=True)
    if CRS(crs).is_compound:
        there = Transformer.from_crs(local, CRS(crs).sub_crs_list[0], always_xy=True)
    x, y = there.transform(points_m[:, 0], points_m[:, 1])
    return np.column_stack([x, y, points_m[:, 2] / height_m])


def write(path: Path, points: NDArray[np.float64], crs: str | None = "EPSG:32610", **fields: Any) -> Path:
    """Write a LAS 1.4 file (point format 6), or LAZ by its suffix; fields are arrays of the format."""
    header = laspy.LasHeader(point_format=6, version="1.4")
    degrees = crs is not None and CRS(crs).is_geographic
    header.scales = np.array([1e-9, 1e-9, 1e-3]) if degrees else np.array([1e-3, 1e-3, 1e-3])
    header.offsets = np.floor(points.min(axis=0)) if len(points) else np.zeros(3)
    if crs is not None:
        header.add_crs(CRS(crs))
    las = laspy.LasData(header)
    if len(points):
        las.x, las.y, las.z = points.T
    for name, values in fields.items():
        las[name] = values
    las.write(path)
    return path
