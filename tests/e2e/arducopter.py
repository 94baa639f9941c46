"""A real ArduCopter SITL, its pilot, our LiDAR on it and our companion beside it: programs in real time."""

from __future__ import annotations

import json
import math
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, field
from importlib import resources
from pathlib import Path
from typing import Any, Self

import pymap3d
from pymavlink import mavutil
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from sitl import scenes, truth

HOME = (-35.363262, 149.165237, 584.0)
POINT_RATE = 50_000
BASE_PORT = 5760
PORTS_APART = 10
# What makes the simulated airframe arm and fly; what we need comes from our own file.
FRAME = """
FRAME_CLASS 1
FRAME_TYPE 0
FS_THR_ENABLE 0
FS_GCS_ENABLE 0
BATT_MONITOR 4
COMPASS_OFS_X 5
COMPASS_OFS_Y 13
COMPASS_OFS_Z -18
COMPASS_OFS2_X 5
COMPASS_OFS2_Y 13
COMPASS_OFS2_Z -18
COMPASS_OFS3_X 5
COMPASS_OFS3_Y 13
COMPASS_OFS3_Z -18
INS_ACCOFFS_X 0.001
INS_ACCOFFS_Y 0.001
INS_ACCOFFS_Z 0.001
INS_ACCSCAL_X 1.001
INS_ACCSCAL_Y 1.001
INS_ACCSCAL_Z 1.001
INS_ACC2OFFS_X 0.001
INS_ACC2OFFS_Y 0.001
INS_ACC2OFFS_Z 0.001
INS_ACC2SCAL_X 1.001
INS_ACC2SCAL_Y 1.001
INS_ACC2SCAL_Z 1.001
ATC_RAT_YAW_P 0.3
ATC_RAT_YAW_I 0.02
MOT_THST_EXPO 0.65
MOT_THST_HOVER 0.39
MOT_BAT_VOLT_MIN 9.6
MOT_BAT_VOLT_MAX 12.8
SIM_TERRAIN 0
TERRAIN_ENABLE 0
"""


class FlightError(AssertionError):
    """The flight did not come to its end; the message holds what was said last."""


@dataclass(slots=True)
class Outcome:
    """What a flight came to, by the simulator's own truth."""

    summary: dict[str, Any]
    flight: dict[str, Any]
    safe: bool
    error_m: float | None
    said: list[str] = field(default_factory=list)


class Pilot:
    """A ground station on the first port: arms, takes off in GUIDED, and watches."""

    def __init__(self, port: int, limit_s: float = 60.0) -> None:
        self.said: list[str] = []
        self.armed = False
        self.mode = ""
        self.height_m = 0.0
        self.acks: dict[int, int] = {}
        self._beat_s = 0.0
        self._port = mavutil.mavlink_connection(
            f"tcp:127.0.0.1:{port}",
            source_system=255,
            source_component=190,
            retries=int(limit_s),
            robust_parsing=True,
        )

    def close(self) -> None:
        self._port.close()

    def until(self, done: Callable[[], bool], limit_s: float, what: str) -> None:
        """Listen until something holds."""
        end = time.monotonic() + limit_s
        while not done():
            if time.monotonic() > end:
                raise FlightError(
                    f"no {what} within {limit_s:g} s; mode {self.mode}; heard {self.said[-12:]}"
                )
            self.listen(0.2)

    def listen(self, seconds: float) -> None:
        """Read one message, at most so long, and keep our own heartbeat up."""
        if time.monotonic() >= self._beat_s:
            self._beat_s = time.monotonic() + 1.0
            self._port.mav.heartbeat_send(mavlink.MAV_TYPE_GCS, mavlink.MAV_AUTOPILOT_INVALID, 0, 0, 4)
        message = self._port.recv_match(blocking=True, timeout=seconds)
        if message is None:
            return
        kind = message.get_type()
        if kind == "STATUSTEXT":
            self.said.append(str(message.text))
        elif kind == "COMMAND_ACK":
            self.acks[message.command] = message.result
        elif kind == "GLOBAL_POSITION_INT":
            self.height_m = message.relative_alt / 1000
        elif kind == "HEARTBEAT" and message.get_srcComponent() == 1:
            self.armed = bool(message.base_mode & mavlink.MAV_MODE_FLAG_SAFETY_ARMED)
            self.mode = mavutil.mode_string_v10(message)

    def command(self, number: int, *values: float) -> None:
        self.acks.pop(number, None)
        padded = [*values, *[0.0] * (7 - len(values))]
        self._port.mav.command_long_send(1, 1, number, 0, *padded)

    def take_off(self, height_m: float) -> None:
        """Stream positions, arm in GUIDED as soon as that works, climb."""
        position = float(mavlink.MAVLINK_MSG_ID_GLOBAL_POSITION_INT)
        self.until(lambda: self.mode != "", 60, "heartbeat")
        self.command(mavlink.MAV_CMD_SET_MESSAGE_INTERVAL, position, 100_000.0)
        self._lift(height_m)
        self.until(lambda: self.height_m > 0.9 * height_m, 90, "height")

    def _lift(self, height_m: float, limit_s: float = 180.0) -> None:
        """Set GUIDED, arm and take off, again and again until it flies: it refuses while it initialises."""
        end = time.monotonic() + limit_s
        while self.height_m < 1.0:
            if time.monotonic() > end:
                raise FlightError(f"not flying after {limit_s:g} s; heard {self.said[-12:]}")
            if self.mode != "GUIDED":  # what is set before it is initialised does not last
                guided = float(mavlink.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED), 4.0
                self.command(mavlink.MAV_CMD_DO_SET_MODE, *guided)
            elif not self.armed:
                self.acks.pop(mavlink.MAV_CMD_NAV_TAKEOFF, None)
                self.command(mavlink.MAV_CMD_COMPONENT_ARM_DISARM, 1.0)
            elif self.acks.get(mavlink.MAV_CMD_NAV_TAKEOFF) != mavlink.MAV_RESULT_ACCEPTED:
                self.command(mavlink.MAV_CMD_NAV_TAKEOFF, *[0.0] * 6, height_m)  # a second one starts it anew
            again = time.monotonic() + 2.0
            while self.height_m < 1.0 and time.monotonic() < again:
                self.listen(0.2)


