"""Handler of a browser's orders, through the same interfaces as MAVLink's commands and parameters."""

from __future__ import annotations

from typing import Protocol

import numpy as np

from companion.flight.dashboard.browser_orders import (
    Command,
    Confirm,
    Record,
    Replay,
    SelectPoint,
    SelectZone,
    SetParameter,
    Simple,
)
from companion.flight.flight_view import FlightView
from companion.flight.landing.orders.operator_order import Order, OrderKind
from companion.flight.landing.situation import Reply
from params import unknown

SIMPLE = {
    "abort": OrderKind.ABORT,
    "land_best": OrderKind.LAND_AT_BEST,
    "land_now": OrderKind.LAND_NOW,
}


class OrderHandler(Protocol):
    """Handler of orders, in the event loop of the flight or replay."""

    async def carry_out(self, order: Command) -> Reply:
        """Execute an order, or return the reason of its refusal."""


class FlightOrderHandler:
    """Handler of a flight's orders."""

    def __init__(self, flight: FlightView) -> None:
        self._flight = flight
        self._desk = flight.deciding.order_desk

    async def carry_out(self, order: Command) -> Reply:
        """Execute an order, or return the reason of its refusal."""
        match order:
            case Simple():
                return self._desk.carry_out(Order(SIMPLE[order.do]))
            case SelectZone():
                return self._desk.carry_out(Order(OrderKind.SELECT_ZONE, order.zone))
            case SelectPoint():
                return self._select_point(order.east_m, order.north_m)
            case Confirm():
                return self._confirm(order)
            case SetParameter():
                return self._set(order)
            case Record():
                return await self._flight.recordings.set_recording(order.on)
            case Replay():
                return Reply(False, "this is a flight, no replay")

    def _select_point(self, east_m: float, north_m: float) -> Reply:
        """Select a point of the map."""
        if self._flight.sensing.history.frame is None:
            return Reply(False, "no position yet")
        point = np.array([east_m, north_m, 0.0])
        return self._desk.carry_out(Order(OrderKind.SELECT_POINT, point_enu_m=point))

    def _confirm(self, order: Confirm) -> Reply:
        """Land at the selected point, if it is the one that the sender saw."""
        flight, seen = self._flight, np.array([order.east_m, order.north_m, 0.0])
        situation = flight.deciding.situations.situation()
        if not situation.lidar_ok:
            return Reply(False, f"{situation.no_map_reason.text}: nothing is judged now")
        if not flight.deciding.executive.is_selected(situation, seen):
            return Reply(False, "the selection changed or is not judged yet: look and confirm again")
        return self._desk.carry_out(Order(OrderKind.LAND_AT_SELECTED))

    def _set(self, order: SetParameter) -> Reply:
        settings = self._flight.settings
        if all(row.name != order.name for row in settings.rows):
            return Reply(False, unknown(order.name))
        change = settings.change(order.name, order.value)
        return Reply(change.accepted, change.reason or "unchanged")
