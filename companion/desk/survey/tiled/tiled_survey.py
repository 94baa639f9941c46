"""Out-of-core survey, step by step: sort, count, derive, join, describe."""

from __future__ import annotations

import math
import shutil
import time
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import chain
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from companion.desk.clouds.cloud import Skipped, open_clouds
from companion.desk.clouds.cloud_source import Source
from companion.desk.survey import geotiff
from companion.desk.survey.cloud_quality import check_steps, coverage_for
from companion.desk.survey.findings import Findings, MapFiles, numbered_by_rank
from companion.desk.survey.local_metres import Metric, wgs84
from companion.desk.survey.overview import ground_png, water_mask
from companion.desk.survey.tiled import array_file, plan
from companion.desk.survey.tiled.cell_sums import per_m2, tally
from companion.desk.survey.tiled.census import Census, count_points, first_guess, metric_of
from companion.desk.survey.tiled.derive_tiles import Ground, draw_tile
from companion.desk.survey.tiled.lattice import UNIT_M, Lattice
from companion.desk.survey.tiled.sort_points import Piece, sort_piece
from companion.desk.survey.tiled.surface_parts import classify_part
from companion.desk.survey.tiled.task_engine import Engine, Progress
from companion.desk.survey.tiled.tile_labels import join_components, label_tile
from companion.desk.survey.tiled.tile_store import Store, TileLayout
from companion.desk.survey.tiled.tiled_zones import batches, describe_zones
from companion.desk.survey.tiled.zone_file import DescribedZone, load
from companion.runtime.errors import UsageError
from params import Parameters
from slz import Box, TerrainMaps
from slz.terrain.derive import reach_of
from slz.terrain.layers import Output, reaching
from slz.zones.detection import side_in_cells
from slz.zones.ranking import rank

SORTED_BYTES = 7.5  # on disk per point
LEAST_SHARES = {
    "sorting": 0.38, "counting": 0.02, "surface": 0.04, "drawing": 0.23, "joining": 0.03,
    "zones": 0.1, "writing": 0.2,
}  # fmt: skip
MOST_CELLS = 4 * 10**12  # an unknown cell takes 0.08 bytes on disk: 320 GB in all
MOST_LINES = 2**31 - 1  # rows or columns of a raster of GDAL
MOST_ZONES = 10**9
MOST_HELD = 40_000_000  # cells of a survey up to which zones keep their cell masks in memory, for pictures
T = TypeVar("T")
R = TypeVar("R")


@dataclass(frozen=True, slots=True)
class Surveyed:
    """Result of a tiled survey. found: the best first, numbered by rank. drawings: in the work folder."""

    layout: TileLayout
    drawings: MapFiles
    metric: Metric
    parameters: Parameters
    density_per_m2: float
    n_read: int
    n_used: int
    dropped: dict[str, int]
    n_safe: int
    n_unsafe: int
    coordinate_spacing: float
    found: list[DescribedZone]
    skipped: list[Skipped]
    stage_ms: dict[str, float]


