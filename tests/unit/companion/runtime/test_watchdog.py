"""Notifications to systemd, received at the other end of its socket."""

from __future__ import annotations

import asyncio
import os
import platform
import socket
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from companion.runtime.lockstep_loop import LockstepLoop
from companion.runtime.process_tuning import SWITCH_S, real_time_priority
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


# Memory pages, taken from the system once, not once a window.


CHURN = """
import resource, threading
import numpy as np
from companion.runtime.process_tuning import keep_memory

def churn():
    before = 0
    for n in range(40):
        if n == 10:
            before = resource.getrusage(resource.RUSAGE_SELF).ru_minflt
        arrays = [np.ones(400_000) for _ in range(4)]
    faults.append(resource.getrusage(resource.RUSAGE_SELF).ru_minflt - before)

faults, kept = [], keep_memory()
thread = threading.Thread(target=churn)
thread.start()
thread.join()
print(int(kept), *faults)
"""


@pytest.mark.skipif(platform.libc_ver()[0] != "glibc", reason="only glibc's allocator can be told")
def test_arrays_that_come_and_go_in_a_thread_take_no_new_pages() -> None:
    told = subprocess.run([sys.executable, "-c", CHURN], capture_output=True, text=True, check=True)
    kept, faults = map(int, told.stdout.split())
    assert kept == 1
    assert faults < 1000  # 4 x 3.2 MB in 30 rounds: 94,000 pages, were they given back each time


# Real-time scheduling: used where allowed, for one thread, and given back.


def test_the_class_and_the_switch_interval_are_given_back(monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[int] = []
    monkeypatch.setattr(os, "sched_setscheduler", lambda _pid, policy, _param: asked.append(policy))
    before = sys.getswitchinterval()
    with real_time_priority() as allowed:
        assert allowed
        assert sys.getswitchinterval() == pytest.approx(SWITCH_S)
    assert asked == [os.SCHED_RR | os.SCHED_RESET_ON_FORK, os.sched_getscheduler(0)]
    assert sys.getswitchinterval() == before


def test_where_it_is_not_allowed_everything_stays_as_it_is(monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(*_: Any) -> None:
        raise PermissionError

    monkeypatch.setattr(os, "sched_setscheduler", refuse)
    before = sys.getswitchinterval()
    with real_time_priority() as allowed:
        assert not allowed
        assert sys.getswitchinterval() == before
