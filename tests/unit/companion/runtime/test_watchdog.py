"""Notifications to systemd, received at the other end of its socket."""

from __future__ import annotations

import asyncio
import socket
from collections.abc import Iterator
from pathlib import Path

import pytest

from companion.runtime.lockstep_loop import LockstepLoop
from companion.runtime.watchdog import Watchdog

MS = 1_000_000


@pytest.fixture
def systemd(tmp_path: Path) -> Iterator[tuple[socket.socket, str]]:
    path = str(tmp_path / "notify")
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as ear:
        ear.bind(path)
        ear.setblocking(False)
        yield ear, path


def heard(ear: socket.socket) -> list[str]:
    lines = []
    while True:
        try:
            lines.append(ear.recv(1024).decode())
        except BlockingIOError:
            return lines


def live(watchdog: Watchdog, seconds: float) -> None:
    """Run it for so long, in simulated time."""
    clock = [0]

    def advance() -> int:
        clock[0] += 10 * MS
        return clock[0]

    loop = LockstepLoop(advance)

    async def script() -> None:
        task = asyncio.create_task(watchdog.run())
        await asyncio.sleep(seconds)
        task.cancel()
        await asyncio.gather(task, return_exceptions=True)

    loop.run_until_complete(script())
    loop.close()


def test_start_and_end_are_told(systemd: tuple[socket.socket, str]) -> None:
    ear, path = systemd
    watchdog = Watchdog(lambda: True, {"NOTIFY_SOCKET": path})
    watchdog.ready()
    watchdog.stopping()
    assert heard(ear) == ["READY=1", "STOPPING=1"]


def test_it_lives_twice_within_the_time_asked_for(systemd: tuple[socket.socket, str]) -> None:
    ear, path = systemd
    live(Watchdog(lambda: True, {"NOTIFY_SOCKET": path, "WATCHDOG_USEC": "2000000"}), 9.5)
    assert heard(ear) == ["WATCHDOG=1"] * 10


def test_what_hangs_gives_no_sign_of_life(
    systemd: tuple[socket.socket, str], caplog: pytest.LogCaptureFixture
) -> None:
    ear, path = systemd
    live(Watchdog(lambda: False, {"NOTIFY_SOCKET": path, "WATCHDOG_USEC": "2000000"}), 9.5)
    assert heard(ear) == []
    assert caplog.text.count("hangs") == 1


@pytest.mark.parametrize("environment", [{}, {"WATCHDOG_USEC": "x"}, {"NOTIFY_SOCKET": "/there/is/none"}])
def test_without_systemd_it_is_silent(environment: dict[str, str]) -> None:
    watchdog = Watchdog(lambda: True, environment)
    watchdog.ready()
    live(watchdog, 1.0)
