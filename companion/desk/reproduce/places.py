"""The three landing places of the sources, and their surroundings (SLZ thesis, Section 4.4.5)."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from companion.desk.reproduce.scenarios import ONE_MAP
from companion.desk.reproduce.source_scenes import Case, Settings, pipeline_for
from companion.desk.reproduce.survey_recording import SurveyFlight, SurveyRecording, fly
from params import Parameters
from slz import Box, SelectedPoint, Surroundings, TerrainMaps

ABOVE_DEG, BELOW_DEG = 7.0, 1.0
"""Tolerated errors of the horizon: too high costs an approach, too low hides an obstacle. Noise of 0.12 m on
the ground at the footprint's edge, 1 m away, appears 7 degrees high."""

SECTORS = 36
LEAST_M, BULGE = 0.3, 0.02  # obstacles rise over the point's ground by LEAST_M + BULGE * distance

Extent = tuple[float, float, float, float]


@dataclass(frozen=True, slots=True)
class Place:
    """A landing point: its position, its survey, and the settings of each mode."""

    name: str
    survey: SurveyFlight
    east_north_m: tuple[float, float]
    settings: Settings = ()
    source: Settings = ("cell_m=1",)

    def case(self, mode: str) -> Case:
        own = (f"mode={mode}", *ONE_MAP, *self.settings)
        return Case(
            f"{self.name}, {mode} mode",
            self.survey,
            1.0,
            settings=(*own, *(self.source if mode == "source" else ())),
        )


PLACES = (
    Place(
        "open plain",
        SurveyFlight(
            "plain",
            (-33.0, -33.0, 33.0, 33.0),
            spacing_m=22.0,
            speed_ms=15.0,
            point_rate_hz=80_000,
            cell_m=0.5,
        ),
        (0.0, 0.0),
    ),
    Place(
        "between two buildings",
        SurveyFlight(
            "buildings", (-28.0, -20.0, 30.0, 20.0), spacing_m=14.0, speed_ms=10.0, point_rate_hz=100_000
        ),
        (1.0, 0.0),
    ),
    Place(
        "inside the stadium",
        SurveyFlight(
            "stadium",
            (-112.0, -14.0, 32.0, 98.0),
            spacing_m=22.0,
            speed_ms=25.0,
            point_rate_hz=100_000,
            cell_m=0.5,
        ),
        (-40.0, 40.0),
        ("cell_m=0.5", "surround_m=75"),
        (),
    ),
)


@dataclass(frozen=True, slots=True)
class ObservedPoint:
    """A selected point after a survey, the true obstacles around it, and the map about it."""

    place: Place
    mode: str
    selected: SelectedPoint
    truth: TrueSurroundings
    maps: TerrainMaps
    parameters: Parameters

    @property
    def surroundings(self) -> Surroundings:
        if self.selected.surroundings is None:
            raise RuntimeError(f"{self.place.name}: nothing is known around the point")
        return self.selected.surroundings

    @property
    def pairs(self) -> list[Pair]:
        """Return the true obstacles in named regions, each with the obstacle found for it."""
        return [pair for pair in self.truth.pairs(self.surroundings) if pair.true.where]

    @property
    def phantoms(self) -> int:
        return self.truth.phantoms(self.surroundings, 2 * self.maps.grid.cell_m)

    def true_horizon_deg(self, spare_deg: float = 0.0) -> NDArray[np.float64]:
        return self.truth.horizon_deg(self.parameters.footprint_m / 2, spare_deg)

    @property
    def too_low(self) -> int:
        """Return the number of sectors with a horizon below the truth; unseen sectors do not count."""
        return int((self.surroundings.horizon_deg < self.true_horizon_deg(-1.0) - BELOW_DEG).sum())

    @property
    def too_high(self) -> int:
        return int((self.surroundings.horizon_deg > self.true_horizon_deg(1.0) + ABOVE_DEG).sum())

    @property
    def horizon_error_deg(self) -> float:
        """Return the median absolute error of the horizon."""
        return float(np.nanmedian(np.abs(self.surroundings.horizon_deg - self.true_horizon_deg())))


