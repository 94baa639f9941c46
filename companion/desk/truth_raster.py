"""Reader of the simulator's truth raster: a GeoTIFF of one byte a cell, in strips."""

from __future__ import annotations

import struct
import zlib
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

WIDTH, HEIGHT, BITS, COMPRESSION, STARTS, SIZES = 256, 257, 258, 259, 273, 279
SCALE, CORNER = 33550, 33922  # ModelPixelScale, ModelTiepoint
FORMAT = {3: "H", 4: "I", 12: "d"}  # TIFF's types SHORT, LONG and DOUBLE
PLAIN, DEFLATE = 1, 8


class TruthRaster(NamedTuple):
    """Cells (rows, columns), the northernmost row first; north-west corner and side of a cell."""

    values: NDArray[np.uint8]
    west_m: float
    north_m: float
    cell_m: float


def read_raster(path: Path) -> TruthRaster:
    """Read a raster of bytes, plain or deflated.

    Raises
    ------
    OSError
        The file cannot be read.
    ValueError
        It is no such raster.
    """
    data = path.read_bytes()
    try:
        fields = _fields(data)
        if (fields[BITS], *fields[COMPRESSION]) not in (((8,), PLAIN), ((8,), DEFLATE)):
            raise ValueError(f"{path.name} does not hold bytes, plain or deflated")
        strips = [data[int(a) : int(a) + int(n)] for a, n in zip(fields[STARTS], fields[SIZES], strict=True)]
        if fields[COMPRESSION] == (DEFLATE,):
            strips = [zlib.decompress(strip) for strip in strips]
        shape = int(fields[HEIGHT][0]), int(fields[WIDTH][0])
        cells = np.frombuffer(b"".join(strips), np.uint8).reshape(shape)
        column, row, _, east, north, _ = fields[CORNER]
        cell_m = fields[SCALE][0]
    except (KeyError, struct.error, zlib.error) as error:
        raise ValueError(f"{path.name} is no raster: {error}") from None
    return TruthRaster(cells, east - column * cell_m, north + row * cell_m, cell_m)


def _fields(data: bytes) -> dict[int, tuple[float, ...]]:
    """Return the numbers of every tag of the first image."""
    order, magic, at = struct.unpack_from("<2sHI", data)
    if (order, magic) != (b"II", 42):
        raise ValueError("no little-endian TIFF")
    (count,) = struct.unpack_from("<H", data, at)
    fields = {}
    for entry in range(at + 2, at + 2 + 12 * count, 12):
        tag, kind, length = struct.unpack_from("<HHI", data, entry)
        if kind in FORMAT:
            form = f"<{length}{FORMAT[kind]}"
            place = entry + 8 if struct.calcsize(form) <= 4 else struct.unpack_from("<I", data, entry + 8)[0]
            fields[tag] = struct.unpack_from(form, data, place)
    return fields
