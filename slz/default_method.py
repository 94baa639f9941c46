"""Default method: evidence of all windows and plane fits, with allowance for errors of ranges and poses."""

from __future__ import annotations

import math
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from itertools import product

import numpy as np
from numpy.typing import NDArray

from params import Parameters
from slz.adaptive import COARSEST, Adapter, Choice
from slz.air.seen_air import SeenAir
from slz.concurrency import run_concurrently
from slz.frame import is_known
from slz.grid import Edges
from slz.kernels.points.range_gate import are_usable, beyond, heights_of, picked, usable
from slz.landing_point.corridors import Corridors, corridors
from slz.landing_point.judgement import SelectedPoint, unknown
from slz.landing_point.watched_ground import WatchedGround, watched_ground
from slz.map_pair import MapPair
from slz.method import MethodResult
from slz.points.mapping_reach import reach_m, within
from slz.points.outliers import (
    CLOUD_GROUP,
    FLIGHT_GROUP,
    gap_interval,
    in_cluster,
    is_dense_at,
    not_isolated,
)
from slz.points.registration import Offset, offset
from slz.points.solid_ground import NOTHING, most_spread_m, solid_ground
from slz.points.sway import sway
from slz.prior import Prior
from slz.prior import Source as PriorSource
from slz.report import MapReport
from slz.stage_clock import StageClock
from slz.surface.surface_map import NO_SIGNAL, Signal, SurfaceMap
from slz.terrain.arrivals import AROUND_M, FEET_M, Arrivals
from slz.window import Window
from slz.wires.wire_detector import WireDetector
from slz.wires.wire_marks import WireMarks
from slz.zones.zone_map import ZoneMap

Points = NDArray[np.float64]
Flags = NDArray[np.bool_]
MOST_HEIGHT_M = 100_000.0  # nothing on the ground is higher or deeper
NONE = np.empty(0, np.int64)
MOST_INTENSITY = 1000.0  # in parts of a white target; beyond it is no measurement, even of a mirror
FEWEST_INTENSITIES = 20  # of a window, among which one that never changes is none
THIN_REACH = 1.2  # of the mapping reach, up to which isolated returns are judged


@dataclass(frozen=True, slots=True)
class KeptPoints:
    """Points that no outlier rule drops.

    points: (n, 3). alone: (n,), those that are not for the near map. isolated: (m, 3), judged together with
    those of other windows. source, isolated_source: (n,) and (m,) indices in the window; source is None where
    it tells nothing more of them. distant, distant_source: (k, 3) and (k,) isolated ones too far to be
    judged, which may be of wires.
    """

    points: Points
    alone: Flags
    isolated: Points
    source: NDArray[np.int64] | None
    isolated_source: NDArray[np.int64]
    distant: Points
    distant_source: NDArray[np.int64]


