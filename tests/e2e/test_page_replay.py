"""The replay page's timeline in a real browser."""

from __future__ import annotations

import asyncio
import threading
from collections.abc import Iterator
from pathlib import Path

import pytest

from companion.desk.replay.recording_type import RecordingOptions
from companion.desk.replay.replay_page import ReplayPage
from companion.flight.dashboard.page import PageEndpoint
from tests.e2e.chromium import Chromium
from tests.e2e.harness import Mission
from tests.e2e.shown import Beside

pytestmark = pytest.mark.browser

AT, LENGTH = "slz.model.replay.at_s", "slz.model.replay.length_s"
LINE = "#replay input[type=range]"
STILL_MS = 2500  # longer than a flight may be silent


@pytest.fixture(scope="module")
def recording(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a flight of some seconds that found a zone."""
    path = tmp_path_factory.mktemp("flight") / "flight.mcap"
    mission = Mission("plain", seed=9, auto=False, height_m=15.0, record=path)

    async def script(m: Mission) -> None:
        await m.until(lambda: m.height_m > 13 and m.companion.mapping.latest.newest is not None)
        found_s = m.loop.time()
        await m.until(lambda: m.loop.time() > found_s + 20.0)  # a path to draw, with a fix and at height

    mission.fly(script)
    return path


class Replayed(Beside):
    """The page of a recording; a context manager that ends it."""

    def __init__(self, path: Path, speed: float) -> None:
        super().__init__(self._serve)
        self.front = PageEndpoint("127.0.0.1:0")
        self.url = f"http://{self.front.address}/"
        self.page = ReplayPage(path, [], RecordingOptions(), speed)

    async def _serve(self, stopped: asyncio.Event, ready: threading.Event) -> None:
        ready.set()
        await self.page.run(self.front, stopped)


DESKTOP = pytest.mark.parametrize("browser", [False], indirect=True, ids=["desktop"])
PHONE = pytest.mark.parametrize("browser", [True], indirect=True, ids=["phone"])


@pytest.fixture
def browser(chromium: Path, request: pytest.FixtureRequest) -> Iterator[Chromium]:
    size = (390, 844) if request.param else (1440, 860)
    with Chromium(chromium, *size, phone=request.param) as made:
        yield made
        assert made.errors == []


def go_to(browser: Chromium, share: float) -> None:
    """Tap on the time line."""
    box = (
        f"(b => [b.x, b.y + b.height / 2, b.width])(document.querySelector('{LINE}').getBoundingClientRect())"
    )
    x, y, width = browser.script(box)
    browser.click(x + share * width, y)


@DESKTOP
def test_the_time_line_holds_goes_on_faster_and_jumps_ahead_and_back(
    browser: Chromium, recording: Path
) -> None:
    with Replayed(recording, speed=1.0) as replayed:
        browser.open(replayed.url)
        browser.until(f"!document.getElementById('replay').hidden && {AT} > 0.5 && {LENGTH} > 5")
        browser.click_on("#play")
        browser.until("slz.model.replay.speed === 0")
        held = browser.script(AT)
        browser.until(f"(window.from ??= performance.now(), performance.now() - window.from > {STILL_MS})")
        assert browser.script(AT) == held
        assert browser.script("document.getElementById('stale').hidden")
        assert browser.script("document.getElementById('play').textContent").endswith("Play")

        length = browser.script(LENGTH)
        go_to(browser, 0.8)
        browser.until(f"Math.abs({AT} - {0.8 * length}) < {0.05 * length}")
        browser.until("slz.model.path.length > 5 && slz.model.near().length > 0")
        flown = browser.script("slz.model.path.length")
        go_to(browser, 0.3)
        browser.until(f"Math.abs({AT} - {0.3 * length}) < {0.05 * length}")
        browser.until(f"slz.model.path.length < {flown}")
        assert browser.script("slz.model.replay.speed") == 0

        script = "(s => { s.value = '5'; s.dispatchEvent(new Event('change')); })"
        browser.script(f"{script}(document.querySelector('#replay select'))")
        browser.until("slz.model.replay.speed === 5")
        browser.until("slz.model.replay.ended && document.getElementById('play').textContent === 'Ended'")
        go_to(browser, 0.1)
        browser.until(f"!slz.model.replay.ended && {AT} < {0.9 * length}")


@PHONE
def test_a_finger_that_returns_to_where_it_began_does_not_stop_the_time_line(
    browser: Chromium, recording: Path
) -> None:
    with Replayed(recording, speed=0.5) as replayed:
        browser.open(replayed.url)
        browser.until(f"!document.getElementById('replay').hidden && {AT} > 0.5 && {LENGTH} > 5")
        line = f"document.querySelector('{LINE}')"
        browser.script(f"{line}.dispatchEvent(new Event('input'))")
        browser.script(f"{line}.dispatchEvent(new PointerEvent('pointerup'))")
        at = browser.script(f"Number({line}.value)")
        browser.until(f"Number({line}.value) > {at}")


@PHONE
def test_nothing_can_be_ordered_in_a_replay(browser: Chromium, recording: Path) -> None:
    with Replayed(recording, speed=1.0) as replayed:
        browser.open(replayed.url)
        browser.until(f"{AT} > 0")
        usable = browser.script(
            "[...document.querySelectorAll('#acts button')].filter(b => !b.disabled).length"
        )
        assert usable == 0
        answer = browser.script("slz.link.order({ do: 'land_best' })")
        assert answer["ok"] is False
