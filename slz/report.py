"""Report of the pipeline after a window."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from slz.adaptive import Choice
from slz.frame import LocalFrame
from slz.grid import Grid
from slz.landing_point.judgement import SelectedPoint
from slz.landing_point.local_heights import Nearby
from slz.wires.detected_wire import Wire
from slz.zone import Zone


@dataclass(frozen=True, slots=True)
class MapReport:
    """One map: its grid, and its zones by rank, the best to land in first."""

    grid: Grid
    zones: tuple[Zone, ...]


@dataclass(frozen=True, slots=True)
class Report:
    """Result of one window.

    near, far: the maps of fine and of coarse cells; both are maintained whichever is active. choice: features
    of the window, and the mode, resolution and window length chosen from them. n_points: returns of the
    window. n_alone: those without others near. n_used: returns in range of the near map. n_without_tile,
    n_evicted: points without a tile in the memory budget, and tiles evicted. far_is_active: the far map is
    the one to land by. stage_ms: processing time by stage; of one that runs beside others, what is left of it
    after them. nearby: heights around the vehicle, None where its position is unknown. prior: zones on ground
    surveyed before the flight, None without a survey: to fly to and inspect, and never to land in before the
    other maps confirm them. wires: power lines and cables known now.
    """

    stamp_ns: int
    frame: LocalFrame
    near: MapReport
    far: MapReport
    choice: Choice
    selected: SelectedPoint | None
    n_points: int
    n_used: int
    n_without_tile: int
    n_evicted: int
    far_is_active: bool
    stage_ms: Mapping[str, float]
    nearby: Nearby | None = None
    prior: MapReport | None = None
    wires: tuple[Wire, ...] = ()
    n_alone: int = 0

    @property
    def active(self) -> MapReport:
        """The map to land by: the near one; in source mode that of the present mode."""
        return self.far if self.far_is_active else self.near

    @property
    def grid(self) -> Grid:
        """Grid of the active map."""
        return self.active.grid

    @property
    def zones(self) -> tuple[Zone, ...]:
        """Zones of the active map."""
        return self.active.zones

    @property
    def total_ms(self) -> float:
        """Processing time of the window."""
        return sum(self.stage_ms.values())
