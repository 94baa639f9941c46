"""Comparison of maps and zones with the simulator's truth."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from companion.desk.evaluation import relative_area_error, room_to_land
from companion.desk.reproduce.survey_recording import SurveyRecording
from params import Parameters
from slz import SAFE, UNKNOWN, Box, Grid, TerrainMaps, Zone, zone_mask

MARGIN_M = 3.0

Mask = NDArray[np.bool_]


@dataclass(frozen=True, slots=True)
class Scores:
    """Scores over the surveyed extent less a margin of 3 m.

    area_error: SLZ paper, Eq. (20). false_safe: truly unsafe cells called safe, as a share of the known
    cells. recall: share of the truly safe cells that are called safe. slope_rms_deg: over the truly safe
    cells.
    """

    computed_m2: float
    truth_m2: float
    common_m2: float
    false_safe: float
    false_safe_cells: int
    recall: float
    slope_rms_deg: float

    @property
    def area_error(self) -> float:
        error = relative_area_error(self.computed_m2, self.truth_m2, self.common_m2)
        return float("nan") if error is None else error


def compare(
    recording: SurveyRecording, maps: TerrainMaps, zones: tuple[Zone, ...], parameters: Parameters
) -> Scores:
    """Compare maps and zones with the truth, cell by cell of the map."""
    grid, box = maps.grid, maps.box
    truth = _Truth(recording, grid, box)
    safe = truth.of(recording.safe, 0) == 1
    known = (maps.state != UNKNOWN) & truth.inside
    called = (maps.state == SAFE) & truth.inside
    computed = zone_mask(zones, box) & truth.inside
    real = room_to_land(safe, grid, parameters) & truth.inside
    cell_m2 = grid.cell_m**2
    error = (maps.slope_deg - truth.of(recording.slope_deg, np.nan))[safe & known]
    error = error[np.isfinite(error)]
    false = int((called & ~safe).sum())
    return Scores(
        computed_m2=float(computed.sum()) * cell_m2,
        truth_m2=float(real.sum()) * cell_m2,
        common_m2=float((computed & real).sum()) * cell_m2,
        false_safe=false / max(1, int(known.sum())),
        false_safe_cells=false,
        recall=float((called & safe).sum()) / max(1, int((safe & truth.inside).sum())),
        slope_rms_deg=float(np.sqrt(np.mean(error**2))) if len(error) else float("nan"),
    )


def truth_at(recording: SurveyRecording, grid: Grid, box: Box) -> tuple[Mask, Mask]:
    """Return masks of the truly safe cells of a map, and of those in the extent less its margin."""
    truth = _Truth(recording, grid, box)
    return np.asarray(truth.of(recording.safe, 0) == 1), truth.inside


class _Truth:
    """The truth at the cells of a map."""

    def __init__(self, recording: SurveyRecording, grid: Grid, box: Box) -> None:
        x0, y0, x1, y1 = recording.survey.extent_m
        rows, cols = np.mgrid[box.row0 : box.row1, box.col0 : box.col1]
        east = grid.west_m + (cols + 0.5) * grid.cell_m
        north = grid.south_m + (rows + 0.5) * grid.cell_m
        cell = recording.survey.cell_m
        self._row = np.floor((north - y0) / cell).astype(np.int64)
        self._col = np.floor((east - x0) / cell).astype(np.int64)
        self.inside: Mask = (
            (east > x0 + MARGIN_M)
            & (east < x1 - MARGIN_M)
            & (north > y0 + MARGIN_M)
            & (north < y1 - MARGIN_M)
        )

    def of(self, raster: NDArray[Any], outside: float) -> NDArray[Any]:
        held = (self._row >= 0) & (self._col >= 0)
        held &= (self._row < raster.shape[0]) & (self._col < raster.shape[1])
        row, col = self._row.clip(0, raster.shape[0] - 1), self._col.clip(0, raster.shape[1] - 1)
        return np.where(held, raster[row, col], outside)
