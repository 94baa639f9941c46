"""Cases of the benchmark: a scene with its task, truth and flights, wherever it comes from."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass
from typing import Any

from pyproj import CRS

from companion.desk.open_benchmark.footprint_truth import SceneTruth, lattice_heights, scene_truth
from companion.desk.open_benchmark.frozen_scenes import DENSITIES, ORIGIN, TASK, FrozenScene, frozen_scenes
from companion.desk.open_benchmark.landing_task import FlownReturns, LandingTask
from companion.desk.open_benchmark.scan_simulation import scan
from companion.desk.open_benchmark.scene_manifest import (
    description,
    description_digest,
    read_manifest,
    returns_digest,
    truth_digest,
)
from companion.runtime.errors import UsageError


@dataclass(frozen=True, slots=True)
class BenchmarkCase:
    """Scene to be judged.

    origin: latitude, longitude (deg), altitude (m) of its local metres. flights: returns by label, such as
    the pulses per m². document: what the scene is, as JSON. digests_agree: of a frozen scene, whether it is
    what the manifest says; None for others.
    """

    name: str
    origin: tuple[float, float, float]
    task: LandingTask
    truth: SceneTruth
    flights: Mapping[str, FlownReturns]
    document: Mapping[str, Any]
    digests_agree: bool | None = None

    @property
    def crs(self) -> CRS:
        return local_crs(self.origin)


def local_crs(origin: tuple[float, float, float]) -> CRS:
    """Return the transverse Mercator projection about an origin, whose coordinates are the local metres."""
    lat, lon, _ = origin
    return CRS.from_proj4(
        f"+proj=tmerc +lat_0={lat!r} +lon_0={lon!r} +k=1 +x_0=0 +y_0=0 +datum=WGS84 +units=m"
    )


def frozen_names() -> list[str]:
    """Return the names of the frozen scenes."""
    return [scene.name for scene in frozen_scenes()]


def chosen_scenes(wanted: Collection[str]) -> list[FrozenScene]:
    """Return the frozen scenes whose names hold one of the words; all without words.

    Raises
    ------
    UsageError
        A word is in no name.
    """
    scenes = frozen_scenes()
    for word in wanted:
        if not any(word in scene.name for scene in scenes):
            raise UsageError(f"no scene is named {word!r}: slz benchmark --list names them all")
    return [scene for scene in scenes if not wanted or any(word in scene.name for word in wanted)]


def frozen_cases(scenes: Collection[FrozenScene], densities: Collection[int]) -> Iterator[BenchmarkCase]:
    """Compute the cases of frozen scenes one after the other; without densities, truth alone."""
    expected = {entry["name"]: entry for entry in read_manifest()["scenes"]}
    for scene in scenes:
        heights = lattice_heights(scene)
        truth = scene_truth(scene, TASK, heights)
        flights = {density: scan(scene, density, heights) for density in densities}
        frozen = expected.get(scene.name, {})
        agree = (description_digest(scene), truth_digest(truth)) == (
            frozen.get("scene_sha256"),
            frozen.get("truth_sha256"),
        ) and all(
            returns_digest(returns) == frozen["returns"][str(density)]["sha256"]
            for density, returns in flights.items()
            if density in DENSITIES
        )
        labelled = {str(density): returns for density, returns in flights.items()}
        yield BenchmarkCase(scene.name, ORIGIN, TASK, truth, labelled, description(scene), agree)
