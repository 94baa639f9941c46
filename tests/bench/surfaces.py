"""What the surface layer tells over the simulator's scenes: water, car parks, roofs, plants, reliability.

    python -m tests.bench.surfaces [--heights 10 20 40] [--sensors mid360 vlp16 os0] [--seeds 1]

The vehicle flies a straight line to the middle of a region at a constant height and hovers there. Poses are
exact, the sensors' noise and lost rays are the simulator's. Truth is the exact world. Prints Markdown.
"""

from __future__ import annotations

import argparse
import itertools
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

import params
from sitl import scenes
from sitl.scenes import Scene
from sitl.sensors.mid360 import Mid360
from sitl.sensors.ouster_os1 import OS0, Ouster
from sitl.sensors.pulse_lidar import PulseLidar
from sitl.sensors.vlp16 import Vlp16
from sitl.truth.surface_class import SurfaceClass, surface_map
from slz import SAFE, LocalFrame, Pipeline, PointAttributes, Scan, SurfaceKind, Window, join
from slz.kernels.surface.weights_of_evidence import SCORE_WATER
from slz.surface.surface_map import SurfaceMap

Floats = NDArray[np.float64]
FRAME = LocalFrame(47.0, 8.0, 400.0)
RATE_HZ = 100_000
STEP_NS, STEPS = 100_000_000, 10  # of a scan; scans of a window
THINNING = 5  # lost rays, one of which is reported
BELOW = -np.sin(np.radians(5.0))  # rays nearer to the horizon are not reported
WATER = {
    "lakes": ("lake-1", "lake-2"),
    "ponds": ("pond-1", "pond-2", "pond-3"),
    "river": ("river",),
    "flooded_field": ("field_south", "field_north"),
}
LAND = {
    "car_park_dry": ("car_park",),
    "car_park_wet": ("car_park",),
    "plain": ("middle",),
    "maize": ("meadow", "maize", "wheat"),
}
KINDS = {
    SurfaceClass.BARE: SurfaceKind.BARE,
    SurfaceClass.WATER: SurfaceKind.WATER,
    SurfaceClass.ROOF: SurfaceKind.ROOF,
    SurfaceClass.LOW_VEGETATION: SurfaceKind.LOW_VEGETATION,
}


def lidar(name: str, seed: int) -> PulseLidar:
    """Return a LiDAR that looks down."""
    rng = np.random.default_rng(seed)
    match name:
        case "mid360":
            return Mid360(rng, point_rate_hz=RATE_HZ)
        case "vlp16":
            return Vlp16(rng, point_rate_hz=RATE_HZ)
        case "os0":
            return Ouster(rng, point_rate_hz=RATE_HZ, model=OS0)
    raise ValueError(f"no LiDAR is named {name}")


@dataclass(frozen=True)
class Line:
    """A straight line at a constant height, with a sway of 2 cm up and down, and a hover at its end."""

    start: Floats
    goal: Floats
    up_m: float
    speed_ms: float = 5.0
    hover_s: float = 5.0

    @property
    def duration_s(self) -> float:
        return float(np.hypot(*(self.goal - self.start))) / self.speed_ms + self.hover_s

    def at(self, stamps_ns: NDArray[np.int64]) -> tuple[Floats, Floats]:
        """Return positions ENU (n, 3) and quaternions (n, 4) body FRD to NED."""
        t, way = np.atleast_1d(stamps_ns) * 1e-9, self.goal - self.start
        share = np.clip(t * self.speed_ms / max(1e-9, float(np.hypot(*way))), 0, 1)[:, None]
        half, zero = np.arctan2(*way) / 2, np.zeros(len(t))
        up = self.up_m + 0.02 * np.sin(2 * np.pi * t / 7)
        quaternion = np.column_stack([zero + np.cos(half), zero, zero, zero + np.sin(half)])
        return np.column_stack([self.start + way * share, up]), quaternion


