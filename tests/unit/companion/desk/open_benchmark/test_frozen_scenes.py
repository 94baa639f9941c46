"""The frozen scenes are those of the manifest, bit for bit."""

from __future__ import annotations

import pytest

from companion.desk.open_benchmark.benchmark_case import chosen_scenes, frozen_cases
from companion.desk.open_benchmark.frozen_scenes import DENSITIES, frozen_scenes
from companion.desk.open_benchmark.scene_manifest import VERSION, description_digest, read_manifest
from companion.runtime.errors import UsageError

COMPUTED = ("pole-0.1x1.5m", "stairs", "water", "yard")  # clutter, steps, no answer, all kinds with a wire


def test_closed_forms_are_those_of_the_manifest() -> None:
    manifest = read_manifest()
    assert manifest["version"] == VERSION == 1
    frozen = {entry["name"]: entry["scene_sha256"] for entry in manifest["scenes"]}
    assert frozen == {scene.name: description_digest(scene) for scene in frozen_scenes()}
    assert all({int(d) for d in entry["returns"]} == set(DENSITIES) for entry in manifest["scenes"])


@pytest.mark.parametrize("name", COMPUTED)
def test_truth_and_returns_are_those_of_the_manifest(name: str) -> None:
    (scene,) = chosen_scenes((name,))
    (case,) = frozen_cases((scene,), (10,))
    assert case.digests_agree
    assert set(case.truth.kinds) >= set(scene.kinds)


def test_every_kind_of_hazard_has_a_scene() -> None:
    kinds = {kind for scene in frozen_scenes() for kind in scene.kinds}
    assert kinds >= {"kerb", "pole", "rock", "crater", "stairs", "car", "wall", "ditch", "hole", "wire"}
    assert kinds >= {"hill", "bump", "vegetation", "building", "water"}


def test_an_unknown_scene_is_refused() -> None:
    with pytest.raises(UsageError, match="no scene is named 'mars'"):
        chosen_scenes(("mars",))
