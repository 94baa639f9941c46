"""Survey prior of a flight: `slz run --prior DIR`, a folder that `slz map` wrote."""

from __future__ import annotations

import json
import logging
import math
from pathlib import Path
from typing import Any

import numpy as np
import rasterio
from numpy.typing import NDArray
from pyproj import CRS, Transformer
from pyproj.exceptions import ProjError
from rasterio.windows import Window
from scipy import ndimage

from companion.runtime.errors import UsageError
from params import Parameters
from slz import SAFE, UNKNOWN, UNSAFE, Grid, LocalFrame
from slz.prior import Surveyed

log = logging.getLogger(__name__)

CELLS = 512  # per side
STRIP = 64  # rows resampled at a time
KNOT = 32  # cells between nodes with exact coordinates; linear interpolation between them
AROUND = ((0.0, 0.0), (-0.4, -0.4), (-0.4, 0.4), (0.4, -0.4), (0.4, 0.4))  # in a cell: all must be safe
FILES = ("safe", "dsm", "slope")
GEAR = ("gear", "gear_length_m", "gear_width_m", "pad_radius_m", "clearance_m", "tip_limit_deg")
NOWHERE = -1e9  # row or column outside the survey
Floats = NDArray[np.float64]


class SurveyPrior:
    """Surveyed ground around a place, as `slz.prior.Source`.

    Raises
    ------
    UsageError
        The folder holds no survey, a damaged one, or one for a smaller or a hardier vehicle than this.
    """

    def __init__(self, folder: Path, parameters: Parameters) -> None:
        try:
            document = json.loads((folder / "survey.json").read_text("utf-8"))
        except (OSError, ValueError):
            raise _no(folder, "survey.json") from None
        self._paths = {name: folder / f"{name}.tif" for name in FILES}
        try:
            _check(folder, document, parameters)
            _check_maps(folder, list(self._paths.values()))
            crs = CRS.from_wkt(document["crs"])
            horizontal = crs.sub_crs_list[0] if crs.is_compound else crs.to_2d()
            self._to_crs = Transformer.from_crs("EPSG:4326", horizontal, always_xy=True)
            self._unit_m, cell_m = float(document["vertical_unit_m"]), float(document["cells"]["cell_m"])
        except (KeyError, TypeError, AttributeError, ValueError, ProjError) as error:
            reason = " ".join(f"{type(error).__name__}: {error}".split())[:120]
            raise UsageError(
                f"--prior {folder}: its survey.json is not as slz map writes it ({reason}): survey again"
            ) from None
        if not (0 < self._unit_m < math.inf and 0 < cell_m < math.inf):
            raise UsageError(
                f"--prior {folder}: its survey.json tells of lengths that are none: survey again"
            )
        self._cell_m = max(parameters.far_cell_m / 2, cell_m)

    def __call__(self, frame: LocalFrame, enu_m: Floats) -> Surveyed | None:
        """Return the surveyed ground around a place of a frame, None where there is none."""
        side_m = CELLS * self._cell_m
        corner = np.round(enu_m[:2] / self._cell_m) * self._cell_m - side_m / 2
        grid = Grid(float(corner[0]), float(corner[1]), self._cell_m, CELLS, CELLS)
        state = np.full((CELLS, CELLS), UNKNOWN, np.uint8)
        height, slope = (np.full((CELLS, CELLS), np.nan, np.float32) for _ in range(2))
        x, y = self._places(grid, frame)
        try:
            with (
                rasterio.open(self._paths["safe"]) as safe,
                rasterio.open(self._paths["dsm"]) as dsm,
                rasterio.open(self._paths["slope"]) as steep,
            ):
                for row in range(0, CELLS, STRIP):
                    rows = slice(row, row + STRIP)
                    _resample(safe, dsm, steep, x[rows], y[rows], state[rows], height[rows], slope[rows])
        except rasterio.errors.RasterioError as error:
            log.error("the survey cannot be read, the flight goes on without: %s", error)
            return None
        if not (state != UNKNOWN).any():
            log.warning("the survey holds no ground within %.0f m", side_m / 2)
            return None
        height *= np.float32(self._unit_m)
        height -= np.float32(frame.alt_m)
        safe_m2 = np.count_nonzero(state == SAFE) * self._cell_m**2
        log.info("the survey is known here, %.0f m2 of it safe within %.0f m", safe_m2, side_m / 2)
        return Surveyed(grid, state, height, slope)

    def _places(self, grid: Grid, frame: LocalFrame) -> tuple[Floats, Floats]:
        """Return the coordinates (rows, cols) of all cell centres in the survey's CRS."""
        knots = np.arange(0, CELLS + KNOT, KNOT)
        across, up = np.meshgrid(
            grid.west_m + (knots + 0.5) * grid.cell_m, grid.south_m + (knots + 0.5) * grid.cell_m
        )
        lla = frame.lla(np.stack([across, up, np.zeros_like(up)], axis=-1))
        found = self._to_crs.transform(lla[..., 1].ravel(), lla[..., 0].ravel())
        at = np.mgrid[:CELLS, :CELLS] / KNOT
        x, y = (
            ndimage.map_coordinates(np.reshape(values, across.shape), at, order=1, mode="nearest")
            for values in found
        )
        return x, y


