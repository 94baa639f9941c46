"""Safe maps (GeoTIFF) and zones (GeoJSON) of any program, on the grid of a case."""

from __future__ import annotations

import json
import warnings
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import rasterio
import shapely
from numpy.typing import NDArray
from pyproj import CRS, Transformer
from pyproj.exceptions import CRSError, ProjError
from rasterio.enums import ColorInterp
from rasterio.errors import NotGeoreferencedWarning, RasterioError
from rasterio.windows import Window
from shapely.geometry import GeometryCollection, MultiPolygon, Polygon
from shapely.geometry.base import BaseGeometry

from companion.desk.open_benchmark.benchmark_case import BenchmarkCase
from companion.desk.open_benchmark.landing_task import F64, SAFE, UNKNOWN, UNSAFE, SafeMap
from companion.runtime.errors import UsageError

WGS84 = CRS.from_epsg(4326)
SAFE_FROM = 0.5
MOST_CELLS = 100_000_000  # of a file on one scene, 0.8 GB as float64
LEAST_COVER = 0.5
"""Share of the judged cells that a map must cover, so that nothing is scored by what it leaves out."""


def read_safe_map(path: Path, case: BenchmarkCase, safe_from: float | None = None) -> SafeMap:
    """Read a GeoTIFF or GeoJSON by its suffix.

    Parameters
    ----------
    safe_from
        Least probability of a cell that is called safe, for maps of probabilities: above 0, at most 1,
        compared in float32; `SAFE_FROM` if None. Zones have none.

    Raises
    ------
    UsageError
        The file is missing or of no known kind, cannot be read, is empty, has no CRS or one that cannot be
        converted, lies elsewhere, covers too little, or has values that mean nothing; or safe_from is none.
    """
    if safe_from is not None and not 0 < np.float32(safe_from) <= 1:
        raise UsageError(f"--safe-from {safe_from:g}: a probability above 0, at most 1, is needed")
    if not path.is_file():
        raise UsageError(f"{path}: there is no such file")
    if path.stat().st_size == 0:
        raise UsageError(f"{path}: it is empty")
    kind = path.suffix.lower()
    if kind in (".tif", ".tiff"):
        return read_raster(path, case, SAFE_FROM if safe_from is None else safe_from)
    if kind in (".geojson", ".json"):
        if safe_from is not None:
            raise UsageError(f"--safe-from is of maps (.tif): the zones of {path} have no probabilities")
        return read_zones(path, case)
    raise UsageError(f"{path}: a safe map is a GeoTIFF (.tif), zones are GeoJSON (.geojson)")


def read_raster(path: Path, case: BenchmarkCase, safe_from: float) -> SafeMap:
    """Read band 1 of a GeoTIFF at the centres of the case's cells, the nearest cell.

    Whole numbers: 0 unsafe, 1 safe, nodata or 255 unknown. Floating point: probability of safe, NaN or
    nodata unknown. Cells hidden by the file's mask or alpha band are unknown, whatever their value. Only the
    part of the file that covers the case is read.
    """
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", NotGeoreferencedWarning)
        try:
            with rasterio.open(path) as file:
                rows, cols, inside = _covered(path, case, file)
                window = _window(path, file, rows[inside], cols[inside])
                values, unknown = _values(path, file, window)
        except (RasterioError, ValueError) as error:
            raise UsageError(f"{path}: it is no readable GeoTIFF ({_line(error)})") from None
    _check_values(path, values[~unknown])
    at = rows[inside] - window.row_off, cols[inside] - window.col_off
    probability = np.full(case.task.grid.shape, np.nan, np.float32)
    probability[inside] = np.where(unknown[at], np.nan, values[at].astype(np.float32))
    safe = probability >= np.float32(safe_from)
    state = np.where(np.isnan(probability), UNKNOWN, np.where(safe, SAFE, UNSAFE))
    if (state[case.truth.safe != UNKNOWN] == UNKNOWN).all():
        raise UsageError(f"{path}: it is empty, no judged cell has a value")
    fuzzy = values.dtype.kind == "f"
    return SafeMap(state.astype(np.uint8), probability if fuzzy else None)


