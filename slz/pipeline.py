"""Pipeline of the whole method, one window at a time, in the order of the SLZ paper."""

from __future__ import annotations

import itertools
import math
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from typing import TYPE_CHECKING, Literal, TypeAlias, TypeVar

import numpy as np
from numpy.typing import NDArray

from params import Parameters
from slz.adaptive import Adapter, Choice
from slz.concurrency import beside
from slz.default_method import ZoneMap, far_parameters
from slz.frame import LocalFrame, is_known
from slz.grid import Box, Grid
from slz.kernels.points.range_gate import are_usable, beyond, heights_of, picked, usable, within_reach
from slz.landing_point.judgement import SelectedPoint, judge, unknown
from slz.landing_point.local_heights import nearby
from slz.points.outliers import (
    CLOUD_GROUP,
    FLIGHT_GROUP,
    LoneReturns,
    gap_interval,
    in_a_group,
    in_company,
)
from slz.points.registration import Offset, offset
from slz.prior import Prior
from slz.prior import Source as PriorSource
from slz.report import MapReport, Report
from slz.terrain.changes import Drawn, take_drawn
from slz.terrain.terrain import EvidenceTerrain
from slz.terrain.terrain_maps import UNKNOWN, TerrainMaps
from slz.window import Window

if TYPE_CHECKING:
    from slz.paper.paper_method import SourceMap
    from slz.paper.window_cells import Returns