class DefaultMethod:
    """Safer rules than the sources'; see `docs/sources.md` for each departure.

    Parameters
    ----------
    centre_enu_m
        East and north of the first window's centre; None takes the first point.
    threads
        With 2 the far map is derived beside the near one; the results are the same.
    prior
        Gives ground surveyed before the flight, see `slz.prior`.
    """

    fills_contours = False

    def __init__(
        self,
        parameters: Parameters,
        centre_enu_m: tuple[float, float] | None,
        threads: int,
        prior: PriorSource | None,
    ) -> None:
        self._p = parameters
        self._other = ThreadPoolExecutor(1, "slz-far-map") if threads == 2 else None
        self._pair = MapPair(
            lambda centre, numbers: ZoneMap(self._p, centre, numbers),
            lambda centre, numbers: ZoneMap(far_parameters(self._p), centre, numbers),
            centre_enu_m,
        )
        self._adapter = Adapter(parameters)
        self._surface = SurfaceMap(0.0, 0.0, parameters)
        self._arrivals = Arrivals(0.0, 0.0, parameters)
        self.air = SeenAir(parameters)
        self._wires, self._marks = WireDetector(parameters, self.air), WireMarks()
        self.prior = None if prior is None else Prior(prior, parameters)

    @property
    def maps(self) -> tuple[ZoneMap, ZoneMap] | None:
        """Near and far map, None before the first window."""
        return self._pair.maps

    def use(self, parameters: Parameters) -> None:
        """Use other parameters that shape no map from the next window on."""
        self._p = parameters
        if self.maps is not None:
            near, far = self.maps
            near.use(parameters)
            far.use(far_parameters(parameters))
        if self.prior is not None:
            self.prior.use(parameters)

    def process(
        self, window: Window, sensor_enu_m: Points, selected: SelectedPoint | None, clock: StageClock
    ) -> MethodResult:
        """Run outlier removal, registration, terrain and zones on a window."""
        new_frame = self._pair.is_new(window)
        if new_frame:
            self._adapter = Adapter(self._p)
        kept = self._without_outliers(window, sensor_enu_m)
        points, alone = kept.points, kept.alone
        clock.lap("outliers")
        near, far = self._pair.create_maps(window, lambda: points[:1]) if new_frame else self._pair.maps_now
        if new_frame:
            self._surface = SurfaceMap(near.tiles.west_m, near.tiles.south_m, self._p)
            near.terrain.surface = far.terrain.surface = self._surface
            self._arrivals = Arrivals(near.tiles.west_m, near.tiles.south_m, self._p)
            near.terrain.arrivals = far.terrain.arrivals = self._arrivals
            self.air = SeenAir(self._p)
            self._wires, self._marks = WireDetector(self._p, self.air), WireMarks()
        near_ones = within(points, sensor_enu_m, reach_m(self._p))
        trusted = near_ones & ~alone
        with run_concurrently(self._other, self._chosen, window, _picked(points, near_ones), far) as chosen:
            points, isolated, distant = self._registered(kept, near_ones, sensor_enu_m, near, window)
            raised = self._raised(points, alone, sensor_enu_m, near)
            self._follow_rays(points, window, kept, near)
        choice = chosen.result()
        clock.lap("registration")
        pinned = None if selected is None else selected.enu_m
        for zone_map in (near, far):
            zone_map.terrain.pin(pinned, self._p.touchdown_error_m)
        stamp_s = window.end_ns * 1e-9
        with run_concurrently(
            self._other, self._surface_of, points, trusted, sensor_enu_m, near, stamp_s, window, kept
        ) as surface:
            ground, judged, settled = self._without_arrivals(
                points, raised, isolated, sensor_enu_m, window, kept, near
            )
            clock.lap("arrivals")
            altered = self._find_wires(points, isolated, distant, kept, sensor_enu_m, near, far, window)
            clock.lap("wires")
        altered += surface.result()
        clock.lap("surface")
        of_near, of_far = (_picked(points, which) for which in (ground & (trusted | raised), ground))
        if len(settled):
            of_near, of_far = (np.concatenate([some, settled]) for some in (of_near, of_far))
        isolated = _picked(isolated, judged)
        with run_concurrently(
            self._other, far.add_points, of_far, sensor_enu_m, stamp_s, None, near.tiles, math.inf, altered
        ):
            near.add_points(of_near, sensor_enu_m, stamp_s, isolated, None, reach_m(self._p), altered)
        clock.lap("terrain")
        near.identify(sensor_enu_m)
        far.identify(sensor_enu_m)
        clock.lap("zones")
        near.judge_ways(self._corridors_of(near, far))
        clock.lap("corridors")
        if self.prior is not None:
            live, tiles = (near.terrain, far.terrain), near.tiles
            self.prior.update(points, sensor_enu_m, window.frame, tiles.latest_s, live, tiles.datum_m)
            clock.lap("prior")
        wires = self._wires.wires(near.tiles.datum_m)
        return MethodResult(near, far, choice, int((trusted | raised).sum()), wires)

    def without_map(self, enu_m: Points, before: SelectedPoint | None) -> SelectedPoint:
        """Return an unknown point: evidence that neither map has is too old, or was given up."""
        return unknown(enu_m, math.nan if before is None else before.height_m)

    def corridors(self, enu_m: Points) -> Corridors | None:
        """Return the ways in and out of a point (3,)."""
        if self.maps is None:
            return None
        return self._corridors_of(*self.maps)(enu_m)

    def watched_ground(self, enu_m: Points) -> WatchedGround | None:
        """Return the near map's ground at a point (3,), None before any window."""
        return None if self.maps is None else watched_ground(enu_m, self.maps[0].terrain, self._p)

    def far_is_active(self, choice: Choice) -> bool:
        """Return False: zones of the far map are places to look closer at."""
        return False

    def prior_report(self) -> MapReport | None:
        """Return the zones of ground surveyed before the flight, None without."""
        grid = None if self.prior is None else self.prior.grid
        return None if self.prior is None or grid is None else MapReport(grid, self.prior.zones)

    # ---- stages ---------------------------------------------------------------------------------

    def _without_outliers(self, window: Window, sensor_enu_m: Points) -> KeptPoints:
        """Return the finite points within `max_range_m` that no outlier rule drops, and the isolated ones.

        The near map judges the isolated ones together with those of other windows. Where most points are
        isolated, the far map takes them all; the second result marks those that are not for the near map.
        """
        p = self._p
        points = np.ascontiguousarray(window.points_enu_m)
        height_m, usable_as_they_are = are_usable(points, sensor_enu_m, p.max_range_m**2, MOST_HEIGHT_M)
        source = None if window.origin is None else np.arange(len(points))
        if not usable_as_they_are:
            if source is not None:
                source = source[_usable(points, sensor_enu_m, p.max_range_m**2)]
            points = usable(points, sensor_enu_m, p.max_range_m**2, MOST_HEIGHT_M)
            height_m = points[:, 2].copy()
        in_flight = is_known(sensor_enu_m)  # a stored cloud was cleaned by who made it
        keep = not_isolated(points, sensor_enu_m, p.cell_m) if in_flight else np.ones(len(points), bool)
        believed_m = height_m if keep.all() else heights_of(height_m, keep)
        strays = beyond(height_m, keep, *gap_interval(believed_m, p.outlier_gap_m))
        keep[strays] = in_cluster(points[strays], *(FLIGHT_GROUP if in_flight else CLOUD_GROUP))
        kept = picked(points, keep)
        if not in_flight:
            source = None if source is None else source[keep]
            none = np.empty((0, 3))
            return KeptPoints(kept, np.zeros(len(kept), bool), none, source, NONE, none, NONE)
        isolated = picked(points, ~keep)
        mostly = len(isolated) > len(kept)
        dense = is_dense_at(isolated, sensor_enu_m, len(points))
        judged = within(isolated, sensor_enu_m, THIN_REACH * reach_m(p)) & ~dense
        far_off = ~(judged | dense)
        distant, isolated = picked(isolated, far_off), picked(isolated, judged)
        of_isolated, of_distant = (
            (NONE, NONE) if source is None else (source[~keep][judged], source[~keep][far_off])
        )
        if mostly:
            return KeptPoints(points.copy(), ~keep, isolated, source, of_isolated, distant, of_distant)
        source, alone = None if source is None else source[keep], np.zeros(len(kept), bool)
        return KeptPoints(kept, alone, isolated, source, of_isolated, distant, of_distant)

    def _surface_of(
        self,
        points: Points,
        trusted: Flags,
        sensor: Points,
        near: ZoneMap,
        stamp_s: float,
        window: Window,
        kept: KeptPoints,
    ) -> list[Edges]:
        """Add points to the surface map; return the edges of the places where it refuses other cells."""
        datum_m = np.array([0.0, 0.0, near.tiles.datum_m])
        signal = _signal(window, kept.source, datum_m)
        now_s = near.tiles.now_s(stamp_s)
        grid = near.terrain.grid
        edges = grid.west_m, grid.south_m, grid.east_m, grid.north_m
        return self._surface.update(points, trusted, sensor - datum_m, now_s, signal, edges)

    def _follow_rays(self, points: Points, window: Window, kept: KeptPoints, near: ZoneMap) -> None:
        """Add to the seen air what the rays of the points passed, if the sensor's place is known."""
        origin, origins = window.origin, window.origins_enu_m
        if origin is None or origins is None or kept.source is None:
            return
        self.air.add(points, origin[kept.source], origins, near.tiles.datum_m)

    def _find_wires(
        self,
        points: Points,
        isolated: Points,
        distant: Points,
        kept: KeptPoints,
        sensor: Points,
        near: ZoneMap,
        far: ZoneMap,
        window: Window,
    ) -> list[Edges]:
        """Seek wires in all returns, and mark them on both maps; return the edges of places that change."""
        datum_m = np.array([0.0, 0.0, near.tiles.datum_m])
        parts, source = [points, isolated, distant], kept.source
        if kept.alone.any():  # then the isolated ones are among the points
            parts = [points]
        together, rays = np.concatenate(parts), None
        origins = window.thin_origins_enu_m
        if source is not None and window.origin is not None and origins is not None:
            sources = [source, kept.isolated_source, kept.distant_source][: len(parts)]
            rays = window.origin[np.concatenate(sources)], origins - datum_m
        stamp_ns = window.end_ns
        self._wires.update(together, sensor - datum_m, near.tiles.latest_s, stamp_ns, rays)
        altered = self._marks.update(self._wires.wires(0.0))
        near.terrain.wires_m = far.terrain.wires_m = self._marks.points_m
        return altered

    def _corridors_of(self, near: ZoneMap, far: ZoneMap) -> Callable[[Points], Corridors]:
        """Return what judges the ways in and out of a point (3,)."""
        wires = self._marks.points_m + np.array([0.0, 0.0, near.tiles.datum_m])
        return lambda enu_m: corridors(enu_m, near.terrain, far.terrain, self.air, self._p, wires)

    def _chosen(self, window: Window, points_enu_m: Points, far: ZoneMap) -> Choice:
        """Choose the next window and the far map's level, and set that level."""
        choice = self._adapter.choose(window, points_enu_m)
        far.at_level(choice.level)
        return choice

    def _registered(
        self, kept: KeptPoints, used: Flags, sensor: Points, near: ZoneMap, window: Window
    ) -> tuple[Points, Points, Points]:
        """Return points, isolated and distant points in the near map's stored heights.

        The drift of the used points moves its datum.
        """
        p, tiles, which = self._p, near.tiles, np.flatnonzero(used)
        registers = p.register_m > 0 and is_known(sensor)
        ground, found = NOTHING, Offset()
        if registers:
            ground = solid_ground(kept.points, which, sensor, tiles, near.terrain.noise, most_spread_m(p))
            found = offset(ground, sensor, p.register_m)
        points = found.removed_from(kept.points, sensor, tiles.datum_m)
        isolated = found.removed_from(kept.isolated, sensor, tiles.datum_m)
        distant = found.removed_from(kept.distant, sensor, tiles.datum_m)
        tiles.datum_m += found.up_m
        if not registers or window.origin is None or window.origins_enu_m is None or kept.source is None:
            return points, isolated, distant
        scan, of_isolated = window.origin[kept.source], window.origin[kept.isolated_source]
        swayed = sway(points, which, scan, window.origins_enu_m, tiles, ground)
        distant = swayed.removed_from(distant, window.origin[kept.distant_source])
        return swayed.removed_from(points, scan), swayed.removed_from(isolated, of_isolated), distant

    def _raised(self, points: Points, alone: Flags, sensor: Points, near: ZoneMap) -> Flags:
        """Return which points are above known ground of the near map, at any range: they count at once."""
        raised = np.zeros(len(points), bool)
        if is_known(sensor):
            raised[~alone] = self._are_above(_picked(points, ~alone), sensor, near)
        return raised

    def _are_above(
        self, points: Points, sensor: Points, near: ZoneMap, least_m: float | None = None
    ) -> Flags:
        """Return which points are higher over known ground of the near map than noise and a height explain.

        By default that of what stands on ground: `relief_m`.
        """
        terrain, least_m = near.terrain, self._p.relief_m if least_m is None else least_m
        return terrain.tiles.contradicted_by(points, sensor, terrain.noise, least_m)

    def _stands_free(self, points: Points, raised: Flags, sensor: Points, near: ZoneMap) -> Flags:
        """Return which of the raised points have known and lower ground on all sides: others are of walls."""
        free, side_m = raised.copy(), max(AROUND_M, self._p.cell_m)
        for north, east in product((-side_m, 0.0, side_m), repeat=2):
            some = np.flatnonzero(free)
            free[some] = self._are_above(points[some] + (east, north, 0.0), sensor, near)
        return free

    def _without_arrivals(
        self,
        points: Points,
        raised: Flags,
        isolated: Points,
        sensor: Points,
        window: Window,
        kept: KeptPoints,
        near: ZoneMap,
    ) -> tuple[Flags, Flags, Points]:
        """Return which points and isolated points are not of arrivals, and those that are evidence after all.

        Nothing is an arrival where the sensor's places, and so the rays, are unknown. Returns of a sensor
        without thin rays are none either: these could not prove that it has gone.
        """
        origin, origins, n = window.origin, window.thin_origins_enu_m, len(points)
        everything = np.ones(n, bool), np.ones(len(isolated), bool), np.empty((0, 3))
        if origin is None or origins is None or kept.source is None or not is_known(sensor):
            return everything
        thin = ~np.isnan(origins[:, 0])
        if not (raised.any() or len(self._arrivals) or len(self._arrivals.altered_enu_m)):
            return everything
        free, above = self._stands_free(points, raised, sensor, near), self._are_above(isolated, sensor, near)
        scan = np.concatenate([origin[kept.source], origin[kept.isolated_source]])
        order = np.argsort(scan, kind="stable")
        together, stands = np.concatenate([points, isolated]), np.concatenate([free, above]) & thin[scan]
        over = self._are_above(together, sensor, near, FEET_M)
        apart = np.empty(len(order), bool)
        apart[order], settled = self._arrivals.update(
            together[order],
            stands[order],
            over[order],
            order >= n,
            scan[order],
            origins - (0.0, 0.0, near.tiles.datum_m),
            sensor,
            near.tiles.now_s(window.end_ns * 1e-9),
        )
        # At their feet, ground that was never seen before stays evidence.
        feet = apart & ~(stands | over)
        seen = np.zeros(len(feet), bool)
        seen[np.flatnonzero(feet)[near.tiles.differences(together[feet])[:, 3].astype(np.int64)]] = True
        apart &= stands | over | seen
        return ~apart[:n], ~apart[n:], settled


