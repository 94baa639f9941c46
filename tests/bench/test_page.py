"""Cost of the pilot's page in real time: `pytest -m bench -s -n 0 tests/bench/test_page.py`.

The feeder's Mid-360 at 200,000 points/s, the map of 1 km at cells of 0.2 m, five browsers with all of it in
view. Every window changes the maximum number of tiles that the page sends, at moving places along a sweep
over that kilometre.
"""

from __future__ import annotations

import asyncio
import json
import os
import shutil
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np
import pytest

import params
from companion.flight.app import Companion
from companion.flight.dashboard.board import NEAR_TILES
from companion.flight.dashboard.page import PageEndpoint
from companion.flight.sensing import Sources
from companion.flight.telling import Displays
from slz import Drawn, DrawnTile, Pipeline
from slz.kernels.cells.cell_record import TILE
from slz.terrain.terrain_view import DISPLAYED
from tests.bench.test_streams import POINTS_PER_S, feeder
from tests.ports import free_port

TURNS, SETTLE_S, TURN_S = 5, 5.0, 25.0
BROWSERS, LEVEL = 5, 2
SIDE_TILES = round(1000 / (TILE * 0.2))


class Sweep:
    """Ground of a kilometre that changes at 160 tiles a window, in place of the feeder's small circle."""

    def __init__(self, companion: Companion) -> None:
        self._companion = companion
        self._next = 0
        rng = np.random.default_rng(1)
        self._ground = [_ground(rng) for _ in range(40)]

    def look(self, pipeline: Pipeline) -> None:
        """Copy what a window changed, as the page does, and show as much of the sweep instead."""
        assert self._companion.telling.page is not None
        board = self._companion.telling.page.board
        if board.viewers == 0 or len(board.map_changes) >= 4:
            return
        for name, most in (NEAR_TILES, ("far", 40)):
            pipeline.drawn(name, most)  # type: ignore[arg-type]
        board.map_changes.append(("near", Drawn(-1, -500.0, -500.0, 0.2, self._tiles(), (), 0)))

    def _tiles(self) -> tuple[DrawnTile, ...]:
        tiles = []
        for _ in range(NEAR_TILES[1]):
            key = divmod(self._next % SIDE_TILES**2, SIDE_TILES)
            self._next += 1
            tiles.append(DrawnTile(key, *self._ground[self._next % len(self._ground)]))
        return tuple(tiles)


def _ground(rng: np.random.Generator) -> tuple[Any, ...]:
    """Return the maps of a tile: a slope with noise of 2 cm, as uneven as a meadow."""
    rise = np.add.outer(np.arange(TILE), np.arange(TILE)) * 0.01
    height = (400 + rise + rng.normal(0, 0.02, (TILE, TILE))).astype(np.float32)
    some = rng.random((TILE, TILE)).astype(np.float32)
    state = np.ones((TILE, TILE), np.uint8)
    known = {
        "height_m": height, "slope_deg": 3 + some, "relief_m": 0.05 + 0.1 * some,
        "certainty": 0.9 + 0.1 * some,
    }  # fmt: skip
    return {name: known.get(name, some) for name in DISPLAYED}, state


@contextmanager
def browsers(host: str) -> Iterator[subprocess.Popen[str]]:
    # In flight they run on other computers: here they get what nobody else wants.
    ordinary = ["chrt", "--other", "0"] if shutil.which("chrt") else []
    command = [*ordinary, sys.executable, "-m", "tests.bench.onlooker", host, str(BROWSERS), str(LEVEL)]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdin is not None
        assert process.stdout is not None
        assert process.stdout.readline() == "ready\n"
        yield process


def cpu_s(prefix: str) -> float:
    """Return processor time of the living threads whose name begins so."""
    ticks = 0
    for thread in threading.enumerate():
        if thread.name.startswith(prefix) and thread.native_id is not None:
            with open(f"/proc/self/task/{thread.native_id}/stat") as file:
                fields = file.read().rpartition(")")[2].split()
            ticks += int(fields[11]) + int(fields[12])
    return ticks / os.sysconf("SC_CLK_TCK")


async def measure() -> dict[str, Any]:
    """Look at turns with five browsers and with none, at one companion: a computer's mood changes."""
    mavlink_port, lidar_port = free_port(), free_port()
    front = PageEndpoint("127.0.0.1:0")
    with feeder(mavlink_port, lidar_port, POINTS_PER_S):
        companion = Companion(
            f"udpin:127.0.0.1:{mavlink_port}",
            Sources(f"livox:127.0.0.1:{lidar_port}"),
            params.build({"zone_m": 1000.0, "cell_m": 0.2}),
            auto=False,
            displays=Displays(front),
        )
        task = asyncio.create_task(companion.run())
        while not (companion.link.ready and companion.mapping.worker.reports):
            await asyncio.sleep(0.1)
        companion.mapping.worker.display_hooks["page"] = Sweep(companion).look
        without, shown = Turns(), Turns()
        for _ in range(TURNS):
            await watch(companion, without)
            with browsers(str(front.address)) as process:
                await watch(companion, shown)
                assert process.stdin is not None
                assert process.stdout is not None
                process.stdin.close()
                seen = json.loads(process.stdout.read())
        companion.stop()
        await task
    dropped = companion.mapping.worker.dropped_windows
    return {"without": without.told(), "with": shown.told() | {"last_turn": seen}, "dropped_windows": dropped}


class Turns:
    """What was measured in turns of one kind."""

    def __init__(self) -> None:
        self.latencies_ms: list[float] = []
        self.seconds = self.process_s = self.page_s = 0.0

    def told(self) -> dict[str, Any]:
        """Sum up."""
        p50_ms, p99_ms = np.percentile(self.latencies_ms, (50, 99))
        return {
            "latency_p50_ms": round(float(p50_ms), 1),
            "latency_p99_ms": round(float(p99_ms), 1),
            "reports": len(self.latencies_ms),
            "process_cpu": round(self.process_s / self.seconds, 3),
            "page_cpu": round(self.page_s / self.seconds, 3),
            "load": round(os.getloadavg()[0], 1),
        }


async def watch(companion: Companion, turns: Turns) -> None:
    """Add a turn."""
    await asyncio.sleep(SETTLE_S)
    companion.mapping.worker.computing_ms.clear()
    started_s, process_s, page_s = time.monotonic(), time.process_time(), cpu_s("slz-page")
    await asyncio.sleep(TURN_S)
    turns.seconds += time.monotonic() - started_s
    turns.process_s += time.process_time() - process_s
    turns.page_s += cpu_s("slz-page") - page_s
    turns.latencies_ms += companion.mapping.worker.computing_ms.array().tolist()


@pytest.mark.bench
@pytest.mark.timeout(600)
def test_the_page_costs_little_with_a_kilometre_and_five_browsers() -> None:
    told = asyncio.run(measure())
    print(json.dumps(told))
    without, shown = told["without"], told["with"]
    assert shown["page_cpu"] <= 0.15
    assert shown["latency_p99_ms"] <= without["latency_p99_ms"] + 5
    assert told["dropped_windows"] == 0
