"""Page service of the companion: optional, and a failure does not affect the landing."""

from __future__ import annotations

import asyncio
import logging
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np

import params
from companion.flight.dashboard import map_block, state_document
from companion.flight.dashboard.board import Board
from companion.flight.dashboard.browser_orders import Command
from companion.flight.dashboard.order_handler import FlightOrderHandler, OrderHandler
from companion.flight.dashboard.security.access import Access, read_tokens
from companion.flight.dashboard.security.address import bound, listen, parse_address
from companion.flight.dashboard.security.token_check import TokenCheck
from companion.flight.dashboard.server import Server
from companion.flight.dashboard.site import ANSWER_S, Site
from companion.flight.flight_view import FlightView
from companion.flight.landing.situation import Reply
from companion.runtime.process_tuning import SWITCH_S
from params import Row
from slz import LocalFrame, Pipeline, Report

log = logging.getLogger(__name__)

STATE_S = 0.1
HEALTH_S = 1.0
FIRST_PAUSE_S, LONGEST_PAUSE_S = 1.0, 60.0
STEADY_S = 60.0


class PageEndpoint:
    """Address and access of a page, opened before the flight so that a wrong address ends the start.

    Parameters
    ----------
    address
        HOST:PORT.
    tokens
        File of tokens, None for none.

    Raises
    ------
    UsageError
        The address is wrong, in use, or needs a token; the file is refused.
    """

    def __init__(self, address: str, tokens: Path | None = None) -> None:
        wanted = parse_address(address)
        known = None if tokens is None else read_tokens(tokens)
        Access(wanted, known)  # refuse before the port is opened
        self.socket = listen(wanted)
        self.address = bound(self.socket)
        self.token_check = TokenCheck(Access(self.address, known))
        self.background: Any = None  # BackgroundPicture, which only some installations can import

    def close(self) -> None:
        """Free the port, and stop drawing the background."""
        self.socket.close()
        if self.background is not None:
            self.background.worker.shutdown(wait=False, cancel_futures=True)


def serve(endpoint: PageEndpoint, board: Board, handler: OrderHandler, about: dict[str, Any]) -> Server:
    """Start serving a board; orders go to the handler in the running loop."""
    loop = asyncio.get_running_loop()

    async def carry_out(order: Command) -> Reply:
        asked = carry_out_in_time(handler, order, time.monotonic() + ANSWER_S)
        return await asyncio.wrap_future(asyncio.run_coroutine_threadsafe(asked, loop))

    server = Server(
        lambda: Site(board, endpoint.token_check, carry_out, about, endpoint.background), endpoint.socket
    )
    server.start()
    return server


async def carry_out_in_time(handler: OrderHandler, order: Command, until_s: float) -> Reply:
    """Execute an order before its deadline; later, its sender has been informed that it had no effect.

    until_s: monotonic clock. An abort is executed at any time.
    """
    if time.monotonic() > until_s and order.do != "abort":
        return Reply(False, "the landing program was busy for too long: look and try again")
    return await handler.carry_out(order)


class Page:
    """Shows a companion and accepts orders for it."""

    def __init__(self, flight: FlightView, endpoint: PageEndpoint) -> None:
        self._flight, self.endpoint = flight, endpoint
        self.board = Board(flight.parameters)
        self.board.computing = lambda: flight.mapping.worker.busy
        self.starts = 0
        self._server: Server | None = None
        self._anew = True
        self._last_state_s = self._last_health_s = -1e9
        flight.link.on_text.subscribe(self.board.add_text)

    async def run(self) -> None:
        """Serve until cancelled; restart the page's thread after a growing pause when it ends."""
        pause_s = FIRST_PAUSE_S
        # Threads that compute for the landing get Python's lock back from the page after this interval.
        sys.setswitchinterval(min(SWITCH_S, sys.getswitchinterval()))
        log.info("the page is at http://%s/", self.endpoint.address)
        while True:
            begun_s = time.monotonic()
            try:
                await self._serve()
            except Exception:
                log.exception("the page failed")
            if time.monotonic() - begun_s > STEADY_S:
                pause_s = FIRST_PAUSE_S
            log.warning("the page is started again in %.0f s", pause_s)
            await asyncio.sleep(pause_s)
            pause_s = min(2 * pause_s, LONGEST_PAUSE_S)

    def use_report(self, report: Report) -> None:
        """Put a report on the board."""
        self.board.set_report(report, self._flight.mapping.worker.age_ms)

    def clear_path(self, _frame: LocalFrame) -> None:
        """Clear the path, which is in the map frame of before."""
        self.board.clear_path()

    def close(self) -> None:
        """Stop the page and free its port."""
        if self._server is not None:
            self._server.stop()
        self.endpoint.close()

    # ---- parts ----------------------------------------------------------------------------------

    async def _serve(self) -> None:
        self.starts += 1
        self.board.viewers = 0
        self.board.map_changes.clear()
        self._anew = True
        self._flight.mapping.worker.display_hooks["page"] = self._copy_map_changes
        handler = FlightOrderHandler(self._flight)
        server = self._server = serve(self.endpoint, self.board, handler, about(self._flight.settings.rows))
        try:
            while server.alive:
                self._observe()
                await asyncio.sleep(STATE_S)
        finally:
            server.ask_to_stop()
        raise server.failure or RuntimeError("it ended by itself")

    def _observe(self) -> None:
        """Put the state on the board, at most ten times a second of real time."""
        now_s, flight, board = time.monotonic(), self._flight, self.board
        path_enu_m = flight.deciding.path.enu_m
        if path_enu_m:
            board.add_position(_place(path_enu_m.last))
        if now_s - self._last_state_s >= 0.9 * STATE_S:
            self._last_state_s = now_s
            board.state = state_document.state(flight)
        if now_s - self._last_health_s >= HEALTH_S and (board.viewers or board.health is None):
            self._last_health_s = now_s
            board.health = state_document.health(flight)

    def _copy_map_changes(self, pipeline: Pipeline) -> None:
        """Copy the changes of the maps, in the pipeline's thread."""
        if self.board.copy_map_changes(pipeline, anew=self._anew):
            self._anew = False


def about(rows: tuple[Row, ...]) -> dict[str, Any]:
    """Return the document sent once to each page: the table of parameters and that of the layers."""
    table = [
        {
            "name": row.name,
            "mavlink": row.mavlink,
            "unit": row.unit,
            "low": row.low,
            "high": row.high,
            "whole": row.kind is int,
            "choices": list(row.airworthy_choices),
            "default": row.default,
            "help": row.sentence,
            "allowed": params.allowed(row, in_flight=True),
            "live": row.live,
        }
        for row in rows
    ]
    return {"kind": "flight", "rows": table, "layers": map_block.description()}


def _place(enu_m: np.ndarray[Any, Any]) -> tuple[float, float, float]:
    return round(float(enu_m[0]), 2), round(float(enu_m[1]), 2), round(float(enu_m[2]), 2)
