"""GeoTIFF of one band in a transverse Mercator projection (TIFF 6.0, OGC GeoTIFF 1.1)."""

from __future__ import annotations

import struct
import zlib
from collections.abc import Mapping
from pathlib import Path
from typing import Any
from xml.sax.saxutils import escape, quoteattr

import numpy as np
from numpy.typing import NDArray

ASCII, SHORT, LONG, DOUBLE = 2, 3, 4, 12  # types of TIFF fields
FORMAT = {SHORT: "H", LONG: "I", DOUBLE: "d"}
ROWS = 64  # of a strip
DEFLATE, WHOLE, FLOAT = 8, 1, 3  # values of the tags Compression and SampleFormat
PROJECTED, PIXEL_IS_AREA, USER_DEFINED, TRANSVERSE_MERCATOR = 1, 1, 32767, 1  # values of GeoKeys
WGS_84, METRE = 4326, 9001


def write_geotiff(
    path: Path,
    values: NDArray[np.uint8] | NDArray[np.float32],
    corner_m: tuple[float, float],
    cell_m: float,
    origin_deg: tuple[float, float],
    tags: Mapping[str, str],
    nodata: float | None = None,
) -> None:
    """Write a raster, deflated.

    Parameters
    ----------
    values
        (rows, columns), the northernmost row first.
    corner_m
        Easting and northing of the north-west corner from the origin.
    origin_deg
        Latitude and longitude of the projection's origin, WGS-84; its scale is 1.
    tags
        Metadata, as GDAL stores them.
    nodata
        Value of cells without data.
    """
    little = np.ascontiguousarray(values, values.dtype.newbyteorder("<"))
    rows, columns = values.shape
    strips = [zlib.compress(little[row : row + ROWS].tobytes()) for row in range(0, rows, ROWS)]
    starts = [8 + sum(map(len, strips[:k])) for k in range(len(strips))]
    keys, doubles = _geokeys(origin_deg)
    items = "".join(f"<Item name={quoteattr(k)}>{escape(v)}</Item>" for k, v in tags.items())
    fields: dict[int, tuple[int, Any]] = {
        256: (LONG, [columns]),
        257: (LONG, [rows]),
        258: (SHORT, [8 * values.dtype.itemsize]),
        259: (SHORT, [DEFLATE]),
        262: (SHORT, [1]),  # black is zero
        273: (LONG, starts),
        277: (SHORT, [1]),
        278: (LONG, [ROWS]),
        279: (LONG, [len(strip) for strip in strips]),
        339: (SHORT, [FLOAT if values.dtype.kind == "f" else WHOLE]),
        33550: (DOUBLE, [cell_m, cell_m, 0.0]),  # ModelPixelScale
        33922: (DOUBLE, [0.0, 0.0, 0.0, *corner_m, 0.0]),  # ModelTiepoint
        34735: (SHORT, keys),
        34736: (DOUBLE, doubles),
        42112: (ASCII, f"<GDALMetadata>{items}</GDALMetadata>"),
    }
    if nodata is not None:
        fields[42113] = (ASCII, str(nodata))
    data = b"".join(strips)
    data += b"\0" * (len(data) % 2)  # directories begin at even offsets
    path.write_bytes(
        struct.pack("<2sHI", b"II", 42, 8 + len(data)) + data + _directory(fields, 8 + len(data))
    )


def _geokeys(origin_deg: tuple[float, float]) -> tuple[list[int], list[float]]:
    """Return the GeoKey directory of the projection, and the doubles that it refers to."""
    latitude, longitude = origin_deg
    doubles = {
        3080: longitude,
        3081: latitude,
        3082: 0.0,
        3083: 0.0,
        3092: 1.0,
    }  # origin, false origin, scale
    shorts = {
        1024: PROJECTED,
        1025: PIXEL_IS_AREA,
        2048: WGS_84,
        3072: USER_DEFINED,
        3074: USER_DEFINED,
        3075: TRANSVERSE_MERCATOR,
        3076: METRE,
    }
    entries = {key: (0, 1, value) for key, value in shorts.items()}
    entries |= {key: (34736, 1, place) for place, key in enumerate(doubles)}
    flat = [number for key in sorted(entries) for number in (key, *entries[key])]
    return [1, 1, 1, len(entries), *flat], list(doubles.values())


def _directory(fields: Mapping[int, tuple[int, Any]], at: int) -> bytes:
    """Return an image file directory that begins at an offset, and after it the values that it refers to."""
    head, more = struct.pack("<H", len(fields)), b""
    behind = at + 2 + 12 * len(fields) + 4
    for tag in sorted(fields):
        kind, value = fields[tag]
        if kind == ASCII:
            packed = str(value).encode() + b"\0"
            count = len(packed)
        else:
            count, packed = len(value), struct.pack(f"<{len(value)}{FORMAT[kind]}", *value)
        if len(packed) > 4:
            place = struct.pack("<I", behind + len(more))
            more += packed + b"\0" * (len(packed) % 2)
        else:
            place = packed.ljust(4, b"\0")
        head += struct.pack("<HHI", tag, kind, count) + place
    return head + b"\0\0\0\0" + more
