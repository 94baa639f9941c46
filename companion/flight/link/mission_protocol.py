"""MAVLink mission protocol for rally points and fences, without I/O: one transfer at a time.

Measured: ArduPilot requests items with MISSION_REQUEST and keeps whole metres. PX4 acknowledges the frames
GLOBAL_INT (5) and GLOBAL_RELATIVE_ALT_INT (6) and then returns to latitude 0, longitude 0, so no point may
use them; GLOBAL (0) and GLOBAL_RELATIVE_ALT (3) have the same meaning.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import Any, Generic, Literal, TypeVar

from pymavlink.dialects.v20 import ardupilotmega as mavlink

RALLY: int = mavlink.MAV_MISSION_TYPE_RALLY
FENCE: int = mavlink.MAV_MISSION_TYPE_FENCE
NAV_RALLY_POINT = 5100
GLOBAL: int = mavlink.MAV_FRAME_GLOBAL
RELATIVE: int = mavlink.MAV_FRAME_GLOBAL_RELATIVE_ALT
# The same frames under numbers that PX4 interprets as local coordinates.
_TRAPS: dict[int, int] = {
    mavlink.MAV_FRAME_GLOBAL_INT: GLOBAL,
    mavlink.MAV_FRAME_GLOBAL_RELATIVE_ALT_INT: RELATIVE,
}
_TERRAIN = mavlink.MAV_FRAME_GLOBAL_TERRAIN_ALT, mavlink.MAV_FRAME_GLOBAL_TERRAIN_ALT_INT
GLOBAL_FRAMES = frozenset({GLOBAL, RELATIVE, *_TRAPS, *_TERRAIN})
TIMEOUT_NS = 1_500_000_000
TRIES = 5
# The vehicle repeats its request for a missing item; after this silence it has given up.
SILENCE_NS = 8_000_000_000
MOST_POINTS, MOST_FENCE_ITEMS = 255, 1000
HIGHEST_M = 32_767

Outcome = Literal["done", "refused", "timeout"]
Item = TypeVar("Item")


@dataclass(frozen=True, slots=True)
class RallyPoint:
    """Rally point: degrees x 1e7, whole metres, above home (frame 3) or mean sea level (frame 0)."""

    lat_e7: int
    lon_e7: int
    alt_m: int
    frame: int = RELATIVE

    def __post_init__(self) -> None:
        if self.frame in _TRAPS:
            raise ValueError(f"rally points must not have frame {self.frame}: write {_TRAPS[self.frame]}")
        if not _is_on_earth(self.lat_e7, self.lon_e7) or abs(self.alt_m) > HIGHEST_M:
            raise ValueError(f"{self.lat_e7}, {self.lon_e7}, {self.alt_m} is not on the Earth")


@dataclass(frozen=True, slots=True)
class FenceItem:
    """Item of a fence: command, place in degrees x 1e7, and radius (m) or number of the polygon's corners."""

    command: int
    lat_e7: int
    lon_e7: int
    value: float

    def __post_init__(self) -> None:
        if not _is_on_earth(self.lat_e7, self.lon_e7) or not math.isfinite(self.value):
            raise ValueError(f"{self.lat_e7}, {self.lon_e7}, {self.value} is no item of a fence")


def _is_on_earth(lat_e7: int, lon_e7: int) -> bool:
    return abs(lat_e7) <= 900_000_000 and abs(lon_e7) <= 1_800_000_000


class Transfer(ABC):
    """One transfer to or from the vehicle.

    Attributes
    ----------
    mission_type
        MAV_MISSION_TYPE of what is transferred.
    outcome
        Result, None while it runs.
    refusal
        MAV_MISSION_RESULT with which the vehicle refused.
    """

    mission_type = RALLY

    def __init__(self, vehicle: int, system: int, component: int) -> None:
        self.outcome: Outcome | None = None
        self.refusal = 0
        self._to = (vehicle, int(mavlink.MAV_COMP_ID_AUTOPILOT1))
        self._us = (system, component)
        self._left = TRIES
        self._due_ns: int | None = None

    def poll(self, now_ns: int) -> list[Any]:
        """Return the messages to send now: the unanswered request, at intervals."""
        if self.outcome is not None or (self._due_ns is not None and now_ns < self._due_ns):
            return []
        question = self._question() if self._left > 0 else None
        if question is None:
            self.outcome = "timeout"
            return []
        self._left -= 1
        self._due_ns = now_ns + TIMEOUT_NS
        return [question]

    def on_message(self, message: Any, now_ns: int) -> list[Any]:
        """Process a message of the vehicle and return the answers."""
        if self.outcome is not None or getattr(message, "mission_type", 0) != self.mission_type:
            return []
        if (message.target_system, message.target_component) != self._us:
            return []
        return self._answer(message, now_ns)

    def _heard(self, now_ns: int, patience_ns: int = TIMEOUT_NS) -> None:
        self._left, self._due_ns = TRIES, now_ns + patience_ns

    def _refused(self, result: int) -> list[Any]:
        self.outcome, self.refusal = "refused", result
        return []

    @abstractmethod
    def _question(self) -> Any: ...

    @abstractmethod
    def _answer(self, message: Any, now_ns: int) -> list[Any]: ...


