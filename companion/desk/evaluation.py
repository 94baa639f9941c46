"""Evaluation of a simulated flight against the simulator's truth files."""

from __future__ import annotations

import json
import struct
import zlib
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from companion.runtime.errors import CompanionError
from params import Parameters
from slz import SAFE, UNKNOWN, Box, Grid, LocalFrame, TerrainMaps, Zone, zone_mask
from slz.zones.detection import search_components, side_in_cells

WIDTH, HEIGHT, BITS, COMPRESSION, STARTS, SIZES = 256, 257, 258, 259, 273, 279
SCALE, CORNER = 33550, 33922  # ModelPixelScale, ModelTiepoint
FORMAT = {3: "H", 4: "I", 12: "d"}  # TIFF's types SHORT, LONG and DOUBLE
PLAIN, DEFLATE = 1, 8

UNSAFE_GROUND = "touched unsafe ground"


class TruthRaster(NamedTuple):
    """Cells (rows, columns), the northernmost row first; north-west corner and side of a cell."""

    values: NDArray[np.uint8]
    west_m: float
    north_m: float
    cell_m: float


@dataclass(frozen=True, slots=True)
class Truth:
    """Ground truth of the simulator: 1 where the footprint is safe; rows from north to south."""

    safe: NDArray[np.uint8]
    west_m: float
    north_m: float
    cell_m: float
    frame: LocalFrame
    flight: dict[str, Any]

    def at(self, east_m: NDArray[np.float64], north_m: NDArray[np.float64]) -> NDArray[np.uint8]:
        """Return 1 safe, 0 unsafe at points of the truth's own frame; points outside the world are unsafe."""
        col = np.floor((east_m - self.west_m) / self.cell_m).astype(np.int64)
        row = np.floor((self.north_m - north_m) / self.cell_m).astype(np.int64)
        inside = (row >= 0) & (col >= 0) & (row < self.safe.shape[0]) & (col < self.safe.shape[1])
        value = self.safe[row.clip(0, self.safe.shape[0] - 1), col.clip(0, self.safe.shape[1] - 1)]
        return np.where(inside, value, 0).astype(np.uint8)


def read_truth(folder: Path) -> Truth:
    """Read truth.tif, scene.json and flight.json of a simulated flight."""
    try:
        scene = json.loads((folder / "scene.json").read_text("utf-8"))
        flight = json.loads((folder / "flight.json").read_text("utf-8"))
        raster = read_raster(folder / "truth.tif")
    except (OSError, ValueError) as error:
        raise CompanionError(f"the simulator left no truth in {folder}: {error}") from None
    lat, lon, alt = _origin(scene)
    return Truth(*raster, LocalFrame(lat, lon, alt), flight)


def _origin(scene: dict[str, Any]) -> tuple[float, float, float]:
    origin = scene["origin"]
    if isinstance(origin, dict):
        values = list(origin.values())
        return float(values[0]), float(values[1]), float(values[2])
    return float(origin[0]), float(origin[1]), float(origin[2])


def touchdown(truth: Truth, chosen_lla: NDArray[np.float64] | None) -> dict[str, Any]:
    """Return landing, distance to the chosen point (m) and safety of the touchdown, by name.

    A touchdown is safe on safe ground that carries the gear. `touchdown_fault`: reason against it.
    `touchdown_tilt_deg`: tilt of the gear at rest.
    """
    contact = truth.flight.get("touchdown")
    if not contact:
        return {
            "landed": False,
            "touchdown_error_m": None,
            "touchdown_tilt_deg": None,
            "touchdown_safe": False,
            "touchdown_fault": "",
        }
    here = np.array([float(contact["e"]), float(contact["n"])])
    error = None
    if chosen_lla is not None:
        error = float(np.hypot(*(truth.frame.enu_m(*chosen_lla)[:2] - here)))
    footing = contact.get("footing", {"tilt_deg": None, "fault": ""})
    ground = "" if truth.at(here[:1], here[1:])[0] else UNSAFE_GROUND
    fault = "; ".join(reason for reason in (ground, footing["fault"]) if reason)
    return {
        "landed": True,
        "touchdown_error_m": error,
        "touchdown_tilt_deg": footing["tilt_deg"],
        "touchdown_safe": not fault,
        "touchdown_fault": fault,
    }


def area_error(
    truth: Truth, maps: TerrainMaps, zones: tuple[Zone, ...], parameters: Parameters
) -> dict[str, float | None]:
    """Return the area error, SLZ paper, Eq. (20), over seen ground, and the error rates of safe cells.

    Computed area: the cells of the zones. Ground truth: the truly safe cells among those seen that belong
    to a patch with room to land by the rule for zones. unsafe_as_safe: truly unsafe cells classified as
    safe, as a share of all seen cells. recall: cells classified as safe, as a share of the truly safe cells
    that were seen.
    """
    box = maps.box
    rows, cols = np.mgrid[box.row0 : box.row1, box.col0 : box.col1]
    east, north = (
        maps.grid.west_m + (cols + 0.5) * maps.grid.cell_m,
        maps.grid.south_m + (rows + 0.5) * maps.grid.cell_m,
    )
    there = truth.frame.enu_m(*np.moveaxis(maps.frame.lla(np.stack([east, north, 0 * east], -1)), -1, 0))
    safe = truth.at(there[..., 0], there[..., 1])
    seen = maps.state != UNKNOWN
    computed = zone_mask(zones, box)
    real = room_to_land((safe == 1) & seen, maps.grid, parameters)
    called = maps.state == SAFE
    n_seen = max(1.0, float(seen.sum()))
    return {
        "area_error": relative_area_error(
            float(computed.sum()), float(real.sum()), float((computed & real).sum())
        ),
        "unsafe_as_safe": float((called & (safe == 0)).sum()) / n_seen,
        "recall": float((called & (safe == 1)).sum()) / max(1.0, float((seen & (safe == 1)).sum())),
    }


def relative_area_error(computed: float, truth: float, common: float) -> float | None:
    """Return SLZ paper, Eq. (20) from three areas; None where one of the first two is zero."""
    if not (computed and truth):
        return None
    return (computed - common) / computed + (truth - common) / truth


def room_to_land(safe: NDArray[np.bool_], grid: Grid, parameters: Parameters) -> NDArray[np.bool_]:
    """Return the safe cells of patches that hold the smallest allowed safe square, as zones must."""
    out = np.zeros(safe.shape, bool)
    least = side_in_cells(parameters.min_square_m, grid)
    for patch in search_components(safe.astype(np.uint8), Box(0, safe.shape[0], 0, safe.shape[1]), least, 1):
        out[patch.box.slices] |= patch.component == 1
    return out


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
