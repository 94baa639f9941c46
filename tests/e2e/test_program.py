"""`slz run` as a program beside the simulator as a program, in real time."""

from __future__ import annotations

import json
import os
import pty
import select
import signal
import socket
import subprocess
import sys
import threading
import time
import tty
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path
from typing import Any

import pytest
from pymavlink import mavutil

from tests.ports import free_port

pytestmark = [pytest.mark.realtime, pytest.mark.timeout(180)]

FAST = ["--set", "survey_s=3", "--set", "zone_m=100"]
Program = subprocess.Popen[str]


@contextmanager
def program(*arguments: str) -> Iterator[Program]:
    process = subprocess.Popen(
        [sys.executable, "-m", *arguments], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )
    try:
        yield process
    finally:
        process.kill()
        process.communicate()


def says(process: Program, text: str) -> None:
    """Wait until a program says something on stderr; the test's time limit ends the wait."""
    assert process.stderr is not None
    said = ""
    for line in process.stderr:
        said += line
        if text in line:
            return
    raise AssertionError(f"ended without saying {text!r}: {said}")


def until(done: Callable[[], bool]) -> None:
    """Ask until something holds; the test's time limit ends the wait."""
    while not done():
        select.select([], [], [], 0.01)


def children(process: Program) -> list[str]:
    return Path(f"/proc/{process.pid}/task/{process.pid}/children").read_text().split()


def started(process: Program) -> None:
    assert process.stdout is not None
    if not process.stdout.readline():
        raise AssertionError(process.communicate()[1])


def simulator(mavlink_url: str, watch_port: int, lidar_port: int) -> list[str]:
    return [
        *("sitl", "--scene", "plain", "--pilot", "takeoff", "--takeoff-alt", "15", "--speedup", "1"),
        *("--point-rate", "20000", "--lidar-to", f"127.0.0.1:{lidar_port}"),
        *("--mavlink", mavlink_url, "--mavlink", f"tcpin:127.0.0.1:{watch_port}"),
    ]


def companion(mavlink_url: str, lidar_port: int) -> list[str]:
    return [
        *(
            "companion.cli",
            "run",
            "--mavlink",
            mavlink_url,
            "--lidar",
            f"livox:127.0.0.1:{lidar_port}",
        ),
        *("--land", "auto", "--json", *FAST),
    ]


class GroundStation:
    """A pilot's screen on the simulator's TCP port, by pymavlink's own connection."""

    def __init__(self, port: int) -> None:
        self._link: Any = mavutil.mavlink_connection(f"tcp:127.0.0.1:{port}", source_system=254, retries=30)
        self.texts: list[str] = []
        self.mode = -1
        self.speed_ms = float("nan")

    def until(self, done: Callable[[], bool], limit_s: float = 90.0) -> None:
        """Read until something holds."""
        end = time.monotonic() + limit_s
        while not done():
            assert time.monotonic() < end, self.texts
            message = self._link.recv_match(blocking=True, timeout=1.0)
            kind = None if message is None else message.get_type()
            if kind == "STATUSTEXT":
                self.texts.append(message.text)
            elif kind == "HEARTBEAT" and message.get_srcComponent() == 1:
                self.mode = message.custom_mode
            elif kind == "GLOBAL_POSITION_INT":
                self.speed_ms = (message.vx**2 + message.vy**2 + message.vz**2) ** 0.5 / 100

    def told(self, text: str) -> bool:
        return any(text in heard for heard in self.texts)

    def close(self) -> None:
        self._link.close()


@contextmanager
def serial_cable() -> Iterator[tuple[str, str]]:
    """Two serial devices joined by a cable; what an end does not read in time is lost, as in a UART."""
    near, far = pty.openpty(), pty.openpty()
    for master, slave in (near, far):
        tty.setraw(slave)
        os.set_blocking(master, False)
    stop_read, stop_write = os.pipe()

    def carry() -> None:
        while True:
            ready, _, _ = select.select([near[0], far[0], stop_read], [], [])
            if stop_read in ready:
                return
            for source, sink in ((near[0], far[0]), (far[0], near[0])):
                if source in ready:
                    with suppress(BlockingIOError):
                        os.write(sink, os.read(source, 4096))

    cable = threading.Thread(target=carry, name="cable")
    cable.start()
    try:
        yield os.ttyname(near[1]), os.ttyname(far[1])
    finally:
        os.write(stop_write, b"x")
        cable.join()
        for descriptor in (*near, *far, stop_read, stop_write):
            os.close(descriptor)


