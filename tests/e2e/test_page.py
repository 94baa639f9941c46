"""The pilot's page in a real browser, over a flight in the simulator.

Simulated time pauses while the browser is queried, so that both see the same state.
"""

from __future__ import annotations

import asyncio
import json
import socket
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor, wait
from pathlib import Path
from typing import TypeVar

import pytest

from companion.flight.dashboard.site import Site
from companion.flight.landing.situation import Phase
from sitl.intruders import DrivenCar
from tests.e2e.chromium import Chromium
from tests.e2e.harness import Mission

Result = TypeVar("Result")
RENEW_S = 0.1
BEST = (
    "(z => { const [x, y] = slz.bird.place(z.best[0], z.best[1]),"
    " b = slz.bird.canvas.getBoundingClientRect(), r = devicePixelRatio;"
    " return [b.x + x / r, b.y + y / r]; })(slz.model.near()[0])"
)


@pytest.fixture
def browser(chromium: Path) -> Iterator[Chromium]:
    with Chromium(chromium) as made:
        yield made


class Watched:
    """A mission and the browser that shows it."""

    def __init__(self, mission: Mission, browser: Chromium) -> None:
        self.mission, self.browser = mission, browser

    async def see(self, look: Callable[..., Result], *args: object) -> Result:
        """Ask the browser; simulated time waits, but the companion is there all the same."""
        loop, page = asyncio.get_running_loop(), self.mission.companion.telling.page
        assert page is not None
        with ThreadPoolExecutor(1) as beside:
            asked = beside.submit(look, *args)
            while not asked.done():
                await loop.run_in_executor(None, wait, [asked], RENEW_S)
                page.board.state = None if page.board.state is None else dict(page.board.state)
            return asked.result()

    async def until_seen(self, text: str) -> None:
        """Wait until the page shows something; the flight goes on meanwhile."""
        for _ in range(400):
            try:
                if await self.see(self.browser.script, text):
                    return
            except RuntimeError:
                pass  # it is loading
            await asyncio.sleep(0.2)
        raise AssertionError(f"never seen: {text}; {self.browser.errors}")

    async def open(self) -> None:
        """Open the page over a vehicle that hovers and has found a zone."""
        m = self.mission
        await m.until(lambda: bool(m.companion.mapping.latest.zones_seen))
        await m.until(lambda: m.height_m > 13)
        assert m.front is not None
        await self.see(self.browser.open, f"http://{m.front.address}/")
        await self.until_seen("slz.model.near().length && slz.bird._fitted")

    async def select_and_confirm(self) -> None:
        """Click the best zone on the map, select it, wait for its judgement, confirm."""
        await self.see(lambda: self.browser.click(*self.browser.script(BEST)))
        await self.until_seen("slz.model.picked?.zone && !document.getElementById('select').disabled")
        await self.see(self.browser.click_on, "#select")
        await self.until_seen("slz.model.selected() && !document.getElementById('confirm').disabled")
        await self.see(self.browser.hold, "#confirm")


def watch(browser: Chromium, scene: str = "plain", *, seed: int = 9) -> Watched:
    return Watched(Mission(scene, seed=seed, auto=False, height_m=15.0, page=True), browser)


def test_a_zone_is_clicked_selected_confirmed_and_the_landing_aborted_by_a_key(browser: Chromium) -> None:
    w = watch(browser)

    async def script(m: Mission) -> None:
        await w.open()
        await w.select_and_confirm()
        await m.until_phase(Phase.APPROACH, 20)
        await w.see(browser.reload)
        await w.until_seen("slz.model.state?.phase === 'approach' && slz.model.selected()?.state === 'safe'")
        await w.see(browser.press, "a")
        await m.until_phase(Phase.HOLD, 10)
        await w.until_seen("document.getElementById('phase').textContent === 'hold'")

    w.mission.fly(script)
    assert browser.errors == []


