"""Vehicle side of the mission protocol, like ArduCopter's: items of one kind, listed, written and cleared."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from sitl.autopilot.autopilot_view import AutopilotView
from sitl.autopilot.guidance import mission_mode

REPEAT_NS = 1_000_000_000
GIVE_UP_NS = 8_000_000_000
RELATIVE_FRAMES = (mavlink.MAV_FRAME_GLOBAL_RELATIVE_ALT, mavlink.MAV_FRAME_GLOBAL_RELATIVE_ALT_INT)
GLOBAL_FRAMES = (*RELATIVE_FRAMES, mavlink.MAV_FRAME_GLOBAL, mavlink.MAV_FRAME_GLOBAL_INT)
F64 = NDArray[np.float64]
RALLY_POINT = 5100
COMMANDS = (mission_mode.TAKEOFF, mission_mode.WAYPOINT, mission_mode.LAND, mission_mode.RETURN)


@dataclass(frozen=True, slots=True)
class Item:
    """Stored item: its command, its param1 and its place."""

    command: int
    value: float
    lat_e7: int
    lon_e7: int
    alt_m: float
    relative: bool


@dataclass(slots=True)
class Receipt:
    """Upload in progress: its sender, number of items, and time of the last request."""

    link: int
    sender: tuple[int, int]
    count: int
    asked_ns: int
    heard_ns: int
    items: list[Item] = field(default_factory=list)


class MissionItems(ABC):
    """Server of items; requests uploads with MISSION_REQUEST, item by item.

    Attributes
    ----------
    kind, room, total
        MAV_MISSION_TYPE, greatest number of items, and the parameter that counts them.
    replaces_at_end
        Whether an upload replaces the items when it is complete, instead of one by one.
    step_m
        Resolution of altitudes, which are cut off.
    items
        Stored items.
    """

    kind: int
    room: int
    total: str
    replaces_at_end: bool
    step_m = 1.0

    def __init__(self, autopilot: AutopilotView) -> None:
        self._ap = autopilot
        self._receipt: Receipt | None = None
        self.items: list[Item] = []

    @abstractmethod
    def _fault(self, message: Any) -> int:
        """Return the MAV_MISSION_RESULT for an item, 0 for a valid one."""

    def _are_valid(self, items: list[Item]) -> bool:
        """Return whether the items of an upload make sense together."""
        return True

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

    def on_list(self, message: Any, link: int) -> None:
        """Answer MISSION_REQUEST_LIST."""
        self._ap.send(
            mavlink.MAVLink_mission_count_message(*_sender(message), len(self.items), self.kind), link
        )

    def on_request(self, message: Any, link: int) -> None:
        """Answer MISSION_REQUEST and MISSION_REQUEST_INT."""
        if message.seq >= len(self.items):
            self._ack(_sender(message), link, mavlink.MAV_MISSION_INVALID_SEQUENCE)
            return
        p = self.items[message.seq]
        frame = RELATIVE_FRAMES[0] if p.relative else mavlink.MAV_FRAME_GLOBAL
        self._ap.send(
            mavlink.MAVLink_mission_item_int_message(
                *_sender(message), message.seq, frame, p.command, 0, 1, p.value, 0, 0, 0,
                p.lat_e7, p.lon_e7, p.alt_m, self.kind,
            ),
            link,
        )  # fmt: skip

    def on_count(self, message: Any, link: int) -> None:
        """Begin an upload, or clear the items."""
        sender = _sender(message)
        if self._receipt is not None and self._receipt.sender != sender:
            self._ack(sender, link, mavlink.MAV_MISSION_DENIED)
        elif message.count > self.room:
            self._ack(sender, link, mavlink.MAV_MISSION_NO_SPACE)
        elif message.count == 0:
            self._store([])
            self._ack(sender, link, mavlink.MAV_MISSION_ACCEPTED)
        else:
            if not self.replaces_at_end:
                self._store(self.items[: message.count])
            now_ns = self._ap.now_ns
            self._receipt = Receipt(link, sender, message.count, now_ns, now_ns)
            self._ask(self._receipt)

    def on_item(self, message: Any, link: int) -> None:
        """Take an item of the upload in progress."""
        receipt = self._receipt
        if receipt is None or receipt.sender != _sender(message) or message.seq != len(receipt.items):
            return
        fault = self._fault(message)
        if fault:
            self._receipt = None
            self._ack(receipt.sender, link, fault)
            return
        relative = message.frame in RELATIVE_FRAMES
        receipt.items.append(
            Item(message.command, message.param1, message.x, message.y, self._cut(message.z), relative)
        )
        receipt.heard_ns = self._ap.now_ns
        complete = len(receipt.items) == receipt.count
        valid = not complete or self._are_valid(receipt.items)
        if not self.replaces_at_end:
            self._store([*receipt.items, *self.items[len(receipt.items) :]])
        elif complete and valid:
            self._store(receipt.items)
        if complete:
            self._receipt = None
            accepted, error = mavlink.MAV_MISSION_ACCEPTED, mavlink.MAV_MISSION_ERROR
            self._ack(receipt.sender, link, accepted if valid else error)
        else:
            self._ask(receipt)

    def on_clear(self, message: Any, link: int) -> None:
        """Clear the items."""
        self._store([])
        self._ack(_sender(message), link, mavlink.MAV_MISSION_ACCEPTED)

    def _cut(self, altitude_m: float) -> float:
        return math.trunc(altitude_m / self.step_m + 1e-6) * self.step_m

    def _place_enu_m(self, item: Item) -> F64:
        """Return an item's place in the estimate's frame; relative altitudes are above the current home."""
        enu = self._ap.enu_m(item.lat_e7 * 1e-7, item.lon_e7 * 1e-7, self._ap.origin_lla[2])
        home_up = float(self._ap.navigator.home_enu_m[2])
        enu[2] = item.alt_m + home_up if item.relative else item.alt_m - self._ap.origin_lla[2]
        return enu

    def _store(self, items: list[Item]) -> None:
        self.items = items
        self._ap.parameters[self.total] = float(len(items))

    def _ask(self, receipt: Receipt) -> None:
        receipt.asked_ns = self._ap.now_ns
        number = len(receipt.items)
        self._ap.send(
            mavlink.MAVLink_mission_request_message(*receipt.sender, number, self.kind), receipt.link
        )

    def _ack(self, to: tuple[int, int], link: int, result: int) -> None:
        self._ap.send(mavlink.MAVLink_mission_ack_message(*to, result, self.kind), link)


class MissionServer:
    """Hands messages of the mission protocol to the items of their kind; other kinds are empty."""

    def __init__(self, autopilot: AutopilotView, *kinds: MissionItems) -> None:
        self._ap = autopilot
        self._kinds = {items.kind: items for items in kinds}
        self.handlers: dict[str, Callable[[Any, int], None]] = {
            "MISSION_REQUEST_LIST": lambda m, link: self._to(m, link, MissionItems.on_list),
            "MISSION_REQUEST": lambda m, link: self._to(m, link, MissionItems.on_request),
            "MISSION_REQUEST_INT": lambda m, link: self._to(m, link, MissionItems.on_request),
            "MISSION_COUNT": lambda m, link: self._to(m, link, MissionItems.on_count),
            "MISSION_ITEM_INT": lambda m, link: self._to(m, link, MissionItems.on_item),
            "MISSION_CLEAR_ALL": self._clear,
        }

    def on_tick(self, now_ns: int) -> None:
        """Repeat requests."""
        for items in self._kinds.values():
            items.on_tick(now_ns)

    def _to(self, message: Any, link: int, handle: Callable[[MissionItems, Any, int], None]) -> None:
        items = self._kinds.get(message.mission_type)
        if items is not None:
            handle(items, message, link)
        elif message.get_type() == "MISSION_REQUEST_LIST":
            to = _sender(message)
            self._ap.send(mavlink.MAVLink_mission_count_message(*to, 0, message.mission_type), link)
        elif message.get_type() != "MISSION_ITEM_INT":
            result = {
                "MISSION_COUNT": mavlink.MAV_MISSION_UNSUPPORTED,
            }.get(message.get_type(), mavlink.MAV_MISSION_INVALID_SEQUENCE)
            self._ap.send(
                mavlink.MAVLink_mission_ack_message(*_sender(message), result, message.mission_type), link
            )

    def _clear(self, message: Any, link: int) -> None:
        kinds = list(self._kinds.values())
        if message.mission_type != mavlink.MAV_MISSION_TYPE_ALL:
            kinds = [items for items in kinds if items.kind == message.mission_type]
        for items in kinds:
            items.on_clear(message, link)
        if not kinds:
            accepted = mavlink.MAV_MISSION_ACCEPTED
            ack = mavlink.MAVLink_mission_ack_message(*_sender(message), accepted, message.mission_type)
            self._ap.send(ack, link)


def place_fault(message: Any) -> int:
    """Return the MAV_MISSION_RESULT for an item's frame and place."""
    if message.frame not in GLOBAL_FRAMES:
        return int(mavlink.MAV_MISSION_UNSUPPORTED_FRAME)
    if not (math.isfinite(message.z) and abs(message.z) < 32_768):
        return int(mavlink.MAV_MISSION_INVALID)
    on_earth = abs(message.x) <= 900_000_000 and abs(message.y) <= 1_800_000_000
    return 0 if on_earth else int(mavlink.MAV_MISSION_INVALID)


