"""Real autopilot in its own simulator, with its pilot, the simulated LiDAR and the companion.

Programs in real time, each with its own output in the flight's folder. Differences between autopilots are
in `arducopter` and `px4`.
"""

from __future__ import annotations

import json
import math
import os
import signal
import subprocess
import sys
import time
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator, Mapping
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Self

import pymap3d
from pymavlink import mavutil
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from sitl import scenes
from sitl.truth.touchdown import fault_of

HOME = (-35.363262, 149.165237, 584.0)
POINT_RATE = 50_000
FIRST_LIDAR_PORT = 56400


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


class Pilot(ABC):
    """A ground station: arms, takes off, hands over to the companion, and watches.

    Parameters
    ----------
    url
        Where the autopilot speaks to ground stations.
    limit_s
        How long the autopilot may take to listen.
    """

    def __init__(self, url: str, limit_s: float = 60.0) -> None:
        self.said: list[str] = []
        self.modes: list[str] = []
        self.system = 1
        self.armed = False
        self.mode = ""
        self.height_m = 0.0
        self.acks: dict[int, int] = {}
        self._beat_s = 0.0
        self._port = mavutil.mavlink_connection(
            url, source_system=255, source_component=190, retries=int(limit_s), robust_parsing=True
        )

    def close(self) -> None:
        self._port.close()

    @property
    def flying(self) -> bool:
        """Whether it has left the ground; a height alone may be one over a home not yet found."""
        return self.armed and self.height_m > 1.0

    def until(self, done: Callable[[], bool], limit_s: float, what: str) -> None:
        """Listen until something holds."""
        end = time.monotonic() + limit_s
        while not done():
            if time.monotonic() > end:
                raise FlightError(
                    f"no {what} within {limit_s:g} s; mode {self.mode}; heard {self.said[-12:]}"
                )
            self.listen(0.2)

    def wait(self, done: Callable[[], bool], limit_s: float) -> None:
        """Listen until something holds, at most so long."""
        end = time.monotonic() + limit_s
        while not done() and time.monotonic() < end:
            self.listen(0.2)

    def listen(self, seconds: float) -> None:
        """Read one message, at most so long, and keep our own heartbeat up."""
        if time.monotonic() >= self._beat_s:
            self._beat_s = time.monotonic() + 1.0
            self._port.mav.heartbeat_send(mavlink.MAV_TYPE_GCS, mavlink.MAV_AUTOPILOT_INVALID, 0, 0, 4)
        message = self._port.recv_match(blocking=True, timeout=seconds)
        if message is not None:
            self.take(message)

    def _hear(self, message: Any) -> None:
        """Note a text; the parts of a long one have a number in common and follow each other."""
        if message.chunk_seq and self.said:
            self.said[-1] += str(message.text)
        else:
            self.said.append(str(message.text))

    def take(self, message: Any) -> None:
        """Note what a message says."""
        kind = message.get_type()
        if kind == "STATUSTEXT":
            self._hear(message)
        elif kind == "COMMAND_ACK":
            self.acks[message.command] = message.result
        elif kind == "GLOBAL_POSITION_INT":
            self.height_m = message.relative_alt / 1000
        elif kind == "HEARTBEAT" and message.get_srcComponent() == 1:
            self.system = message.get_srcSystem()
            self.armed = bool(message.base_mode & mavlink.MAV_MODE_FLAG_SAFETY_ARMED)
            self.mode = self.mode_name(message)
            if self.modes[-1:] != [self.mode]:
                self.modes.append(self.mode)

    def command(self, number: int, *values: float) -> None:
        self.acks.pop(number, None)
        padded = [*values, *[0.0] * (7 - len(values))]
        self._port.mav.command_long_send(self.system, 1, number, 0, *padded)

    def accepted(self, number: int) -> bool:
        """Tell whether the last command of a number was accepted."""
        return self.acks.get(number) == mavlink.MAV_RESULT_ACCEPTED

    def take_off(self, height_m: float) -> None:
        """Stream positions, arm as soon as that works, climb, and hand over."""
        position = float(mavlink.MAVLINK_MSG_ID_GLOBAL_POSITION_INT)
        self.until(lambda: self.mode != "", 60, "heartbeat")
        self.command(mavlink.MAV_CMD_SET_MESSAGE_INTERVAL, position, 100_000.0)
        self._lift(height_m)
        self.until(lambda: self.height_m > 0.9 * height_m, 90, "height")
        self.hand_over()

    def hears(self, text: str) -> bool:
        """Tell whether some text on the screen holds this one."""
        return any(text in said for said in self.said)

    def _lift(self, height_m: float, limit_s: float = 180.0) -> None:
        """Arm and take off, again and again until it flies: it refuses while it initialises."""
        end = time.monotonic() + limit_s
        while not self.flying:
            if time.monotonic() > end:
                raise FlightError(f"not flying after {limit_s:g} s; heard {self.said[-12:]}")
            self.ask_to_fly(height_m)
            self.wait(lambda: self.flying, 2.0)

    @abstractmethod
    def mode_name(self, heartbeat: Any) -> str:
        """Return the mode that a heartbeat of the autopilot tells."""

    @abstractmethod
    def set_mode(self, name: str) -> None:
        """Ask once for a mode by its name."""

    @abstractmethod
    def ask_to_fly(self, height_m: float) -> None:
        """Send what is missing next for it to fly: a mode, arming, the take-off."""

    @abstractmethod
    def hand_over(self) -> None:
        """Set the mode that obeys the companion, unless it is set."""


