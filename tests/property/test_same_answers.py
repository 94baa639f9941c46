"""Determinism of the pipeline: same answers in one thread or two, derived incrementally or at once."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from dataclasses import fields
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import params
from slz import Pipeline, Report
from slz.grid import Grid
from slz.terrain.layers import NAMED
from slz.terrain.terrain import EvidenceTerrain
from tests.property.test_incremental_source import scan, window

OWN = ["cell_m=0.5", "zone_m=90", "min_square_m=2", "min_boundary_points=20", "max_zones=1000"]
PARAMETERS = {mode: params.load("quadcopter", [f"mode={mode}", *OWN]) for mode in ("source", "default")}


def plain(value: Any) -> Any:
    """Return what a value holds, as things that can be compared."""
    if isinstance(value, np.ndarray):
        return value.shape, value.tobytes()
    if hasattr(value, "__dataclass_fields__"):
        return [plain(getattr(value, field.name)) for field in fields(value) if field.name != "stage_ms"]
    if isinstance(value, float):
        return value.hex()
    if hasattr(value, "__len__") and not isinstance(value, str):
        return [plain(part) for part in value]
    return value


def flown(mode: str, seed: int, windows: int = 3) -> list[Any]:
    rng = np.random.default_rng(seed)
    pipe = Pipeline(PARAMETERS[mode], (0.0, 0.0), follow=False)

    def said(report: Report) -> Any:
        return plain((report.near, report.far, report.selected, report.n_used))

    return [said(pipe.process(window(scan(rng), second))) for second in range(windows)]


@pytest.mark.parametrize("mode", ["source", "default"])
def test_two_threads_give_what_one_gives(mode: str) -> None:
    seeds = range(6)
    alone = [flown(mode, seed) for seed in seeds]
    with ThreadPoolExecutor(2) as pool:
        assert list(pool.map(lambda seed: flown(mode, seed), seeds)) == alone


@settings(max_examples=60, deadline=None)
@given(st.integers(0, 100_000), st.integers(2, 5))
def test_maps_drawn_where_they_changed_are_those_drawn_at_once(seed: int, windows: int) -> None:
    rng = np.random.default_rng(seed)
    parameters = PARAMETERS["default"]
    terrain = EvidenceTerrain(Grid.centred(0.0, 0.0, 90.0, 0.5), parameters)
    for second in range(windows):
        terrain.add(scan(rng), np.array([0.0, 0.0, 30.0]), float(second))
    anew = terrain.at_level(terrain.level)
    box = terrain.seen
    assert anew.seen == box
    np.testing.assert_array_equal(terrain.state(box), anew.state(box))
    for name in NAMED:
        np.testing.assert_array_equal(terrain.layer(name, box), anew.layer(name, box), name)
