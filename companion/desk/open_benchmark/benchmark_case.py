"""Cases of the benchmark: a scene with its task, truth and flights, wherever it comes from."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Collection, Iterator, Mapping
from dataclasses import asdict, dataclass, replace
from importlib import resources
from typing import Any

import numpy as np
from pyproj import CRS

from companion.desk.open_benchmark.footprint_truth import SceneTruth, lattice_heights, scene_truth
from companion.desk.open_benchmark.frozen_scenes import ORIGIN, TASK, FrozenScene, frozen_scenes
from companion.desk.open_benchmark.landing_task import FlownReturns, LandingTask
from companion.desk.open_benchmark.scan_simulation import RESOLUTION_M, scan
from companion.runtime.errors import CompanionError, UsageError

VERSION = 1
FILE = "manifest.json"


@dataclass(frozen=True, slots=True)
class BenchmarkCase:
    """Scene to be judged.

    origin: latitude, longitude (deg), altitude (m) of its local metres. flights: returns by label, such as
    the pulses per m². document: description of the scene, as JSON. digests_agree: True if digests of a
    frozen scene equal the manifest's (`frozen_agreement`); None for other scenes.
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


def read_manifest() -> dict[str, dict[str, Any]]:
    """Return the entries of the installed program's manifest by the scenes' names.

    Raises
    ------
    CompanionError
        The manifest is missing, broken or of another version.
    """
    place = resources.files("companion.desk.open_benchmark").joinpath(FILE)
    try:
        manifest = json.loads(place.read_text("utf-8"))
        if manifest["version"] != VERSION:
            raise ValueError(f"it is of version {manifest['version']!r}, the program of {VERSION}")
        return {str(entry["name"]): _complete(entry) for entry in manifest["scenes"]}
    except (OSError, ValueError, KeyError, TypeError, AttributeError) as error:
        reason = " ".join(f"{type(error).__name__}: {error}".split())[:160]
        raise CompanionError(
            f"{place}: the benchmark's manifest is broken ({reason}): install the program again"
        ) from None


def _complete(entry: dict[str, Any]) -> dict[str, Any]:
    digests = [flown["sha256"] for flown in entry["returns"].values()]
    for digest in (entry["scene_sha256"], entry["truth_sha256"], *digests):
        int(digest, 16)
    return entry


def description(scene: FrozenScene) -> dict[str, Any]:
    """Return the closed form of a scene as JSON: numbers by which its surface can be computed."""
    return {
        "name": scene.name,
        "seed": scene.seed,
        "clutter": scene.clutter,
        "ground": asdict(scene.ground),
        "shapes": [{"form": type(shape).__name__, **asdict(shape)} for shape in scene.shapes],  # type: ignore[call-overload]
        "cables": [asdict(cable) for cable in scene.cables],
    }


def description_digest(scene: FrozenScene) -> str:
    """Return SHA-256 of the closed form."""
    return document_digest(description(scene))


def document_digest(document: Any) -> str:
    """Return SHA-256 of a closed form that is JSON already."""
    text = json.dumps(document, sort_keys=True, separators=(",", ":"))
    return hashlib.sha256(text.encode()).hexdigest()


def truth_digest(truth: SceneTruth) -> str:
    """Return SHA-256 of the states and kinds, row by row from the south."""
    parts = (*truth.kinds, truth.safe.shape)
    digest = hashlib.sha256(repr(parts).encode())
    digest.update(truth.safe.tobytes())
    digest.update(truth.kind.tobytes())
    return digest.hexdigest()


def returns_digest(returns: FlownReturns) -> str:
    """Return SHA-256 of the coordinates in millimetres and of the windows, little-endian."""
    whole = np.rint(returns.points_m / RESOLUTION_M).astype("<i4")
    digest = hashlib.sha256(whole.tobytes())
    digest.update(returns.window.astype("u1").tobytes())
    return digest.hexdigest()


def entry(scene: FrozenScene, truth: SceneTruth, flights: dict[int, FlownReturns]) -> dict[str, Any]:
    """Return the entry of a scene in the manifest."""
    return {
        "name": scene.name,
        "seed": scene.seed,
        "scene_sha256": description_digest(scene),
        "truth_sha256": truth_digest(truth),
        "returns": {
            str(density): {"n": len(returns), "sha256": returns_digest(returns)}
            for density, returns in flights.items()
        },
    }
