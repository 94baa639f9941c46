"""Commands of the quick start, with the built-in simulator and, on request, real autopilots."""

from __future__ import annotations

import http.client
import json
import os
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from tests.e2e.arducopter import ArduCopterField
from tests.e2e.field import Field, stop
from tests.e2e.px4 import Px4Field
from tests.e2e.quickstart import Command, block_with, replaced, slz
from tests.ports import free_port

pytestmark = pytest.mark.realtime
MODULES = {"sim": ["sitl"], "run": ["companion.cli", "run"]}
# Beside what the page says: an end without a hand, coarse and small enough for a busy computer.
SHORT = "--json", "--set", "survey_s=8", "--set", "zone_m=200"


@contextmanager
def program(name: str, words: list[str], folder: Path) -> Iterator[subprocess.Popen[bytes]]:
    """Run a command of the page in a folder."""
    paths = os.pathsep.join(path for path in (str(Path.cwd()), os.environ.get("PYTHONPATH", "")) if path)
    own = os.environ | {"PYTHONPATH": paths, "XDG_STATE_HOME": str(folder / "state")}
    with (folder / f"{name}.out").open("wb") as out, (folder / f"{name}.err").open("wb") as err:
        started = subprocess.Popen(
            [sys.executable, "-m", *MODULES[name], *words], cwd=folder, env=own, stdout=out, stderr=err
        )
        try:
            yield started
        finally:
            stop(started)


def answer(port: int) -> int:
    """Return the status of the pilot's page, 0 while nobody serves it."""
    connection = http.client.HTTPConnection("127.0.0.1", port, timeout=5)
    try:
        connection.request("GET", "/")
        return connection.getresponse().status
    except OSError:
        return 0
    finally:
        connection.close()


def until(condition: Callable[[], bool], limit_s: float, what: str) -> None:
    """Wait until something is so, in real time."""
    end = time.monotonic() + limit_s
    while not condition():
        assert time.monotonic() < end, what
        time.sleep(0.2)


def test_simulator_and_program_apart_fly_and_serve_the_page(tmp_path: Path) -> None:
    block = block_with("--pilot takeoff")
    mavlink, lidar, page = free_port(), free_port(), free_port()
    sim = [*slz(block, "sim").words[2:], "--mavlink", f"udpout:127.0.0.1:{mavlink}"]
    sim += ["--lidar-to", f"127.0.0.1:{lidar}", "--point-rate", "25000"]
    run = replaced(slz(block, "run").words[2:], {14550: mavlink, 56301: lidar, 8080: page})
    said = tmp_path / "run.err"
    with program("sim", sim, tmp_path) as simulator, program("run", [*run, *SHORT], tmp_path) as companion:
        until(lambda: "autopilot connected" in said.read_text("utf-8"), 60, "autopilot")
        until(lambda: answer(page) == 200, 150, "page")
        until(lambda: "ready" in said.read_text("utf-8"), 150, "ready")
        until(lambda: "parameters read" in said.read_text("utf-8"), 60, "parameters")
        assert simulator.poll() is None
        stop(companion)
        assert companion.returncode == 0, said.read_text("utf-8")[-2000:]
    summary = json.loads((tmp_path / "run.out").read_text("utf-8").splitlines()[-1])
    assert summary["lidar"]["packets"] > 0
    assert summary["link"]["missing"] == []
    assert summary["autopilot_parameters"]["fit"]


def lands_by_the_page(field: Field, block: list[Command]) -> None:
    """Fly the page's `slz sim` and `slz run` beside an autopilot of ours; only ports and the order differ."""
    sim, run = (list(slz(block, name).words[2:]) for name in ("sim", "run"))
    mavlink_sim, mavlink_run = field.urls()
    sim[sim.index("--autopilot") + 1] = mavlink_sim
    run[run.index("--mavlink") + 1] = mavlink_run
    lidar = free_port()
    run = replaced(tuple(run), {56301: lidar, 8080: free_port()})
    with field.autopilot_alone() as pilot:
        with (
            program("sim", [*sim, "--lidar-to", f"127.0.0.1:{lidar}"], field.folder),
            program("run", [*run, "--land", "auto", "--json"], field.folder) as companion,
        ):
            pilot.take_off(20.0)
            pilot.until(lambda: pilot.mode == field.landing_mode, 400, field.landing_mode)
            pilot.until(lambda: not pilot.armed, 200, "landing")
            stop(companion)
        summary = json.loads((field.folder / "run.out").read_text("utf-8").splitlines()[-1])
        assert summary["landed"]


@pytest.mark.px4
@pytest.mark.timeout(900)
def test_px4_lands_by_the_page_s_commands(request: pytest.FixtureRequest, tmp_path: Path) -> None:
    field = Px4Field(request.config.getoption("--px4"), tmp_path, scene="stadium", seed=1, instance=7)
    lands_by_the_page(field, block_with("px4_sitl"))


@pytest.mark.arducopter
@pytest.mark.timeout(900)
def test_arducopter_lands_by_the_page_s_commands(request: pytest.FixtureRequest, tmp_path: Path) -> None:
    field = ArduCopterField(
        request.config.getoption("--arducopter"), tmp_path, scene="stadium", seed=1, instance=7
    )
    lands_by_the_page(field, block_with("sim_vehicle.py"))
