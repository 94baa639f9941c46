"""Page site: prepares the messages to browsers and answers their requests, in the page's event loop."""

from __future__ import annotations

import asyncio
import json
import logging
import secrets
import time
from collections import deque
from collections.abc import Awaitable, Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import astuple
from typing import Any, Literal, TypeVar

from companion.flight.dashboard.alarms import active_alarms
from companion.flight.dashboard.board import Board
from companion.flight.dashboard.browser_orders import Command, Facts
from companion.flight.dashboard.freshness import NEVER
from companion.flight.dashboard.security.token_check import TokenCheck
from companion.flight.dashboard.tile_pyramid import LEVELS, TilePyramids
from companion.flight.dashboard.zone_shapes import ZoneShapes
from companion.flight.landing.situation import Reply
from companion.flight.outputs.geojson_features import hazard_features, zone_features

log = logging.getLogger(__name__)

TICK_S = 0.1
ANSWER_S = 3.0
STALE_S = 3.0
TICKS_KEPT = 256  # earlier ticks are stale whatever their age
# The page waits while a window is computed, but at most this long, so that what it shows stays fresh.
MOST_WAIT_S, LOOK_AGAIN_S = 0.2, 0.01
DRAWN_S = 0.3  # from one picture of the zones to the next: reports come faster than eyes follow
Result = TypeVar("Result")


