"""Cloud Optimized GeoTIFF output of the maps, in the CRS and units of the cloud."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import rasterio
import rasterio.shutil
from numpy.typing import NDArray
from rasterio._err import CPLE_BaseError
from rasterio.crs import CRS
from rasterio.enums import Resampling
from rasterio.transform import Affine
from rasterio.windows import Window

from companion.desk.clouds.unit_statements import unit_name
from companion.desk.survey.findings import Maps
from companion.desk.survey.local_metres import Metric
from slz import SAFE, UNKNOWN, UNSAFE, Box, SurfaceKind
from slz.terrain.layers import NAMED, Output, reaching

TILE = 256  # cells
STRIP, WIDE = 1024, 4096  # rows and columns read at a time: whole tiles
CACHE_MB = 128  # of GDAL
STATE_COLOURS = {int(UNSAFE): (215, 48, 31), int(SAFE): (27, 120, 55), int(UNKNOWN): (255, 255, 255)}  # RGB


@dataclass(frozen=True, slots=True)
class Raster:
    """GeoTIFF: its name, the map layer it is read from, its unit and the meaning of its cells."""

    name: str
    of: str
    unit: str
    meaning: str

    @property
    def is_float(self) -> bool:
        return self.of not in ("state", "surface")

    @property
    def unknown(self) -> float:
        """Value where nothing is known."""
        return math.nan if self.is_float else int(UNKNOWN) if self.of == "state" else SurfaceKind.UNKNOWN


def rasters(metric: Metric, mode: str) -> tuple[Raster, ...]:
    """Return the GeoTIFFs that are written in a mode, see `slz.terrain.layers`.

    Layers are float32 with NaN where unknown; heights are in the cloud's own vertical unit and datum. safe:
    uint8 with a colour table, 0 unsafe (red), 1 safe (green), 255 (nodata) unknown.
    """
    found = []
    for layer in reaching(Output.GEOTIFF):
        if unit := layer.unit_in(mode):
            unit = unit_name(metric.reference.vertical_m) if layer.is_height else unit
            found.append(Raster(layer.file, layer.name, unit, layer.meaning.format(unit=unit)))
    found.append(Raster("safe", "state", "", "0 unsafe, 1 safe, 255 unknown"))
    if mode != "source":
        kinds = ", ".join(f"{kind} {kind.word}" for kind in SurfaceKind)
        found += [
            Raster("surface", "surface", "", kinds),
            Raster("water", "water", "probability", "probability of water"),
        ]
    return tuple(found)


def write(path: Path, raster: Raster, maps: Maps, metric: Metric) -> Path:
    """Write a map, north up, with overviews where it is larger than a tile.

    Overviews of the state take the nearest cell, so that no new value appears. Maps are read and
    written in windows, so memory does not grow with their size.

    Raises
    ------
    OSError
        It cannot be written.
    """
    unfinished = path.with_suffix(".part.tif")
    rows, cols = maps.grid.rows, maps.grid.cols
    values: Callable[[Box], NDArray[Any]] = lambda box: _values(raster, maps, metric, box)  # noqa: E731
    tiled = rows > TILE or cols > TILE
    try:
        with rasterio.Env(GDAL_CACHEMAX=CACHE_MB):
            with rasterio.open(
                unfinished,
                "w",
                driver="GTiff",
                height=rows,
                width=cols,
                count=1,
                dtype="float32" if raster.is_float else "uint8",
                nodata=raster.unknown,
                crs=CRS.from_wkt(metric.reference.crs.to_wkt()),
                transform=transform(maps, metric),
                bigtiff="if_safer",
                sparse_ok=True,
                **({"tiled": True, "blockxsize": TILE, "blockysize": TILE} if tiled else {}),
            ) as file:
                if raster.of == "state":
                    file.write_colormap(1, STATE_COLOURS)  # before any cell, as GDAL asks
                for window in _windows(rows, cols):
                    found = values(window)
                    if _known(raster, found):  # unknown blocks stay sparse
                        place = Window(window.col0, rows - window.row1, *found.shape[::-1])
                        file.write(np.ascontiguousarray(found[::-1]), 1, window=place)
                file.set_band_description(1, raster.meaning)
                file.update_tags(VERTICAL_DATUM=metric.reference.heights)
                if raster.unit:
                    file.set_band_unit(1, raster.unit)
                # Built before compression, since the COG driver would compress them twice.
                file.build_overviews(_factors(rows, cols), _resampling(raster))
            _optimize(unfinished, path, raster)
    except CPLE_BaseError as error:  # raised by GDAL when the disk is full
        raise OSError(str(error)) from None
    finally:
        unfinished.unlink(missing_ok=True)
    return path


def transform(maps: Maps, metric: Metric) -> Affine:
    """Return the affine map from columns and rows, north up, to the CRS."""
    grid = maps.grid
    ((west, north),) = metric.crs_xy(np.array([[grid.west_m, grid.north_m]]))
    return Affine(grid.cell_m / metric.x_m, 0, west, 0, -grid.cell_m / metric.y_m, north)


def _windows(rows: int, cols: int) -> Iterator[Box]:
    """Return the boxes in which a map is written, from the north-west on."""
    for stop in range(rows, 0, -STRIP):
        for col in range(0, cols, WIDE):
            yield Box(max(0, stop - STRIP), stop, col, min(col + WIDE, cols))


def _known(raster: Raster, values: NDArray[Any]) -> bool:
    """Return whether any cell of a window is known."""
    return not (np.isnan(values) if raster.is_float else values == raster.unknown).all()


def _values(raster: Raster, maps: Maps, metric: Metric, box: Box) -> NDArray[Any]:
    found = maps.read(raster.of, box)
    if not raster.is_float or raster.of not in NAMED or not NAMED[raster.of].is_height:
        return found
    height = metric.altitude_m(found.astype(np.float64)) / metric.reference.vertical_m
    return np.asarray(height.astype(np.float32))


def _factors(rows: int, cols: int) -> list[int]:
    """Return the reduction factor of each overview, up to the first that fits into a tile."""
    return [2**k for k in range(1, max(0, math.ceil(math.log2(max(rows, cols) / TILE))) + 1)]


def _resampling(raster: Raster) -> Resampling:
    return Resampling.average if raster.is_float else Resampling.nearest


def _optimize(unfinished: Path, path: Path, raster: Raster) -> None:
    rasterio.shutil.copy(
        unfinished,
        path,
        driver="COG",
        compress="deflate",
        predictor="floating_point" if raster.is_float else "no",
        level=1,
        blocksize=TILE,
        overviews="auto",
        overview_resampling=_resampling(raster).name,
        bigtiff="if_safer",
    )
