"""Cases of the benchmark: a scene with its task, truth and flights, wherever it comes from."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Any

from pyproj import CRS

from companion.desk.open_benchmark.footprint_truth import SceneTruth, lattice_heights, scene_truth
from companion.desk.open_benchmark.frozen_scenes import ORIGIN, TASK, FrozenScene, frozen_scenes
from companion.desk.open_benchmark.landing_task import FlownReturns, LandingTask
from companion.desk.open_benchmark.scan_simulation import scan
from companion.desk.open_benchmark.scene_manifest import (
    description,
    document_digest,
    read_manifest,
    returns_digest,
    truth_digest,
)
from companion.runtime.errors import UsageError


@dataclass(frozen=True, slots=True)
class BenchmarkCase:
    """Scene to be judged.

    origin: latitude, longitude (deg), altitude (m) of its local metres. flights: returns by label, such as
    the pulses per m². document: what the scene is, as JSON. digests_agree: of a frozen scene, whether what
    was computed of it is what the manifest says (`frozen_agreement`); None for others.
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
    for scene in scenes:
        heights = lattice_heights(scene)
        truth = scene_truth(scene, TASK, heights)
        flights = {str(density): scan(scene, density, heights) for density in densities}
        case = BenchmarkCase(scene.name, ORIGIN, TASK, truth, flights, description(scene))
        yield replace(case, digests_agree=bool(frozen_agreement(case)))


def frozen_agreement(case: BenchmarkCase) -> bool | None:
    """Return whether a case is the frozen scene of its name; None where none has it.

    Compared are origin, task, and SHA-256 of closed form, truth and those flights of the case that the
    manifest holds.
    """
    entry = read_manifest().get(case.name)
    if entry is None:
        return None
    return (
        (case.origin, case.task) == (ORIGIN, TASK)
        and document_digest(case.document) == entry["scene_sha256"]
        and truth_digest(case.truth) == entry["truth_sha256"]
        and all(
            returns_digest(returns) == entry["returns"][label]["sha256"]
            for label, returns in case.flights.items()
            if label in entry["returns"]
        )
    )
