"""Commands, options, parameters and ports of the quick start, against the tests."""

from __future__ import annotations

import re
from importlib import resources

import pytest
import typer

from companion.cli import program
from params.required import parse
from sitl import __main__ as simulator
from sitl.sensors import lidars
from tests.e2e import arducopter, px4
from tests.e2e.quickstart import PAGE, ROOT, Command, block_with, blocks, slz

ALL = [command for block in blocks() for command in block]
MAKE = re.findall(r"^([a-z]+):", (ROOT / "Makefile").read_text("utf-8"), re.MULTILINE)


def test_the_page_s_blocks_are_read() -> None:
    assert len(ALL) == 10
    assert sum(command.program == "slz" for command in ALL) == 7


@pytest.mark.parametrize("command", [c for c in ALL if c.program == "slz" and c.words[1] != "sim"], ids=str)
def test_every_option_of_slz_is_one(command: Command) -> None:
    group = typer.main.get_command(program.app)
    sub = group.get_command(typer.Context(group), command.words[1])  # type: ignore[attr-defined]
    sub.make_context(command.words[1], list(command.words[2:]))  # raises what it refuses


@pytest.mark.parametrize("words", ["--scene streets", "--sensor radar", "--intruder car@15"])
def test_the_other_flights_named_are_flights(words: str) -> None:
    assert f"`{words}`" in PAGE
    group = typer.main.get_command(program.app)
    sub = group.get_command(typer.Context(group), "demo")  # type: ignore[attr-defined]
    context = sub.make_context("demo", words.split())
    assert words.split()[1] in context.params.values()


def test_make_has_every_target() -> None:
    told = [command.words[1] for command in ALL if command.words[0] == "make"]
    told += re.findall(r"`make (\w+)`", PAGE)
    assert {"demo", "docs"} <= set(told)
    assert set(told) - {"px4_sitl"} <= set(MAKE)  # which is PX4's own


def test_simulator_and_program_meet_by_the_simulator_s_defaults() -> None:
    block = block_with("--pilot takeoff")
    run = slz(block, "run")
    _, _, port = run.value("--mavlink").rpartition(":")
    assert f"udpout:127.0.0.1:{port}" in simulator.DEFAULT_MAVLINK
    assert run.value("--lidar") == f"livox:{lidars.DEFAULTS['mid360']}"
    watched = re.findall(r"watch, at `tcp:(\S+)`", PAGE)
    assert [f"tcpin:{place}" for place in watched] == simulator.DEFAULT_MAVLINK[:1]


def test_px4_is_flown_as_the_tests_fly_it() -> None:
    block = block_with("px4_sitl")
    assert block[0].environment == {"PX4_SIM_SPEED_FACTOR": px4.SPEED}
    assert slz(block, "sim").value("--autopilot") == f"udpin:127.0.0.1:{px4.TRUTH_PORT}"
    assert slz(block, "run").value("--mavlink") == f"udpin:127.0.0.1:{px4.COMPANION_PORT}"
    assert tuple(slz(block, "run").values("--set")) == px4.SIH_NOISE


def test_arducopter_is_flown_as_the_tests_fly_it() -> None:
    block = block_with("sim_vehicle.py")
    assert slz(block, "sim").value("--autopilot") == f"tcp:127.0.0.1:{arducopter.BASE_PORT + 2}"
    assert slz(block, "run").value("--mavlink") == f"tcp:127.0.0.1:{arducopter.BASE_PORT + 3}"


def test_the_parameter_files_named_are_those_that_the_tests_load() -> None:
    named = set(re.findall(r"params/autopilot/([\w.]+)", PAGE))
    assert named == {"arducopter.parm", "px4.params", "px4_sih.params"}
    folder = resources.files("params").joinpath("autopilot")
    assert all(folder.joinpath(name).is_file() for name in named)


def test_sih_s_noise_is_told_to_the_estimator() -> None:
    text = resources.files("params").joinpath("autopilot/px4_sih.params").read_text("utf-8")
    values = {row.name: row.value for row in parse(text)}
    assert (values["EKF2_GYR_NOISE"], values["EKF2_ACC_NOISE"]) == (pytest.approx(0.1), 1.0)
    assert {name: float(value) for name, value in px4.file_parameters("px4_sih.params").items()} == values
