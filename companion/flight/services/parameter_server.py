"""Server of the MAVLink parameter protocol, without I/O.

Each parameter of slz has a MAVLink name: floats are REAL32, integers INT32, choices INT32 counted from 0 in
the order of the table. Integers are encoded in the float field as by the vehicle's autopilot, because ground
stations decode all components of a vehicle alike: ArduPilot by value, PX4 bytewise.
"""

from __future__ import annotations

import math
import struct
from collections import deque
from typing import Any, Protocol

import numpy as np
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from companion.flight.services.settings import Change
from companion.runtime.event import Event
from params import RENAMED, Row, allowed

# Interval of a list: four seconds for all parameters, a tenth of the rate of a 57600 baud radio.
LIST_INTERVAL_NS = 50_000_000


class ParameterHolder(Protocol):
    """Holder of some parameters; `stored` has an attribute for the name of each row."""

    @property
    def rows(self) -> tuple[Row, ...]: ...

    @property
    def stored(self) -> Any: ...

    def change(self, name: str, value: Any) -> Change: ...


class ParameterServer:
    """Lists, reads and sets parameters for any ground station.

    Parameters
    ----------
    holders
        Holders of the values; they refuse invalid ones.

    Attributes
    ----------
    bytewise
        Whether integers are encoded bytewise (PX4) or by value (ArduPilot).
    changed, refused
        Counts of changes and of refusals.
    on_change_result
        Event (text, accepted) of a change or of an old name, for the pilot's screen.
    """

    def __init__(self, *holders: ParameterHolder) -> None:
        self._holders = [holder for holder in holders for _ in holder.rows]
        self._rows = [row for holder in holders for row in holder.rows]
        self._index = {row.mavlink: i for i, row in enumerate(self._rows)}
        self._waiting: deque[int] = deque()
        self._next_ns = 0
        self.on_change_result: Event[[str, bool]] = Event()
        self.bytewise = False
        self.changed = 0
        self.refused = 0

    def on_message(self, message: Any, system: int, component: int) -> list[Any]:
        """Return the answers to a PARAM_SET or PARAM_REQUEST_READ; queue those to a PARAM_REQUEST_LIST.

        A message for other components gets none; a wrong one for this component alone gets PARAM_ERROR.
        """
        kind = message.get_type()
        if kind not in ("PARAM_REQUEST_LIST", "PARAM_REQUEST_READ", "PARAM_SET"):
            return []
        if message.target_system not in (0, system) or message.target_component not in (0, component):
            return []
        for_us_alone = message.target_component == component
        if kind == "PARAM_REQUEST_LIST":
            # Continue a list in progress, then wrap: two stations that ask in turn must not starve its end.
            self._waiting.extend(i for i in range(len(self._rows)) if i not in self._waiting)
            return []
        by_index = kind == "PARAM_REQUEST_READ" and message.param_index >= 0
        if by_index and not for_us_alone:
            return []  # the index refers to another component's table
        index = message.param_index if by_index else self._index.get(message.param_id, -1)
        if not 0 <= index < len(self._rows):
            if new := RENAMED.get(message.param_id):
                text = f"SLZ: {message.param_id} is {new} now"
                self.on_change_result.emit(text, False)
            fault = mavlink.MAV_PARAM_ERROR_DOES_NOT_EXIST
            return [self._error(message, fault)] if for_us_alone else []
        return [self._value(index)] if kind == "PARAM_REQUEST_READ" else self._set(index, message)

    def poll(self, now_ns: int) -> list[Any]:
        """Return the next message of a requested list, if it is due."""
        if not self._waiting or now_ns < self._next_ns:
            return []
        self._next_ns = now_ns + LIST_INTERVAL_NS
        return [self._value(self._waiting.popleft())]

    def _set(self, index: int, message: Any) -> list[Any]:
        row = self._rows[index]
        value = self._decode(row, message)
        change = Change(False, f"{row.mavlink}: must be {allowed(row, in_flight=True)}")
        if value is not None:
            change = self._holders[index].change(row.name, value)
        if change.reason:
            self.on_change_result.emit(f"SLZ: {change.reason}", change.accepted)
        if change.accepted:
            self.changed += bool(change.reason)
            if value != getattr(self._holders[index].stored, row.name) and index not in self._waiting:
                self._waiting.append(index)  # an order: the answer echoes it, the list sends the real value
            return [self._value(index, value)]
        self.refused += 1
        return [self._error(message, mavlink.MAV_PARAM_ERROR_VALUE_OUT_OF_RANGE), self._value(index)]

    def _value(self, index: int, value: Any = None) -> Any:
        row = self._rows[index]
        if value is None:
            value = getattr(self._holders[index].stored, row.name)
        kind = mavlink.MAV_PARAM_TYPE_REAL32 if row.kind is float else mavlink.MAV_PARAM_TYPE_INT32
        number = row.choices.index(value) if row.choices else value
        if row.kind is not float and self.bytewise:
            number = struct.unpack("<f", struct.pack("<i", number))[0]
        return mavlink.MAVLink_param_value_message(
            row.mavlink.encode("ascii"), float(number), kind, len(self._rows), index
        )

    def _decode(self, row: Row, message: Any) -> Any:
        """Return the value of a PARAM_SET, None if it is invalid."""
        number = float(message.param_value)
        if self.bytewise and message.param_type == mavlink.MAV_PARAM_TYPE_INT32:
            number = float(struct.unpack("<i", struct.pack("<f", number))[0])
        if not math.isfinite(number):
            return None
        if row.kind is float:
            return float(str(np.float32(number)))  # 0.1, not 0.10000000149
        if not number.is_integer():
            return None
        if row.choices:
            return row.choices[int(number)] if 0 <= number < len(row.choices) else None
        return int(number)

    def _error(self, message: Any, fault: int) -> Any:
        return mavlink.MAVLink_param_error_message(
            message.get_srcSystem(),
            message.get_srcComponent(),
            message.param_id.encode("utf-8", "replace")[:16],
            getattr(message, "param_index", -1),
            fault,
        )