def _covered(
    path: Path, case: BenchmarkCase, file: rasterio.DatasetReader
) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.bool_]]:
    """Return rows and columns of the file at the case's cells, and which cells are inside it."""
    transform = file.transform
    if file.crs is None or transform.is_identity:
        raise UsageError(f"{path}: it has no CRS or no georeference: write it in that of truth.tif")
    if transform.is_degenerate:
        raise UsageError(f"{path}: its cells have no area: write its georeference as that of truth.tif")
    x, y = _centres(path, case, CRS.from_wkt(file.crs.to_wkt()))
    col, row = (np.floor(v) for v in ~transform @ (x, y))
    inside = (row >= 0) & (col >= 0) & (row < file.height) & (col < file.width)
    _check_cover(path, case, inside)
    whole = [np.where(inside, v, 0).astype(np.int64) for v in (row, col)]
    return whole[0], whole[1], inside


def _window(
    path: Path, file: rasterio.DatasetReader, rows: NDArray[np.int64], cols: NDArray[np.int64]
) -> Window:
    """Return the part of the file that holds cells; refuse one that is too fine to be read."""
    top, left = int(rows.min()), int(cols.min())
    height, width = int(rows.max()) - top + 1, int(cols.max()) - left + 1
    if height * width > MOST_CELLS:
        raise UsageError(f"{path}: it has {height} x {width} cells on the scene: resample it to fewer")
    return Window(left, top, width, height)


def _values(
    path: Path, file: rasterio.DatasetReader, window: Window
) -> tuple[NDArray[Any], NDArray[np.bool_]]:
    """Return the values of band 1 in a window, float64 or whole, and which are unknown."""
    kind = np.dtype(file.dtypes[0]).kind
    if kind not in "uif":
        raise UsageError(f"{path}: its values are of type {file.dtypes[0]}: write whole numbers or floats")
    if (file.scales[0], file.offsets[0]) != (1.0, 0.0):
        raise UsageError(
            f"{path}: its band has scale {file.scales[0]:g} and offset {file.offsets[0]:g}: write the values"
            " themselves, 0 to 1"
        )
    values = file.read(1, window=window)
    values = values.astype(np.float64) if kind == "f" else values
    unknown = _hidden(file, window)
    unknown |= np.isnan(values) if kind == "f" else values == UNKNOWN
    if file.nodata is not None:
        unknown |= values == file.nodata
    return values, unknown


def _hidden(file: rasterio.DatasetReader, window: Window) -> NDArray[np.bool_]:
    """Return the cells of a window that nodata, a mask or an alpha band hides."""
    hidden = (file.read_masks(1, window=window) == 0) | (file.dataset_mask(window=window) == 0)
    for band, meaning in zip(file.indexes, file.colorinterp, strict=True):
        if meaning == ColorInterp.alpha:  # one beside a nodata value is in no mask
            hidden |= file.read(band, window=window) == 0
    return np.asarray(hidden, np.bool_)


def _check_values(path: Path, known: NDArray[Any]) -> None:
    if not known.size:
        raise UsageError(f"{path}: it is empty, all of its cells are nodata or masked")
    low, high = known.min(), known.max()
    if known.dtype.kind == "f":
        if low < 0 or high > 1:
            raise UsageError(f"{path}: its values run from {low:g} to {high:g}: a probability is 0 to 1")
    elif not np.isin(known, (UNSAFE, SAFE)).all():
        raise UsageError(f"{path}: its values run from {low} to {high}: 0 is unsafe, 1 safe, nodata unknown")


