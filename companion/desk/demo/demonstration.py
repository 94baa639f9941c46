"""Demonstration flight of `slz demo`: simulator and companion, coupled only by messages and a clock."""

from __future__ import annotations

import asyncio
import contextlib
import json
import logging
import shutil
import socket
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from rich.console import Console
from rich.status import Status

from companion.desk.demo import flight_files
from companion.desk.demo.demo_options import TAKEOFF_M, DemoOptions, check
from companion.desk.demo.flight_files import FlownMap, Said, Timeline
from companion.desk.evaluation import Truth, area_error, read_truth, touchdown
from companion.flight.app import Companion
from companion.flight.landing.situation import Phase
from companion.flight.sensing import Sources
from companion.flight.telling import Displays
from companion.runtime import extras, output_folder
from companion.runtime.errors import CompanionError
from companion.runtime.interrupt import Interrupts
from companion.runtime.lockstep_loop import LockstepClient, LockstepLoop
from params import Parameters

if TYPE_CHECKING:
    from companion.flight.dashboard.page import PageEndpoint

log = logging.getLogger(__name__)

START_LIMIT_S = 180.0
END_LIMIT_S = 900.0  # the simulator draws the truth at the end: minutes on a slow computer
SETTLE_S = 3.0


def fly(
    plan: DemoOptions,
    parameters: Parameters,
    console: Console,
    interrupts: Interrupts,
    *,
    live: bool,
    front: PageEndpoint | None = None,
) -> dict[str, Any]:
    """Fly one simulated mission and return its summary, evaluated against the simulator's truth.

    live: show the progress. front: server of the pilot's page. A signal ends the companion in order and the
    simulator at once; nothing is evaluated or drawn then.

    Raises
    ------
    UsageError
        The scene is unknown or the folder cannot be written.
    CompanionError
        The simulator does not start or dies.
    Interrupted
        A signal arrived.
    """
    check(plan)
    output_folder.prepare(plan.out)
    flight_files.remove(plan.out)
    started = time.perf_counter()
    interrupts.leftovers.append(lambda: console.show_cursor(True))
    shown = console if live else Console(quiet=True)
    with _truth_folder(interrupts) as folder:
        with (
            shown.status("starting the simulator (which compiles at its first start)") as status,
            _simulator(plan, parameters, folder, interrupts) as simulator,
        ):
            companion, flown, elapsed_s = _run(plan, parameters, simulator, status, interrupts, front)
            status.update("judging against the truth")
            _wait(simulator.process)
        truth = read_truth(folder)
        evaluated = _evaluate(companion, truth, parameters)
        files = _draw(companion, plan.out)
        for file in ("truth.tif", "scene.json", "flight.json"):
            shutil.copy(folder / file, plan.out / file)
    summary = companion.summary | evaluated
    wall_s = time.perf_counter() - started
    summary |= {
        "scene": plan.scene,
        "seed": plan.seed,
        "sensor": plan.sensor.name,
        "simulated_s": round(elapsed_s, 1),
        "wall_s": round(wall_s, 1),
        "maps": files,
    }
    mapped = None
    report = companion.mapping.latest.newest
    if companion.maps is not None and report is not None:
        points = flight_files.points(summary, truth.flight.get("touchdown"))
        mapped = FlownMap(companion.maps, report, companion.settings.running, flown, points)
    summary["files"] = flight_files.write(plan.out, mapped, summary)
    (plan.out / "summary.json").write_text(json.dumps(summary, indent=1) + "\n", "utf-8")
    return summary


@dataclass(frozen=True, slots=True)
class _Simulator:
    """The simulator's process, the port of its clock, and the ports it sends to."""

    process: subprocess.Popen[str]
    clock_port: int
    mavlink_port: int
    lidar_port: int
    radar_port: int


