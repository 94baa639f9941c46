"""Web page of a replay: the views of a flight, with a timeline in place of orders."""

from __future__ import annotations

import asyncio
import logging
import time
from collections.abc import Callable, Iterable, Iterator
from contextlib import AbstractContextManager
from functools import partial
from pathlib import Path
from typing import Any

from mcap.exceptions import McapError
from mcap.reader import make_reader

from companion.desk.replay.own_replay import Replay as Flight
from companion.desk.replay.player import Player, Playing, Step
from companion.desk.replay.recording_reader import RecordingReader
from companion.desk.replay.recording_type import RecordingOptions, open_recording, recording_type_of
from companion.flight.dashboard import state_document
from companion.flight.dashboard.board import Board
from companion.flight.dashboard.browser_orders import Command, Replay
from companion.flight.dashboard.order_handler import OrderHandler
from companion.flight.dashboard.page import PageEndpoint, about, serve
from companion.flight.landing.situation import Reply
from params import rows
from slz import Report
from slz.warm_up import warm_up

log = logging.getLogger(__name__)

SHOW_S = 0.1


class ReplayDesk:
    """Handler of the timeline's commands; it refuses all others."""

    def __init__(self, player: Player) -> None:
        self._player = player

    async def carry_out(self, order: Command) -> Reply:
        """Run a command, or refuse it with a reason."""
        if not isinstance(order, Replay):
            return Reply(False, "this is a replay: nothing flies")
        if order.speed is not None:
            self._player.set_speed(order.speed)
        if order.at_s is not None:
            self._player.go_to(order.at_s)
        return Reply(True, "")


class ReplayPage:
    """Player of a recording with a web page.

    Raises
    ------
    UsageError
        The recording cannot be used.
    """

    def __init__(self, path: Path, settings: Iterable[str], options: RecordingOptions, speed: float) -> None:
        self._path, self._settings, self._options = path, tuple(settings), options
        playing, _ = self._open_run()  # opened now, so that an unusable file is refused at once
        self.board = Board(playing.parameters)
        self.player = Player(self._open_run, self._on_step, self._on_begin, _length_s(path), speed or 1.0)
        self._shown_s = 0.0
        self._judged_ns: int | None = None
        self._anew = True
        warm_up(playing.parameters)

    async def run(self, front: PageEndpoint, stopped: asyncio.Event) -> None:
        """Serve and play until stopped."""
        desk: OrderHandler = ReplayDesk(self.player)
        server = serve(front, self.board, desk, about(rows()) | {"kind": "replay"})
        playing = asyncio.get_running_loop().run_in_executor(None, self.player.run)
        try:
            while not stopped.is_set() and not playing.done():
                player = self.player
                self.board.replay = {
                    "at_s": round(player.at_s, 2),
                    "length_s": round(player.length_s, 2),
                    "speed": player.speed,
                    "ended": player.ended,
                }
                await asyncio.sleep(SHOW_S)
        finally:
            self.player.close()
            server.stop()
            front.close()
        await playing

    # ---- in the player's thread -----------------------------------------------------------------

    def _open_run(self) -> tuple[Any, Iterator[Step]]:
        if recording_type_of(self._path) != "own":
            feed, rerun = open_recording(self._path, self._settings, self._options)
            return rerun, ((at_ns, partial(rerun.hand_over, act)) for at_ns, act in feed.steps(rerun))
        recording = RecordingReader(self._path)
        flight = Flight(recording.header, recording.header.parameters(self._settings))
        return flight, (
            (message.at_ns, partial(flight.process_message, message)) for message in recording.messages()
        )

    def _on_begin(self) -> None:
        self.board.path, self.board.path_number = [], self.board.path_number + 1
        self._anew, self._judged_ns = True, None

    def _on_step(self, playing: Playing, _at_s: float, stamp_ns: int, report: Report | None) -> None:
        board, now_s = self.board, time.monotonic()
        if report is not None:
            board.set_report(report, report.total_ms)
            self._judged_ns = stamp_ns
            self._anew = not board.copy_map_changes(playing.pipeline, anew=self._anew)
        if now_s - self._shown_s < SHOW_S:
            return
        self._shown_s = now_s
        board.state = state_document.replayed(
            playing.history, playing.vehicle, stamp_ns, playing.diagnosis, self._judged_ns
        )
        state = board.state
        if state["east_m"] is not None:
            board.add_position((state["east_m"], state["north_m"], state["up_m"]))


def show(
    path: Path,
    settings: Iterable[str],
    front: PageEndpoint,
    options: RecordingOptions,
    speed: float,
    handled_by: Callable[[Callable[[], None]], AbstractContextManager[None]],
) -> None:
    """Serve a recording's page until a signal arrives.

    Raises
    ------
    UsageError
        The recording or a setting cannot be used.
    Interrupted
        A signal arrived.
    """
    page = ReplayPage(path, settings, options, speed)

    async def run() -> None:
        stopped, loop = asyncio.Event(), asyncio.get_running_loop()

        def stop() -> None:
            loop.call_soon_threadsafe(stopped.set)

        with handled_by(stop):
            await page.run(front, stopped)

    asyncio.run(run())


def _length_s(path: Path) -> float:
    """Return the length of a recording of slz; 0 where the file does not state it."""
    try:
        with path.open("rb") as file:
            summary = make_reader(file).get_summary()
    except (OSError, McapError, ValueError, RuntimeError, EOFError, MemoryError):
        return 0.0
    if summary is None or summary.statistics is None:
        return 0.0
    times = summary.statistics
    return (times.message_end_time - times.message_start_time) * 1e-9