class TiledSurvey:
    """One survey in a work folder; finished work found there is reused."""

    def __init__(
        self,
        files: Sequence[Path],
        work: Path,
        parameters: Parameters,
        engine: Engine,
        report: Callable[[str, float], None],
        crs: str | None = None,
        tile_m: float | None = None,
        vertical_unit: str | None = None,
        corridors: bool = False,
    ) -> None:
        self._files, self._work, self._crs = files, work, crs
        self._vertical_unit = vertical_unit
        self._corridors = corridors
        self._parameters = parameters
        self._engine = engine
        self._progress = Progress(report)
        self._side = plan.tile_side(tile_m, parameters.cell_m)
        self._bin_m = parameters.outlier_gap_m / 4
        self.stage_ms: dict[str, float] = {}

    def run(self) -> Surveyed:
        """Run the survey.

        Raises
        ------
        UsageError
            A file, their CRS or the work folder cannot be used, or no point is left.
        """
        p = self._parameters
        sources, skipped = open_clouds(self._files, self._crs, self._vertical_unit)
        guess = first_guess(sources, p.cell_m)
        for source in sources:
            check_steps(str(source.path), source.scales, (guess.x_m, guess.y_m, guess.z_m), p)
        self._check_room(sources)
        wanted = plan.manifest(self._files, self._crs, p, guess, self._side, self._vertical_unit)
        if self._corridors:
            wanted["corridors"] = True
        plan.claim(self._work, wanted)
        sorted_, census, metric, broken = self._sorted(sources, guess)
        skipped += broken
        _check_cells(census.box, p.cell_m)
        plan.record_sources(self._work, sorted_)
        layout = TileLayout(self._work / "tiles", self._side, census.box, p.cell_m)
        density, p = self._fitted(layout, sorted_)
        drawn = self._drawn(layout, sorted_, census, metric, p)
        drawings, begun = self._drawings(layout, metric, p)  # workers write them during the next steps
        self._zones(layout, p)
        self._follow("writing", begun, len(drawings.rasters) + 1)
        rows, cols = layout.whole.shape
        small = rows * cols <= MOST_HELD
        found = sorted(
            (
                one if small else _without_cells(one)
                for path in (self._work / "zones").glob("*.zones")
                for one in load(path)
            ),
            key=lambda one: one.first,
        )
        used, lone = drawn["n_used"], drawn["n_outliers"]
        astray = census.n_read - sum(census.dropped.values()) - used - lone
        dropped = Counter(census.dropped) + Counter(stray=astray, outlier=lone)
        return Surveyed(
            layout, drawings, metric, p, density, census.n_read, used, dict(dropped), drawn["safe"],
            drawn["unsafe"], plan.spacing(sources, census.box, guess), _ranked(found, p), skipped,
            self.stage_ms,
        )  # fmt: skip

    # ---- steps ----------------------------------------------------------------------------------

    def _each(
        self, what: str, task: Callable[..., Any], items: Sequence[T], done: int, *shared: Any
    ) -> list[tuple[T, Any]]:
        """Run the tasks of a step and report its progress."""
        return self._follow(what, self._engine.each(task, items, *shared), len(items), done)

    def _follow(
        self, what: str, begun: Iterator[tuple[T, R]], total: int, done: int = 0
    ) -> list[tuple[T, R]]:
        """Wait for the tasks of a step and report its progress."""
        began = time.perf_counter()
        self._progress.begin_stage(what, LEAST_SHARES[what], total, done)
        results = []
        for count, pair in enumerate(begun, start=1):
            results.append(pair)
            self._progress.report(count)
        ms = (time.perf_counter() - began) * 1e3
        self.stage_ms[what] = self.stage_ms.get(what, 0.0) + ms
        return results

    def _sorted(
        self, sources: Sequence[Source], lattice: Lattice
    ) -> tuple[list[Path], Census, Metric, list[Skipped]]:
        """Sort all points; twice where only the points determine the length of the CRS's units."""
        paths, census, broken = self._sort(sources, lattice, "sorted")
        metric = metric_of(sources[0], census, lattice)
        if (metric.x_m, metric.y_m) != (lattice.x_m, lattice.y_m):
            lattice = replace(lattice, x_m=metric.x_m, y_m=metric.y_m)
            for path in paths:
                path.unlink(missing_ok=True)
            again = f"sorted-{lattice.x_m!r}-{lattice.y_m!r}"  # other usable files have another centre
            paths, census, broken = self._sort(sources, lattice, again)
        box, cell_m = census.box, lattice.cell_m
        origin = (
            box.col0 * cell_m / lattice.x_m,
            box.row0 * cell_m / lattice.y_m,
            math.floor(census.lowest * UNIT_M / lattice.z_m),
        )
        return paths, census, replace(metric, origin=origin), broken

    def _sort(
        self, sources: Sequence[Source], lattice: Lattice, folder: str
    ) -> tuple[list[Path], Census, list[Skipped]]:
        (self._work / folder).mkdir(exist_ok=True)
        pieces = plan.pieces(self._files, sources, self._crs, self._work / folder, self._vertical_unit)
        done = sum(piece.sorted.exists() for piece in pieces)
        outcomes = self._each("sorting", sort_piece, pieces, done, lattice, self._bin_m)
        reasons = {piece.path: outcome.broken for piece, outcome in outcomes if outcome.broken}
        whole = [piece for piece in pieces if piece.path not in reasons]
        reasons |= _empty(whole)
        whole = [piece for piece in whole if piece.path not in reasons]
        broken = [Skipped(path, str(reasons[path])) for path in self._files if path in reasons]
        if not whole:
            raise UsageError(broken[0].reason)
        paths = [piece.sorted for piece in whole]
        return paths, count_points(paths, self._bin_m), broken

    def _fitted(self, layout: TileLayout, paths: list[Path]) -> tuple[float, Parameters]:
        """Return the density, and parameters whose limits hold a survey of any size."""
        p = self._parameters
        tiles = plan.tiles(layout, paths, 0)
        shared = (layout.whole, p.cell_m)
        pairs = self._each("counting", _tally, tiles, 0, *shared)
        density = per_m2([found for _, found in pairs], p.cell_m)
        own: dict[str, Any] = {}
        if "coverage_m" not in p.model_fields_set:
            own["coverage_m"] = coverage_for(density, p.cell_m, p.coverage_m, p.min_square_m)
        if "max_zones" not in p.model_fields_set:
            own["max_zones"] = MOST_ZONES
        return density, p.model_copy(update=own)

    def _drawn(
        self, layout: TileLayout, paths: list[Path], census: Census, metric: Metric, p: Parameters
    ) -> Counter[str]:
        tiles = plan.tiles(layout, paths, reach_of(p, p.cell_m).margin + 16)
        done = sum(tile.drawn.exists() for tile in tiles)
        datum = round(metric.origin[2] * metric.z_m / UNIT_M)
        surface = layout.surface
        surface.folder.mkdir(exist_ok=True)
        parts = surface.parts(paths, census.box)
        classified = sum(part.done.exists() for part in parts)
        self._each("surface", classify_part, parts, classified, surface, census.box, census.interval, datum)
        ground = Ground(census.box, census.interval, datum, p, surface)
        total: Counter[str] = Counter()
        for _, notes in self._each("drawing", draw_tile, tiles, done, ground):
            total.update({name: notes[name] for name in ("n_used", "n_outliers", "safe", "unsafe")})
        return total

    def _drawings(self, layout: TileLayout, metric: Metric, p: Parameters) -> tuple[MapFiles, Iterator[Any]]:
        """Start the tasks that write the GeoTIFFs and the picture."""
        folder = self._work / "drawings"
        asked = [(folder / f"{each.name}.tif", each) for each in geotiff.rasters(metric, "default")]
        picture = folder / "ground.png"
        store = Store(layout)
        rasters = self._engine.each(_write_raster, asked, store, metric)
        pictures = self._engine.each(_write_picture, [picture], store, p)
        return MapFiles([path for path, _ in asked], picture), chain[Any](rasters, pictures)

    def _zones(self, layout: TileLayout, p: Parameters) -> None:
        """Join the safe ground of all tiles and describe every zone."""
        keys = sorted(tuple(map(int, path.stem.split("_"))) for path in layout.folder.glob("*.tile"))
        least = side_in_cells(p.min_square_m, layout.grid)
        pairs = self._each("joining", _labelled, [(layout, key, least) for key in keys], 0)
        work = batches(join_components({found.key: found for _, found in pairs}), self._work / "zones")
        done = sum(one.done.exists() for one in work)
        self._each("zones", describe_zones, work, done, layout, p, self._corridors)

    def _check_room(self, sources: Sequence[Source]) -> None:
        """Refuse clouds too large for the disk, before hours are spent."""
        need = SORTED_BYTES * sum(source.n_points for source in sources)
        free = shutil.disk_usage(
            next(part for part in (self._work, *self._work.parents) if part.exists())
        ).free
        if need > free:
            raise UsageError(
                f"{self._work}: {free / 1e9:.1f} GB are free, the points alone take {need / 1e9:.1f} GB:"
                " choose another disk by --out, or map fewer files at a time"
            )


