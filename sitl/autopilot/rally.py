"""Vehicle side of the mission protocol for rally points, like ArduCopter's."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from sitl.autopilot.autopilot_view import AutopilotView

F64 = NDArray[np.float64]

RALLY: int = mavlink.MAV_MISSION_TYPE_RALLY
RALLY_POINT = 5100
ROOM = 84
REPEAT_NS = 1_000_000_000
GIVE_UP_NS = 8_000_000_000
_RELATIVE = (mavlink.MAV_FRAME_GLOBAL_RELATIVE_ALT, mavlink.MAV_FRAME_GLOBAL_RELATIVE_ALT_INT)
_ABSOLUTE = (mavlink.MAV_FRAME_GLOBAL, mavlink.MAV_FRAME_GLOBAL_INT)


@dataclass(frozen=True, slots=True)
class Point:
    """Stored rally point; altitudes are whole metres."""

    lat_e7: int
    lon_e7: int
    alt_m: int
    relative: bool


@dataclass(slots=True)
class Receipt:
    """Upload in progress: its sender, number of items, and time of the last request."""

    link: int
    sender: tuple[int, int]
    count: int
    asked_ns: int
    heard_ns: int
    points: list[Point] = field(default_factory=list)


class Rally:
    """Rally point server; requests uploads with MISSION_REQUEST, item by item, and stores each on arrival."""

    def __init__(self, autopilot: AutopilotView) -> None:
        self._ap = autopilot
        self._receipt: Receipt | None = None
        self.points: list[Point] = []
        self.handlers: dict[str, Callable[[Any, int], None]] = {
            "MISSION_REQUEST_LIST": self._list,
            "MISSION_REQUEST": self._request,
            "MISSION_REQUEST_INT": self._request,
            "MISSION_COUNT": self._count,
            "MISSION_ITEM_INT": self._item,
            "MISSION_CLEAR_ALL": self._clear,
        }

    def points_enu_m(self) -> list[F64]:
        """Return the points in the estimate's frame; relative altitudes are above the current home."""
        home_up = float(self._ap.navigator.home_enu_m[2])
        found = []
        for point in self.points:
            enu = self._ap.enu_m(point.lat_e7 * 1e-7, point.lon_e7 * 1e-7, self._ap.origin_lla[2])
            enu[2] = point.alt_m + home_up if point.relative else point.alt_m - self._ap.origin_lla[2]
            found.append(enu)
        return found

    def on_tick(self, now_ns: int) -> None:
        """Repeat the request for a missing item, and give up in the end."""
        receipt = self._receipt
        if receipt is None or now_ns - receipt.asked_ns < REPEAT_NS:
            return
        if now_ns - receipt.heard_ns >= GIVE_UP_NS:
            self._receipt = None
            self._ack(receipt.sender, receipt.link, mavlink.MAV_MISSION_OPERATION_CANCELLED)
            return
        self._ask(receipt)

    def _list(self, message: Any, link: int) -> None:
        count = len(self.points) if message.mission_type == RALLY else 0
        self._ap.send(
            mavlink.MAVLink_mission_count_message(*_sender(message), count, message.mission_type), link
        )

    def _request(self, message: Any, link: int) -> None:
        if message.mission_type != RALLY or message.seq >= len(self.points):
            self._ack(_sender(message), link, mavlink.MAV_MISSION_INVALID_SEQUENCE, message.mission_type)
            return
        p = self.points[message.seq]
        frame = _RELATIVE[0] if p.relative else _ABSOLUTE[0]
        self._ap.send(
            mavlink.MAVLink_mission_item_int_message(
                *_sender(message), message.seq, frame, RALLY_POINT, 0, 1, 0, 0, 0, 0,
                p.lat_e7, p.lon_e7, float(p.alt_m), RALLY,
            ),
            link,
        )  # fmt: skip

    def _count(self, message: Any, link: int) -> None:
        sender = _sender(message)
        if message.mission_type != RALLY:
            self._ack(sender, link, mavlink.MAV_MISSION_UNSUPPORTED, message.mission_type)
        elif self._receipt is not None and self._receipt.sender != sender:
            self._ack(sender, link, mavlink.MAV_MISSION_DENIED)
        elif message.count > ROOM:
            self._ack(sender, link, mavlink.MAV_MISSION_NO_SPACE)
        else:
            self._truncate(message.count)
            if message.count == 0:
                self._ack(sender, link, mavlink.MAV_MISSION_ACCEPTED)
                return
            now_ns = self._ap.now_ns
            self._receipt = Receipt(link, sender, message.count, now_ns, now_ns)
            self._ask(self._receipt)

    def _item(self, message: Any, link: int) -> None:
        receipt = self._receipt
        if message.mission_type != RALLY or receipt is None or receipt.sender != _sender(message):
            return
        if message.seq != len(receipt.points):
            return
        fault = _fault(message)
        if fault:
            self._receipt = None
            self._ack(receipt.sender, link, fault)
            return
        point = Point(message.x, message.y, int(message.z), message.frame in _RELATIVE)
        self.points[message.seq : message.seq + 1] = [point]
        self._ap.parameters["RALLY_TOTAL"] = float(len(self.points))
        receipt.points.append(point)
        receipt.heard_ns = self._ap.now_ns
        if len(receipt.points) == receipt.count:
            self._receipt = None
            self._ack(receipt.sender, link, mavlink.MAV_MISSION_ACCEPTED)
        else:
            self._ask(receipt)

    def _clear(self, message: Any, link: int) -> None:
        if message.mission_type in (RALLY, mavlink.MAV_MISSION_TYPE_ALL):
            self._truncate(0)
        self._ack(_sender(message), link, mavlink.MAV_MISSION_ACCEPTED, message.mission_type)

    def _truncate(self, count: int) -> None:
        del self.points[count:]
        self._ap.parameters["RALLY_TOTAL"] = float(len(self.points))

    def _ask(self, receipt: Receipt) -> None:
        receipt.asked_ns = self._ap.now_ns
        number = len(receipt.points)
        self._ap.send(mavlink.MAVLink_mission_request_message(*receipt.sender, number, RALLY), receipt.link)

    def _ack(self, to: tuple[int, int], link: int, result: int, kind: int = RALLY) -> None:
        self._ap.send(mavlink.MAVLink_mission_ack_message(*to, result, kind), link)


def _sender(message: Any) -> tuple[int, int]:
    return message.get_srcSystem(), message.get_srcComponent()


def _fault(message: Any) -> int:
    """Return the MAV_MISSION_RESULT for an item, 0 for a valid one."""
    if message.command != RALLY_POINT:
        return int(mavlink.MAV_MISSION_UNSUPPORTED)
    if message.frame not in (*_RELATIVE, *_ABSOLUTE):
        return int(mavlink.MAV_MISSION_UNSUPPORTED_FRAME)
    if not (math.isfinite(message.z) and abs(message.z) < 32_768):
        return int(mavlink.MAV_MISSION_INVALID)
    on_earth = abs(message.x) <= 900_000_000 and abs(message.y) <= 1_800_000_000
    return 0 if on_earth else int(mavlink.MAV_MISSION_INVALID)