@dataclass(frozen=True, slots=True)
class Standing:
    """True obstacle: west, south, east and north edge, height over the point's ground, area, region."""

    extent_m: Extent
    height_m: float
    area_m2: float
    where: str


@dataclass(frozen=True, slots=True)
class Pair:
    """True obstacle, with extent and height of the one found for it, None where there is none."""

    true: Standing
    found: tuple[Extent, float] | None

    @property
    def edge_error_m(self) -> float:
        """Return the largest error of the four edges."""
        if self.found is None:
            return math.inf
        return max(abs(a - b) for a, b in zip(self.found[0], self.true.extent_m, strict=True))

    @property
    def height_error_m(self) -> float:
        return math.inf if self.found is None else self.found[1] - self.true.height_m


class TrueSurroundings:
    """The truth within `radius_m` of a point."""

    def __init__(self, recording: SurveyRecording, east_m: float, north_m: float, radius_m: float) -> None:
        self._recording, self._point = recording, (east_m, north_m)
        self._x0, self._y0, self.cell_m = *recording.survey.extent_m[:2], recording.survey.cell_m
        n_rows, n_cols = recording.height_m.shape
        rows, cols = np.mgrid[:n_rows, :n_cols]
        self._east: NDArray[np.float64] = self._x0 + (cols + 0.5) * self.cell_m - east_m
        self._north: NDArray[np.float64] = self._y0 + (rows + 0.5) * self.cell_m - north_m
        self._way: NDArray[np.float64] = np.hypot(self._east, self._north)
        here = np.unravel_index(int(np.argmin(self._way)), self._way.shape)
        self.ground_m = float(recording.height_m[here])
        self._over: NDArray[np.float64] = recording.height_m.astype(np.float64) - self.ground_m
        self._held = (self._way <= radius_m) & np.isfinite(self._over)

    @property
    def regions(self) -> dict[str, NDArray[np.float64]]:
        """Corners of the scene's regions."""
        return self._recording.regions

    def highest_m(self, region: str) -> float:
        """Return the largest height in a rectangular region, over the point's ground."""
        return float(np.nanmax(np.where(self._inside(region), self._over, np.nan)))

    def _inside(self, region: str) -> NDArray[np.bool_]:
        corners = self.regions[region]
        (west, south), (east, north) = corners.min(axis=0).tolist(), corners.max(axis=0).tolist()
        x, y = self._east + self._point[0], self._north + self._point[1]
        return np.asarray((x >= west) & (x <= east) & (y >= south) & (y <= north))

    def standing(self, least_m2: float = 2.0) -> list[Standing]:
        """Return the 8-connected groups of raised cells of at least an area, the nearest first."""
        raised = self._held & (self._over > LEAST_M + BULGE * self._way)
        label, count = ndimage.label(raised, np.ones((3, 3)))
        found = []
        for number in range(1, count + 1):
            cells = label == number
            area = float(cells.sum()) * self.cell_m**2
            if area >= least_m2:
                item = Standing(self._extent(cells), float(self._over[cells].max()), area, self._where(cells))
                found.append((float(self._way[cells].min()), item))
        return [item for _, item in sorted(found, key=lambda entry: entry[0])]

    def _extent(self, cells: NDArray[np.bool_]) -> Extent:
        rows, cols = np.flatnonzero(cells.any(axis=1)), np.flatnonzero(cells.any(axis=0))
        west, south = self._x0 + cols[0] * self.cell_m, self._y0 + rows[0] * self.cell_m
        east, north = self._x0 + (cols[-1] + 1) * self.cell_m, self._y0 + (rows[-1] + 1) * self.cell_m
        return float(west), float(south), float(east), float(north)

    def _where(self, cells: NDArray[np.bool_]) -> str:
        """Return the names of the rectangular regions that hold at least a tenth of the cells."""
        names = [name for name in self.regions if self._inside(name)[cells].mean() >= 0.1]
        return " and ".join(name.replace("_", " ") for name in names)

    def horizon_deg(self, near_m: float, spare_deg: float = 0.0) -> NDArray[np.float64]:
        """Return (36,) elevation angles by bearing; each sector is widened by `spare_deg` on both sides."""
        use = self._held & (self._way >= near_m)
        angle = np.degrees(np.arctan2(self._over[use], self._way[use]))
        bearing = np.degrees(np.arctan2(self._east[use], self._north[use]))
        out = np.full(SECTORS, np.nan)
        half = 180 / SECTORS + spare_deg
        for sector in range(SECTORS):
            off = (bearing - sector * 360 / SECTORS + 180) % 360 - 180
            within = np.abs(off) <= half
            if within.any():
                out[sector] = angle[within].max()
        return out

    def pairs(self, found: Surroundings, least_m2: float = 2.0) -> list[Pair]:
        """Return each true obstacle with the listed one whose box overlaps most with its own."""
        out = []
        for item in self.standing(least_m2):
            shared = [_shared_m2(obstacle.extent_m, item.extent_m) for obstacle in found.obstacles]
            best = int(np.argmax(shared)) if shared else 0
            if not shared or shared[best] <= 0:
                out.append(Pair(item, None))
            else:
                obstacle = found.obstacles[best]
                out.append(Pair(item, (obstacle.extent_m, obstacle.height_m)))
        return out

    def phantoms(self, found: Surroundings, spare_m: float) -> int:
        """Return the number of listed obstacles without anything raised within `spare_m` of their box.

        A pole or wire may pass between the heights at the cells' centres; the relief of the footprint shows
        it.
        """
        raised = (self._over > LEAST_M) | (self._recording.relief_m > LEAST_M)
        count = 0
        for west, south, east, north in (obstacle.extent_m for obstacle in found.obstacles):
            rows = self._span(south - spare_m, north + spare_m, self._y0)
            cols = self._span(west - spare_m, east + spare_m, self._x0)
            count += not raised[rows, cols].any()
        return count

    def _span(self, low_m: float, high_m: float, start_m: float) -> slice:
        first = max(0, math.floor((low_m - start_m) / self.cell_m))
        return slice(first, max(first, math.ceil((high_m - start_m) / self.cell_m)))


