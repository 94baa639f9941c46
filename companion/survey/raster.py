"""The maps as Cloud Optimized GeoTIFF, in the CRS and units of the cloud."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import rasterio
from numpy.typing import NDArray
from rasterio.crs import CRS
from rasterio.transform import Affine

from companion.survey.metric import Metric
from companion.survey.reference import unit_name
from slz import UNKNOWN, TerrainMaps

TILE = 256  # cells


def write(folder: Path, maps: TerrainMaps, metric: Metric, source_mode: bool) -> list[Path]:
    """Write dsm.tif, slope.tif, roughness.tif and safe.tif, north up, and return their paths.

    dsm: height in the cloud's own vertical unit and datum. slope: degrees. roughness: rms residual about
    the plane of the footprint, metres; in source mode the gradient of the slope map, degrees. These are
    float32 with NaN where unknown. safe: uint8, 0 unsafe, 1 safe, 255 (nodata) unknown.
    """
    z = metric.reference.vertical_m
    height = (metric.altitude_m(maps.height_m.astype(np.float64)) / z).astype(np.float32)
    rough_unit = "degree" if source_mode else "m"
    layers: tuple[tuple[str, NDArray[Any], float, str, str], ...] = (
        ("dsm", height, np.nan, unit_name(z), f"mean height of the returns, {unit_name(z)}"),
        ("slope", maps.slope_deg, np.nan, "degree", "slope, degrees"),
        ("roughness", maps.roughness, np.nan, rough_unit, f"roughness, {rough_unit}"),
        ("safe", maps.state, int(UNKNOWN), "", "0 unsafe, 1 safe, 255 unknown"),
    )
    affine = transform(maps, metric)
    return [
        _write(folder / f"{name}.tif", values, nodata, unit, description, affine, metric)
        for name, values, nodata, unit, description in layers
    ]


def transform(maps: TerrainMaps, metric: Metric) -> Affine:
    """Return the affine map from columns and rows, north up, to the CRS."""
    cell = maps.grid.cell_m
    north_m = maps.south_m + maps.box.shape[0] * cell
    ((west, north),) = metric.crs_xy(np.array([[maps.west_m, north_m]]))
    return Affine(cell / metric.x_m, 0, west, 0, -cell / metric.y_m, north)


def _write(
    path: Path,
    values: NDArray[Any],
    nodata: float,
    unit: str,
    description: str,
    affine: Affine,
    metric: Metric,
) -> Path:
    """Write one map, with overviews where it is larger than a tile; those of safe.tif invent no state."""
    rows, cols = values.shape
    is_float = values.dtype == np.float32
    with rasterio.open(
        path,
        "w",
        driver="COG",
        height=rows,
        width=cols,
        count=1,
        dtype=values.dtype,
        nodata=nodata,
        crs=CRS.from_wkt(metric.reference.crs.to_wkt()),
        transform=affine,
        compress="deflate",
        predictor="floating_point" if is_float else "no",
        level=1,
        blocksize=TILE,
        overviews="auto",
        overview_resampling="average" if is_float else "nearest",
        bigtiff="if_safer",
        num_threads="all_cpus",
    ) as file:
        file.write(np.ascontiguousarray(values[::-1]), 1)
        file.set_band_description(1, description)
        if unit:
            file.set_band_unit(1, unit)
    return path