def _check_cells(box: Box, cell_m: float) -> None:
    """Refuse a survey whose maps would have too many cells, before any map is derived."""
    rows, cols = box.shape
    excess = max(rows * cols / MOST_CELLS, (max(rows, cols) / MOST_LINES) ** 2)
    if excess > 1:
        fits = math.ceil(cell_m * math.sqrt(excess) * 1.01 * 100) / 100
        raise UsageError(
            f"{cols * cell_m / 1e3:.0f} km x {rows * cell_m / 1e3:.0f} km are too many cells of {cell_m:g} m:"
            f" --cell-m {fits:g} would do, or map fewer files at a time"
        )


def _write_raster(asked: tuple[Path, geotiff.Raster], maps: Store, metric: Metric) -> None:
    path, raster = asked
    if not path.exists():
        with array_file.atomic_file(path) as unfinished:
            geotiff.write(unfinished.path, raster, maps, metric)


def _write_picture(path: Path, maps: Store, parameters: Parameters) -> None:
    if not path.exists():
        with array_file.atomic_file(path) as unfinished:
            unfinished.path.write_bytes(ground_png(maps, water_mask(maps, parameters)))


def _ranked(found: Sequence[DescribedZone], parameters: Parameters) -> list[DescribedZone]:
    """Return zones by rank and numbered so; of equal ones the first in the order given comes first."""
    order = rank((replace(one.zone, id=k) for k, one in enumerate(found)), parameters)
    zones = numbered_by_rank(order, parameters)
    return [replace(found[was.id], zone=zone) for was, zone in zip(order, zones, strict=True)]