Points = NDArray[np.float64]
AnyMap: TypeAlias = "ZoneMap | SourceMap"
M = TypeVar("M", ZoneMap, "SourceMap")
ANYWHERE = Grid(0.0, 0.0, 1.0, 1, 1)
MOST_HEIGHT_M = 100_000.0  # nothing on the ground is higher or deeper
FARTHEST_M = 1e8  # bound on the position of a selected point; more than the circumference of the Earth


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
        self._other = ThreadPoolExecutor(1, "slz-far-map") if threads == 2 else None
        self._parameters = parameters
        self._far_parameters = far_parameters(parameters)
        self._centre = centre_enu_m
        self._follow = follow
        self._source = parameters.mode == "source"
        if self._source:  # imported here, so that default mode does not load the kernels of source mode
            from slz.paper.paper_method import SourceMap
            from slz.paper.window_cells import Returns

            self._returns, self._source_map = Returns(), SourceMap
        self._frame: LocalFrame | None = None
        self._near: AnyMap | None = None
        self._far: AnyMap | None = None
        self._adapter = Adapter(parameters)
        self._far_is_active = False
        self._numbers = itertools.count(1)
        self._prior = None if prior is None or self._source else Prior(prior, parameters)
        self._lone = LoneReturns()
        self._selected: SelectedPoint | None = None
        self._sensor = np.zeros(3)

    def process(self, window: Window) -> Report:
        """Run every stage on one window and report the zones of the total maps.

        Non-finite points, points beyond `reach_m` of the sensor and isolated points are dropped: n_points
        minus n_used counts them.
        """
        clock = _Stages()
        sensor = np.array(window.sensor_enu_m, np.float64)  # the kernels accept no read-only array
        if not is_known(sensor):
            sensor[:] = np.nan
        self._sensor = sensor
        step = self._by_the_sources if self._source else self._by_default
        near, far, choice, n_used, moved = step(window, sensor, clock)
        self._selected = self._judge_selected(near, far)
        self._far_is_active = self._source and choice.far
        clock.lap("landing_point")
        around = nearby(near.terrain, far.terrain, sensor)
        clock.lap("nearby")
        return Report(
            stamp_ns=window.end_ns,
            frame=window.frame,
            near=MapReport(near.terrain.grid, near.zones),
            far=MapReport(far.terrain.grid, far.zones),
            choice=choice,
            selected=self._selected,
            n_points=len(window),
            n_used=n_used,
            new_map=moved,
            n_without_tile=near.n_without_tile,
            n_evicted=near.n_evicted,
            far_is_active=self._far_is_active,
            stage_ms=clock.ms,
            nearby=around,
            prior=self._prior_report(),
        )

    def _by_default(
        self, window: Window, sensor: Points, clock: _Stages
    ) -> tuple[ZoneMap, ZoneMap, Choice, int, bool]:
        if window.frame != self._frame:
            self._lone = LoneReturns()
        points = self._without_outliers(window, sensor)
        clock.lap("outliers")
        near, far = self._maps_for(ZoneMap, window, lambda: points[:1])
        used = within(points, sensor, reach_m(self._parameters))
        with beside(self._other, self._chosen, window, _picked(points, used), far) as chosen:
            points = self._registered(points, used, sensor, near)
            self._contradictions(points, used, sensor, near)
        choice = chosen.result()
        clock.lap("registration")
        self._pin()
        stamp_s = window.end_ns * 1e-9
        with beside(self._other, far.take, points, sensor, stamp_s, near.tiles):
            moved = near.take(_picked(points, used), sensor, stamp_s)
        clock.lap("terrain")
        near.name(sensor)
        far.name(sensor)
        clock.lap("zones")
        if self._prior is not None:
            live, tiles = (near.terrain, far.terrain), near.tiles
            self._prior.take(points, sensor, window.frame, tiles.latest_s, live, tiles.datum_m)
            clock.lap("prior")
        return near, far, choice, int(used.sum()), moved

    def _by_the_sources(
        self, window: Window, sensor: Points, clock: _Stages
    ) -> tuple[SourceMap, SourceMap, Choice, int, bool]:
        """Run the SLZ paper's stages on one map; the time grows with the returns and the ground they hit."""
        near, far = self._maps_for(
            self._source_map, window, lambda: self._read(window, sensor, ANYWHERE).kept()[:1]
        )
        guess = far if self._far_is_active else near
        returns = self._read(window, sensor, guess.terrain.grid)
        clock.lap("outliers")
        choice = self._adapter.look_at_some(window, returns)
        active = far if choice.far else near
        if active is not guess:
            returns = self._read(window, sensor, active.terrain.grid)
        clock.lap("choice")
        outside = returns.first_outside() if self._follow else None
        if outside is not None:
            active.move(*outside)
            returns = self._read(window, sensor, active.terrain.grid)
        n_used = active.take(returns)
        clock.lap("terrain")
        near.find(sensor)
        far.find(sensor)
        clock.lap("zones")
        return near, far, choice, n_used, outside is not None and active is near

    def prepare(self) -> None:
        """Prefault memory for the next window; optional, for idle time.

        The system allocates a page on the first write to it, which may take longer than the computation. The
        next report does not depend on it.
        """
        for zone_map in (self._near, self._far):
            if zone_map is not None:
                zone_map.terrain.prepare()

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
        if self._near is not None and self._far is not None:
            self._selected = judge(point, self._near.terrain, self._far.terrain, self._parameters, None)

    @property
    def fills_contours(self) -> bool:
        """True in source mode: zones hold all cells inside their contour; else safe cells only."""
        return self._source

    def state(self, which: Literal["near", "far"], box: Box) -> NDArray[np.uint8]:
        """Return 0 unsafe, 1 safe, 255 unknown for a box of a map's grid; all unknown before any window."""
        zone_map = self._far if which == "far" else self._near
        return np.full(box.shape, UNKNOWN, np.uint8) if zone_map is None else zone_map.terrain.state(box)

    def maps(
        self,
        box: Box | None = None,
        which: Literal["near", "far", "active"] = "active",
        level: int | None = None,
    ) -> TerrainMaps | None:
        """Return copies of a map over a box of its grid, by default over all ground seen; None before any.

        Parameters
        ----------
        which
            The active map is the one whose zones the last report gave as `zones`.
        level
            Level of the resolution pyramid, by default the one in use; the finest is 0.
        """
        far = which == "far" or (which == "active" and self._far_is_active)
        zone_map = self._far if far else self._near
        if zone_map is None or self._frame is None:
            return None
        terrain = zone_map.terrain
        if level is not None and isinstance(terrain, EvidenceTerrain) and level != terrain.level:
            terrain = terrain.at_level(level)
        if box is None and terrain.seen.empty:
            return None
        box = terrain.seen if box is None else box
        return TerrainMaps(
            frame=self._frame,
            grid=terrain.grid,
            box=box,
            height_m=terrain.layer("height_m", box),
            slope_deg=terrain.layer("slope_deg", box),
            slope_sigma_deg=terrain.layer("slope_sigma_deg", box),
            roughness=terrain.layer("roughness", box),
            relief_m=terrain.layer("relief_m", box),
            certainty=terrain.layer("certainty", box),
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
        zone_map = self._far if which == "far" else self._near
        if zone_map is None:
            return None
        if anew:
            zone_map.terrain.touch_all()
        return take_drawn(zone_map.terrain, most, self._sensor)

    def _prior_report(self) -> MapReport | None:
        grid = None if self._prior is None else self._prior.grid
        return None if self._prior is None or grid is None else MapReport(grid, self._prior.zones)

    # ---- stages ---------------------------------------------------------------------------------

    def _without_outliers(self, window: Window, sensor_enu_m: Points) -> Points:
        """Return the finite points within `max_range_m` that no outlier rule drops."""
        p = self._parameters
        points = np.ascontiguousarray(window.points_enu_m)
        height_m, usable_as_they_are = are_usable(points, sensor_enu_m, p.max_range_m**2, MOST_HEIGHT_M)
        if not usable_as_they_are:
            points = usable(points, sensor_enu_m, p.max_range_m**2, MOST_HEIGHT_M)
            height_m = points[:, 2].copy()
        in_flight = is_known(sensor_enu_m)  # a stored cloud is assumed free of isolated noise
        keep = in_company(points, sensor_enu_m, p.cell_m) if in_flight else np.ones(len(points), bool)
        believed_m = height_m if keep.all() else heights_of(height_m, keep)
        strays = beyond(height_m, keep, *gap_interval(believed_m, p.outlier_gap_m))
        keep[strays] = in_a_group(points[strays], *(FLIGHT_GROUP if in_flight else CLOUD_GROUP))
        kept = picked(points, keep)
        if not in_flight:
            return kept
        again = self._lone.returning(picked(points, ~keep), sensor_enu_m, len(points))
        return np.vstack([kept, again]) if len(again) else kept

    def _read(self, window: Window, sensor_enu_m: Points, grid: Grid) -> Returns:
        """Place a window's returns in a grid and drop the outliers among them (SLZ paper, section 3.2.1)."""
        p = self._parameters
        self._returns.read(window.points_enu_m, sensor_enu_m, p.max_range_m, grid)
        self._returns.keep_heights(p.histogram_bins, p.histogram_threshold)
        return self._returns

    def _maps_for(self, kind: type[M], window: Window, first_point: Callable[[], Points]) -> tuple[M, M]:
        """Return the maps; a new frame starts new ones at the first point (SLZ paper, section 3.1.2)."""
        if isinstance(self._near, kind) and isinstance(self._far, kind) and window.frame == self._frame:
            return self._near, self._far
        if self._frame is not None:  # the selected point is in another frame
            self._selected = None
        self._frame = window.frame
        self._adapter = Adapter(self._parameters)
        centre = self._centre
        if centre is None:
            first = next(iter(first_point()), np.nan_to_num(window.sensor_enu_m, posinf=0, neginf=0))
            centre = float(first[0]), float(first[1])
        near, far = (kind(p, centre, self._numbers) for p in (self._parameters, self._far_parameters))
        self._near, self._far = near, far
        return near, far

    def _chosen(self, window: Window, points_enu_m: Points, far: ZoneMap) -> Choice:
        """Choose the next window and the far map's level, and set that level."""
        choice = self._adapter.look(window, points_enu_m)
        far.at_level(choice.level)
        return choice

    def _registered(self, points: Points, used: NDArray[np.bool_], sensor: Points, near: ZoneMap) -> Points:
        """Return the points in the near map's stored heights; the drift of the used ones moves its datum."""
        tiles, found = near.tiles, Offset()
        most_m = self._parameters.register_m
        if most_m > 0 and is_known(sensor):
            found = offset(points, np.flatnonzero(used), sensor, tiles, most_m)
        points = found.taken_out(points, sensor, tiles.datum_m)
        tiles.datum_m += found.up_m
        return points

    def _contradictions(self, points: Points, used: NDArray[np.bool_], sensor: Points, near: ZoneMap) -> None:
        """Also use points above known ground of the near map, at any range: they count at once."""
        terrain, least_m = near.terrain, self._parameters.relief_m
        if is_known(sensor):
            others = np.flatnonzero(~used)
            used[others] = terrain.tiles.contradicted_by(points[others], sensor, terrain.noise, least_m)

    def _judge_selected(self, near: AnyMap, far: AnyMap) -> SelectedPoint | None:
        if self._selected is None:
            return None
        point = judge(self._selected.enu_m, near.terrain, far.terrain, self._parameters, self._selected)
        zones: AnyMap | None = {"near": near, "far": far}.get(point.judged_by)
        return replace(point, zone_id=zones.zone_at(point.enu_m) if zones else None)

    def _pin(self) -> None:
        """Pin the evidence at the selected point, regardless of the memory budget."""
        enu_m = None if self._selected is None else self._selected.enu_m
        for zone_map in (self._near, self._far):
            if zone_map is not None and isinstance(zone_map.terrain, EvidenceTerrain):
                zone_map.terrain.pin(enu_m, self._parameters.touchdown_error_m)


def _picked(points: Points, which: NDArray[np.bool_]) -> Points:
    return points if which.all() else picked(points, which)


def within(points_enu_m: Points, sensor_enu_m: Points, reach_m: float) -> NDArray[np.bool_]:
    """Return which points are within a horizontal range of the sensor; all where its position is unknown."""
    if not is_known(sensor_enu_m[:2]):
        return np.ones(len(points_enu_m), bool)
    return within_reach(points_enu_m, sensor_enu_m, reach_m**2)


def reach_m(parameters: Parameters) -> float:
    """Return the horizontal distance from the sensor up to which returns are mapped (m).

    An error of a ray's direction moves its return up or down by that angle times the horizontal distance.
    Beyond the distance where this exceeds `height_noise_m`, noise alone would use up the relief limit; such
    ground stays unknown until the vehicle is nearer. The sources have no such rule.
    """
    p = parameters
    if p.mode == "source" or p.angle_noise_deg == 0:
        return p.max_range_m
    allowed = max(0.0, p.height_noise_m**2 - p.range_noise_m**2) ** 0.5
    return float(min(p.max_range_m, allowed / math.radians(p.angle_noise_deg)))


class _Stages:
    """Stopwatch for the milliseconds of every stage."""

    def __init__(self) -> None:
        self.ms: dict[str, float] = {}
        self._last = time.perf_counter()

    def lap(self, stage: str) -> None:
        now = time.perf_counter()
        self.ms[stage] = (now - self._last) * 1e3
        self._last = now
