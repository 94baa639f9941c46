"""Truth of the frozen scenes, computed again from their published numbers by another program.

It reads the closed forms as scene.json holds them, and computes heights point by point with `math`, planes
by `numpy.linalg.lstsq` over all samples, water and wires with shapely.
"""

from __future__ import annotations

import json
import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
import shapely
from numpy.typing import NDArray
from shapely import affinity

from companion.desk.open_benchmark.benchmark_case import description
from companion.desk.open_benchmark.footprint_truth import SceneTruth, scene_truth
from companion.desk.open_benchmark.frozen_scenes import TASK, FrozenScene, frozen_scenes
from companion.desk.open_benchmark.landing_task import CellGrid, LandingTask

COARSE = LandingTask(CellGrid(-10.7, -10.7, 3.6, 6, 6))  # every 18th cell of the frozen grid
OFFSET = (np.arange(81) - 40) / 40.0
Points = NDArray[np.float64]
Form = dict[str, Any]


def along(form: Form, x: Points, y: Points) -> tuple[Points, Points]:
    a = math.radians(form["turn_deg"])
    dx, dy = x - form["x_m"], y - form["y_m"]
    return dx * math.cos(a) + dy * math.sin(a), -dx * math.sin(a) + dy * math.cos(a)


def distance(form: Form, x: Points, y: Points) -> Points:
    return np.sqrt((x - form["x_m"]) ** 2 + (y - form["y_m"]) ** 2)


def polygon(form: Form) -> shapely.Polygon:
    long, wide = form["length_m"] / 2, form["width_m"] / 2
    box = affinity.rotate(shapely.box(-long, -wide, long, wide), form["turn_deg"], origin=(0, 0))
    return affinity.translate(box, form["x_m"], form["y_m"])


def slab(form: Form, x: Points, y: Points) -> Points:
    return form["height_m"] * shapely.intersects_xy(polygon(form), x, y)


def dome(form: Form, x: Points, y: Points) -> Points:
    u, v = along(form, x, y)
    squared = (u / (form["length_m"] / 2)) ** 2 + (v / (form["width_m"] / 2)) ** 2
    return np.where(squared < 1, form["height_m"] * np.sqrt(np.abs(1 - squared)), 0.0)


def crater(form: Form, x: Points, y: Points) -> Points:
    radius = form["diameter_m"] / 2
    r = distance(form, x, y)
    bowl = 0.4 * radius * ((r / radius) ** 2 - 1) + 0.072 * radius
    rim = np.interp(r, [radius, 1.6 * radius], [0.072 * radius, 0.0])
    return np.where(r < radius, bowl, rim)


FORMS: dict[str, Callable[[Form, Points, Points], Points]] = {
    "Step": lambda f, x, y: f["height_m"] * (along(f, x, y)[1] > 0),
    "Slab": slab,
    "Disc": lambda f, x, y: f["height_m"] * (distance(f, x, y) <= f["diameter_m"] / 2),
    "Dome": dome,
    "Crater": crater,
    "Mound": lambda f, x, y: f["height_m"] * np.exp(-((distance(f, x, y) / f["sigma_m"]) ** 2) / 2),
    "Stairs": lambda f, x, y: f["riser_m"] * np.clip(along(f, x, y)[0] // f["tread_m"], 0, f["steps"]),
    "Hills": lambda f, x, y: (
        f["height_m"] * np.sin(math.tau * x / f["length_m"]) * np.cos(math.tau * y / f["length_m"])
    ),
}


def height(scene: Form, x: Points, y: Points) -> Points:
    ground = scene["ground"]
    a = math.radians(ground["ascent_deg"])
    z = math.tan(math.radians(ground["slope_deg"])) * (math.cos(a) * x + math.sin(a) * y)
    for phase, (across, up) in enumerate(((0.9, 1.3), (-1.7, 0.8), (0.5, -0.45))):
        z = z + ground["texture_m"] * 0.5 * np.sin(math.tau * x / across + math.tau * y / up + phase)
    west, east, south, north = x.min(), x.max(), y.min(), y.max()
    for form in scene["shapes"]:
        reach = 0.8 * max(form.get("diameter_m", 0), form.get("length_m", 0) + form.get("width_m", 0)) or 99.0
        reach = 99.0 if form["form"] == "Hills" else reach
        if (
            west - reach < form.get("x_m", 0) < east + reach
            and south - reach < form.get("y_m", 0) < north + reach
        ):
            z = z + FORMS[form["form"]](form, x, y)
    return z


def judged(scene: Form, east: float, north: float) -> tuple[float, float, bool]:
    """Return slope (deg), relief (m) and whether a footprint of 2 m is safe."""
    x, y = (v.ravel() for v in np.meshgrid(east + OFFSET, north + OFFSET))
    z = height(scene, x, y)
    basis = np.column_stack([np.ones(len(x)), x - east, y - north])
    plane = np.linalg.lstsq(basis, z, rcond=None)[0]
    rest = z - basis @ plane
    slope, relief = math.degrees(math.atan(math.hypot(plane[1], plane[2]))), float(rest.max() - rest.min())
    wet = any(f["kind"] == "water" and FORMS[f["form"]](f, x, y).any() for f in scene["shapes"])
    footprint = shapely.box(east - 1, north - 1, east + 1, north + 1)
    hung = False
    for cable in scene["cables"]:
        grown = footprint.buffer(cable["radius_m"], join_style="mitre")
        hung |= shapely.LineString([cable["from_m"][:2], cable["to_m"][:2]]).intersects(grown)
    return slope, relief, slope <= 10.0 and relief <= 0.3 and not wet and not hung


def compare(scene: FrozenScene, task: LandingTask) -> int:
    """Compare every judged cell of a grid and return their number."""
    truth: SceneTruth = scene_truth(scene, task)
    published: Form = json.loads(json.dumps(description(scene)))
    east, north = task.grid.centres()
    cells = np.argwhere(truth.safe != 255)
    for row, col in cells:
        slope, relief, safe = judged(published, float(east[row, col]), float(north[row, col]))
        assert truth.slope_deg[row, col] == pytest.approx(slope, abs=1e-6), (scene.name, row, col)
        assert truth.relief_m[row, col] == pytest.approx(relief, abs=1e-6), (scene.name, row, col)
        assert truth.safe[row, col] == safe, (scene.name, row, col)
    return len(cells)


@pytest.mark.parametrize("scene", frozen_scenes(), ids=lambda scene: scene.name)
def test_slope_relief_and_state_are_those_of_another_program(scene: FrozenScene) -> None:
    assert compare(scene, COARSE) == 25


def test_compared_cells_are_some_of_the_frozen_grid() -> None:
    scene = frozen_scenes()[9]
    fine, coarse = scene_truth(scene, TASK), scene_truth(scene, COARSE)
    assert np.array_equal(fine.safe[10::18, 10::18], coarse.safe)