def _signal(window: Window, source: NDArray[np.int64] | None, datum_m: Points) -> Signal:
    """Return what a window's points tell besides their place; source: (n,) their indices in the window."""
    if window.origin is None or window.origins_enu_m is None or source is None:
        return NO_SIGNAL
    origin, origins = window.origin[source], window.origins_enu_m - datum_m
    attributes = window.attributes
    if attributes is None:
        return replace(NO_SIGNAL, origin=origin, origins_enu_m=origins)
    return Signal(
        origin,
        origins,
        _believable(attributes.intensity[source]),
        attributes.echoes[source],
        attributes.lost_enu_m - datum_m,
        attributes.lost_origin_enu_m - datum_m,
        attributes.lost_weight,
    )


def _believable(intensity: NDArray[np.float32]) -> NDArray[np.float32]:
    """Return intensities (n,), NaN where out of range; and all NaN where they are one constant."""
    with np.errstate(invalid="ignore"):
        good = (intensity >= 0) & (intensity <= MOST_INTENSITY)
    some = intensity[good]
    if len(some) < FEWEST_INTENSITIES or some.min() == some.max():
        return np.full(len(intensity), np.nan, np.float32)
    return intensity if good.all() else np.where(good, intensity, np.float32(np.nan))


def _usable(points: Points, sensor_enu_m: Points, reach2: float) -> Flags:
    """Return the mask of the points that `usable` returns."""
    with np.errstate(invalid="ignore"):
        way = points[:, :2] - sensor_enu_m[:2]
        beyond = np.einsum("ij,ij->i", way, way) > reach2
        return np.asarray(~beyond & (np.abs(points[:, 2]) < MOST_HEIGHT_M) & np.isfinite(points).all(axis=1))


def _picked(points: Points, which: NDArray[np.bool_]) -> Points:
    return points if which.all() else picked(points, which)


def far_parameters(parameters: Parameters) -> Parameters:
    """Return the parameters of the far map.

    The evidence has cells a quarter of `far_cell_m` wide, from which coarser levels are derived; a footprint
    spans three cells at least, gaps of a cell count as seen, the limit on a zone's boundary follows the cell,
    and neither gear nor rotor, tail and D are judged, so that the far map finds where it is worth looking
    closer. What it calls safe is no place to land before the near map says so too.
    """
    p = parameters
    cell_m = max(p.far_cell_m / 2**COARSEST, p.cell_m)
    return p.model_copy(
        update={
            "cell_m": cell_m,
            "coverage_m": max(p.coverage_m, p.far_cell_m),
            "min_square_m": max(p.min_square_m, p.far_cell_m),
            "min_boundary_points": max(1, int(p.min_boundary_points * p.cell_m / cell_m)),
            "height_noise_m": 2 * p.height_noise_m,
            "gear": "none",
            "rotor_diameter_m": 0.0,
            "tail_length_m": 0.0,
            "d_value_m": 0.0,
            "memory_mb": p.memory_mb / 8,
        }
    )
