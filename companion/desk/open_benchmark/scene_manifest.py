"""Manifest of the frozen scenes: version, seeds and digests that show whether they are the same."""

from __future__ import annotations

import hashlib
import json
from dataclasses import asdict
from importlib import resources
from typing import Any

import numpy as np

from companion.desk.open_benchmark.footprint_truth import SceneTruth
from companion.desk.open_benchmark.frozen_scenes import FrozenScene
from companion.desk.open_benchmark.landing_task import FlownReturns
from companion.desk.open_benchmark.scan_simulation import RESOLUTION_M
from companion.runtime.errors import CompanionError

VERSION = 1
FILE = "manifest.json"


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