class Field:
    """All programs of one flight, in a folder of their own."""

    def __init__(self, binary: Path, folder: Path, *, scene: str, seed: int, instance: int = 0) -> None:
        self.folder, self.scene, self.seed = folder, scene, seed
        self._binary = binary.resolve()
        self._first = BASE_PORT + PORTS_APART * instance
        self._instance = instance
        self._lidar = 56400 + instance
        self._stack = ExitStack()

    def __enter__(self) -> Self:
        folder = self.folder
        folder.mkdir(parents=True, exist_ok=True)
        (folder / "frame.parm").write_text(FRAME, "utf-8")
        ours = resources.files("params").joinpath("autopilot/arducopter.parm").read_text("utf-8")
        (folder / "slz.parm").write_text(ours, "utf-8")
        home = ",".join(str(value) for value in (*HOME, 0.0))
        self.autopilot = self._start(
            "autopilot",
            [
                *(str(self._binary), "--model", "quad", "--speedup", "1", "--wipe", "--home", home),
                *("--defaults", "frame.parm,slz.parm", "-I", str(self._instance)),
            ],
        )
        self.pilot = Pilot(self._first)
        self._stack.callback(self.pilot.close)
        self.lidar = self._python(
            "lidar",
            *("sitl", "--autopilot", f"tcp:127.0.0.1:{self._first + 2}", "--scene", self.scene),
            *("--seed", str(self.seed), "--lidar-to", f"127.0.0.1:{self._lidar}"),
            *("--point-rate", str(POINT_RATE), "--truth", str(folder / "truth")),
        )
        return self

    def __exit__(self, *_: object) -> None:
        self._stack.close()

    def run_companion(self, *settings: str) -> None:
        """Start `slz run --land auto`."""
        self.companion = self._python(
            "companion",
            *("companion.cli", "run", "--mavlink", f"tcp:127.0.0.1:{self._first + 3}"),
            *("--lidar", f"livox:127.0.0.1:{self._lidar}", "--land", "auto", "--json"),
            *(word for setting in settings for word in ("--set", setting)),
        )

    def ended(self) -> Outcome:
        """Stop the companion and the LiDAR and say what the flight came to."""
        stop(self.companion)
        stop(self.lidar)
        lines = (self.folder / "companion.out").read_text("utf-8").strip().splitlines()
        if not lines:
            raise FlightError(f"the companion gave no summary: {self._tail('companion')}")
        flight = json.loads((self.folder / "truth" / "flight.json").read_text("utf-8"))
        summary = json.loads(lines[-1])
        touchdown, chosen = flight["touchdown"], summary["chosen"]
        error_m, safe = None, False
        if touchdown is not None:
            safe = self._safe(touchdown["e"], touchdown["n"])
            if chosen is not None:
                error_m = _apart_m(chosen, touchdown)
        return Outcome(summary, flight, safe, error_m, self.pilot.said)

    def _safe(self, east: float, north: float) -> bool:
        world = scenes.build(self.scene, self.seed).world
        found = truth.safe_map(world, (east - 0.1, north - 0.1, east + 0.1, north + 0.1))
        return bool(found.safe[0, 0])

    def _tail(self, name: str) -> str:
        return (self.folder / f"{name}.err").read_text("utf-8")[-1500:]

    def _python(self, name: str, *words: str) -> subprocess.Popen[bytes]:
        return self._start(name, [sys.executable, "-m", *words])

    def _start(self, name: str, words: list[str]) -> subprocess.Popen[bytes]:
        return self._stack.enter_context(_program(words, self.folder, name))


@contextmanager
def _program(words: list[str], folder: Path, name: str) -> Iterator[subprocess.Popen[bytes]]:
    paths = os.pathsep.join(path for path in (str(Path.cwd()), os.environ.get("PYTHONPATH", "")) if path)
    own = {"PYTHONPATH": paths, "XDG_STATE_HOME": str(folder / "state")}
    with (folder / f"{name}.out").open("wb") as out, (folder / f"{name}.err").open("wb") as err:
        process = subprocess.Popen(
            words, cwd=folder, stdin=subprocess.DEVNULL, stdout=out, stderr=err, env=os.environ | own
        )
        try:
            yield process
        finally:
            stop(process)


def stop(process: subprocess.Popen[bytes], limit_s: float = 30.0) -> None:
    """Ask a program to end, then end it."""
    if process.poll() is None:
        process.send_signal(signal.SIGINT)
        try:
            process.wait(limit_s)
        except subprocess.TimeoutExpired:
            process.kill()
    process.wait()


def _apart_m(chosen: dict[str, float], touchdown: dict[str, float]) -> float:
    place = chosen["lat"], chosen["lon"], touchdown["alt"]
    e, n, _ = pymap3d.geodetic2enu(*place, touchdown["lat"], touchdown["lon"], touchdown["alt"])
    return math.hypot(float(e), float(n))
