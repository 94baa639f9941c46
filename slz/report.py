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

    near, far: the maps of fine and of coarse cells; both are maintained in flight. choice: features
    of the window, and the mode, resolution and window length chosen from them. n_points: returns of the
    window. n_alone: those without others near. n_used: returns in range of the near map. n_without_tile,
    n_evicted: points without a tile in the memory budget, and tiles evicted. stage_ms: processing time by
    stage; of one that runs beside others, what is left of it after them. nearby: heights around the vehicle,
    None where its position is unknown. prior: zones on ground surveyed before the flight, None without a
    survey: to fly to and inspect, and never to land in before the other maps confirm them. wires: power lines
    and cables known now.
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
    stage_ms: Mapping[str, float]
    nearby: Nearby | None = None
    prior: MapReport | None = None
    wires: tuple[Wire, ...] = ()
    n_alone: int = 0

    @property
    def grid(self) -> Grid:
        """Grid of the map to land by, the near one."""
        return self.near.grid

    @property
    def zones(self) -> tuple[Zone, ...]:
        """Zones to land in, those of the near map."""
        return self.near.zones

    @property
    def total_ms(self) -> float:
        """Processing time of the window."""
        return sum(self.stage_ms.values())