class Download(Transfer, Generic[Item]):
    """Download of the vehicle's items of one kind into `items`."""

    most_items = MOST_POINTS

    def __init__(self, vehicle: int, system: int, component: int) -> None:
        super().__init__(vehicle, system, component)
        self.items: list[Item] = []
        self._count: int | None = None

    @abstractmethod
    def _read(self, message: Any) -> Item:
        """Return the content of a MISSION_ITEM_INT; ValueError or OverflowError if it is invalid."""

    def _question(self) -> Any:
        if self._count is None:
            return mavlink.MAVLink_mission_request_list_message(*self._to, self.mission_type)
        return mavlink.MAVLink_mission_request_int_message(*self._to, len(self.items), self.mission_type)

    def _answer(self, message: Any, now_ns: int) -> list[Any]:
        kind = message.get_type()
        if kind == "MISSION_ACK" and message.type != mavlink.MAV_MISSION_ACCEPTED:
            return self._refused(message.type)
        if kind == "MISSION_COUNT" and self._count is None:
            self._count = message.count
            if self._count > self.most_items:
                return self._refused(mavlink.MAV_MISSION_NO_SPACE)
        elif kind == "MISSION_ITEM_INT" and self._count is not None and message.seq == len(self.items):
            try:
                self.items.append(self._read(message))
            except (ValueError, OverflowError):  # also NaN
                return self._refused(mavlink.MAV_MISSION_INVALID)
        else:
            return []
        self._heard(now_ns)
        if len(self.items) < self._count:
            return [self._question()]
        self.outcome = "done"
        return [
            mavlink.MAVLink_mission_ack_message(*self._to, mavlink.MAV_MISSION_ACCEPTED, self.mission_type)
        ]


class RallyDownload(Download[RallyPoint]):
    """Download of the vehicle's rally points."""

    def _read(self, message: Any) -> RallyPoint:
        frame = _TRAPS.get(message.frame, message.frame)
        return RallyPoint(message.x, message.y, int(message.z), frame)


class FenceDownload(Download[FenceItem]):
    """Download of the items of the vehicle's fence."""

    mission_type, most_items = FENCE, MOST_FENCE_ITEMS

    def _read(self, message: Any) -> FenceItem:
        if message.frame not in GLOBAL_FRAMES:
            raise ValueError(f"fence item {message.seq} in frame {message.frame}")
        return FenceItem(message.command, message.x, message.y, float(message.param1))


class Upload(Transfer):
    """Upload that replaces the vehicle's rally points; an empty list clears them."""

    def __init__(self, vehicle: int, system: int, component: int, points: tuple[RallyPoint, ...]) -> None:
        super().__init__(vehicle, system, component)
        self.points = points
        self._asked = False
        self._complete = not points

    def _question(self) -> Any:
        if self._asked:
            return None  # now the vehicle sends the requests
        if not self.points:
            return mavlink.MAVLink_mission_clear_all_message(*self._to, RALLY)
        return mavlink.MAVLink_mission_count_message(*self._to, len(self.points), RALLY)

    def _answer(self, message: Any, now_ns: int) -> list[Any]:
        kind = message.get_type()
        if kind in ("MISSION_REQUEST", "MISSION_REQUEST_INT") and message.seq < len(self.points):
            self._asked = True
            self._complete = self._complete or message.seq == len(self.points) - 1
            self._heard(now_ns, SILENCE_NS)
            return [self._item(message.seq)]
        if kind == "MISSION_ACK":
            if message.type != mavlink.MAV_MISSION_ACCEPTED:
                return self._refused(message.type)
            if self._complete:  # otherwise it belongs to an older transfer
                self.outcome = "done"
        return []

    def _item(self, number: int) -> Any:
        p = self.points[number]
        return mavlink.MAVLink_mission_item_int_message(
            *self._to, number, p.frame, NAV_RALLY_POINT, 0, 1, 0.0, 0.0, 0.0, 0.0,
            p.lat_e7, p.lon_e7, float(p.alt_m), RALLY,
        )  # fmt: skip