def windows(sensor: PulseLidar, line: Line, scene: Scene) -> Iterator[Window]:
    """Yield the windows of a flight, with lost rays."""
    scans: list[Scan] = []
    for number in range(int(line.duration_s * 1e9 / STEP_NS)):
        shots = sensor.shots(number * STEP_NS, (number + 1) * STEP_NS, line.at, scene.world)
        stamps = sensor.stamps_ns(shots)
        position, attitude = line.at(stamps)
        origin = position + sensor.mount.lever_enu_m(attitude)
        good, traced = shots.echoes.range_m > 0, sensor.is_traced(shots.index)
        lost = np.flatnonzero(~good if traced is None else ~good & traced)[::THINNING]
        way = sensor.mount.to_enu(shots.unit[lost], attitude[lost])
        lost, way = lost[way[:, 2] < BELOW], way[way[:, 2] < BELOW]
        n = int(np.count_nonzero(good))
        if n:
            none = np.zeros(n, np.uint8)
            weight = np.full(len(lost), float(THINNING), np.float32)
            bright = shots.bright[good].astype(np.float32)
            told = PointAttributes.of(bright, none, none, origin[lost] + 100 * way, origin[lost], weight)
            points = origin + sensor.mount.to_enu(sensor.points_m(shots), attitude)
            scans.append(Scan(points[good], stamps[good], origin[-1], FRAME, attributes=told))
        if number % STEPS == STEPS - 1 and scans:
            yield join(scans)
            scans = []


@dataclass
class Flight:
    """Counts of one flight. moments: (water cells seen, of them safe) after each window."""

    pipeline: Pipeline
    scene: Scene
    moments: list[tuple[int, int]] = field(default_factory=list)
    surface_ms: list[float] = field(default_factory=list)
    total_ms: list[float] = field(default_factory=list)
    bare: int = 0
    refused: int = 0

    @property
    def surface(self) -> SurfaceMap:
        surface = self.pipeline.method.maps[0].terrain.surface  # type: ignore[index,attr-defined]
        assert isinstance(surface, SurfaceMap)
        return surface


def fly(
    scene_name: str, region: str, sensor: str, height_m: float, seed: int, away: Sequence[float]
) -> Flight:
    """Fly to the middle of a region from `away` (east, north) of it."""
    scene = scenes.build(scene_name, seed)
    goal = np.array(scene.regions[region]).mean(axis=0)
    low = scene.extent_m
    start = np.clip(goal + np.array(away), (low[0] + 5, low[1] + 5), (low[2] - 5, low[3] - 5))
    line = Line(start, goal, scene.world.height_m(*goal) + height_m)
    pipeline = Pipeline(params.load("quadcopter", ["zone_m=200"]), tuple(goal))
    flight = Flight(pipeline, scene)
    for window in windows(lidar(sensor, seed), line, scene):
        report = pipeline.process(window)
        flight.surface_ms.append(report.stage_ms["surface"])
        flight.total_ms.append(report.total_ms)
        _look(flight)
    return flight


def _look(flight: Flight) -> None:
    maps = flight.pipeline.maps(which="near")
    assert maps is not None
    grid, box, cell = maps.grid, maps.box, maps.grid.cell_m
    west, south = grid.west_m + box.col0 * cell, grid.south_m + box.row0 * cell
    rows, cols = box.shape
    extent = (west, south, west + cols * cell + 1e-6, south + rows * cell + 1e-6)
    truth = surface_map(flight.scene.world, extent, cell).surface[:rows, :cols]
    seen = np.isfinite(maps.height_m)
    water = (truth == SurfaceClass.WATER) & seen
    flight.moments.append((int(water.sum()), int((water & (maps.state == SAFE)).sum())))
    refused = flight.surface.refused(west, south, cell, rows, cols)
    bare = (truth == SurfaceClass.BARE) & seen
    flight.bare = int(bare.sum())
    flight.refused = 0 if refused is None else int((bare & refused).sum())


def told(flight: Flight) -> tuple[NDArray[np.uint8], NDArray[np.uint8], NDArray[np.float32], Floats]:
    """Return truth, kind, probability of water and error of roofs' heights of the surface cells known."""
    surface, (low_x, low_y, high_x, high_y) = flight.surface, flight.scene.extent_m
    west, south, side = surface.west_m, surface.south_m, surface.cell_m
    col0, row0 = max(0, int(np.ceil((low_x - west) / side))), max(0, int(np.ceil((low_y - south) / side)))
    cols = min(int(200 / side), int((high_x - west) / side)) - col0
    rows = min(int(200 / side), int((high_y - south) / side)) - row0
    x0, y0 = west + col0 * surface.cell_m, south + row0 * surface.cell_m
    truth = surface_map(flight.scene.world, (x0, y0, x0 + cols + 1e-6, y0 + rows + 1e-6), surface.cell_m)
    kind, water, raised = np.zeros((3, rows, cols))
    for row in range(rows):
        for col in range(cols):
            here = surface.here(x0 + col + 0.5, y0 + row + 0.5, 0.0)
            kind[row, col], water[row, col], raised[row, col] = here.kind, here.water, here.raised_m
    known = kind != SurfaceKind.UNKNOWN
    roofs = known & (kind == SurfaceKind.ROOF) & (truth.surface == SurfaceClass.ROOF)
    error = (raised - truth.roof_height_m)[roofs]
    return truth.surface[known], kind[known].astype(np.uint8), water[known].astype(np.float32), error