def _run(
    plan: DemoOptions,
    parameters: Parameters,
    simulator: _Simulator,
    status: Status,
    interrupts: Interrupts,
    front: PageEndpoint | None,
) -> tuple[Companion, Timeline, float]:
    """Fly on simulated time; return the stopped companion, its log and the simulated seconds."""
    with interrupts.held():
        client = LockstepClient(simulator.clock_port)
        loop = LockstepLoop(client.advance)

    def break_off() -> None:
        loop.let_go()
        simulator.process.kill()

    started = loop.time()
    with (
        interrupts.handled_by(break_off),
        contextlib.closing(client),
        asyncio.Runner(loop_factory=lambda: loop) as runner,
    ):
        try:
            flown = runner.run(_mission(plan, parameters, simulator, status, interrupts, front))
            return *flown, loop.time() - started
        finally:
            loop.let_go()


async def _mission(
    plan: DemoOptions,
    parameters: Parameters,
    simulator: _Simulator,
    status: Status,
    interrupts: Interrupts,
    front: PageEndpoint | None,
) -> tuple[Companion, Timeline]:
    companion = Companion(
        f"udpin:127.0.0.1:{simulator.mavlink_port}",
        Sources(
            f"{plan.sensor.kind}:127.0.0.1:{simulator.lidar_port}",
            f"radar:127.0.0.1:{simulator.radar_port}" if plan.sensor.radar else None,
        ),
        parameters,
        auto=True,
        displays=Displays(front),
        prior=plan.prior,
        record=plan.out / flight_files.RECORDING,
    )
    log = Timeline()
    watch = asyncio.create_task(_watch(companion, log, plan, status, interrupts))
    try:
        await companion.run()
    finally:
        watch.cancel()
    return companion, log


async def _watch(
    companion: Companion, log: Timeline, plan: DemoOptions, status: Status, interrupts: Interrupts
) -> None:
    """Log and show the progress; stop the companion after landing, at the time limit or on a signal."""
    loop = asyncio.get_running_loop()
    start, wall = loop.time(), time.perf_counter()
    companion.link.on_text.subscribe(
        lambda text, severity: log.texts.append(Said(loop.time() - start, severity, text))
    )
    while companion.executive.phase is not Phase.LANDED and loop.time() - start < plan.limit_s:
        if interrupts.number is not None:
            companion.stop()
            return
        s = companion.deciding.situations.situation()
        elapsed = loop.time() - start
        log.note(elapsed, companion)
        pace = elapsed / max(1e-3, time.perf_counter() - wall)
        report = companion.mapping.latest.newest
        zones = len(report.zones) if report else 0
        status.update(
            f"{elapsed:4.0f} s  {companion.executive.phase.value:<8}  {s.mode or '-':<9} "
            f"height {s.height_above_home_m:5.1f} m  zones {zones:2d}  {pace:4.1f}x real time"
        )
        await asyncio.sleep(0.5)
    log.note(loop.time() - start, companion)
    await asyncio.sleep(SETTLE_S)
    companion.stop()


@contextlib.contextmanager
def _truth_folder(interrupts: Interrupts) -> Iterator[Path]:
    """Yield a temporary folder for the simulator's truth; it is removed afterwards."""
    folders: list[Path] = []

    def remove() -> None:
        for made in folders:
            shutil.rmtree(made, ignore_errors=True)

    interrupts.leftovers.append(remove)
    try:
        with interrupts.held():
            folders.append(Path(tempfile.mkdtemp(prefix="slz-truth-")))
        yield folders[0]
    finally:
        remove()


