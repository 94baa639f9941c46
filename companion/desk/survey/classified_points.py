"""Classified point cloud: the survey's points with the class of the ground they fell on, LAZ 1.4.

ASPRS LAS 1.4 reserves classes 64 to 255 for the user. Only point formats 6 to 10 have them, so points of
older formats are written in the equivalent newer one. The input's class is kept in the dimension
`source_class`.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import laspy
import numpy as np
from numpy.typing import NDArray

from companion.desk.clouds.cloud import open_source
from companion.desk.clouds.cloud_source import Source, translated
from companion.desk.clouds.las import LasSource, coordinates, pieces
from companion.desk.survey.findings import Maps
from companion.desk.survey.local_metres import Metric
from slz import SAFE, UNSAFE, Box

SAFE_CLASS, UNSAFE_CLASS, UNKNOWN_CLASS = 64, 65, 66
NEWER = {0: 6, 1: 6, 2: 7, 3: 7, 4: 9, 5: 10}  # the point format of LAS 1.4 that replaces each older one
SOURCE_CLASS = "source_class"
# Records that are not copied: CRS, extra bytes and LAZ are rewritten, and the COPC index would be invalid.
MADE = frozenset({2111, 2112, 34735, 34736, 34737, 4, 22204, 1})
SCALE_M, SCALE_DEG = 1e-3, 1e-9  # of points that had no scale
SCAN_ANGLE = 0.006  # degrees, unit of formats 6 to 10
SUFFIX = ".laz"
SQUARE = 1024  # cells read at a time


def write_classified(folder: Path, files: Sequence[Path], maps: Maps, metric: Metric) -> list[Path]:
    """Write classified.laz, or classified-1-NAME.laz and so on for several files; return their paths.

    LAS input keeps its coordinates, scales and all dimensions; other input gets scales of a millimetre
    (1e-9 degrees). All points of a file are written, including those that the survey left out.
    """
    written = []
    for k, path in enumerate(files, start=1):
        name = "classified" if len(files) == 1 else f"classified-{k}-{path.stem}"
        written.append(folder / f"{name}{SUFFIX}")
        source = open_source(path, metric.reference)
        with translated(path):
            if isinstance(source, LasSource):
                _of_las(written[-1], source, maps, metric)
            else:
                _of_others(written[-1], source, maps, metric)
    return written


def classes(points: NDArray[np.float64], maps: Maps, metric: Metric) -> NDArray[np.uint8]:
    """Return the classes (n,) of points (n, 3) of the CRS, from the cells they fall on."""
    local, grid = metric.local(points), maps.grid
    row, col = (
        np.floor((local[:, axis] - edge) / grid.cell_m)
        for axis, edge in ((1, grid.south_m), (0, grid.west_m))
    )
    inside = (row >= 0) & (row < grid.rows) & (col >= 0) & (col < grid.cols)  # NaN compares false
    found = np.full(len(points), UNKNOWN_CLASS, np.uint8)
    state = _state_at(row[inside].astype(np.int64), col[inside].astype(np.int64), maps)
    found[inside] = np.select([state == SAFE, state == UNSAFE], [SAFE_CLASS, UNSAFE_CLASS], UNKNOWN_CLASS)
    return found


def _state_at(row: NDArray[np.int64], col: NDArray[np.int64], maps: Maps) -> NDArray[np.uint8]:
    """Return the states of cells (n,), reading only the squares of the map that hold any of them."""
    out = np.empty(len(row), np.uint8)
    if not len(row):
        return out
    across = maps.grid.cols // SQUARE + 1
    square = row // SQUARE * across + col // SQUARE
    order = np.argsort(square, kind="stable")
    for part in np.split(order, np.flatnonzero(np.diff(square[order])) + 1):
        row0, col0 = row[part[0]] // SQUARE * SQUARE, col[part[0]] // SQUARE * SQUARE
        box = Box(int(row0), int(row0) + SQUARE, int(col0), int(col0) + SQUARE)
        box = box.grown(0, maps.grid)
        out[part] = maps.read("state", box)[row[part] - row0, col[part] - col0]
    return out


def _of_las(out: Path, source: LasSource, maps: Maps, metric: Metric) -> None:
    with laspy.open(source.path, encoding_errors="replace") as reader:
        old = reader.header
    header = _header(NEWER.get(old.point_format.id, old.point_format.id), old.scales, old.offsets, metric)
    header.global_encoding.gps_time_type = old.global_encoding.gps_time_type
    extra = [d for d in old.point_format.extra_dimensions if d.name != SOURCE_CLASS]
    # laspy has the no-data value in the record, but not in the dimension.
    records = [one for vlr in old.vlrs.get("ExtraBytesVlr") for one in vlr.extra_bytes_structs]
    no_data = {one.format_name(): one.no_data for one in records}
    header.add_extra_dims(
        [
            laspy.ExtraBytesParams(d.name, d.dtype, d.description, d.offsets, d.scales, no_data.get(d.name))
            for d in extra
        ]
    )
    header.vlrs.extend(vlr for vlr in old.vlrs if vlr.record_id not in MADE)
    with laspy.open(out, "w", header=header) as writer:
        for piece in pieces(source.path, source.n_points):
            writer.write_points(_copied(piece, header, classes(coordinates(piece), maps, metric)))


def _copied(piece: Any, header: Any, found: NDArray[np.uint8]) -> Any:
    """Return a laspy point record with all dimensions of the input and the new classes."""
    new = laspy.ScaleAwarePointRecord.zeros(len(piece), header=header)
    ours, extra = set(new.point_format.dimension_names), set(new.point_format.extra_dimension_names)
    for name in piece.point_format.dimension_names:
        if name in extra:  # the raw integers, since scaling and unscaling would round
            new.array[name] = piece.array[name]
        elif name in ours:
            new[name] = piece[name]
        else:  # scan_angle_rank, the only dimension that was renamed
            new["scan_angle"] = np.round(np.asarray(piece[name], np.float64) / SCAN_ANGLE).astype(np.int16)
    new[SOURCE_CLASS] = piece.classification
    new.classification = found
    return new


def _of_others(out: Path, source: Source, maps: Maps, metric: Metric) -> None:
    scale = SCALE_DEG if source.reference.unit_m is None else SCALE_M / source.reference.unit_m
    scales = np.array([scale, scale, SCALE_M / source.reference.vertical_m])
    header = _header(6, scales, np.array(metric.origin), metric)
    with laspy.open(out, "w", header=header) as writer:
        for points in _representable(source, header):
            new = laspy.ScaleAwarePointRecord.zeros(len(points), header=header)
            new.x, new.y, new.z = points.T
            new.classification = classes(points, maps, metric)
            writer.write_points(new)


def _representable(source: Source, header: Any) -> Iterator[NDArray[np.float64]]:
    """Yield points, without those too far from the offsets for the format's 32-bit integers."""
    most = np.iinfo(np.int32).max * np.asarray(header.scales)
    for chunk in source.chunks():
        yield chunk.points[(np.abs(chunk.points - header.offsets) < most).all(axis=1)]


def _header(form: int, scales: Any, offsets: Any, metric: Metric) -> Any:
    header = laspy.LasHeader(point_format=form, version="1.4")
    header.scales, header.offsets = np.array(scales), np.array(offsets)
    header.add_crs(metric.reference.crs)
    header.add_extra_dim(laspy.ExtraBytesParams(SOURCE_CLASS, np.uint8, "class in the input"))
    header.generating_software = "slz"
    return header
