"""Background of the map from above: the operator's GeoTIFF or MBTiles, only shown, never judged."""

from __future__ import annotations

import io
import logging
import math
import warnings
from concurrent.futures import ThreadPoolExecutor
from functools import lru_cache, partial
from pathlib import Path
from typing import Any

import numpy as np
import rasterio
from PIL import Image
from rasterio import Affine
from rasterio._err import CPLE_BaseError
from rasterio.enums import ColorInterp, Resampling
from rasterio.warp import reproject, transform_bounds

from companion.runtime.errors import UsageError
from slz.frame import EARTH_RADIUS_M, LocalFrame

log = logging.getLogger(__name__)

SIDE, UNIT_M = 512, 0.1  # as in background.js; GDAL takes cells of 1 m at the origin for no place at all
KEPT = 128  # tiles, of 10 to 60 kB as a rule
CACHE_MB = 64  # of GDAL, and as much to warp
MOST_PX = 8192  # of a side of the smallest overview, all of which is read for a tile from afar
MOST_BLOCK_PX = 2**24  # decoded at once
FAILURES = rasterio.errors.RasterioError, CPLE_BaseError, OSError, ValueError, ArithmeticError


class BackgroundPicture:
    """Tiles of a picture file in a map frame, drawn one by one in the thread `worker`.

    Tile (row, col) of a level has `SIDE` x `SIDE` cells of `UNIT_M` 2^level, counted from the frame's origin.

    Raises
    ------
    UsageError
        The file cannot be used.
    """

    def __init__(self, path: Path) -> None:
        self.name, driver = path.name, "GTiff"
        try:
            with path.open("rb") as file:
                driver = "MBTiles" if file.read(6) == b"SQLite" else driver
            self._open = partial(rasterio.open, path.resolve(), driver=driver)  # other drivers may download
            quiet = warnings.catch_warnings(action="ignore")
            with quiet, rasterio.Env(GDAL_CACHEMAX=CACHE_MB), self._open() as picture:
                _check(path, picture)
                self._learn(picture)
        except FAILURES as error:
            kind = "GeoTIFF (gdal_translate makes one)"
            kind = "MBTiles (vector tiles, pbf, are no picture)" if driver == "MBTiles" else kind
            raise UsageError(f"{path}: it cannot be read as {kind}: {error}") from error
        self.etag = f'"{path.stat().st_mtime_ns:x}"'
        self.tile = lru_cache(KEPT)(self._tile)
        self.worker = ThreadPoolExecutor(1, thread_name_prefix="slz-background")

    def place(self, frame: LocalFrame) -> dict[str, Any]:
        """Return name, finest level, and west, south, east and north (m), None for the Earth's other side."""
        with self._open() as picture:
            box_m = transform_bounds(picture.crs, _plane(frame), *picture.bounds)
        finest = round(math.log2(self._pixel_m / UNIT_M))
        return {"name": self.name, "finest": finest, "box_m": box_m if np.isfinite(box_m).all() else None}

    def _learn(self, picture: Any) -> None:
        """Read what all tiles need, and some of the pixels: is the file whole?"""
        lon, lat = picture.lnglat()
        west, _, east, _ = transform_bounds(picture.crs, _plane(LocalFrame(lat, lon, 0.0)), *picture.bounds)
        self._pixel_m, self._factors = (east - west) / picture.width, picture.overviews(1)
        self._bands = [1, 2, 3] if picture.count >= 3 else [1]
        kinds = [ColorInterp.undefined, *picture.colorinterp]
        self._alpha = kinds.index(ColorInterp.alpha) if ColorInterp.alpha in kinds else 0
        colours = picture.colormap(1) if kinds[1] == ColorInterp.palette else {}
        self._palette = np.array([colours.get(i, (0, 0, 0))[:3] for i in range(256)]).T if colours else None
        rows, cols = (np.linspace(0, side - 1, 5).astype(int).tolist() for side in picture.shape)
        windows = [((row, row + 64), (col, col + 64)) for row in rows for col in cols]
        parts = [picture.read(self._bands, window=window, masked=True).compressed() for window in windows]
        seen = np.concatenate(parts)
        self._range = np.percentile(seen, (2, 98)) if seen.size and seen.itemsize > 1 else (0, 255)

    def _tile(self, frame: LocalFrame, level: int, row: int, col: int) -> bytes:
        """Return a tile as WebP, transparent where the picture does not reach; empty if it cannot be read."""
        try:
            cell_m = UNIT_M * 2.0**level
            west_m, north_m = col * SIDE * cell_m, (row + 1) * SIDE * cell_m
            enough = sum(factor * self._pixel_m <= cell_m for factor in self._factors)
            coarse = {"overview_level": enough - 1} if enough else {}
            with rasterio.Env(GDAL_CACHEMAX=CACHE_MB), self._open(**coarse) as picture:
                pixels = np.zeros((len(self._bands) + 1, SIDE, SIDE), picture.dtypes[0])
                reproject(
                    rasterio.band(picture, self._bands),
                    pixels,
                    dst_crs=_plane(frame),
                    dst_transform=Affine(cell_m, 0, west_m, 0, -cell_m, north_m),
                    src_alpha=self._alpha,
                    dst_alpha=len(pixels),
                    init_dest_nodata=False,
                    resampling=Resampling.bilinear if self._palette is None else Resampling.nearest,
                    warp_mem_limit=CACHE_MB,
                )
        except FAILURES as error:
            log.warning("%s: %s", self.name, error)
            return b""
        shades = pixels[:-1] if self._palette is None else self._palette[:, pixels[0]]
        darkest, brightest = self._range
        colours = np.clip((shades - darkest) * (255 / max(brightest - darkest, 1)), 0, 255)
        rgba = np.concatenate([*[colours] * (3 // len(colours)), 255 * (pixels[-1:] > 0)])
        encoded = io.BytesIO()
        Image.fromarray(np.moveaxis(rgba, 0, -1).astype(np.uint8)).save(encoded, "WEBP", quality=75, method=2)
        return encoded.getvalue()


def _plane(frame: LocalFrame) -> dict[str, Any]:
    """Return the projection onto a frame's plane, of ground at the altitude of its origin."""
    origin = {"proj": "ortho", "lat_0": frame.lat_deg, "lon_0": frame.lon_deg, "datum": "WGS84"}
    return {**origin, "to_meter": 1 / (1 + frame.alt_m / EARTH_RADIUS_M)}


def _check(path: Path, picture: Any) -> None:
    """Raise a UsageError that says what is wrong with a picture, and what helps."""
    high, wide = picture.block_shapes[0]
    if picture.crs is None or picture.transform.is_identity:
        fault = (
            "no coordinate system or corner in it: gdal_translate -a_srs EPSG:CODE -a_ullr W N E S sets them"
        )
    elif (kind := picture.dtypes[0]) not in ("uint8", "uint16", "int16"):
        fault = f"its pixels are {kind}: a picture of 8 or 16 bits is needed"
    elif max(picture.shape) / max(picture.overviews(1), default=1) > MOST_PX or high * wide > MOST_BLOCK_PX:
        size = f"{picture.width} x {picture.height} pixels"
        fault = f"it has {size}, not in tiles with overviews: gdal_translate -of COG FILE NEW.tif makes them"
    else:
        return
    raise UsageError(f"{path}: {fault}")