def read_zones(path: Path, case: BenchmarkCase) -> SafeMap:
    """Read the polygons of a GeoJSON: cells whose centres are inside one are safe, the others are not.

    Coordinates are longitude and latitude (RFC 7946), unless a member `crs` names another CRS; edges are
    straight in these coordinates. Points and lines are no zones.
    """
    try:
        document = json.loads(path.read_text("utf-8"))
        features = document["features"] if document["type"] == "FeatureCollection" else [document]
        shapes = [f["geometry"] if f.get("type") == "Feature" else f for f in features]
        found = [shapely.from_geojson(json.dumps(shape)) for shape in shapes if shape]
    except (
        OSError,
        UnicodeDecodeError,
        ValueError,
        KeyError,
        TypeError,
        AttributeError,
        RecursionError,
        shapely.errors.ShapelyError,
    ) as error:
        raise UsageError(f"{path}: it is no readable GeoJSON ({_line(error)})") from None
    polygons = [valid for p in _polygons(found) for valid in _polygons([shapely.make_valid(p)])]
    if not polygons:
        raise UsageError(f"{path}: it is empty, it holds no polygon")
    zones = shapely.union_all(polygons)
    shapely.prepare(zones)
    x, y = _centres(path, case, _zones_crs(path, document))
    inside = shapely.contains_xy(zones, x.ravel(), y.ravel()).reshape(x.shape)
    if not (inside & (case.truth.safe != UNKNOWN)).any():
        raise UsageError(f"{path}: {_elsewhere(case)}")
    return SafeMap(np.where(inside, SAFE, UNSAFE).astype(np.uint8))


def _polygons(shapes: Iterable[BaseGeometry]) -> Iterator[BaseGeometry]:
    """Yield the polygons among shapes, and in collections of shapes."""
    for shape in shapes:
        if isinstance(shape, Polygon | MultiPolygon):
            yield shape
        elif isinstance(shape, GeometryCollection):
            yield from _polygons(shape.geoms)


def _zones_crs(path: Path, document: dict[str, Any]) -> CRS:
    named = document.get("crs")
    if not named:
        return WGS84
    try:
        crs = CRS.from_user_input(named["properties"]["name"])
    except (CRSError, KeyError, TypeError) as error:
        raise UsageError(f"{path}: its member crs is unknown ({_line(error)})") from None
    if not (crs.is_geographic or crs.is_projected):
        raise UsageError(f"{path}: its member crs, {crs.name}, has no east and north")
    return crs


def _centres(path: Path, case: BenchmarkCase, crs: CRS) -> tuple[F64, F64]:
    """Return the centres of the case's cells in another CRS; infinite where it has no such place."""
    x, y = case.task.grid.centres()
    if crs.equals(case.crs):
        return x, y
    try:
        transformer = Transformer.from_crs(case.crs, crs, always_xy=True)
    except ProjError as error:
        raise UsageError(f"{path}: its CRS cannot be converted to the scene's ({_line(error)})") from None
    there = transformer.transform(x.ravel(), y.ravel(), errcheck=False)
    return there[0].reshape(x.shape), there[1].reshape(y.shape)


def _check_cover(path: Path, case: BenchmarkCase, inside: NDArray[np.bool_]) -> None:
    judged = case.truth.safe != UNKNOWN
    share = float((inside & judged).sum()) / max(1, int(judged.sum()))
    if share == 0.0:
        raise UsageError(f"{path}: {_elsewhere(case)}")
    if share < LEAST_COVER:
        raise UsageError(
            f"{path}: it covers {100 * share:.0f} % of the judged cells of {case.name}, less than half"
        )


def _elsewhere(case: BenchmarkCase) -> str:
    lat, lon, _ = case.origin
    where = f"it does not overlap scene {case.name} where this is judged, about {lat:.5f}, {lon:.5f}"
    return f"{where}: is it of its CRS?"


def _line(error: BaseException) -> str:
    return " ".join(f"{type(error).__name__}: {error}".split())[:160]
