"""A demonstration: the gear its simulator is told, and the table with the verdict."""

from __future__ import annotations

import inspect
import re
from typing import Any

import pytest
from rich.console import Console

import params
from companion.cli.demo import demo
from companion.desk.demo.demo_options import SCENES
from companion.desk.demo.demonstration import gear_options
from companion.desk.demo.flight_files import table
from sitl.scenes import NAMES

SAFE = {
    "scene": "streets",
    "seed": 3,
    "landed": True,
    "touchdown_safe": True,
    "touchdown_fault": "",
    "touchdown_error_m": 0.03,
    "off_point_m": 0.14,
    "touchdown_tilt_deg": 2.31,
    "zones": [],
    "zones_seen": 4,
    "area_error": 0.1,
    "unsafe_as_safe": 0.0,
    "recall": 0.9,
    "aborts": 0,
    "abort_reasons": [],
    "latency_ms": {"p50": 1, "p99": 2, "max": 3},
    "simulated_s": 100.0,
    "wall_s": 50.0,
    "maps": {},
    "files": {"page": "out/demo/flight.html"},
}


@pytest.mark.parametrize(
    ("more", "texts"),
    [
        (
            {},
            [
                "streets, seed 3: landed on safe ground",
                "2.3 degrees on its gear",
                "0.03 m from the chosen point (simulator's truth)",
                "0.14 m from it, as the pilot is told: by the vehicle's own position, which errs",
                "out/demo/flight.html",
            ],
        ),
        (
            {
                "touchdown_safe": False,
                "touchdown_tilt_deg": 19.3,
                "touchdown_fault": "stands at 19 degrees on its gear",
            },
            ["did NOT land on safe ground", "stands at 19 degrees on its gear", "19.3 degrees"],
        ),
        (
            {"landed": False, "touchdown_error_m": None, "off_point_m": None, "touchdown_tilt_deg": None},
            ["seed 3: did NOT land on safe ground"],
        ),
    ],
)
def test_the_table_tells_how_the_vehicle_stands(more: dict[str, Any], texts: list[str]) -> None:
    console = Console(width=200)
    with console.capture() as shown:
        console.print(table(SAFE | more))
    for text in texts:
        assert text in shown.get()


def test_the_simulator_is_told_the_vehicle_s_gear() -> None:
    words = gear_options(params.build({"gear": "tripod", "gear_width_m": 0.7, "tip_limit_deg": 12.0}))
    told = dict(zip(words[::2], words[1::2], strict=True))
    assert (told["--gear"], told["--gear-width"], told["--tip-limit"]) == ("tripod", "0.7", "12.0")


def test_without_a_gear_the_simulator_keeps_its_own() -> None:
    assert gear_options(params.build({"gear": "none"})) == []


@pytest.mark.parametrize("scene", SCENES)
def test_every_scene_of_a_demonstration_is_one_of_the_simulator_s_and_named_in_the_help(scene: str) -> None:
    assert scene in NAMES
    (option,) = inspect.signature(demo, eval_str=True).parameters["scene"].annotation.__metadata__
    assert scene in re.split(r"[^a-z_]+", option.help)