def _sender(message: Any) -> tuple[int, int]:
    return message.get_srcSystem(), message.get_srcComponent()


class Rally(MissionItems):
    """Rally points."""

    kind, room, total = mavlink.MAV_MISSION_TYPE_RALLY, 84, "RALLY_TOTAL"
    replaces_at_end = False

    def points_enu_m(self) -> list[F64]:
        """Return the points in the estimate's frame."""
        return [self._place_enu_m(point) for point in self.items]

    def _fault(self, message: Any) -> int:
        if message.command != RALLY_POINT:
            return int(mavlink.MAV_MISSION_UNSUPPORTED)
        return place_fault(message)


class FlightPlan(MissionItems):
    """Mission of AUTO; its first item is home. Of an item's parameters only the first is stored."""

    kind, room, total = mavlink.MAV_MISSION_TYPE_MISSION, 700, "MIS_TOTAL"
    replaces_at_end = False
    step_m = 0.01

    @property
    def starts_with_takeoff(self) -> bool:
        """True if the first command after home is a take-off."""
        return len(self.items) > 1 and self.items[1].command == mission_mode.TAKEOFF

    def legs(self) -> list[mission_mode.Leg]:
        """Return the commands after home."""
        return [
            mission_mode.Leg(item.command, number, self._place_or_none(item), item.value)
            for number, item in enumerate(self.items)
            if number > 0
        ]

    def _place_or_none(self, item: Item) -> F64 | None:
        has_place = item.lat_e7 or item.lon_e7 or item.command == mission_mode.TAKEOFF
        return self._place_enu_m(item) if has_place else None

    def _fault(self, message: Any) -> int:
        if message.command not in COMMANDS:
            return int(mavlink.MAV_MISSION_UNSUPPORTED)
        if message.command == mission_mode.RETURN:
            return 0
        return (
            place_fault(message) if math.isfinite(message.param1) else int(mavlink.MAV_MISSION_INVALID_PARAM1)
        )
