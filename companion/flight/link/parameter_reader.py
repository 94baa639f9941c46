"""Reader of single autopilot parameters, without I/O."""

from __future__ import annotations

import math
import struct
from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from companion.flight.link.autopilots.autopilot_interface import Autopilot
from params import Required

TRIES = 4
RETRY_NS = 700_000_000
# Maximum of requests in progress, because a telemetry port has a small buffer.
AT_ONCE = 4
_BYTES = {
    mavlink.MAV_PARAM_TYPE_UINT8: "<B3x",
    mavlink.MAV_PARAM_TYPE_INT8: "<b3x",
    mavlink.MAV_PARAM_TYPE_UINT16: "<H2x",
    mavlink.MAV_PARAM_TYPE_INT16: "<h2x",
    mavlink.MAV_PARAM_TYPE_UINT32: "<I",
    mavlink.MAV_PARAM_TYPE_INT32: "<i",
}


def parameter_value(message: Any, bytewise: bool) -> float:
    """Return the value of a PARAM_VALUE; bytewise: integers are sent by their bytes."""
    if bytewise and message.param_type in _BYTES:
        raw = struct.pack("<f", message.param_value)
        return float(struct.unpack(_BYTES[message.param_type], raw)[0])
    return float(message.param_value)


def parameter_request(system: int, name: str) -> Any:
    """Return the PARAM_REQUEST_READ of a parameter of the autopilot."""
    return mavlink.MAVLink_param_request_read_message(
        system, mavlink.MAV_COMP_ID_AUTOPILOT1, name.encode(), -1
    )


class ParameterReader:
    """Reader that requests parameters one by one and stores their values.

    Attributes
    ----------
    values
        Values by name.
    absent
        Names that the autopilot does not have, according to PARAM_ERROR (sent by newer versions).
    """

    def __init__(self, rows: tuple[Required, ...], autopilot: Autopilot) -> None:
        self._rows = rows
        self._bytewise = autopilot.bytewise_parameters
        self._asked: dict[str, tuple[int, int]] = {}  # name -> requests, time of the last one
        self.values: dict[str, float] = {}
        self.absent: set[str] = set()

    @property
    def done(self) -> bool:
        """True if every parameter is known or was requested often enough."""
        return all(self._is_over(row) for row in self._rows)

    @property
    def settled(self) -> bool:
        """True if `done` holds without the optional parameters, which some versions lack and never answer."""
        return all(self._is_over(row) for row in self._rows if not row.optional)

    def knows(self, name: str) -> bool:
        """Return whether the autopilot has answered for a parameter."""
        return name in self.values or name in self.absent

    def is_unanswered(self, name: str) -> bool:
        """Return whether the autopilot has no such parameter, or has not answered any request for it."""
        return name in self.absent or (name not in self.values and self._tries(name) > TRIES)

    def due(self, system: int, now_ns: int) -> list[Any]:
        """Return the requests to send now."""
        waiting = [row.name for row in self._rows if not self.knows(row.name)]
        under_way = [name for name in waiting if self._tries(name) and not self._is_late(name, now_ns)]
        due = [name for name in waiting if self._tries(name) <= TRIES and self._is_late(name, now_ns)]
        chosen = due[: max(0, AT_ONCE - len(under_way))]
        for name in chosen:
            self._asked[name] = (self._tries(name) + 1, now_ns)
        return [parameter_request(system, name) for name in chosen if self._tries(name) <= TRIES]

    def on_message(self, message: Any) -> None:
        """Store a PARAM_VALUE or record a PARAM_ERROR."""
        name = str(message.param_id).rstrip("\0")
        if message.get_type() == "PARAM_ERROR":
            if message.error == mavlink.MAV_PARAM_ERROR_DOES_NOT_EXIST:
                self.absent.add(name)
            return
        value = parameter_value(message, self._bytewise)
        if math.isfinite(value):
            self.values[name] = value
            self.absent.discard(name)

    def _is_over(self, row: Required) -> bool:
        return row.name in self.values or self.is_unanswered(row.name)

    def _tries(self, name: str) -> int:
        return self._asked.get(name, (0, 0))[0]

    def _is_late(self, name: str, now_ns: int) -> bool:
        times, when = self._asked.get(name, (0, 0))
        return times == 0 or now_ns - when >= RETRY_NS