@contextlib.contextmanager
def _simulator(
    plan: DemoOptions, parameters: Parameters, truth: Path, interrupts: Interrupts
) -> Iterator[_Simulator]:
    """Run the simulator in a child process; it is killed at the end of the block."""
    mavlink_port, lidar_port, radar_port = _free_udp_ports(3)
    command = [
        sys.executable, "-m", "sitl",
        "--scene", plan.scene,
        "--seed", str(plan.seed),
        "--lidar", plan.sensor.simulated,
        "--point-rate", str(plan.point_rate_hz),
        "--mavlink", f"udpout:127.0.0.1:{mavlink_port}",
        "--lidar-to", f"127.0.0.1:{lidar_port}",
        "--lockstep", "0",
        "--speedup", str(plan.speedup),
        "--pilot", "takeoff",
        "--takeoff-alt", str(TAKEOFF_M.get(plan.scene, 30.0)),
        "--intruder", plan.intruder,
        "--wind", str(plan.wind_ms),
        "--truth", str(truth),
        "--footprint", str(parameters.footprint_m),
        "--slope-limit", str(parameters.safe_slope_deg),
        "--relief-limit", str(parameters.relief_m),
        *gear_options(parameters),
        *rotor_options(parameters),
    ]  # fmt: skip
    if plan.wind_from_deg is not None:
        command += ["--wind-from", str(plan.wind_from_deg)]
    if plan.sensor.radar:
        command += ["--radar-to", f"127.0.0.1:{radar_port}"]
    processes: list[subprocess.Popen[str]] = []

    def kill() -> None:
        for started in processes:
            started.kill()
            started.wait()

    interrupts.leftovers.append(kill)
    try:
        with interrupts.held():
            # Its own process group keeps the terminal's Ctrl-C from it: it is ended from here.
            processes.append(
                subprocess.Popen(
                    command, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, text=True, process_group=0
                )
            )
        process = processes[0]
        yield _Simulator(process, _ready(process), mavlink_port, lidar_port, radar_port)
    finally:
        kill()
        for ended in processes:
            if ended.stdout is not None:
                ended.stdout.close()


def gear_options(parameters: Parameters) -> list[str]:
    """Return the simulator's options of the gear; without gear, none: its vehicle has pads of its own."""
    if parameters.gear == "none":
        return []
    return [
        "--gear", parameters.gear,
        "--gear-length", str(parameters.gear_size_m[0]),
        "--gear-width", str(parameters.gear_size_m[1]),
        "--pad-radius", str(parameters.pad_radius_m),
        "--clearance", str(parameters.clearance_m),
        "--tip-limit", str(parameters.greatest_tilt_deg),
    ]  # fmt: skip


def rotor_options(parameters: Parameters) -> list[str]:
    """Return the simulator's options of the disc; without one its vehicle has its own propellers."""
    if parameters.rotor_diameter_m == 0:
        return []
    diameter_m, height_m = parameters.rotor_diameter_m, parameters.rotor_height_m
    return ["--rotor-diameter", str(diameter_m), "--rotor-height", str(height_m)]


def _ready(process: subprocess.Popen[str]) -> int:
    """Return the clock's port from the simulator's ready line."""
    line = process.stdout.readline() if process.stdout else ""
    try:
        return int(json.loads(line)["lockstep"])
    except (ValueError, KeyError, TypeError):
        code = process.wait(START_LIMIT_S)
        raise CompanionError(f"the simulator did not start (exit code {code})") from None


def _wait(process: subprocess.Popen[str]) -> None:
    try:
        process.wait(END_LIMIT_S)
    except subprocess.TimeoutExpired:
        process.kill()
        process.wait()
        raise CompanionError("the simulator did not end") from None


def _draw(companion: Companion, out: Path) -> dict[str, str]:
    """Draw the maps of the flight; without the drawing library only say so."""
    if (package := extras.missing("plots")) is not None:
        log.warning(extras.explain("no pictures", package, "plots"))
        return {}
    from companion.desk.figures import draw_flight

    return draw_flight(companion, out)


def _evaluate(companion: Companion, truth: Truth, parameters: Parameters) -> dict[str, Any]:
    chosen = companion.executive.tally.chosen_enu_m
    frame = companion.sensing.history.frame
    where = frame.lla(np.asarray(chosen)) if chosen is not None and frame is not None else None
    result: dict[str, Any] = {"area_error": None, "unsafe_as_safe": 0.0, "recall": 0.0}
    report = companion.mapping.latest.newest
    if companion.maps is not None and report is not None:
        result |= area_error(truth, companion.maps, report.zones, parameters)
    return result | touchdown(truth, where)


def _free_udp_ports(count: int) -> list[int]:
    """Return ports that were free a moment ago."""
    sockets = [socket.socket(socket.AF_INET, socket.SOCK_DGRAM) for _ in range(count)]
    try:
        for one in sockets:
            one.bind(("127.0.0.1", 0))
        return [int(one.getsockname()[1]) for one in sockets]
    finally:
        for one in sockets:
            one.close()