def _resample(
    safe: Any,
    dsm: Any,
    steep: Any,
    x: Floats,
    y: Floats,
    state: NDArray[np.uint8],
    height: NDArray[np.float32],
    slope: NDArray[np.float32],
) -> None:
    """Resample state, height and slope in a strip; a cell is safe only if the survey is safe all over it."""
    known = np.isfinite(x) & np.isfinite(y)  # a projection does not cover the whole Earth
    if not known.any():
        return
    x, y = np.where(known, x, np.nan), np.where(known, y, np.nan)
    inverse = ~safe.transform
    col, row = inverse.a * x + inverse.c, inverse.e * y + inverse.f
    up_row, right_row, up_col, right_col = (_step(at, axis) for at in (row, col) for axis in (0, 1))
    step_row, step_col = abs(up_row) + abs(right_row), abs(up_col) + abs(right_col)
    first = max(0, math.floor(np.nanmin(row) - step_row)), max(0, math.floor(np.nanmin(col) - step_col))
    stop = (
        min(safe.height, math.ceil(np.nanmax(row) + step_row)),
        min(safe.width, math.ceil(np.nanmax(col) + step_col)),
    )
    row, col = np.where(known, row, NOWHERE), np.where(known, col, NOWHERE)
    if not (first[0] < stop[0] and first[1] < stop[1]):
        return
    window = Window(first[1], first[0], stop[1] - first[1], stop[0] - first[0])
    states = safe.read(1, window=window)
    worst = np.zeros(x.shape, np.uint8)  # 0 safe, 1 unknown, 2 unsafe
    for up, right in AROUND:
        there = row + up * up_row + right * right_row, col + up * up_col + right * right_col
        found = _at(states, there[0] - first[0], there[1] - first[1], int(UNKNOWN))
        worst = np.maximum(worst, np.select([found == SAFE, found == UNSAFE], [0, 2], 1).astype(np.uint8))
    state[:] = np.array([SAFE, UNKNOWN, UNSAFE], np.uint8)[worst]
    for source, out in ((dsm, height), (steep, slope)):
        out[:] = _at(source.read(1, window=window), row - first[0], col - first[1], math.nan)
    state[(state == SAFE) & np.isnan(height)] = UNKNOWN  # no height to compare a return with


def _step(at: Floats, axis: int) -> float:
    """Return the change of a survey row or column from one cell of a strip to the next."""
    steps = np.diff(at, axis=axis)
    return float(np.nanmedian(steps)) if np.isfinite(steps).any() else 0.0


def _at(values: NDArray[Any], row: Floats, col: Floats, empty: float) -> NDArray[Any]:
    """Return the values of an array at rows and columns, `empty` outside."""
    r, c = np.floor(row).astype(np.int64), np.floor(col).astype(np.int64)
    inside = (r >= 0) & (r < values.shape[0]) & (c >= 0) & (c < values.shape[1])
    out = np.full(row.shape, empty, values.dtype)
    out[inside] = values[r[inside], c[inside]]
    return out


def _no(folder: Path, name: str) -> UsageError:
    return UsageError(f"--prior {folder}: it holds no {name}: name a folder that slz map wrote")


def _check_maps(folder: Path, paths: list[Path]) -> None:
    """Refuse maps that are missing, unreadable or of different surveys."""
    places = set()
    for path in paths:
        if not path.is_file():
            raise _no(folder, path.name)
        try:
            with rasterio.open(path) as file:
                places.add((file.shape, tuple(file.transform)))
        except rasterio.errors.RasterioError:
            raise UsageError(f"--prior {folder}: {path.name} cannot be read: survey again") from None
    if len(places) > 1:
        names = ", ".join(path.name for path in paths)
        raise UsageError(f"--prior {folder}: {names} are not of one survey: survey again")


def _check(folder: Path, document: dict[str, Any], parameters: Parameters) -> None:
    """Refuse a survey whose safe ground may be unsafe for this vehicle."""
    theirs = document.get("parameters", {})
    for name, larger in (("footprint_m", True), ("relief_m", False), ("safe_slope_deg", False)):
        own, surveyed = float(getattr(parameters, name)), float(theirs.get(name, math.nan))
        fits = surveyed >= own if larger else surveyed <= own
        if not fits:
            least = "at least" if larger else "at most"
            raise UsageError(
                f"--prior {folder}: it was surveyed with {name}={surveyed:g}, this vehicle needs {least}"
                f" {own:g}: survey again with --set {name}={own:g}"
            )
    for name in GEAR if parameters.gear != "none" else ():
        own_gear = getattr(parameters, name)
        surveyed_gear = theirs.get(name, own_gear)  # a survey older than the gear knows none
        if surveyed_gear != own_gear:
            raise UsageError(
                f"--prior {folder}: it was surveyed with {name}={surveyed_gear}, this vehicle has {own_gear}:"
                f" survey again with --set {name}={own_gear}"
            )
