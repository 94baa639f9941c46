"""The page as an optional part: it fails alone, and comes back."""

import asyncio
import urllib.request
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from typing import Any

import pytest

import params
from companion.app import Companion
from companion.dashboard.page import Front, Page
from companion.dashboard.site import Site


@asynccontextmanager
async def shown(monkeypatch: pytest.MonkeyPatch) -> AsyncIterator[Page]:
    """Return the running page of a companion that does nothing else."""
    monkeypatch.setattr("companion.dashboard.page.FIRST_PAUSE_S", 0.01)
    front = Front("127.0.0.1:0")
    urls = "udpin:127.0.0.1:14550", "livox:127.0.0.1:56301"
    made = Companion(*urls, params.load(), auto=False, front=front)
    assert made.page is not None
    running = asyncio.create_task(made.page.run())
    yield made.page
    assert not running.done()
    running.cancel()
    await asyncio.gather(running, return_exceptions=True)
    await asyncio.to_thread(made.page.close)
    made.worker.close()


async def until_started(page: Page, times: int) -> None:
    async with asyncio.timeout(20):
        while page.starts < times:
            await asyncio.sleep(0.01)


def answers(page: Page) -> bool:
    """Ask for the page, in the thread that calls."""
    with urllib.request.urlopen(f"http://{page.front.address}/api/status", timeout=5) as answer:
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

    monkeypatch.setattr("companion.dashboard.observe.state", fail)
    async with shown(monkeypatch) as page:
        await until_started(page, 2)
    assert "planted" in caplog.text


async def test_a_display_that_fails_in_the_pipeline_s_thread_is_dropped(
    caplog: pytest.LogCaptureFixture,
) -> None:
    made = Companion("udpin:127.0.0.1:14550", "livox:127.0.0.1:56301", params.load(), auto=False)

    def fail(_pipeline: Any) -> None:
        raise RuntimeError("planted")

    made.worker.look = fail
    await made.worker._show(asyncio.get_running_loop(), fail)
    assert made.worker.look is None
    assert not made.worker.invalid
    assert "planted" in caplog.text
    made.worker.close()
