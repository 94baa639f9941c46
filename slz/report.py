"""What the pipeline says after a window."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from slz.frame import LocalFrame
from slz.grid import Grid
from slz.landing_point import SelectedPoint
from slz.zone import Zone


@dataclass(frozen=True, slots=True)
class Report:
    """Result of one window.

    zones are ranked, the best to land in first. stage_ms: processing time by stage. n_points: returns of the
    window, n_used: those that entered the maps. new_map: the map was moved before this window.
    """

    stamp_ns: int
    frame: LocalFrame
    grid: Grid
    zones: tuple[Zone, ...]
    selected: SelectedPoint | None
    n_points: int
    n_used: int
    new_map: bool
    stage_ms: Mapping[str, float]

    @property
    def total_ms(self) -> float:
        return sum(self.stage_ms.values())