def watch(place: Place, mode: str, surveys: Path, recording: SurveyRecording | None = None) -> ObservedPoint:
    """Fly over a place, select its point before the last window, and return its surroundings and truth."""
    recording = recording or fly(place.survey, surveys)
    pipeline, parameters = pipeline_for(place.case(mode))
    windows = list(recording.windows())
    if not windows:
        raise RuntimeError(f"{place.name}: nothing was seen")
    for window in windows[:-1]:
        pipeline.process(window)
    pipeline.select(np.array([*place.east_north_m, 0.0]))
    report = pipeline.process(windows[-1])
    grid, selected = report.near.grid, report.selected
    reach = int(np.ceil(1.1 * parameters.surround_m / grid.cell_m))
    row, col = grid.index(*place.east_north_m)
    box = Box(row - reach, row + reach + 1, col - reach, col + reach + 1)
    maps = pipeline.maps(box.grown(0, grid), "near")
    if selected is None or maps is None:
        raise RuntimeError(f"{place.name}: nothing is known of it")
    truth = TrueSurroundings(recording, *place.east_north_m, parameters.surround_m)
    return ObservedPoint(place, mode, selected, truth, maps, parameters)


def _shared_m2(a: Extent, b: Extent) -> float:
    width, depth = min(a[2], b[2]) - max(a[0], b[0]), min(a[3], b[3]) - max(a[1], b[1])
    return width * depth if width > 0 and depth > 0 else 0.0