def _without_cells(found: DescribedZone) -> DescribedZone:
    """Return a zone without its cells, which grow with its area; outline and boundary grow with its rim."""
    return replace(found, zone=replace(found.zone, cells=found.zone.cells[:0, :0]))


def _tally(tile: Any, whole: Any, cell_m: float) -> Any:
    return tally(tile.sources, tile.box, whole, cell_m)


def _labelled(asked: tuple[TileLayout, Any, int]) -> Any:
    return label_tile(*asked)


def _empty(pieces: Sequence[Piece]) -> dict[Path, str]:
    """Return the files without any usable point, and the reasons."""
    used: Counter[Path] = Counter()
    read: Counter[Path] = Counter()
    dropped: dict[Path, Counter[str]] = {}
    for piece in pieces:
        arrays, notes = array_file.read(piece.sorted)
        used[piece.path] += len(arrays["cells"])
        read[piece.path] += int(notes["n_read"])
        dropped.setdefault(piece.path, Counter()).update(notes["dropped"])
    return {
        path: f"{path}: none of its {read[path]} points is usable{_reasons(dropped[path])}"
        for path in dropped
        if not used[path]
    }


def _reasons(dropped: Counter[str]) -> str:
    counts = ", ".join(f"{count} {name.replace('_', ' ')}" for name, count in dropped.items() if count)
    return f" ({counts})" if counts else ""


def of_tiles(surveyed: Surveyed) -> Findings:
    """Return the findings: zones, and maps read from their tiles."""
    found = surveyed.found
    rows, cols = surveyed.layout.whole.shape
    return Findings(
        metric=surveyed.metric,
        parameters=surveyed.parameters,
        maps=Store(surveyed.layout),
        drawings=surveyed.drawings,
        zones=[one.zone for one in found],
        shapes=[wgs84(one.polygon_m, surveyed.metric) for one in found],
        outlines_m=[one.polygon_m for one in found],
        square_centres_m=[one.square_centre_m for one in found],
        ways=[one.ways for one in found],
        n_obstacles=[one.n_obstacles for one in found],
        cells={
            "rows": rows,
            "cols": cols,
            "safe": surveyed.n_safe,
            "unsafe": surveyed.n_unsafe,
            "unknown": rows * cols - surveyed.n_safe - surveyed.n_unsafe,
        },
        n_read=surveyed.n_read,
        n_used=surveyed.n_used,
        dropped=surveyed.dropped,
        density_per_m2=surveyed.density_per_m2,
        coordinate_spacing=surveyed.coordinate_spacing,
        skipped=[one.document() for one in surveyed.skipped],
        n_cut=sum(one.cut for one in found),
        stage_ms=surveyed.stage_ms,
    )


def whole_maps(findings: Findings) -> TerrainMaps:
    """Return all maps in memory, for pictures; layers that surveys do not keep are NaN."""
    maps, grid = findings.maps, findings.maps.grid
    box = grid.everything
    nothing = np.full(box.shape, np.nan, np.float32)
    layers = {
        layer.name: maps.read(layer.name, box) if Output.SURVEY in layer.outputs else nothing
        for layer in reaching(Output.MAPS)
    }
    return TerrainMaps(
        frame=findings.metric.frame,
        grid=grid,
        box=box,
        layers=layers,
        state=maps.read("state", box),
    )