class Field(ABC):
    """All programs of one flight, in a folder of their own.

    Parameters
    ----------
    binary
        The autopilot's.
    instance
        Of the autopilot: its ports, and the LiDAR's, follow from it.
    """

    landing_mode: str
    guided_mode: str
    """Names of the mode that lands on the target, and of the one that obeys the companion."""

    def __init__(self, binary: Path, folder: Path, *, scene: str, seed: int, instance: int = 0) -> None:
        self.folder, self.scene, self.seed = folder, scene, seed
        self.binary = binary.resolve()
        self.instance = instance
        self._lidar_port = FIRST_LIDAR_PORT + instance
        self._stack = ExitStack()

    @abstractmethod
    def autopilot_words(self) -> list[str]:
        """Return the autopilot's command line, after writing the files that it reads."""

    def autopilot_environment(self) -> Mapping[str, str]:
        """Return the autopilot's own environment variables."""
        return {}

    @abstractmethod
    def new_pilot(self) -> Pilot:
        """Return the pilot at this autopilot."""

    @abstractmethod
    def urls(self) -> tuple[str, str]:
        """Return where the LiDAR and where the companion find the autopilot."""

    @contextmanager
    def autopilot_alone(self) -> Iterator[Pilot]:
        """Start the autopilot and give its pilot; all else is up to the test."""
        with self._stack:
            self._start_autopilot()
            yield self.pilot

    def _start_autopilot(self) -> None:
        self.folder.mkdir(parents=True, exist_ok=True)
        self.autopilot = self._start("autopilot", self.autopilot_words(), self.autopilot_environment())
        self.pilot = self.new_pilot()
        self._stack.callback(self.pilot.close)

    def __enter__(self) -> Self:
        folder = self.folder
        self._start_autopilot()
        self.lidar = self._python(
            "lidar",
            *("sitl", "--autopilot", self.urls()[0], "--scene", self.scene),
            *("--seed", str(self.seed), "--lidar-to", f"127.0.0.1:{self._lidar_port}"),
            *("--point-rate", str(POINT_RATE), "--truth", str(folder / "truth")),
        )
        said = folder / "lidar.out"
        self.pilot.until(lambda: bool(said.read_text("utf-8")), 60, "word that the LiDAR is ready")
        return self

    def __exit__(self, *_: object) -> None:
        self._stack.close()

    def run_companion(self, *settings: str) -> None:
        """Start `slz run --land auto`."""
        self.companion = self._python(
            "companion",
            *("companion.cli", "run", "--mavlink", self.urls()[1]),
            *("--lidar", f"livox:127.0.0.1:{self._lidar_port}", "--land", "auto", "--json"),
            *(word for setting in settings for word in ("--set", setting)),
        )

    def land(self, limit_s: float = 400.0) -> Outcome:
        """Wait until the companion has landed it, and say what the flight came to."""
        pilot = self.pilot
        pilot.until(lambda: pilot.mode == self.landing_mode, limit_s, self.landing_mode)
        pilot.until(lambda: not pilot.armed, 200, "landing")
        return self.ended()

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
            world = scenes.build(self.scene, self.seed).world
            safe = not fault_of(world, touchdown)
            if chosen is not None:
                error_m = _apart_m(chosen, touchdown)
        return Outcome(summary, flight, safe, error_m, self.pilot.said)

    def _tail(self, name: str) -> str:
        return (self.folder / f"{name}.err").read_text("utf-8")[-1500:]

    def _python(self, name: str, *words: str) -> subprocess.Popen[bytes]:
        return self._start(name, [sys.executable, "-m", *words], {})

    def _start(self, name: str, words: list[str], own: Mapping[str, str]) -> subprocess.Popen[bytes]:
        return self._stack.enter_context(_program(words, self.folder, name, own))


@contextmanager
def _program(
    words: list[str], folder: Path, name: str, environment: Mapping[str, str]
) -> Iterator[subprocess.Popen[bytes]]:
    paths = os.pathsep.join(path for path in (str(Path.cwd()), os.environ.get("PYTHONPATH", "")) if path)
    own = {"PYTHONPATH": paths, "XDG_STATE_HOME": str(folder / "state"), **environment}
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
