"""World of the simulated vehicle: ground, solids, and movable objects."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, fields, replace
from itertools import pairwise
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray

from sitl.world.hits import MOVERS
from sitl.world.layer_cast import cast_layers, top_layers
from sitl.world.plant_motion import QUANTUM_S, Sway, Wash, swept
from sitl.world.primitives import ROW_LENGTH, Box, Ellipsoid, Ground, Kind, Solid
from sitl.world.raycast import cast_rays
from sitl.world.surface_layers import SurfaceLayers
from sitl.world.tables import GridTable, GroundTable, LayerTable, MoverTable, OpaqueTable, SolidTable
from sitl.world.topview import top_surface
from sitl.world.water_waves import WaterState
from sitl.world.wires import THIN_M, Wires

F64 = NDArray[np.float64]
U8 = NDArray[np.uint8]
I64 = NDArray[np.int64]

_MARGIN_M = 1e-6
Part = Box | Ellipsoid
PUDDLE_M = 0.05
"""Standing water up to this depth is a puddle, which a vehicle can stand in."""

CAR = (
    Box(0.0, 0.0, 0.0, 4.5, 1.8, 0.85, kind=Kind.CAR, name="body"),
    Box(-0.2, 0.0, 0.85, 2.3, 1.6, 0.6, kind=Kind.CAR, name="cabin"),
)
"""A car about its own origin, length along x, 4.5 x 1.8 x 1.45 m."""


@dataclass(frozen=True, slots=True)
class Mover:
    """Named movable object: its parts about its own origin, and its position and yaw.

    An `Ellipsoid` among the parts must be round about the vertical: it has no yaw.
    """

    name: str
    parts: tuple[Part, ...]
    x_m: float
    y_m: float
    z_m: float
    yaw_rad: float

    def placed(self) -> tuple[Part, ...]:
        """Return the parts in the world."""
        c, s = math.cos(self.yaw_rad), math.sin(self.yaw_rad)
        return tuple(
            _turned(
                replace(
                    part,
                    x_m=self.x_m + c * part.x_m - s * part.y_m,
                    y_m=self.y_m + s * part.x_m + c * part.y_m,
                    z_m=self.z_m + part.z_m,
                    name=f"{self.name}-{part.name}",
                ),
                self.yaw_rad,
            )
            for part in self.parts
        )


def _turned(part: Part, yaw_rad: float) -> Part:
    return replace(part, yaw_rad=part.yaw_rad + yaw_rad) if isinstance(part, Box) else part


@dataclass(frozen=True, slots=True)
class Crossings:
    """Surfaces that rays meet, in front and behind; arrays of one length.

    range_m, kind, cosine: of the first opaque surface, range NaN for none. water_m: range of the surface of
    standing water in front of it, NaN for none; an opaque ``Kind.WATER`` counts, its depth is inf. depth_m,
    bottom: depth of the water there, and material below it. leaf_m: (n, parts) range of the leaf that each
    part of the beam meets, NaN where it passes. plant: kind of the leaf. hit: the opaque
    surface, see ``hits``.
    """

    range_m: F64
    kind: U8
    cosine: F64
    water_m: F64
    depth_m: F64
    bottom: U8
    leaf_m: F64
    plant: U8
    hit: I64

    def of(self, rays: NDArray[np.bool_] | I64) -> Crossings:
        """Return the crossings of some of the rays."""
        return Crossings(*(getattr(self, f.name)[rays] for f in fields(self)))


class World:
    """Ground, fixed solids and movers, with exact ray casting and exact heights.

    Frame: ENU metres about the geodetic origin; z is relative to the origin's altitude. Yaw of objects is
    radians counter-clockwise from east.

    Parameters
    ----------
    ground
        The height field; its extent is the extent of the world.
    solids
        Fixed objects. Each must be within the extent of the ground.
    cell_m
        Size of the grid cells that list the solids.
    layers
        Standing water, plants and snow over the ground; None for none.
    water
        Wind and waves on all water.
    sways
        Swings of some of the solids, ellipsoids all, by their number. Beams with a time see such a crown
        where it is; everything else sees all that it sweeps, which `solids` holds.

    Attributes
    ----------
    wind_ms
        Wind that the crowns swing in.
    wash
        Downwash on the plants; None for none.

    Raises
    ------
    ValueError
        If a solid is partly outside the ground, the cell is smaller than the distance of the posts, or
        anything but an ellipsoid sways.
    """

    def __init__(
        self,
        ground: Ground,
        solids: Sequence[Solid] = (),
        cell_m: float = 4.0,
        *,
        layers: SurfaceLayers | None = None,
        water: WaterState | None = None,
        sways: Mapping[int, Sway] = MappingProxyType({}),
    ) -> None:
        if cell_m < ground.post_m:
            raise ValueError(f"world: cell_m {cell_m} is smaller than post_m {ground.post_m}")
        self.ground = ground
        self._crowns = {k: (_crown(solids[k]), sway) for k, sway in sways.items()}
        self.solids = tuple(
            swept(*self._crowns[k]) if k in self._crowns else solid for k, solid in enumerate(solids)
        )
        self.wind_ms = 3.0
        self.wash: Wash | None = None
        self.wires = Wires(self.solids)
        self.layers = layers
        self.water = water or WaterState()
        self._movers: dict[str, Mover] = {}
        self._ground_table: GroundTable = (
            np.ascontiguousarray(ground.z_m, dtype=np.float64),
            np.ascontiguousarray(ground.kind, dtype=np.uint8),
            np.array([ground.x0_m, ground.y0_m, ground.post_m]),
        )
        self._solid_table: SolidTable = _solid_table(self.solids)
        self._grid_table: GridTable = _grid_table(ground, self.solids, cell_m)
        self._mover_table: MoverTable = _mover_table(())
        self._layer_table: LayerTable | None = None if layers is None else layers.table(ground)
        special = np.isin(ground.kind, (Kind.WATER, Kind.WET_ASPHALT)).any()
        self._has_layers = layers is not None or bool(special)

    @property
    def has_layers(self) -> bool:
        """True if a beam may meet water, a wet surface, plants or snow: see `cross`."""
        return self._has_layers

    @property
    def extent_m(self) -> tuple[float, float, float, float]:
        """(x_min, y_min, x_max, y_max), ENU metres."""
        return self.ground.extent_m

    @property
    def movers(self) -> Mapping[str, Mover]:
        """Objects that can be moved, by name."""
        return MappingProxyType(self._movers)

    def add_car(self, name: str, x: float, y: float, yaw: float) -> None:
        """Put a car on the ground at (x, y), its length along yaw (radians counter-clockwise from east)."""
        self.add_mover(name, CAR, x, y, yaw)

    def add_mover(self, name: str, parts: Sequence[Part], x: float, y: float, yaw: float) -> None:
        """Put a movable object on the ground at (x, y).

        Raises
        ------
        ValueError
            If the name is taken or (x, y) is outside the world.
        """
        if name in self._movers:
            raise ValueError(f"world: a mover named {name!r} exists; use move() to move it")
        self._movers[name] = Mover(name, tuple(parts), x, y, self._standing_m(name, x, y), yaw)
        self._place_movers()

    def move(self, name: str, x: float, y: float, yaw: float, over_m: float = 0.0) -> None:
        """Move an object onto the fixed surface at (x, y), or to a height over it.

        Raises
        ------
        KeyError
            If there is no mover of that name.
        ValueError
            If (x, y) is outside the world.
        """
        z = self._standing_m(name, x, y) + over_m
        self._movers[name] = replace(self._movers[name], x_m=x, y_m=y, z_m=z, yaw_rad=yaw)
        self._place_movers()

    def remove(self, name: str) -> None:
        """Remove a mover from the world; KeyError if there is none of that name."""
        del self._movers[name]
        self._place_movers()

    def mover_of(self, hit: int) -> str | None:
        """Return the name of the mover that a code of ``hits`` stands for; None for anything else."""
        parts = [mover.name for mover in self._movers.values() for _ in mover.parts]
        return parts[hit - MOVERS] if 0 <= hit - MOVERS < len(parts) else None

    def height_m(self, x: float, y: float) -> float:
        """Return the height of the top surface at one place, NaN outside the world."""
        z, _ = self.surface(np.array([x], dtype=np.float64), np.array([y], dtype=np.float64))
        return float(z[0])

    def height_below_m(self, x: float, y: float, z: float) -> float:
        """Return the height of the highest surface below a point, NaN outside the world.

        That is the top surface unless something hangs over the point; of the ground, a point below counts as
        on it.
        """
        top = self.height_m(x, y)
        if not top > z:
            return top
        down = np.array([[0.0, 0.0, -1.0]])
        met = self.cross(np.array([[x, y, z]]), down, math.inf, np.zeros((1, 1)))
        first = np.array([met.range_m[0], met.water_m[0], met.leaf_m[0, 0]])
        return z - float(np.nanmin(first)) if np.isfinite(first).any() else top

    def highest_about_m(self, x: float, y: float, radius_m: float) -> float:
        """Return a height that nothing solid within a distance exceeds; -inf outside the world."""
        (cell_m, _, _), _, any_top, _, _ = self._grid_table
        x0, y0, _ = self._ground_table[2]
        rows, cols = (
            slice(
                max(0, math.floor((m - radius_m - m0) / cell_m)),
                max(0, math.floor((m + radius_m - m0) / cell_m) + 1),
            )
            for m, m0 in ((y, y0), (x, x0))
        )
        highest_m, spheres = float(any_top[rows, cols].max(initial=-math.inf)), self._mover_table[3]
        if not len(spheres):  # asked at each tick
            return highest_m
        near = np.hypot(spheres[:, 0] - x, spheres[:, 1] - y) <= radius_m + spheres[:, 3]
        tops = spheres[near, 2] + spheres[near, 3]
        return max(highest_m, float(tops.max(initial=-math.inf)))

    def surface(self, xs: F64, ys: F64) -> tuple[F64, U8]:
        """Return the exact height and material seen from straight above.

        Parameters
        ----------
        xs, ys
            ENU positions, any equal shape.

        Returns
        -------
        z, kind
            Same shape; NaN and ``Kind.NOTHING`` outside the world. Over plants these are their top and kind,
            over water its level and ``Kind.WATER``, or ``Kind.PUDDLE`` up to `PUDDLE_M` deep.
        """
        return self._surface(xs, ys, self._mover_table)

    def cast(self, origins_enu_m: F64, directions_enu: F64, max_range_m: float) -> tuple[F64, U8]:
        """Cast rays, each from its own origin.

        Parameters
        ----------
        origins_enu_m, directions_enu
            (n, 3); directions are unit vectors.
        max_range_m
            Greatest range of a hit.

        Returns
        -------
        range_m, kind
            (n,) f64, NaN without a return, and (n,) u8 ``Kind``. Water stops a ray without a return: NaN with
            ``Kind.WATER``.
        """
        range_m, kind, _ = self.trace(origins_enu_m, directions_enu, max_range_m)
        return range_m, kind

    def trace(
        self, origins_enu_m: F64, directions_enu: F64, max_range_m: float, *, thin_wires: bool = True
    ) -> tuple[F64, U8, F64]:
        """Cast rays like ``cast`` and also return the cosine of each angle of incidence.

        Layers are opaque here: a ray ends at the tops of plants.
        """
        whole = np.zeros((len(origins_enu_m), 1))
        c = self.cross(origins_enu_m, directions_enu, max_range_m, whole, thin_wires=thin_wires)
        wet, leaf = np.isfinite(c.water_m), np.isfinite(c.leaf_m[:, 0])
        range_m = np.where(leaf, c.leaf_m[:, 0], np.where(wet, np.nan, c.range_m))
        kind = np.where(leaf, c.plant, np.where(wet, np.uint8(Kind.WATER), c.kind))
        slant = np.abs(np.asarray(directions_enu, dtype=np.float64)[:, 2])
        return range_m, kind, np.where(leaf, slant, np.where(wet, 0.0, c.cosine))

    def cross(
        self,
        origins_enu_m: F64,
        directions_enu: F64,
        max_range_m: float,
        leaf_depths: F64,
        *,
        thin_wires: bool = True,
        time_s: F64 | None = None,
    ) -> Crossings:
        """Cast rays through water, plants and snow.

        Parameters
        ----------
        origins_enu_m, directions_enu, max_range_m
            As in ``cast``.
        leaf_depths
            (n, parts) optical depths at which each part of a beam meets a leaf: draws from the exponential
            distribution.
        thin_wires
            Whether `wires` are solids; not to beams, which see them by their share of a footprint.
        time_s
            (n,) times of beams, for plants that move; None for all that they sweep.
        """
        origins = np.ascontiguousarray(origins_enu_m, dtype=np.float64)
        directions = np.ascontiguousarray(directions_enu, dtype=np.float64)
        if origins.ndim != 2 or origins.shape[1] != 3 or origins.shape != directions.shape:
            raise ValueError(f"cast: need two (n, 3) arrays, got {origins.shape} and {directions.shape}")
        count = len(origins)
        range_m, cosine, kind = np.empty(count), np.empty(count), np.empty(count, dtype=np.uint8)
        hit, thin_m = np.empty(count, np.int64), -1.0 if thin_wires else THIN_M
        rays, limit = (origins, directions), float(max_range_m)
        for cut, tables in self.opaque(time_s, count):
            found = range_m[cut], kind[cut], cosine[cut], hit[cut]
            cast_rays(tables, origins[cut], directions[cut], limit, thin_m, *found)
        water_m, depth_m = np.full(count, np.nan), np.zeros(count)
        bottom, plant = np.zeros(count, np.uint8), np.zeros(count, np.uint8)
        leaf_m = np.full(leaf_depths.shape, np.nan)
        if self._layer_table is not None:
            layers = (self._ground_table, self._layer_table)
            depths = np.ascontiguousarray(leaf_depths, dtype=np.float64)
            cast_layers(*layers, *rays, range_m, limit, depths, water_m, depth_m, bottom, leaf_m, plant)
            if self.wash is not None and time_s is not None:
                leaf_m = self.wash.pressed_m(leaf_m, range_m, origins, directions, time_s)
        opaque = (kind == np.uint8(Kind.WATER)) & np.isnan(water_m)
        water_m[opaque], depth_m[opaque] = range_m[opaque], np.inf
        return Crossings(range_m, kind, cosine, water_m, depth_m, bottom, leaf_m, plant, hit)

    def opaque(self, time_s: F64 | None, count: int) -> Iterator[tuple[slice, OpaqueTable]]:
        """Yield stretches of `count` beams, and the tables of all that stops them in that time.

        `time_s` are their times, (n,), which let crowns sway; None for all that these sweep.
        """
        ground, grid, movers = self._ground_table, self._grid_table, self._mover_table
        if time_s is None or not self._crowns:
            yield slice(count), (ground, self._solid_table, grid, movers)
            return
        steps = np.floor(time_s / QUANTUM_S)
        ends = [0, *(np.flatnonzero(np.diff(steps)) + 1).tolist(), count]
        for begin, end in pairwise(ends) if count else ():
            solids = self._swayed((steps[begin] + 0.5) * QUANTUM_S)
            yield slice(begin, end), (ground, solids, grid, movers)

    def _swayed(self, time_s: float) -> SolidTable:
        shape, rows, kind = self._solid_table
        rows = rows.copy()
        for k, (crown, sway) in self._crowns.items():
            rows[k] = crown.row()[1]
            rows[k, :2] += sway.offset_m(time_s, self.wind_ms)
        return shape, rows, kind

    def _surface(self, xs: F64, ys: F64, movers: MoverTable) -> tuple[F64, U8]:
        x, y = np.broadcast_arrays(np.asarray(xs, dtype=np.float64), np.asarray(ys, dtype=np.float64))
        z, kind = np.empty(x.size), np.empty(x.size, dtype=np.uint8)
        tables = (self._ground_table, self._solid_table, self._grid_table, movers)
        places = (np.ascontiguousarray(x.ravel()), np.ascontiguousarray(y.ravel()))
        top_surface(*tables, *places, z, kind)
        if self._layer_table is not None:
            layers = (self._ground_table, self._layer_table)
            top_layers(*layers, *places, int(Kind.WATER), int(Kind.PUDDLE), PUDDLE_M, z, kind)
        return z.reshape(x.shape), kind.reshape(x.shape)

    def _standing_m(self, name: str, x: float, y: float) -> float:
        z, _ = self._surface(np.array([x]), np.array([y]), _mover_table(()))
        if not math.isfinite(z[0]):
            raise ValueError(f"world: {name!r} at ({x}, {y}) is outside the extent {self.extent_m}")
        return float(z[0])

    def _place_movers(self) -> None:
        self._mover_table = _mover_table([p for m in self._movers.values() for p in m.placed()])


def _crown(solid: Solid) -> Ellipsoid:
    if not isinstance(solid, Ellipsoid):
        raise ValueError(f"world: {solid.name!r} cannot sway, only an ellipsoid can")
    return solid


def _solid_table(solids: Sequence[Solid]) -> SolidTable:
    rows = [solid.row() for solid in solids]
    shape = np.array([s for s, _ in rows], dtype=np.uint8)
    table = np.array([r for _, r in rows], dtype=np.float64).reshape(len(rows), ROW_LENGTH)
    kind = np.array([solid.kind for solid in solids], dtype=np.uint8)
    return shape, table, kind


def _mover_table(solids: Sequence[Solid]) -> MoverTable:
    bounds = np.array([solid.bounds() for solid in solids], dtype=np.float64).reshape(-1, 6)
    centre = (bounds[:, :3] + bounds[:, 3:]) / 2
    radius = np.linalg.norm(bounds[:, 3:] - centre, axis=1) + _MARGIN_M
    return (*_solid_table(solids), np.ascontiguousarray(np.column_stack([centre, radius])))


def _grid_table(ground: Ground, solids: Sequence[Solid], cell_m: float) -> GridTable:
    """Return the grid: solids of each cell, and its highest ground and object."""
    x0, y0, x1, y1 = ground.extent_m
    columns, rows = math.ceil((x1 - x0) / cell_m), math.ceil((y1 - y0) / cell_m)
    ground_top = _ground_top(ground, rows, columns, cell_m)
    any_top = ground_top.copy()
    listed: list[list[int]] = [[] for _ in range(rows * columns)]
    for index, solid in enumerate(solids):
        a, b, _, c, d, top = solid.bounds()
        if a < x0 or b < y0 or c > x1 or d > y1:
            raise ValueError(f"world: {solid.name!r} reaches beyond the ground {ground.extent_m}")
        i0, i1 = int((a - x0 - _MARGIN_M) // cell_m), int((c - x0 + _MARGIN_M) // cell_m)
        j0, j1 = int((b - y0 - _MARGIN_M) // cell_m), int((d - y0 + _MARGIN_M) // cell_m)
        for j in range(max(j0, 0), min(j1, rows - 1) + 1):
            for i in range(max(i0, 0), min(i1, columns - 1) + 1):
                listed[j * columns + i].append(index)
                any_top[j, i] = max(any_top[j, i], top + _MARGIN_M)
    start = np.zeros(rows * columns + 1, dtype=np.int32)
    start[1:] = np.cumsum([len(items) for items in listed])
    items = np.array([item for cell in listed for item in cell], dtype=np.int32)
    floor = min(float(ground.z_m.min()), min((s.bounds()[2] for s in solids), default=math.inf)) - 1.0
    return np.array([cell_m, floor, float(any_top.max())]), ground_top, any_top, start, items


def _ground_top(ground: Ground, rows: int, columns: int, cell_m: float) -> F64:
    top = np.empty((rows, columns))
    posts_y, posts_x = ground.z_m.shape
    for j in range(rows):
        # One post to either side, because a cell edge may cut a square.
        j0 = max(math.floor(j * cell_m / ground.post_m), 0)
        j1 = min(math.ceil((j + 1) * cell_m / ground.post_m), posts_y - 1)
        band = ground.z_m[j0 : j1 + 1].max(axis=0)
        for i in range(columns):
            i0 = max(math.floor(i * cell_m / ground.post_m), 0)
            i1 = min(math.ceil((i + 1) * cell_m / ground.post_m), posts_x - 1)
            top[j, i] = band[i0 : i1 + 1].max() + _MARGIN_M
    return top
