"""One scripted flight over MAVLink, the same for every autopilot in GUIDED, recorded with the truth.

Take-off to 15 m, hover for 20 s, 10 m north, 10 m east, 3 m/s north and stop, a turn by 90 degrees, LAND.
The truth is SIM_STATE, the estimate LOCAL_POSITION_NED, both on the autopilot's clock.
"""

from __future__ import annotations

import json
import math
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from pymavlink import mavutil
from pymavlink.dialects.v20 import ardupilotmega as mavlink

HEIGHT_M, HOVER_S, STEP_M, STEP_S, SPEED_MS, SPEED_S = 15.0, 20.0, 10.0, 14.0, 3.0, 7.0
RATE_HZ = 50
GUIDED, LAND = 4, 9
POSITION_ONLY, VELOCITY_ONLY = 0b110111111000, 0b110111000111
WANTED = (
    mavlink.MAVLINK_MSG_ID_SIM_STATE,
    mavlink.MAVLINK_MSG_ID_ATTITUDE,
    mavlink.MAVLINK_MSG_ID_LOCAL_POSITION_NED,
)
LIMIT_S = 240.0


@dataclass(slots=True)
class Flight:
    """Recorder of one flight; `record` flies it."""

    url: str
    settings: dict[str, float] = field(default_factory=dict)
    rows: list[list[float]] = field(default_factory=list)
    """Time (s); truth: latitude, longitude (deg), altitude (m), north, east, down (m/s), roll, pitch, yaw
    (rad), three rates (rad/s); estimate: north, east, down (m), north, east, down (m/s)."""
    marks: list[tuple[str, float]] = field(default_factory=list)
    time_s: float = 0.0
    armed: bool = False
    mode: int = -1
    texts: list[str] = field(default_factory=list)
    _link: Any = None
    _estimate: list[float] = field(default_factory=lambda: [math.nan] * 6)

    def record(self, path: Path) -> None:
        """Fly and write the record, JSON.

        Raises
        ------
        TimeoutError
            If the autopilot does not arm, climb or disarm within `LIMIT_S`.
        """
        self._link = mavutil.mavlink_connection(self.url, source_system=255, source_component=190)
        self._link.wait_heartbeat(timeout=60)
        for number in WANTED:
            self._command(mavlink.MAV_CMD_SET_MESSAGE_INTERVAL, number, 1e6 / RATE_HZ)
        for name, value in self.settings.items():
            self._link.mav.param_set_send(1, 1, name.encode(), value, mavlink.MAV_PARAM_TYPE_REAL32)
        for _ in self._script():
            pass
        path.write_text(json.dumps({"marks": self.marks, "rows": self.rows, "texts": self.texts}), "utf-8")

    def _script(self) -> Iterator[None]:
        yield from self._until(lambda: -self._estimate[2] > 1.0, self._ask_to_climb, 3.0)
        self._mark("climb")
        yield from self._until(lambda: -self._estimate[2] > HEIGHT_M - 0.5)
        yield from self._wait(8.0)
        self._mark("hover")
        yield from self._wait(HOVER_S)
        north, east = self._estimate[:2]
        for name, n, e in (("north", STEP_M, 0.0), ("east", STEP_M, STEP_M)):
            self._mark(name)
            self._target(POSITION_ONLY, north + n, east + e, -HEIGHT_M)
            yield from self._wait(STEP_S)
        for name, speed in (("faster", SPEED_MS), ("stop", 0.0)):
            self._mark(name)
            begun = self.time_s
            while self.time_s < begun + SPEED_S:
                self._target(VELOCITY_ONLY, speed, 0.0, 0.0)
                yield from self._wait(0.2)
        self._mark("turn")
        self._command(mavlink.MAV_CMD_CONDITION_YAW, 90.0, 0.0, 1.0, 0.0)
        yield from self._wait(10.0)
        self._mark("land")
        yield from self._until(lambda: self.mode == LAND, lambda: self._mode(LAND))
        yield from self._until(lambda: not self.armed)
        self._mark("disarmed")
        yield from self._wait(2.0)

    def _wait(self, seconds: float) -> Iterator[None]:
        end = self.time_s + seconds
        while self.time_s < end:
            self._read()
            yield

    def _until(
        self, done: Callable[[], bool], ask: Callable[[], None] | None = None, every_s: float = 1.0
    ) -> Iterator[None]:
        begun, asked = time.monotonic(), -math.inf
        while not done():
            now = time.monotonic()
            if now - begun > LIMIT_S:
                raise TimeoutError(f"{self.url}: nothing after {self.marks[-1:]}; said {self.texts[-5:]}")
            if ask is not None and now - asked > every_s:
                ask()
                asked = now
            self._read()
            yield

    def _read(self) -> None:
        message = self._link.recv_match(blocking=True, timeout=1.0)
        if message is None or message.get_srcComponent() != 1:
            return
        match message.get_type():
            case "HEARTBEAT":
                self.armed = bool(message.base_mode & mavlink.MAV_MODE_FLAG_SAFETY_ARMED)
                self.mode = int(message.custom_mode)
                self._link.mav.heartbeat_send(
                    mavlink.MAV_TYPE_GCS, mavlink.MAV_AUTOPILOT_INVALID, 0, 0, mavlink.MAV_STATE_ACTIVE
                )
            case "STATUSTEXT":
                self.texts.append(message.text)
            case "LOCAL_POSITION_NED":
                m = message
                self._estimate = [m.x, m.y, m.z, m.vx, m.vy, m.vz]
            case "ATTITUDE":
                self.time_s = message.time_boot_ms * 1e-3
            case "SIM_STATE":
                self._note(message)

    def _ask_to_climb(self) -> None:
        """Go on to GUIDED, arm and take off; one that is not initialised yet refuses, or forgets the mode."""
        if self.mode != GUIDED:
            self._mode(GUIDED)
        elif self.armed:
            self._command(mavlink.MAV_CMD_NAV_TAKEOFF, 0, 0, 0, 0, 0, 0, HEIGHT_M)
        else:
            self._command(mavlink.MAV_CMD_COMPONENT_ARM_DISARM, 1)

    def _note(self, m: Any) -> None:
        place = [m.lat_int * 1e-7, m.lon_int * 1e-7, m.alt]
        motion = [m.vn, m.ve, m.vd, m.roll, m.pitch, m.yaw, m.xgyro, m.ygyro, m.zgyro]
        self.rows.append([self.time_s, *place, *motion, *self._estimate])

    def _mark(self, name: str) -> None:
        self.marks.append((name, self.time_s))

    def _mode(self, number: int) -> None:
        self._command(mavlink.MAV_CMD_DO_SET_MODE, mavlink.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED, number)

    def _command(self, number: int, *values: float) -> None:
        self._link.mav.command_long_send(1, 1, number, 0, *values, *[0.0] * (7 - len(values)))

    def _target(self, mask: int, x: float, y: float, z: float) -> None:
        place, speed = ((x, y, z), (0.0, 0.0, 0.0))
        if mask == VELOCITY_ONLY:
            place, speed = speed, place
        self._link.mav.set_position_target_local_ned_send(
            0, 1, 1, mavlink.MAV_FRAME_LOCAL_NED, mask, *place, *speed, 0.0, 0.0, 0.0, 0.0, 0.0
        )
