"""The frozen scenes are those of the manifest, bit for bit."""

from __future__ import annotations

from pathlib import Path

import pytest
import rasterio

from companion.desk.open_benchmark.benchmark_case import (
    VERSION,
    chosen_scenes,
    description_digest,
    frozen_cases,
    read_manifest,
)
from companion.desk.open_benchmark.exchange_folder import read_case, write_case
from companion.desk.open_benchmark.frozen_scenes import DENSITIES, frozen_scenes
from companion.runtime.errors import CompanionError, UsageError

COMPUTED = ("pole-0.1x1.5m", "stairs", "water", "yard")  # clutter, steps, no answer, all kinds with a wire


def test_closed_forms_are_those_of_the_manifest() -> None:
    manifest = read_manifest()
    assert VERSION == 1  # a manifest of another version is refused
    frozen = {name: entry["scene_sha256"] for name, entry in manifest.items()}
    assert frozen == {scene.name: description_digest(scene) for scene in frozen_scenes()}
    assert all({int(d) for d in entry["returns"]} == set(DENSITIES) for entry in manifest.values())


@pytest.mark.parametrize("name", COMPUTED)
def test_truth_and_returns_are_those_of_the_manifest(name: str) -> None:
    (scene,) = chosen_scenes((name,))
    (case,) = frozen_cases((scene,), (10,))
    assert case.digests_agree
    assert set(case.truth.kinds) >= set(scene.kinds)


def test_an_exported_frozen_scene_is_the_frozen_one_until_it_is_changed(tmp_path: Path) -> None:
    (case,) = frozen_cases(chosen_scenes(("plane-8deg",)), (10,))
    write_case(case, tmp_path)
    folder = tmp_path / "plane-8deg"
    assert read_case(folder).digests_agree is True
    with rasterio.open(folder / "truth.tif", "r+") as file:
        values = file.read(1)
        values[50, 50] = 255
        file.write(values, 1)
    assert read_case(folder).digests_agree is None


@pytest.mark.parametrize(
    "text", ["{", "[]", '{"version": 2, "scenes": []}', '{"version": 1, "scenes": [{}]}']
)
def test_a_broken_manifest_is_one_line(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, text: str) -> None:
    (tmp_path / "manifest.json").write_text(text, "utf-8")
    monkeypatch.setattr("importlib.resources.files", lambda _package: tmp_path)
    with pytest.raises(CompanionError, match="manifest is broken .*: install the program again") as refused:
        read_manifest()
    assert "\n" not in str(refused.value)


def test_every_kind_of_hazard_has_a_scene() -> None:
    kinds = {kind for scene in frozen_scenes() for kind in scene.kinds}
    assert kinds >= {"kerb", "pole", "rock", "crater", "stairs", "car", "wall", "ditch", "hole", "wire"}
    assert kinds >= {"hill", "bump", "vegetation", "building", "water"}


def test_an_unknown_scene_is_refused() -> None:
    with pytest.raises(UsageError, match="no scene is named 'mars'"):
        chosen_scenes(("mars",))