@pytest.mark.browser
def test_what_a_silent_lidar_judged_is_of_the_past(browser: Chromium, tmp_path: Path) -> None:
    """Nothing that needs a judgement is offered, drawn as certain or called safe; the reason stands there."""
    w = watch(browser)
    shown = (
        "({badge: document.querySelector('#choice .badge').textContent,"
        " hint: document.getElementById('answer').dataset.hint,"
        " off: ['select', 'confirm', 'best', 'now'].map((id) => document.getElementById(id).disabled),"
        " lamps: [...document.querySelectorAll('.lamp.bad')].map((lamp) => lamp.title),"
        " sure: [...new Set(slz.model.allZones().map((zone) => zone.sure))],"
        " said: document.getElementById('side').innerText + document.getElementById('alarms').innerText})"
    )

    async def script(m: Mission) -> None:
        await w.open()
        await w.select_and_confirm()
        await w.until_seen("slz.model.selected()?.state === 'safe'")
        m.sim.lidar_on = False
        await w.until_seen("slz.model.state.past.map > 4")
        seen = await w.see(browser.script, shown)
        await w.see(browser.picture, tmp_path / "silent.png")
        assert seen["badge"] == "… NOT JUDGED NOW"
        assert seen["hint"].startswith("Hovers. LiDAR lost: nothing is judged now")
        assert seen["off"] == [True] * 4
        assert seen["lamps"] == ["LiDAR", "Map"]
        assert seen["sure"] == ["past"]
        assert "LIDAR LOST" in seen["said"]
        assert "certain " not in seen["said"]
        assert "✓" not in seen["said"]

    w.mission.fly(script)
    assert browser.errors == []


@pytest.mark.browser
def test_a_landing_confirmed_on_the_page_and_the_alarm_when_a_car_drives_in(
    browser: Chromium, tmp_path: Path
) -> None:
    w = watch(browser, "stadium", seed=4)
    w.mission.sim.intruders.append(DrivenCar(9.0))

    async def script(m: Mission) -> None:
        await w.open()
        await w.select_and_confirm()
        await m.until(lambda: m.sim.intruders[0].arrived)
        await m.until_phase(Phase.CLIMB, 5)
        await w.until_seen("document.querySelector('.alarm.critical')?.textContent.includes('UNSAFE')")
        await w.see(browser.picture, tmp_path / "alarm.png")
        await m.until_phase(Phase.LANDED)
        await w.until_seen("document.getElementById('controls') !== null")
        summary = await w.see(browser.script, "document.getElementById('choice').innerText")
        assert "m off the point" in summary
        assert "abort: point unsafe" in summary

    w.mission.fly(script)
    assert w.mission.touchdown_safe()
    assert w.mission.companion.executive.tally.aborts >= 1
    assert browser.errors == []


@pytest.mark.browser
def test_five_browsers_four_stalled_a_reload_and_a_crash_of_the_page_do_not_touch_the_landing(
    browser: Chromium, monkeypatch: pytest.MonkeyPatch
) -> None:
    w = watch(browser)
    crash = [False]
    refresh = Site.refresh

    def refresh_or_crash(site: Site) -> None:
        if crash[0]:
            crash[0] = False
            raise RuntimeError("planted")
        refresh(site)

    monkeypatch.setattr(Site, "refresh", refresh_or_crash)

    async def script(m: Mission) -> None:
        await w.open()
        assert m.front is not None
        stalled = [_stalled(str(m.front.address)) for _ in range(4)]
        await w.select_and_confirm()
        await m.until_phase(Phase.DESCEND)
        await w.see(browser.reload)
        await w.until_seen("slz.model.state?.phase === 'descend'")
        crash[0] = True
        await m.until_phase(Phase.LANDED)
        page = m.companion.telling.page
        assert page is not None
        await m.until(lambda: page.starts == 2, 30)
        await w.until_seen("slz.model.state.phase === 'landed' && !slz.link.stale")
        for one in stalled:
            one.close()

    w.mission.fly(script)
    assert w.mission.touchdown_safe()
    assert w.mission.touchdown_error_m() <= 0.5


def _stalled(host: str) -> socket.socket:
    """Return a channel of a browser that reads nothing."""
    address, _, port = host.rpartition(":")
    sock = socket.create_connection((address, int(port)))
    sock.sendall(
        f"GET /live HTTP/1.1\r\nHost: {host}\r\nOrigin: http://{host}\r\nUpgrade: websocket\r\n"
        "Connection: Upgrade\r\nSec-WebSocket-Version: 13\r\n"
        "Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\n\r\n".encode()
    )
    return sock


@pytest.mark.browser
def test_the_keyboard_reaches_every_order_and_each_has_a_name(browser: Chromium) -> None:
    w = watch(browser)

    async def script(_: Mission) -> None:
        await w.open()
        found = await w.see(
            browser.script,
            "JSON.stringify([...document.querySelectorAll('button, input, select, canvas[tabindex]')]"
            ".map(b => [b.tabIndex, (b.textContent + (b.getAttribute('aria-label') ?? '') + (b.title ?? '')"
            " + (b.labels?.[0]?.textContent ?? '')).trim()]))",
        )
        for index, name in json.loads(found):
            assert index >= 0
            assert name

    w.mission.fly(script)
