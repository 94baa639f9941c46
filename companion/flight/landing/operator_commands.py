"""The operator's interface over MAVLink: MAV_CMD_USER_1."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from companion.flight.landing.situation import Reply
from companion.flight.link.command_server import CommandReply, OperatorCommand

if TYPE_CHECKING:
    from companion.flight.app import Companion

ABORT, LAND_AT_BEST, LAND_IN_ZONE, POINT, LAND_NOW, SELECT, CONFIRM = range(7)


class Operator:
    """Turns MAV_CMD_USER_1 into orders for the executive.

    param1: 0 abort, 1 land at the best zone, 2 land at zone param2, 3 watch (param2 = 0) or land at
    (param2 = 1) the point in x, y, z: latitude, longitude (degrees), altitude above mean sea level (m),
    4 land now at the zone reached soonest, from any mode (emergency), 5 select zone param2, 6 land there.
    """

    def __init__(self, companion: Companion) -> None:
        self._companion = companion

    def answer(self, command: OperatorCommand) -> CommandReply:
        """Carry out a command, or say why not; the reason goes to the sender's screen."""
        if command.command != mavlink.MAV_CMD_USER_1:
            return CommandReply.unsupported()
        what, which = command.params[0], command.params[1]
        if what == POINT and which in (0, 1):
            reply = self._point(command, land=which == 1)
        else:
            reply = self.order(what, which)
        answer = CommandReply.accepted() if reply.accepted else CommandReply.denied(f"SLZ: {reply.reason}")
        turns = self.turns
        return replace(answer, always=what == ABORT, stands=lambda: self.turns == turns)

    @property
    def turns(self) -> int:
        """Number that rises with each order taken, and when one ends."""
        return self._companion.executive.turns

    def order(self, what: float, which: float = 0) -> Reply:
        """Carry out an order that needs no place."""
        executive, situation = self._companion.executive, self._companion.situation()
        if what == ABORT:
            return executive.abort(situation)
        if what == LAND_AT_BEST:
            return executive.land_at_best(situation)
        if what == LAND_IN_ZONE and float(which).is_integer():
            return executive.land_in_zone(situation, int(which))
        if what == LAND_NOW:
            return executive.land_now(situation)
        if what == SELECT and float(which).is_integer():
            return executive.watch_zone(situation, int(which))
        if what == CONFIRM:
            return executive.land_at_selected(situation)
        return Reply(False, f"USER_1 knows no {what:g}/{which:g}")

    def watched_zone(self) -> int:
        """Return the ID of the zone that the point under watch lies in, 0 for none."""
        selected = self._companion.situation().selected
        return 0 if selected is None or selected.zone_id is None else selected.zone_id

    def _point(self, command: OperatorCommand, *, land: bool) -> Reply:
        frame = self._companion.history.frame
        lat, lon, alt = command.x, command.y, command.z
        if frame is None:
            return Reply(False, "no position yet")
        if command.frame not in (None, mavlink.MAV_FRAME_GLOBAL, mavlink.MAV_FRAME_GLOBAL_INT):
            return Reply(False, "a point needs frame GLOBAL")
        if not (math.isfinite(lat) and math.isfinite(lon) and abs(lat) <= 90 and abs(lon) <= 180):
            return Reply(False, "x, y are no latitude, longitude")
        enu = frame.enu_m(lat, lon, alt if math.isfinite(alt) else frame.alt_m)
        if float(np.hypot(enu[0], enu[1])) > self._companion.parameters.zone_m:
            return Reply(False, "the point is too far away")
        executive = self._companion.executive
        return executive.land_at_point(self._companion.situation(), enu) if land else executive.watch(enu)
