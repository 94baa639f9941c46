"""MAV_CMD_USER_1: the operator's orders over MAVLink."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Protocol

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from companion.flight.landing.orders.operator_order import NUMBERS, OF_ZONES, Order, OrderDesk, OrderKind
from companion.flight.landing.situation import Reply
from companion.flight.link.command_server import CommandReply, OperatorCommand
from slz import LocalFrame

POINT = 3  # param1: select (param2 = 0) or land at (param2 = 1) the point in x, y, z
KINDS = NUMBERS | {0: OrderKind.ABORT, 4: OrderKind.LAND_NOW}  # 0 and 4: older numbers of 7 and 8


class HasFrame(Protocol):
    """Holder of the map frame, which is None before the first position."""

    @property
    def frame(self) -> LocalFrame | None:
        """Map frame."""


class MavlinkOrders:
    """Converts MAV_CMD_USER_1 to orders.

    param1: 1 land at the best zone, 2 land at zone param2, 3 select (param2 = 0) or land at (param2 = 1) the
    point in x, y, z: latitude, longitude (degrees), altitude above mean sea level (m), 5 select zone param2,
    6 land at the selected point, 7 or 0 abort, 8 or 4 land now at the zone reached soonest, from any mode
    (emergency).

    Parameters
    ----------
    desk
        Executes the orders.
    history
        Holds the map frame.
    """

    def __init__(self, desk: OrderDesk, history: HasFrame) -> None:
        self._desk = desk
        self._history = history

    def answer(self, command: OperatorCommand) -> CommandReply:
        """Execute a command and return the answer; the reason of a refusal goes to the sender's screen."""
        if command.command != mavlink.MAV_CMD_USER_1:
            return CommandReply.unsupported()
        order = self._order(command)
        reply = order if isinstance(order, Reply) else self._desk.carry_out(order)
        answer = CommandReply.accepted() if reply.accepted else CommandReply.denied(f"SLZ: {reply.reason}")
        count = self._desk.order_count
        return replace(
            answer,
            always=isinstance(order, Order) and order.kind is OrderKind.ABORT,
            is_in_effect=lambda: self._desk.order_count == count,
        )

    def _order(self, command: OperatorCommand) -> Order | Reply:
        """Return the order of a command, or the refusal of an invalid one."""
        number, which = command.params[0], command.params[1]
        if number == POINT and which in (0, 1):
            return self._point(command, OrderKind.LAND_AT_POINT if which == 1 else OrderKind.SELECT_POINT)
        kind = KINDS.get(int(number)) if float(number).is_integer() else None
        if kind is None or (kind in OF_ZONES and not float(which).is_integer()):
            return Reply(False, f"USER_1 knows no {number:g}/{which:g}")
        return Order(kind, zone_id=int(which) if kind in OF_ZONES else None)

    def _point(self, command: OperatorCommand, kind: OrderKind) -> Order | Reply:
        frame = self._history.frame
        lat, lon, alt = command.x, command.y, command.z
        if frame is None:
            return Reply(False, "no position yet")
        if command.frame not in (None, mavlink.MAV_FRAME_GLOBAL, mavlink.MAV_FRAME_GLOBAL_INT):
            return Reply(False, "a point needs frame GLOBAL")
        if not (math.isfinite(lat) and math.isfinite(lon) and abs(lat) <= 90 and abs(lon) <= 180):
            return Reply(False, "x, y are no latitude, longitude")
        enu = frame.enu_m(lat, lon, alt if math.isfinite(alt) else frame.alt_m)
        return Order(kind, point_enu_m=enu)