class Site:
    """Converts the board to messages, once for all browsers.

    Parameters
    ----------
    board
        Written by the companion.
    token_check
        Access control.
    carry_out
        Passes an order to the companion and waits for the answer.
    about
        Document sent once to each page: kind of page, table of parameters.
    background
        `BackgroundPicture` beneath the map from above, None for none.

    Attributes
    ----------
    tick
        Count of states shown, by which a browser names the one it has seen. It increases only with a new
        state from the companion, so that a hanging companion is not taken for a flying one.
    serving
        ID of this site; with another one the maps are sent anew.
    state, zones, health, replay
        Messages ready to send, each with a number that increases when it changes.
    """

    def __init__(
        self,
        board: Board,
        token_check: TokenCheck,
        carry_out: Callable[[Command], Awaitable[Reply]],
        about: dict[str, Any],
        background: Any = None,
    ) -> None:
        self.board, self.token_check, self.about, self.background = board, token_check, about, background
        self.pyramids = TilePyramids()
        self.serving = secrets.token_hex(8)
        self.tick = 0
        self.state: tuple[int, str] = (0, "")
        self.zones: tuple[int, str] = (0, "")
        self.health: tuple[int, str] = (0, "")
        self.replay: tuple[int, str] = (0, "")
        self.picture: dict[str, Any] | None = None
        self.refused = 0
        self._carry_out = carry_out
        self._shapes = ZoneShapes()
        self._thread = ThreadPoolExecutor(1, thread_name_prefix="slz-page-encoder")
        self._collection: tuple[object, bytes] = (None, b"")
        self._sources: dict[str, Any] = {}
        self._shown: tuple[Any, Any] = (None, None)
        self._ticked_s: deque[float] = deque(maxlen=TICKS_KEPT)

    # ---- output ---------------------------------------------------------------------------------

    async def run(self) -> None:
        """Refresh ten times a second until cancelled."""
        async with asyncio.TaskGroup() as group:
            group.create_task(self._keep_drawing(), name="page drawing")
            while True:
                await self.give_way()
                self.refresh()
                self.token_check.incidents.report()
                await asyncio.sleep(TICK_S)

    def refresh(self) -> None:
        """Prepare the messages of this tick."""
        board = self.board
        shown, self._shown = self._shown, (board.state, board.replay)
        renewed = self._shown[0] is not shown[0] or self._shown[1] is not shown[1]  # a replay may be paused
        if board.state is not None and renewed:
            self.tick += 1
            self._ticked_s.append(time.monotonic())
            selected = None if self.picture is None else self.picture["selected"]
            document = {"t": "state", "tick": self.tick, **board.state}
            document["alarms"] = active_alarms(board.state, selected)
            self.state = self.tick, json.dumps(document)
        for name in ("health", "replay"):
            source = getattr(board, name)
            if source is not None and source is not self._sources.get(name):
                self._sources[name] = source
                number = getattr(self, name)[0] + 1
                setattr(self, name, (number, json.dumps({"t": name, **source})))

    async def _keep_drawing(self) -> None:
        """Process reports and changes of the maps, in a thread."""
        again_s = 0.0
        while True:
            while self.board.map_changes:
                await self.in_thread(self.pyramids.apply_changes, *self.board.map_changes.popleft())
            number, report = self.board.report_number, self.board.report
            if report is not None and number != self.zones[0] and time.monotonic() >= again_s:
                again_s = time.monotonic() + DRAWN_S
                document = await self.in_thread(self._shapes.document, report, self.board.parameters)
                document |= {"t": "zones", "number": number, "latency_ms": round(self.board.latency_ms, 1)}
                self.picture = document
                self.zones = number, await self.in_thread(json.dumps, document)
            await asyncio.sleep(TICK_S)

    async def in_thread(self, work: Callable[..., Result], *args: Any) -> Result:
        """Run work that takes milliseconds in the encoder's thread."""
        await self.give_way()
        return await asyncio.get_running_loop().run_in_executor(self._thread, work, *args)

    async def give_way(self) -> None:
        """Wait while a window is computed, at most `MOST_WAIT_S`."""
        loop = asyncio.get_running_loop()
        until_s = loop.time() + MOST_WAIT_S
        while self.board.computing() and loop.time() < until_s:  # noqa: ASYNC110 - another thread's
            await asyncio.sleep(LOOK_AGAIN_S)

    async def block(self, name: str, serial: int, level: int, row: int, col: int) -> bytes | None:
        """Return a compressed block of a map; None where there is none, or if the map has been replaced."""
        pyramid = self.pyramids.by_name.get(name)
        if pyramid is None or pyramid.serial != serial or not 0 <= level < LEVELS:
            return None
        return await self.in_thread(pyramid.encoded, level, row, col)

    async def from_background(self, do: Literal["place", "tile"], origin: tuple[float, ...], *of: int) -> Any:
        """Let the background's thread find its place or draw a tile; None without one or in another frame."""
        report, picture = self.board.report, self.background
        if picture is None or report is None or astuple(report.frame) != origin:
            return None
        await self.give_way()
        loop, work = asyncio.get_running_loop(), getattr(picture, do)
        return await loop.run_in_executor(picture.worker, work, report.frame, *of)

    async def collection(self) -> bytes:
        """Return the zones of the newest report as GeoJSON."""
        number, report = self.board.report_number, self.board.report
        now = number, self._past()
        if self._collection[0] != now:
            self._collection = now, await self.in_thread(_collection, now[1], report)
        return self._collection[1]

    async def hazards(self) -> bytes:
        """Return the wires of the newest report, and what moves now, as GeoJSON."""
        report, state = self.board.report, self.board.state
        features = (
            []
            if report is None
            else await self.in_thread(
                hazard_features, report.wires, () if state is None else state["moving"] or (), report.frame
            )
        )
        return _geojson(self._past(), features)

    def _past(self) -> dict[str, float | None]:
        """Return which sources are silent, and for how long."""
        return dict(NEVER) if self.board.state is None else self.board.state["past"]

    # ---- requests -------------------------------------------------------------------------------

    async def answer(self, order: Command, seen_tick: int | None) -> Reply:
        """Execute an operator's order.

        seen_tick: newest state on the sender's screen, None for none. An order given on the sight of a state
        older than three seconds, or never shown, is refused, except an abort.
        """
        age_s = None if seen_tick is None else self._age_s(seen_tick)
        if (age_s is None or age_s > STALE_S) and order.do != "abort":
            return Reply(False, "sent on the sight of old data: look and try again")
        try:
            async with asyncio.timeout(ANSWER_S):
                return await self._carry_out(order)
        except TimeoutError:
            return Reply(False, "no answer from the landing program: try again")

    def _age_s(self, tick: int) -> float | None:
        """Return the age of a shown state; None if it was not shown, or too long ago."""
        back = self.tick - tick
        return time.monotonic() - self._ticked_s[-1 - back] if 0 <= back < len(self._ticked_s) else None

    def facts(self, question: Facts) -> dict[str, Any]:
        """Return the map's values at a point."""
        found = self.pyramids.cell(question.east_m, question.north_m)
        point = {"east_m": question.east_m, "north_m": question.north_m}
        if found is None:
            return {**point, "map": None, "state": "unknown"}
        name, cell = found
        return {**point, "map": name, "cell_m": cell.cell_m, **cell.values, "state": cell.state}

    def close(self) -> None:
        """Stop the encoder's thread."""
        self._thread.shutdown(wait=False, cancel_futures=True)


def _geojson(past: dict[str, float | None], features: list[Any]) -> bytes:
    return json.dumps({"type": "FeatureCollection", "past": past, "features": features}).encode()


def _collection(past: dict[str, float | None], report: Any) -> bytes:
    return _geojson(past, [] if report is None else zone_features(report))
