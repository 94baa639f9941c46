"""Flash LiDAR section: the source's table and figures beside results of slz.

Flash paper, Table 1 and Figures 5, 7 and 8.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from companion.desk.reproduce.reproduction_page import Section, Table
from companion.desk.reproduce.waveform_table import Cell, Level, levels
from slz.flash.camera import FlashCamera, FlashFrame
from slz.flash.elevation import ElevationMap, elevation_map, grid_around, histogram_peaks, relative_elevation
from slz.flash.frame_processing import FlashImage, map_points, process_frame, sensor_points
from slz.flash.hazard_detection import Hazard, find_hazards
from slz.flash.segmentation import segment
from slz.grid import Grid

F64 = NDArray[np.float64]
CELL_M = 0.1
PLOT_M = 23.5
SOMETHING_M = 0.2

RANGING = (
    "Size of the range error of a Gaussian pulse of 10 ns FWHM sampled every 2.4 ns, mean / standard "
    "deviation, cm. The bound is what the best unbiased estimator of one waveform can reach (Cramér-Rao); "
    "from 10 % of noise on it lies above what the source prints for its polynomial, so the source's "
    "figures cannot be those of single waveforms with this pulse. After the 9-point median that the "
    "source applies next, every cell is below the source's."
)
HAZARDS = (
    "Borrow pit from 250 m of slant range, 81 frames of 128 x 128, cells of 0.1 m: what stands out of the "
    "floor or lies below it, and what was reported where less than 0.2 m is."
)
BOXES = "One frame from 250 m: peaks of the histogram of elevations, and the boxes by the segmentation."


def section(data: dict[str, Any], out: Path) -> Section:
    """Process the recorded frames and return tables, pictures and figures."""
    out.mkdir(parents=True, exist_ok=True)
    table = levels()
    camera = FlashCamera()
    images = [_image(data, k, camera) for k in range(len(data["samples"]))]
    heights, grid = _map([images[0]], data, camera)
    above = heights.height_m - np.nanmedian(heights.height_m)
    boxes = {xi: [h for h in find_hazards(above, grid, xi=xi) if h.area_m2 > 4] for xi in (6.0, 2.0)}
    peaks = histogram_peaks(above)
    mosaic, wide = _map(images[1:], data, camera, first=1)
    dem = relative_elevation(mosaic)
    found = find_hazards(dem, wide)
    score = _score(data, found)
    from companion.desk.reproduce import flash_pictures

    files = [
        flash_pictures.images(out / "images.png", images[0]),
        flash_pictures.dem(out / "dem.png", above, grid, peaks),
        flash_pictures.segments(out / "segments.png", {xi: segment(above, xi).mean_m for xi in (6.0, 2.0)}),
        flash_pictures.hazards(out / "hazards.png", dem, wide, found),
    ]
    figures = {
        "flash": {
            "table_1_cm": {f"{100 * one.share:g}": _figures(one) for one in table},
            "peaks_m": peaks.round(3).tolist(),
            "boxes_m": {f"{xi:g}": [round(h.height_m, 3) for h in hs] for xi, hs in boxes.items()},
            "hazards": score,
        }
    }
    tables = [_ranging_table(table), _box_table(peaks, boxes), _hazard_table(score)]
    return Section(tables, [("Flash LiDAR over the borrow pit", files)], figures)


def _image(data: dict[str, Any], k: int, camera: FlashCamera) -> FlashImage:
    return process_frame(FlashFrame(data["samples"][k], data["counter"][k]), camera)


def _map(
    images: list[FlashImage], data: dict[str, Any], camera: FlashCamera, first: int = 0
) -> tuple[ElevationMap, Grid]:
    places = data["position_m"][first:]
    points = np.concatenate(
        [
            map_points(sensor_points(image, camera)[0], place, data["rotation"])
            for image, place in zip(images, places, strict=False)
        ]
    )
    grid = grid_around(points, CELL_M)
    return elevation_map(points, grid), grid


def _score(data: dict[str, Any], found: tuple[Hazard, ...]) -> dict[str, Any]:
    """Compare hazards with the truth: rocks, domes and boxes from the list, craters from exact heights."""
    from scipy import ndimage

    top = data["truth_m"].astype(np.float64)
    side = len(top) * CELL_M / 2
    grid = Grid(-side, -side, CELL_M, *top.shape)
    truth = relative_elevation(ElevationMap(grid, top, np.ones(top.shape, np.int32)))
    standing = [(x, y, h) for x, y, h in data["standing"].tolist()]
    marked, _ = ndimage.label(truth < -0.15)
    for k, box in enumerate(ndimage.find_objects(marked), start=1):
        row, col = np.nonzero(marked[box] == k)
        x, y = (-side + (box[i].start + c.mean()) * CELL_M for i, c in ((1, col), (0, row)))
        standing.append((x, y, float(-truth[box][marked[box] == k].min())))
    standing = [s for s in standing if max(abs(s[0]), abs(s[1])) < PLOT_M]
    hit = [(h, any(_holds(hazard, x, y) for hazard in found)) for x, y, h in standing]
    inside = [h for h in found if max(abs(h.east_m), abs(h.north_m)) < PLOT_M]
    false = [h for h in inside if not _is_something(h, truth, side)]
    counts = {
        f"{least:g}": [sum(seen for h, seen in hit if h >= least), sum(h >= least for h, _ in hit)]
        for least in (0.5, 0.3)
    }
    return {"found_of": counts, "false": len(false), "area_m2": (2 * PLOT_M) ** 2}


def _holds(hazard: Hazard, x: float, y: float) -> bool:
    west, south, east, north = hazard.extent_m
    return west - CELL_M <= x <= east + CELL_M and south - CELL_M <= y <= north + CELL_M


def _is_something(hazard: Hazard, truth: F64, side: float) -> bool:
    low = [max(0, int((edge - 0.2 + side) / CELL_M)) for edge in hazard.extent_m[:2]]
    high = [int((edge + 0.2 + side) / CELL_M) + 1 for edge in hazard.extent_m[2:]]
    part = np.abs(truth[low[1] : high[1], low[0] : high[0]])
    return bool(part.size and np.nanmax(part) >= SOMETHING_M)


def _figures(one: Level) -> dict[str, list[float]]:
    cells = {
        "source": one.source,
        "polynomial": one.waveform[0],
        "likely": one.waveform[1],
        "bound": one.bound,
        "polynomial_image": one.image[0],
        "likely_image": one.image[1],
        "pooled_bound": one.pooled,
    }
    return {name: [round(v, 2) for v in cell] for name, cell in cells.items()}


def _text(cell: Cell) -> str:
    return f"{cell[0]:.1f} / {cell[1]:.1f}"


def _ranging_table(found: list[Level]) -> Table:
    columns = (
        *(
            "noise",
            "source",
            "polynomial, one waveform",
            "likeliest pulse, one waveform",
            "bound, one waveform",
        ),
        *("polynomial, image", "likeliest pulse, image", "bound of nine waveforms"),
    )
    rows = [
        (
            f"{100 * one.share:.0f} %",
            *(_text(cell) for cell in (one.source, *one.waveform, one.bound, *one.image, one.pooled)),
        )
        for one in found
    ]
    return Table("Flash Table 1: range error by noise", RANGING, columns, rows)


def _box_table(peaks: F64, boxes: dict[float, list[Hazard]]) -> Table:
    rows: list[tuple[str, ...]] = [("peaks of the histogram, m", ", ".join(f"{p:.2f}" for p in peaks))]
    for xi, hazards in boxes.items():
        heights = ", ".join(f"{h.height_m:.2f}" for h in hazards)
        rows.append((f"boxes found at xi = {xi:g}, m", heights))
    return Table("Flash Fig. 7 and 8: boxes of 1 m and 2 m", BOXES, ("what", "found"), rows)


def _hazard_table(score: dict[str, Any]) -> Table:
    rows: list[tuple[str, ...]] = [
        (f"{least} m and more", f"{seen} of {there}") for least, (seen, there) in score["found_of"].items()
    ]
    rows.append(("false alarms", f"{score['false']} on {score['area_m2']:.0f} m²"))
    return Table("Flash: hazards", HAZARDS, ("what", "found"), rows)
