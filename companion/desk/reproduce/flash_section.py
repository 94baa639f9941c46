"""Flash LiDAR section: the source's table and figures beside results of slz.

Flash paper, Table 1 and Figures 5, 7 and 8.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from companion.desk.reproduce.reproduction_page import Section, Table
from slz.flash.camera import FlashCamera, FlashFrame
from slz.flash.elevation import ElevationMap, elevation_map, grid_around, histogram_peaks, relative_elevation
from slz.flash.frame_processing import FlashImage, map_points, process_frame, sensor_points
from slz.flash.hazard_detection import Hazard, find_hazards
from slz.flash.ranging import range_bound_m
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
DPI = 110
LEVELS = (0.05, 0.1, 0.2, 0.3)
SOURCE_CM = ((2.2, 1.5), (3.3, 2.6), (6.9, 4.8), (9.9, 8.1))
COUNTS = 1500.0
LAST = 700
MEAN_OF_NORMAL, STD_OF_NORMAL = (2 / np.pi) ** 0.5, (1 - 2 / np.pi) ** 0.5

Cell = tuple[float, float]
"""Mean and standard deviation of the absolute error, cm."""


@dataclass(frozen=True, slots=True)
class Level:
    """Errors at one level of noise, cm: the source's, and those of slz.

    waveform: pixel by pixel, polynomial and likelihood. image: after the 9-point median. bound: an unbiased
    estimator at the Cramér-Rao bound of one waveform. pooled: of nine waveforms together.
    """

    share: float
    source: Cell
    waveform: tuple[Cell, Cell]
    image: tuple[Cell, Cell]
    bound: Cell
    pooled: Cell


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
    files = [
        _draw_images(out / "images.png", images[0]),
        _draw_dem(out / "dem.png", above, grid, peaks),
        _draw_segments(out / "segments.png", {xi: segment(above, xi).mean_m for xi in (6.0, 2.0)}),
        _draw_hazards(out / "hazards.png", dem, wide, found),
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


def _draw_images(file: Path, image: FlashImage) -> Path:
    """Draw intensity and range (Flash paper, Figure 5)."""
    figure = Figure((11, 4.6), layout="constrained")
    for axes, values, title, bar in (
        (figure.add_subplot(1, 2, 1), image.measured.intensity, "intensity", "counts"),
        (figure.add_subplot(1, 2, 2), image.filtered_m, "range, 9-point median", "m"),
    ):
        shown = axes.imshow(values, cmap="viridis")
        figure.colorbar(shown, ax=axes, label=bar)
        axes.set(title=title, xlabel="column", ylabel="row")
    figure.savefig(file, dpi=DPI)
    return file


def _draw_dem(file: Path, heights_m: F64, grid: Grid, peaks_m: F64) -> Path:
    """Draw the DEM and its histogram (Flash paper, Figure 7)."""
    figure = Figure((11, 4.6), layout="constrained")
    axes = figure.add_subplot(1, 2, 1)
    shown = axes.imshow(heights_m, origin="lower", extent=_extent(grid), cmap="viridis")
    figure.colorbar(shown, ax=axes, label="elevation, m")
    axes.set(title="DEM, cells of 0.1 m; white: not seen", xlabel="east, m", ylabel="north, m")
    axes = figure.add_subplot(1, 2, 2)
    axes.hist(
        heights_m[np.isfinite(heights_m)], np.arange(-0.8, 2.6, 0.05).tolist(), log=True, color="#35608d"
    )
    for peak in peaks_m:
        axes.axvline(peak, color="#c0392b", linewidth=0.8)
    axes.set(title="histogram of elevations", xlabel="m", ylabel="cells")
    figure.savefig(file, dpi=DPI)
    return file


def _draw_segments(file: Path, maps: dict[float, F64]) -> Path:
    """Draw classified maps by xi (Flash paper, Figure 8)."""
    figure = Figure((11, 4.8), layout="constrained")
    for k, (xi, mean_m) in enumerate(maps.items(), start=1):
        axes = figure.add_subplot(1, len(maps), k)
        shown = axes.imshow(mean_m, origin="lower", cmap="viridis", vmin=-0.2, vmax=2.1)
        figure.colorbar(shown, ax=axes, label="mean of the segment, m")
        axes.set(title=f"segments, xi = {xi:g}", xlabel="cell", ylabel="cell")
    figure.savefig(file, dpi=DPI)
    return file


def _draw_hazards(file: Path, dem_m: F64, grid: Grid, found: tuple[Hazard, ...]) -> Path:
    """Draw the DEM of the whole pit with the reported hazards."""
    figure = Figure((8.5, 7.5), layout="constrained")
    axes = figure.add_subplot(1, 1, 1)
    shown = axes.imshow(dem_m, origin="lower", extent=_extent(grid), cmap="RdBu_r", vmin=-1, vmax=1)
    figure.colorbar(shown, ax=axes, label="height over the ground around, m")
    for hazard in found:
        west, south, east, north = hazard.extent_m
        axes.plot([west, east, east, west, west], [south, south, north, north, south], "k", linewidth=0.7)
    axes.set(
        title=f"{len(found)} hazards", xlabel="east, m", ylabel="north, m", xlim=(-27, 27), ylim=(-27, 27)
    )
    figure.savefig(file, dpi=DPI)
    return file


def _extent(grid: Grid) -> tuple[float, float, float, float]:
    east, north = grid.west_m + grid.cols * grid.cell_m, grid.south_m + grid.rows * grid.cell_m
    return grid.west_m, east, grid.south_m, north


def levels(seed: int = 1) -> list[Level]:
    """Return the errors over a frame of 128 x 128 waveforms for each level of the source."""
    return [_level(share, source, seed) for share, source in zip(LEVELS, SOURCE_CM, strict=True)]


def _level(share: float, source: Cell, seed: int) -> Level:
    """Measure a plane tilted by one sample across the image, so that pulses have every phase of the clock."""
    camera = FlashCamera(baseline_counts=8000.0, noise_counts=share * COUNTS, saturated_counts=60_000)
    middle = (camera.n_samples - 2) / 2
    peak = np.broadcast_to(middle + np.linspace(-0.5, 0.5, camera.cols), (camera.rows, camera.cols))
    frame, true_m = _frame(camera, peak, share, seed)
    waveform, image = [], []
    for estimator in ("polynomial", "likely"):
        found = process_frame(frame, camera, estimator)
        waveform.append(_cell(found.measured.range_m - true_m))
        image.append(_cell(found.filtered_m - true_m))
    bound = 100 * range_bound_m(camera, share)
    return Level(
        share,
        source,
        (waveform[0], waveform[1]),
        (image[0], image[1]),
        (bound * MEAN_OF_NORMAL, bound * STD_OF_NORMAL),
        (bound / 3 * MEAN_OF_NORMAL, bound / 3 * STD_OF_NORMAL),
    )


def _frame(camera: FlashCamera, peak: F64, share: float, seed: int) -> tuple[FlashFrame, F64]:
    rng = np.random.default_rng(seed)
    n = camera.n_samples
    pulse = np.exp(-0.5 * ((np.arange(n) - peak[..., np.newaxis]) / camera.pulse_sigma_samples) ** 2)
    y = camera.baseline_counts + COUNTS * (pulse + share * rng.standard_normal(pulse.shape))
    y = np.clip(np.rint(y), 20, camera.saturated_counts)
    y[..., -1] = 0
    ring = np.roll(y, 7, axis=2).astype(np.uint16)
    counter = np.full(peak.shape, LAST, np.uint32)
    return FlashFrame(ring, counter), (LAST - (n - 1) + peak) * camera.sample_m


def _cell(error_m: F64) -> Cell:
    size = 100 * np.abs(error_m[np.isfinite(error_m)])
    return float(size.mean()), float(size.std())
