"""The page as an optional part: isolated failure, and restart."""

import asyncio
import urllib.request
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from types import SimpleNamespace
from typing import Any

import pytest

import params
from companion.flight.app import Companion
from companion.flight.dashboard.page import Page, PageEndpoint
from companion.flight.dashboard.security.address import listen
from companion.flight.dashboard.site import Site
from companion.flight.sensing import Sources
from companion.flight.telling import Displays
from companion.runtime.lockstep_loop import LockstepLoop


def companion() -> Companion:
    """Return a companion with a page, of which nothing runs yet."""
    urls = "udpin:127.0.0.1:14550", Sources("livox:127.0.0.1:56301")
    return Companion(*urls, params.load(), auto=False, displays=Displays(PageEndpoint("127.0.0.1:0")))


@asynccontextmanager
async def shown(monkeypatch: pytest.MonkeyPatch) -> AsyncIterator[Page]:
    """Return the running page of a companion that does nothing else."""
    monkeypatch.setattr("companion.flight.dashboard.page.FIRST_PAUSE_S", 0.01)
    made = companion()
    assert made.telling.page is not None
    running = asyncio.create_task(made.telling.page.run())
    yield made.telling.page
    assert not running.done()
    running.cancel()
    await asyncio.gather(running, return_exceptions=True)
    await asyncio.to_thread(made.telling.page.close)
    made.mapping.worker.close()


async def until_started(page: Page, times: int) -> None:
    async with asyncio.timeout(20):
        while page.starts < times:
            await asyncio.sleep(0.01)


def answers(page: Page) -> bool:
    """Ask for the page, in the thread that calls."""
    with urllib.request.urlopen(f"http://{page.endpoint.address}/api/status", timeout=5) as answer:
        return bool(answer.status == 200)


async def test_a_page_that_crashes_is_started_again(
    monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    crashes = iter([True, True])
    refresh = Site.refresh

    def refresh_or_crash(site: Site) -> None:
        if next(crashes, False):
            raise RuntimeError("planted")
        refresh(site)

    monkeypatch.setattr(Site, "refresh", refresh_or_crash)
    async with shown(monkeypatch) as page:
        await until_started(page, 3)
        assert await asyncio.to_thread(answers, page)
    assert "planted" in caplog.text


async def test_a_fault_in_what_is_shown_is_the_page_s_own(
    monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    def fail(_companion: Any) -> None:
        raise RuntimeError("planted")

    monkeypatch.setattr("companion.flight.dashboard.state_document.state", fail)
    async with shown(monkeypatch) as page:
        await until_started(page, 2)
    assert "planted" in caplog.text


class Brief:
    """A server that ends by itself when its time has come."""

    failure: BaseException | None = None

    def __init__(self, loop: asyncio.AbstractEventLoop, lasts_s: float) -> None:
        self._loop, self._ends_s = loop, loop.time() + lasts_s

    @property
    def alive(self) -> bool:
        return self._loop.time() < self._ends_s

    def ask_to_stop(self) -> None:
        """Nothing is left to stop."""


def test_pauses_grow_while_the_page_ends_at_once_and_begin_anew_after_it_ran_well(
    monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    clock, lasts_s = [0], [0.0, 0.0, 0.0, 61.0, 0.0]

    def advance() -> int:
        clock[0] += 50_000_000
        return clock[0]

    loop = LockstepLoop(advance)
    runs = iter(lasts_s)
    made = companion()
    assert made.telling.page is not None
    monkeypatch.setattr("companion.flight.dashboard.page.time", SimpleNamespace(monotonic=loop.time))
    monkeypatch.setattr("companion.flight.dashboard.page.serve", lambda *_: Brief(loop, next(runs)))
    monkeypatch.setattr("companion.flight.dashboard.state_document.state", lambda _: {})
    monkeypatch.setattr("companion.flight.dashboard.state_document.health", lambda _: {})

    async def script(page: Page) -> None:
        running = asyncio.create_task(page.run())
        while page.starts < len(lasts_s):
            await asyncio.sleep(0.5)
        running.cancel()
        await asyncio.gather(running, return_exceptions=True)

    try:
        loop.run_until_complete(script(made.telling.page))
    finally:
        loop.close()
        made.telling.page.endpoint.close()
        made.mapping.worker.close()
    pauses = [r.getMessage() for r in caplog.records if "started again" in r.getMessage()]
    assert [text.rpartition("in ")[2] for text in pauses[:5]] == ["1 s", "2 s", "4 s", "1 s", "2 s"]


def test_a_page_that_was_never_served_frees_its_port() -> None:
    made = companion()
    assert made.telling.page is not None
    made.telling.page.close()
    listen(made.telling.page.endpoint.address).close()
    made.mapping.worker.close()
