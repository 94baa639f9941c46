"""Page over a board that the test writes, served without a flight for speed."""

from __future__ import annotations

import asyncio
import threading
from collections.abc import Callable, Coroutine
from dataclasses import replace
from typing import Any, Self

import numpy as np

import params
from companion.flight.dashboard.board import Board
from companion.flight.dashboard.page import PageEndpoint, about, serve
from slz import Box, Report, SelectedPoint
from tests.unit.companion.flight.dashboard.test_alarms import QUIET
from tests.unit.companion.flight.dashboard.test_server import Clerk
from tests.unit.companion.flight.landing.flight import Flight, zone

RENEW_S = 0.05
START_S = 30.0
FLYING = {
    **QUIET, "phase": "hold", "mode": "GUIDED", "guided": True, "armed": True, "on_ground": False,
    "lidar_ok": True, "blind": "", "failsafe": False, "estimate_lost": "",
    "flying": False, "battery_pct": 80.0, "east_m": 0.0, "north_m": 0.0, "up_m": 20.0,
    "height_m": 20.0, "yaw_deg": 0.0, "pitch_deg": 0.0, "roll_deg": 0.0, "velocity_enu_ms": [0.0, 0.0, 0.0],
    "aim_enu_m": None, "doing": "holds for an order", "abort_does": "holds here",
}  # fmt: skip


def report(*, selected: bool = False, **point: Any) -> Report:
    """Return a report with a zone of 20 m by 20 m around (10, 10)."""
    flight = Flight([])
    if selected:
        flight.selected = np.array([10.0, 10.0, 0.0])
    made = flight.situation().report
    assert made is not None
    grid = made.near.grid
    row, col = round((0 - grid.south_m) / grid.cell_m), round((0 - grid.west_m) / grid.cell_m)
    many = round(20 / grid.cell_m)
    box, cells = Box(row, row + many, col, col + many), np.ones((many, many), np.uint8)
    square = replace(zone(1, 10.0, 10.0), box=box, cells=cells, area_m2=400.0)
    chosen: SelectedPoint | None = made.selected
    if chosen is not None and point:
        chosen = replace(chosen, **point)
    return replace(made, near=replace(made.near, zones=(square,)), selected=chosen)


class Beside:
    """Runs a coroutine in a thread; `stop` lets it end."""

    def __init__(self, main: Callable[[asyncio.Event, threading.Event], Coroutine[Any, Any, None]]) -> None:
        self._main = main
        self._ready = threading.Event()
        self._loop: asyncio.AbstractEventLoop | None = None
        self._stopped: asyncio.Event | None = None
        self._thread = threading.Thread(target=lambda: asyncio.run(self._run()), daemon=True)

    async def _run(self) -> None:
        self._loop, self._stopped = asyncio.get_running_loop(), asyncio.Event()
        await self._main(self._stopped, self._ready)

    def __enter__(self) -> Self:
        self._thread.start()
        assert self._ready.wait(START_S)
        return self

    def __exit__(self, *_: object) -> None:
        assert self._loop is not None
        assert self._stopped is not None
        self._loop.call_soon_threadsafe(self._stopped.set)
        self._thread.join(START_S)
        assert not self._thread.is_alive()


class Shown(Beside):
    """The page of a board; a context manager that ends it.

    Attributes
    ----------
    state
        Shown again and again until it is replaced.
    """

    def __init__(self, port: int = 0) -> None:
        super().__init__(self._serve)
        self.front = PageEndpoint(f"127.0.0.1:{port}")
        self.url = f"http://{self.front.address}/"
        self.board = Board(params.load())
        self.state = dict(FLYING)
        self.clerk = Clerk()
        self._hangs = False

    def hang(self) -> None:
        """Show nothing new any more, as a companion whose loop is stuck."""
        self._hangs = True

    async def _serve(self, stopped: asyncio.Event, ready: threading.Event) -> None:
        server = serve(self.front, self.board, self.clerk, about(params.rows()))
        ready.set()
        while not stopped.is_set():
            if not self._hangs:
                self.board.state = dict(self.state)
            await asyncio.sleep(RENEW_S)
        await asyncio.to_thread(server.stop)
        self.front.close()
