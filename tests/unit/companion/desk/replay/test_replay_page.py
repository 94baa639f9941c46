"""Replay page without a browser: its timeline, its board, and the refusal of orders."""

from __future__ import annotations

import asyncio
import json
import threading
from collections.abc import AsyncIterator, Callable, Iterator
from contextlib import asynccontextmanager, contextmanager
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from mcap.writer import Writer

from companion.desk.replay import replay_page
from companion.desk.replay.player import Player
from companion.desk.replay.recording_type import RecordingOptions
from companion.desk.replay.replay_page import ReplayDesk, ReplayPage, show
from companion.flight.dashboard.browser_orders import Command, parse
from companion.flight.dashboard.page import PageEndpoint
from companion.flight.recorder import journal
from companion.runtime.errors import UsageError
from tests.unit.companion.desk.replay import flights
from tests.unit.companion.desk.replay.flights import BEGIN_NS, HOME, OFFSET_NS, SECONDS

FAST = 1e9


@pytest.fixture(scope="module")
def files(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder of one flight as a recording of ours and as a bag."""
    folder = tmp_path_factory.mktemp("flight")
    flights.write_own(folder / "own.mcap", flights.with_windows(flights.recorded()))
    flights.write_bag(folder / "bag", flights.Bag())
    return folder


@pytest.fixture(autouse=True)
def _quick(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let every test compile what it needs only, and see every step of the flight."""
    monkeypatch.setattr(replay_page, "warm_up", lambda _parameters: None)
    monkeypatch.setattr(replay_page, "SHOW_S", 1e-6)


def page_of(path: Path, speed: float = FAST, **beside: Any) -> ReplayPage:
    return ReplayPage(path, ["cell_m=0.5", "zone_m=200"], RecordingOptions(**beside), speed)


@asynccontextmanager
async def played(page: ReplayPage) -> AsyncIterator[ReplayPage]:
    """Serve and play a recording, first to its end."""
    stopped = asyncio.Event()
    running = asyncio.create_task(page.run(PageEndpoint("127.0.0.1:0"), stopped))
    await until(lambda: page.player.ended)
    yield page
    assert not running.done()
    stopped.set()
    await running


async def until(done: Callable[[], bool]) -> None:
    async with asyncio.timeout(20):
        while not done():
            await asyncio.sleep(0.01)


class Seat:
    """A player that never runs, and the desk before it."""

    def __init__(self) -> None:
        self.player = Player(lambda: (None, iter(())), lambda *_: None, lambda: None, 100.0)  # type: ignore[arg-type,return-value]
        self.gone: list[float] = []
        self.player.go_to = self.gone.append  # type: ignore[method-assign, assignment]
        self.desk = ReplayDesk(self.player)

    def order(self, **fields: Any) -> tuple[bool, str]:
        message = parse(json.dumps({"id": 1, **fields}))
        assert isinstance(message, Command)
        reply = asyncio.run(self.desk.carry_out(message))
        return reply.accepted, reply.reason


def test_the_time_line_sets_speed_and_place_and_leaves_what_was_not_named() -> None:
    seat = Seat()
    assert seat.order(do="replay", speed=5.0) == (True, "")
    assert (seat.player.speed, seat.gone) == (5.0, [])
    assert seat.order(do="replay", at_s=12.5) == (True, "")
    assert (seat.player.speed, seat.gone) == (5.0, [12.5])
    assert seat.order(do="replay", speed=0, at_s=0) == (True, "")
    assert (seat.player.speed, seat.gone) == (0.0, [12.5, 0.0])


@pytest.mark.parametrize(
    "order",
    [
        {"do": "land_best"},
        {"do": "abort"},
        {"do": "set", "name": "survey_s", "value": 3},
        {"do": "record", "on": True},
    ],
)
def test_an_order_to_a_vehicle_is_refused_in_a_replay(order: dict[str, Any]) -> None:
    seat = Seat()
    assert seat.order(**order) == (False, "this is a replay: nothing flies")
    assert (seat.player.speed, seat.gone) == (1.0, [])


async def test_a_recording_is_shown_to_its_end_with_its_zones_and_its_way(files: Path) -> None:
    page = page_of(files / "own.mcap")
    told_s = page.player.length_s
    assert told_s > SECONDS  # of the file, before anything was played
    async with played(page) as shown:
        await until(lambda: shown.board.replay is not None and bool(shown.board.replay["ended"]))
        assert shown.board.replay == {
            "at_s": pytest.approx(told_s, abs=0.01),
            "length_s": pytest.approx(told_s, abs=0.01),
            "speed": FAST,
            "ended": True,
        }
        assert shown.board.report_number == 4
        assert shown.board.report is not None
        assert shown.board.report.zones
        state = shown.board.state
        assert state is not None
        assert (state["phase"], state["flying"]) == ("replay", False)
        assert (state["mode"], [*state["past"]]) == (None, ["autopilot"])  # heartbeats end first
        assert len(shown.board.path) > 100
        climbed_m = shown.board.path[-1][2] - shown.board.path[0][2]
        before, after = (flights.path(t)[0][0, 2] for t in (-0.4, SECONDS + 0.4))
        assert climbed_m == pytest.approx(after - before, abs=0.3)


async def test_going_back_shows_the_flight_anew_up_to_there(files: Path) -> None:
    async with played(page_of(files / "own.mcap")) as shown:
        whole, number = len(shown.board.path), shown.board.path_number
        shown.player.set_speed(0)
        shown.player.go_to(2.0)
        await until(lambda: shown.board.path_number > number and 1.9 < shown.player.at_s <= 2.0)
        assert 0 < len(shown.board.path) < whole / 2
        assert not shown.player.ended


async def test_a_flight_of_another_program_is_shown_and_its_length_grows(files: Path) -> None:
    page = page_of(files / "bag", origin=f"{HOME.lat_deg},{HOME.lon_deg},{HOME.alt_m}")
    assert page.player.length_s == 0.0
    async with played(page) as shown:
        assert shown.player.length_s == pytest.approx(SECONDS + 0.8, abs=0.1)
        assert shown.board.report_number >= 3
        assert shown.board.state is not None
        assert shown.board.path[0][2] == pytest.approx(float(flights.path(-0.4)[0][0, 2]), abs=0.5)


async def test_what_is_shown_is_renewed_no_faster_than_eyes_follow(
    files: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """All of the flight passes within one tick, and of it the first step is shown, which has no place yet."""
    monkeypatch.setattr(replay_page, "time", SimpleNamespace(monotonic=lambda: 100.0))
    monkeypatch.setattr(replay_page, "SHOW_S", 0.1)
    async with played(page_of(files / "own.mcap")) as shown:
        assert shown.board.state is not None
        assert shown.board.state["at_ns"] == BEGIN_NS - OFFSET_NS - 600_000_000
        assert shown.board.path == []
        assert shown.board.report_number == 4


def test_a_recording_without_statistics_has_no_length_before_it_is_played(tmp_path: Path) -> None:
    path = tmp_path / "plain.mcap"
    with path.open("wb") as file:
        writer = Writer(file, use_statistics=False)
        writer.start()
        metadata = {"version": str(journal.VERSION), "lidar": "livox", "clock_offset_ns": "0"}
        writer.add_metadata(journal.METADATA, metadata | {"parameters": flights.PARAMETERS.model_dump_json()})
        writer.finish()  # type: ignore[no-untyped-call]
    assert page_of(path).player.length_s == 0.0


def test_a_recording_cut_off_has_no_length_before_it_is_played(files: Path, tmp_path: Path) -> None:
    content = (files / "own.mcap").read_bytes()
    path = tmp_path / "cut.mcap"
    path.write_bytes(content[: len(content) // 2])
    assert page_of(path).player.length_s == 0.0


@pytest.mark.parametrize("content", [b"", b"nonsense"])
def test_what_cannot_be_shown_is_said_before_anything_is_served(tmp_path: Path, content: bytes) -> None:
    path = tmp_path / "a.mcap"
    path.write_bytes(content)
    with pytest.raises(UsageError, match=r"a\.mcap"):
        page_of(path)


def test_a_signal_ends_the_page(files: Path) -> None:
    front = PageEndpoint("127.0.0.1:0")
    ended: list[bool] = []

    @contextmanager
    def handled_by(stop: Callable[[], None]) -> Iterator[None]:
        threading.Thread(target=stop).start()  # from wherever it comes
        yield
        ended.append(True)

    show(files / "own.mcap", [], front, RecordingOptions(), 1.0, handled_by)
    assert ended
    assert front.socket.fileno() == -1  # the port is free
