"""Pipeline: safe landing zones from windows of points, one window at a time."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from params import Parameters, rows
from slz.default_method import DefaultMethod
from slz.frame import LocalFrame, MapFrame, is_known
from slz.grid import Box, common, within
from slz.landing_point.judgement import SelectedPoint, judge_point, unknown
from slz.landing_point.local_heights import nearby
from slz.lanes import timed
from slz.method import Method, MethodResult, ResolutionMap
from slz.prior import Source as PriorSource
from slz.report import MapReport, Report
from slz.surface.surface_kinds import UNKNOWN_SURFACE, SurfaceHere
from slz.terrain.layers import Output, reaching
from slz.terrain.terrain import Tally
from slz.terrain.terrain_maps import UNKNOWN, TerrainMaps
from slz.terrain.terrain_view import Drawn, read_changes
from slz.window import Window
from slz.zone import zone_mask

Points = NDArray[np.float64]
FARTHEST_M = 1e8  # of a place that may be selected; more than the way around the earth


class Pipeline:
    """Safe landing zones from windows of georeferenced returns.

    Parameters
    ----------
    parameters
        All parameters; `mode` selects the sources' rules or the default ones.
    centre_enu_m
        East and north of the first zone's centre; None uses the first return (SLZ paper, section 3.1.2).
    follow
        In source mode: a return outside the zone moves the zone there (SLZ paper, section 3.2.5); False skips
        it.
    threads
        With 2 the far map is computed in parallel with the near one; the reports are the same. Default mode
        only.
    prior
        Source of the ground surveyed before the flight, see `slz.prior`. Default mode only.

    Notes
    -----
    Not thread safe: call it from one thread. Points and reports are never modified after the call.
    """

    def __init__(
        self,
        parameters: Parameters,
        centre_enu_m: tuple[float, float] | None = None,
        follow: bool = True,
        threads: int = 1,
        prior: PriorSource | None = None,
    ) -> None:
        if threads not in (1, 2):
            raise ValueError(f"the pipeline runs on 1 or 2 threads, not {threads}")
        self._parameters = parameters
        self.method = _method(parameters, centre_enu_m, follow, threads, prior)
        self._frame: LocalFrame | None = None
        self._map_number = 0
        self._map_begins = False  # the method's maps are given up
        self._selected: SelectedPoint | None = None
        self._sensor = np.zeros(3)

    def process(self, window: Window) -> Report:
        """Run every stage on one window and report the zones of the total maps.

        Non-finite points, points beyond `reach_m` of the sensor and isolated points are dropped: n_points
        minus n_used counts them.
        """
        ms: dict[str, float] = {}
        self._sensor = window.sensor_enu_m
        self._follow_frame(window.frame)
        frame = MapFrame.of(window.frame, self._map_number)
        result = self.method.process(window, frame, self._selected, ms)
        self._map_begins = False
        with timed("landing_point", ms):
            self._selected = self._judge_selected(result)
        with timed("nearby", ms):
            near, error_m = result.near, self._parameters.touchdown_error_m
            landable = partial(self._landable, near)
            around = nearby(near.terrain, result.far.terrain, window.sensor_enu_m, landable, error_m)
        return self.method.report(
            stamp_ns=window.end_ns,
            frame=window.frame,
            near=MapReport(result.near.terrain.grid, result.near.zones),
            far=MapReport(result.far.terrain.grid, result.far.zones),
            choice=result.choice,
            selected=self._selected,
            n_points=len(window),
            n_used=result.n_used,
            n_without_tile=result.near.n_without_tile,
            n_evicted=result.near.n_evicted,
            stage_ms=ms,
            nearby=around,
            prior=self.method.prior_report(),
            wires=result.wires,
            n_alone=result.n_alone,
        )

    def begin_new_map(self) -> None:
        """Give up all maps and the selected point: the position estimate moved, and both are misplaced.

        The next window begins new maps, as in a new pipeline, but the IDs of zones go on, so that an old ID
        names no other ground.
        """
        self._map_number += 1
        self._map_begins = True
        self._frame = self._selected = None

    @property
    def parameters(self) -> Parameters:
        """Parameters of the next window."""
        return self._parameters

    def use(self, parameters: Parameters) -> None:
        """Use other parameters from the next window on: one snapshot holds for a whole window.

        Raises
        ------
        ValueError
            A parameter differs that takes effect at the next start only (`params.Row.live`).
        """
        shaping = [row.name for row in rows() if not row.live]
        for name in shaping:
            if getattr(parameters, name) != getattr(self._parameters, name):
                raise ValueError(f"{name} cannot change while a pipeline runs: make a new pipeline")
        self._parameters = parameters
        self.method.use(parameters)

    @property
    def tally(self) -> Tally | None:
        """Numbers of near cells that the last window hit, derived and changed; None in source mode."""
        near = self._map(far=False)
        return None if near is None else near.tally

    def prepare(self) -> None:
        """Prefault memory for the next window; optional, for idle time.

        The system allocates a page on the first write to it, which may take longer than the computation. The
        next report does not depend on it.
        """
        for resolution in self._maps or ():
            resolution.terrain.prepare()

    @property
    def selected(self) -> SelectedPoint | None:
        """The selected landing point, as judged by the newest maps."""
        return self._selected

    def select(self, enu_m: NDArray[np.float64] | None) -> None:
        """Select a landing point to monitor, or none; the next report says whether it is safe."""
        if enu_m is None:
            self._selected = None
            return
        point = np.array(enu_m, np.float64)
        if point.shape != (3,) or not (np.abs(point[:2]) < FARTHEST_M).all():
            raise ValueError(
                f"a landing point is three numbers, east and north within {FARTHEST_M:g} m, not {enu_m!r}"
            )
        self._selected = unknown(point)
        if (maps := self._maps) is not None:
            self._selected = self._judge(point, *maps, before=None)

    def state(self, which: Literal["near", "far"], box: Box) -> NDArray[np.uint8]:
        """Return 0 unsafe, 1 safe, 255 unknown for a box of a map's grid; all unknown before any window."""
        found = self._map(far=which == "far")
        return np.full(box.shape, UNKNOWN, np.uint8) if found is None else found.terrain.state(box)

    def surface_at(self, enu_m: NDArray[np.float64], around_m: float | None = None) -> SurfaceHere:
        """Return the surface within a distance of a point (3,); unknown before any window, and at NaN.

        Parameters
        ----------
        around_m
            By default that of a vehicle's footprint and touchdown error; 0 is the surface cell of the point.
        """
        near, p = self._map(far=False), self._parameters
        if near is None or not is_known(enu_m):
            return UNKNOWN_SURFACE
        if around_m is None:
            around_m = p.touchdown_error_m + p.footprint_m / 2
        return near.terrain.surface_at(enu_m, around_m)

    def maps(
        self,
        box: Box | None = None,
        which: Literal["near", "far"] = "near",
        level: int | None = None,
    ) -> TerrainMaps | None:
        """Return copies of a map over a box of its grid, by default over all ground seen; None before any.

        Parameters
        ----------
        level
            Level of the resolution pyramid, by default the one in use; the finest is 0.
        """
        found = self._map(far=which == "far")
        if found is None or self._frame is None:
            return None
        terrain = found.terrain if level is None else found.terrain.maps_at_level(level)
        if box is None and terrain.seen.empty:
            return None
        box = terrain.seen if box is None else box
        return TerrainMaps(
            frame=self._frame,
            grid=terrain.grid,
            box=box,
            layers={layer.name: terrain.layer(layer.name, box) for layer in reaching(Output.MAPS)},
            state=terrain.state(box),
        )

    def drawn(self, which: Literal["near", "far"], most: int, *, anew: bool = False) -> Drawn | None:
        """Return the changes of a map since the last call, the nearest tiles first; None before any window.

        Parameters
        ----------
        most
            Bound on the tiles returned; the next calls return the rest.
        anew
            Treat all tiles as changed.
        """
        found = self._map(far=which == "far")
        if found is None:
            return None
        if anew:
            found.terrain.mark_all_changed()
        return read_changes(found.terrain, most, self._sensor)

    # ---- parts ----------------------------------------------------------------------------------

    @property
    def _maps(self) -> tuple[ResolutionMap, ResolutionMap] | None:
        return None if self._map_begins else self.method.maps

    def _map(self, *, far: bool) -> ResolutionMap | None:
        maps = self._maps
        return None if maps is None else maps[far]

    def _follow_frame(self, frame: LocalFrame) -> None:
        """Give up the selected point when a new frame begins: it was selected in another."""
        if self._frame not in (None, frame):
            self._selected = None
        self._frame = frame

    def _landable(self, near: ResolutionMap, box: Box) -> NDArray[np.bool_]:
        """Return the cells of a box in zones that need no confirmation, as certain as a landing point is."""
        p = self._parameters
        usable = tuple(
            zone
            for zone in near.zones
            if not zone.best.has_no_heading
            and not zone.best.surface.must_be_confirmed(p.roof, p.vegetation)
            and zone.best.surface.water <= p.water_suspicion
        )
        landable, held = np.zeros(box.shape, bool), common(box, near.terrain.grid.everything)
        if usable and not held.empty:
            certain = near.terrain.layer("certainty", held) >= p.min_certainty
            landable[within(held, box)] = zone_mask(usable, held) & certain
        return landable

    def _judge_selected(self, result: MethodResult) -> SelectedPoint | None:
        if self._selected is None:
            return None
        return self._judge(self._selected.enu_m, result.near, result.far, before=self._selected)

    def _judge(
        self, enu_m: Points, near: ResolutionMap, far: ResolutionMap, before: SelectedPoint | None
    ) -> SelectedPoint:
        point = judge_point(enu_m, near.terrain, far.terrain, self._parameters)
        if point is None:
            return self.method.without_map(enu_m, before)
        found = near if point.judged_by == "near" else far
        row, col = found.terrain.grid.index(float(enu_m[0]), float(enu_m[1]))
        zone_id = next((zone.id for zone in found.zones if zone.holds(row, col)), None)
        ways = self.method.corridors(np.array([*enu_m[:2], point.height_m]))
        ground = self.method.watched_ground(enu_m) if point.judged_by == "near" else None
        return replace(point, zone_id=zone_id, corridors=ways, ground=ground)


def _method(
    parameters: Parameters,
    centre_enu_m: tuple[float, float] | None,
    follow: bool,
    threads: int,
    prior: PriorSource | None,
) -> Method:
    if parameters.mode == "source":
        from slz.paper.paper_method import PaperMethod  # no other mode waits for its kernels

        return PaperMethod(parameters, centre_enu_m, follow)
    return DefaultMethod(parameters, centre_enu_m, threads, prior)
