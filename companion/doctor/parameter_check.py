"""The autopilot's parameters against what is needed, without I/O."""

from __future__ import annotations

import math
import struct
from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from companion.doctor.finding import Finding
from params import Required

TRIES = 4
RETRY_NS = 700_000_000
# At most so many requests under way: a telemetry port has a small buffer.
AT_ONCE = 4
_BYTES = {
    mavlink.MAV_PARAM_TYPE_UINT8: "<B3x",
    mavlink.MAV_PARAM_TYPE_INT8: "<b3x",
    mavlink.MAV_PARAM_TYPE_UINT16: "<H2x",
    mavlink.MAV_PARAM_TYPE_INT16: "<h2x",
    mavlink.MAV_PARAM_TYPE_UINT32: "<I",
    mavlink.MAV_PARAM_TYPE_INT32: "<i",
}


class ParameterReader:
    """Asks for parameters one by one and keeps what comes.

    Attributes
    ----------
    values
        By name, as they come.
    """

    def __init__(self, rows: tuple[Required, ...], autopilot: str) -> None:
        self._rows = rows
        self._bytewise = autopilot == "px4"
        self._asked: dict[str, tuple[int, int]] = {}  # name -> times, when last
        self.values: dict[str, float] = {}

    @property
    def done(self) -> bool:
        """Whether every parameter has come or was asked for often enough."""
        return all(row.name in self.values or self._tries(row.name) > TRIES for row in self._rows)

    def due(self, system: int, now_ns: int) -> list[Any]:
        """Return the requests to send now."""
        waiting = [row.name for row in self._rows if row.name not in self.values]
        under_way = [name for name in waiting if self._tries(name) and not self._is_late(name, now_ns)]
        due = [name for name in waiting if self._tries(name) <= TRIES and self._is_late(name, now_ns)]
        chosen = due[: max(0, AT_ONCE - len(under_way))]
        for name in chosen:
            self._asked[name] = (self._tries(name) + 1, now_ns)
        return [
            mavlink.MAVLink_param_request_read_message(
                system, mavlink.MAV_COMP_ID_AUTOPILOT1, name.encode(), -1
            )
            for name in chosen
            if self._tries(name) <= TRIES
        ]

    def take(self, message: Any) -> None:
        """Keep a PARAM_VALUE."""
        value = float(message.param_value)
        if self._bytewise and message.param_type in _BYTES:
            raw = struct.pack("<f", message.param_value)
            value = float(struct.unpack(_BYTES[message.param_type], raw)[0])
        if math.isfinite(value):
            self.values[str(message.param_id).rstrip("\0")] = value

    def _tries(self, name: str) -> int:
        return self._asked.get(name, (0, 0))[0]

    def _is_late(self, name: str, now_ns: int) -> bool:
        times, when = self._asked.get(name, (0, 0))
        return times == 0 or now_ns - when >= RETRY_NS


def parameter_findings(rows: tuple[Required, ...], values: dict[str, float]) -> list[Finding]:
    """Judge the autopilot's values."""
    return [_finding(row, values.get(row.name)) for row in rows]


def _finding(row: Required, value: float | None) -> Finding:
    bad = "fail" if row.level == "needed" else "warn"
    remedy = f"set {row.name} to {row.value:g} and reboot: {row.why}"
    if value is None:
        text = "the autopilot does not have it"
        return Finding(row.name, "fail" if bad == "fail" else "warn", text, row.accepted_text(), remedy)
    if row.accepts(value):
        return Finding(row.name, "ok", f"{value:g}", row.accepted_text())
    return Finding(row.name, "fail" if bad == "fail" else "warn", f"{value:g}", row.accepted_text(), remedy)