def main() -> None:
    """Print the tables."""
    parser = argparse.ArgumentParser(prog="python -m tests.bench.surfaces")
    parser.add_argument("--heights", nargs="+", type=float, default=[10, 20, 40])
    parser.add_argument("--sensors", nargs="+", default=["mid360", "vlp16", "os0"])
    parser.add_argument("--seeds", nargs="+", type=int, default=[1])
    options = parser.parse_args()
    runs = [(s, h, k) for s in options.sensors for h in options.heights for k in options.seeds]
    pairs: list[tuple[NDArray[np.uint8], NDArray[np.uint8], NDArray[np.float32], Floats]] = []
    surface_ms, total_ms = list[float](), list[float]()
    for kind, heading in (
        (WATER, "| scene | sensor | water cells | safe at worst | safe at the end | dry refused, % |"),
        (LAND, "| scene | sensor | dry refused, % |"),
    ):
        print(f"\n{heading}\n|{'---|' * (heading.count('|') - 1)}")
        for (scene, regions), sensor in itertools.product(kind.items(), options.sensors):
            columns: list[list[str]] = [[], [], [], []]
            for height, seed in itertools.product(options.heights, options.seeds):
                flights = [fly(scene, region, sensor, height, seed, (-50, 0)) for region in regions]
                worst = max(max(safe for _, safe in flight.moments) for flight in flights)
                seen, end = (sum(flight.moments[-1][k] for flight in flights) for k in range(2))
                bare = sum(flight.bare for flight in flights)
                refused = 100 * sum(flight.refused for flight in flights) / max(1, bare)
                surface_ms.append(float(np.median([m for flight in flights for m in flight.surface_ms])))
                total_ms.append(float(np.median([m for flight in flights for m in flight.total_ms])))
                pairs += [told(flight) for flight in flights]
                for column, value in zip(columns, (seen, worst, end, f"{refused:.1f}"), strict=True):
                    column.append(str(value))
            shown = columns if kind is WATER else columns[3:]
            cells = ["0" if set(column) == {"0"} else ", ".join(column) for column in shown]
            print(f"| {scene} | {sensor} | {' | '.join(cells)} |", flush=True)
    print(f"\nsurface {min(surface_ms):.1f} to {max(surface_ms):.1f} ms", end="")
    print(f" of windows of {min(total_ms):.1f} to {max(total_ms):.1f} ms")
    right = n_roofs = 0
    for sensor, height, seed in runs:
        for number in range(1, 8):
            flight = fly("flat_roofs", f"roof-{number}", sensor, min(height, 25.0), seed, (-12, -25))
            middle = np.array(flight.scene.regions[f"roof-{number}"]).mean(axis=0)
            around = (middle[0] - 3, middle[1] - 3, middle[0] + 3, middle[1] + 3)
            true_m = float(np.nanmedian(surface_map(flight.scene.world, around, 1.0).roof_height_m))
            here = flight.surface.here(*middle, 1.0)
            right += here.kind is SurfaceKind.ROOF and abs(here.raised_m - true_m) <= 0.3
            n_roofs += 1
    print(f"\nroofs told with their height within 0.3 m: {right} of {n_roofs}\n")
    truth, kind, water = (np.concatenate([pair[k] for pair in pairs]) for k in range(3))
    print("| truth | cells | told so |\n|---|---|---|")
    for true, expected in KINDS.items():
        own = truth == true
        if own.any():
            print(f"| {true.name.lower()} | {own.sum()} | {np.mean(kind[own] == expected):.1%} |")
    is_water = truth == SurfaceClass.WATER
    prior, here = 1 / (1 + np.exp(-SCORE_WATER)), is_water.mean()
    weight = np.where(is_water, prior / here, (1 - prior) / (1 - here))
    print(f"\n| told probability of water | cells | water | water, were it {prior:.1%} of all |")
    print("|---|---|---|---|")
    edges = [0, 0.01, 0.05, 0.1, 0.2, 0.4, 0.6, 0.8, 1.0]
    for low, high in itertools.pairwise(edges):
        own = (water >= low) & ((water < high) | (high == 1.0))
        if own.any():
            share = float(weight[own & is_water].sum() / weight[own].sum())
            print(f"| {low:g} to {high:g} | {own.sum()} | {is_water[own].mean():.3f} | {share:.3f} |")


if __name__ == "__main__":
    main()
