"""Bit-exact results of a survey for any division into tiles, workers and pieces."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from companion.desk.clouds.cloud import read
from companion.desk.survey.cloud_survey import survey
from companion.desk.survey.tiled import plan, tiled_zones
from companion.desk.survey.tiled.tile_store import Store
from slz import SAFE
from tests.unit.companion.desk.survey.clouds import write
from tests.unit.companion.desk.survey.tiled.ground import Counted, answer, files, parameters, points, surveyed

POINTS = points()
IN_ORDER = np.arange(len(POINTS))


@pytest.fixture(scope="module")
def untiled(tmp_path_factory: pytest.TempPathFactory) -> Any:
    folder = tmp_path_factory.mktemp("untiled")
    found = surveyed(files(folder, POINTS, IN_ORDER, 1), folder / "work", tile_m=10_000)
    assert len(list(found.layout.folder.glob("*.tile"))) <= 4  # one, but for the lattice's lines
    return found


def test_the_survey_is_worth_the_test(untiled: Any) -> None:
    """Zones cross the borders of blocks, points are beyond gaps, some in groups, and something is unsafe."""
    extents = [one.zone.box for one in untiled.found]
    whole = untiled.layout.whole
    blocks = [(whole.row0 + b.row0) // 256 != (whole.row0 + b.row1) // 256 for b in extents]
    assert len(extents) >= 2
    assert sum(blocks) >= 2
    assert 0 < untiled.dropped["outlier"] <= 6
    assert untiled.n_unsafe > 1000


@settings(max_examples=3, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    tile_m=st.sampled_from([100.0, 200.0, 300.0, None]),
    seed=st.integers(0, 1000),
    n_files=st.integers(1, 4),
    piece=st.sampled_from([7_000, 50_000, 10**9]),
)
def test_tiles_files_pieces_and_the_order_of_points_change_no_bit(
    untiled: Any,
    tmp_path_factory: pytest.TempPathFactory,
    tile_m: float | None,
    seed: int,
    n_files: int,
    piece: int,
) -> None:
    folder = tmp_path_factory.mktemp("tiled")
    order = np.random.default_rng(seed).permutation(len(POINTS))
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(plan, "PIECE", piece)
        found = surveyed(files(folder, POINTS, order, n_files), folder / "work", tile_m)
    assert answer(found) == answer(untiled)


def test_the_pipeline_finds_the_same_zones_in_one_window(untiled: Any, tmp_path: Path) -> None:
    path = write(tmp_path / "a.laz", POINTS)
    one = survey(read([path]), parameters())
    state = Store(untiled.layout).state(untiled.layout.grid.everything)
    assert state.shape == one.maps.state.shape
    assert (state != one.maps.state).mean() < 1e-4  # sums are rounded otherwise
    for mine, zone in zip((found.zone for found in untiled.found), one.report.zones, strict=True):
        assert mine.area_m2 == pytest.approx(zone.area_m2, rel=1e-3)
        assert mine.certainty == pytest.approx(zone.certainty, abs=1e-3)
        here, there = mine.best, zone.best
        assert here.enu_m[:2] == pytest.approx(there.enu_m[:2] - (one.maps.west_m, one.maps.south_m), abs=1.0)
        assert here.clearance_m == pytest.approx(there.clearance_m, abs=0.5)


def test_a_zone_too_large_for_memory_is_cut_where_no_tile_matters(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(tiled_zones, "MOST_CELLS", 20_000)
    monkeypatch.setattr(tiled_zones, "CUT", 200)
    paths = files(tmp_path, POINTS, IN_ORDER, 1)
    found = [surveyed(paths, tmp_path / str(tile_m), tile_m) for tile_m in (100.0, 10_000.0)]
    assert answer(found[0]) == answer(found[1])
    parts = [one for one in found[0].found if one.cut]
    assert len(parts) >= 4
    assert all(max(one.zone.cells.shape) <= 200 for one in parts)
    safe = np.zeros(found[0].layout.whole.shape, int)
    for one in found[0].found:
        box = one.zone.box
        safe[box.slices] += one.zone.cells
    assert safe.max() == 1  # parts adjoin and do not overlap
    assert (Store(found[0].layout).state(found[0].layout.grid.everything)[safe == 1] == SAFE).all()


def test_a_killed_survey_goes_on_where_it_was_and_finds_the_same(untiled: Any, tmp_path: Path) -> None:
    paths = files(tmp_path, POINTS, IN_ORDER, 3)
    whole = Counted()
    assert answer(surveyed(paths, tmp_path / "whole", 100, whole)) == answer(untiled)
    for most in (2, len(whole.done) - 1):
        work = tmp_path / str(most)
        with pytest.raises(KeyboardInterrupt):
            surveyed(paths, work, 100, Counted(most))
        before = {path: path.stat().st_mtime_ns for path in work.rglob("*.*ed")} | {
            path: path.stat().st_mtime_ns for path in work.rglob("*.tile")
        }
        assert before
        assert answer(surveyed(paths, work, 100)) == answer(untiled)
        assert all(path.stat().st_mtime_ns == at for path, at in before.items())  # none is made again