def test_sigterm_in_flight_over_a_serial_line_tells_the_pilot_and_ends_in_order() -> None:
    watch, lidar = free_port(socket.SOCK_STREAM), free_port()
    with ExitStack() as stack:
        near, far = stack.enter_context(serial_cable())
        run = stack.enter_context(program(*companion(f"{near},921600", lidar)))
        sim = stack.enter_context(program(*simulator(far, watch, lidar)))
        started(sim)
        pilot = GroundStation(watch)
        stack.callback(pilot.close)
        pilot.until(lambda: pilot.told("SLZ: descending"))
        run.send_signal(signal.SIGTERM)
        out, said = run.communicate(timeout=20)
        pilot.until(lambda: pilot.told("SLZ: companion stops, take over"), 5)
        pilot.until(lambda: pilot.speed_ms < 0.2, 15)
        assert pilot.mode == 4
    assert run.returncode == 0, said
    summary = json.loads(out.splitlines()[-1])
    assert summary["phase"] == "descend"
    assert not summary["landed"]
    assert summary["chosen"] is not None
    assert "Traceback" not in said


@pytest.mark.long
def test_an_autopilot_that_dies_is_waited_for_and_taken_up_again() -> None:
    watch, lidar, port = free_port(socket.SOCK_STREAM), free_port(), free_port()
    arguments = simulator(f"udpout:127.0.0.1:{port}", watch, lidar)
    with program(*companion(f"udpin:127.0.0.1:{port}", lidar)) as run:
        for reached in ("SLZ: surveying", "SLZ: approaching"):
            with program(*arguments) as sim:
                started(sim)
                says(run, reached)
                sim.kill()
                says(run, "autopilot lost")
        run.send_signal(signal.SIGINT)
        out, said = run.communicate(timeout=20)
    assert run.returncode == 0, said
    assert json.loads(out.splitlines()[-1])["landed"] is False


@pytest.mark.parametrize(("word", "number"), [("", signal.SIGINT), ("surveying", signal.SIGTERM)])
def test_a_signal_ends_a_demo_at_once_and_leaves_nothing_behind(
    tmp_path: Path, word: str, number: signal.Signals, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("TMPDIR", str(tmp_path))
    arguments = ["--scene", "plain", "--point-rate", "20000", "--out", str(tmp_path / "maps")]
    with program("companion.cli", "demo", *arguments, "--json") as demo:
        if word:
            says(demo, word)
        else:
            until(lambda: any(tmp_path.glob("slz-truth-*")) and bool(children(demo)))
        (child,) = children(demo)
        asked = time.monotonic()
        demo.send_signal(number)
        out, said = demo.communicate(timeout=30)
        took_s = time.monotonic() - asked
    assert demo.returncode == 128 + number, said
    assert (out, said.splitlines()[-1]) == ("", f"slz: {'terminated' if word else 'interrupted'}")
    assert "Traceback" not in said
    assert "Task was destroyed" not in said
    assert "Event loop is closed" not in said
    assert not any(tmp_path.glob("slz-truth-*"))
    assert not Path(f"/proc/{child}").exists()
    assert took_s < 5  # 2 s, on a machine that does nothing else


def test_bad_usage_ends_in_one_line_and_exit_code_2() -> None:
    """Other complaints: `tests/unit/companion/cli/test_program.py`."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as other:
        other.bind(("127.0.0.1", 0))
        taken = other.getsockname()[1]
        given = ["--mavlink", f"udpin:127.0.0.1:{taken}", "--lidar", f"livox:127.0.0.1:{free_port()}"]
        done = subprocess.run(
            [sys.executable, "-m", "companion.cli", "run", *given],
            capture_output=True,
            text=True,
            timeout=60,
        )
    assert done.returncode == 2, done.stderr
    assert "in use" in done.stderr
    assert "Traceback" not in done.stderr
    assert done.stdout == ""
