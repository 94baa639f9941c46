"""Carries out a browser's orders through the same interfaces as MAVLink's commands and parameters."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Protocol

import numpy as np
from pymavlink.dialects.v20 import ardupilotmega as mavlink

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
from companion.flight.landing.operator_commands import (
    ABORT,
    CONFIRM,
    LAND_AT_BEST,
    LAND_NOW,
    POINT,
    SELECT,
    Operator,
)
from companion.flight.landing.situation import Reply
from companion.flight.link.command_server import OperatorCommand

if TYPE_CHECKING:
    from companion.flight.app import Companion

SIMPLE = {"abort": ABORT, "land_best": LAND_AT_BEST, "land_now": LAND_NOW}


class Desk(Protocol):
    """Takes orders, in the loop of whoever is shown."""

    async def carry_out(self, order: Command) -> Reply:
        """Do it, or say why not."""


class FlightDesk:
    """Orders of a flight."""

    def __init__(self, companion: Companion) -> None:
        self._companion = companion
        self._operator = Operator(companion)

    async def carry_out(self, order: Command) -> Reply:
        """Do it, or say why not."""
        match order:
            case Simple():
                return self._operator.order(SIMPLE[order.do])
            case SelectZone():
                return self._operator.order(SELECT, order.zone)
            case SelectPoint():
                return self._watch(order.east_m, order.north_m)
            case Confirm():
                return self._confirm(order)
            case SetParameter():
                return self._set(order)
            case Record():
                return await self._companion.recordings.ask(order.on)
            case Replay():
                return Reply(False, "this is a flight, no replay")

    def _watch(self, east_m: float, north_m: float) -> Reply:
        """Put a point under watch by the command that a ground station would send."""
        frame = self._companion.history.frame
        if frame is None:
            return Reply(False, "no position yet")
        lat, lon, _ = (float(v) for v in frame.lla([east_m, north_m, 0.0]))
        params = (float(POINT), 0.0, math.nan, math.nan)
        number = mavlink.MAV_CMD_USER_1
        command = OperatorCommand(number, params, lat, lon, math.nan, mavlink.MAV_FRAME_GLOBAL, 0, 0)
        answer = self._operator.answer(command)
        if answer.result == mavlink.MAV_RESULT_ACCEPTED:
            return Reply(True, "watching the point")
        return Reply(False, answer.reason.removeprefix("SLZ: "))

    def _confirm(self, order: Confirm) -> Reply:
        """Land at the point under watch, if it is the one that the sender saw."""
        companion, seen = self._companion, np.array([order.east_m, order.north_m, 0.0])
        if not companion.executive.is_watching(companion.situation(), seen):
            return Reply(False, "the selection changed or is not judged yet: look and confirm again")
        return self._operator.order(CONFIRM)

    def _set(self, order: SetParameter) -> Reply:
        settings = self._companion.settings
        if all(row.name != order.name for row in settings.rows):
            return Reply(False, f"no parameter {order.name}")
        change = settings.change(order.name, order.value)
        return Reply(change.accepted, change.reason or "unchanged")
