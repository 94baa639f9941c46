"""CURRENT_MODE (436) of MAVLink's common set, which the dialect ardupilotmega does not contain yet.

PX4 sends it on a change of mode and at 2 Hz; its HEARTBEAT has a fixed rate of 1 Hz.
"""

from __future__ import annotations

import struct
from typing import Any, ClassVar

from pymavlink.dialects.v20 import ardupilotmega as mavlink

CURRENT_MODE = 436


class MAVLink_current_mode_message(mavlink.MAVLink_message):  # type: ignore[misc]  # noqa: N801
    """Current mode of the vehicle, and the mode that its pilot chose.

    Attributes
    ----------
    custom_mode
        Mode number as in HEARTBEAT.
    intended_custom_mode
        The pilot's choice, different in a failsafe; 0 is unknown.
    standard_mode
        MAV_STANDARD_MODE.
    """

    id = CURRENT_MODE
    msgname = "CURRENT_MODE"
    fieldnames = ("standard_mode", "custom_mode", "intended_custom_mode")
    ordered_fieldnames = ("custom_mode", "intended_custom_mode", "standard_mode")
    fieldtypes = ("uint8_t", "uint32_t", "uint32_t")
    fielddisplays_by_name: ClassVar[dict[str, str]] = {}
    fieldenums_by_name: ClassVar[dict[str, str]] = {"standard_mode": "MAV_STANDARD_MODE"}
    fieldunits_by_name: ClassVar[dict[str, str]] = {}
    native_format = bytearray(b"<IIB")
    orders = (2, 0, 1)
    lengths = (1, 1, 1)
    array_lengths = (0, 0, 0)
    crc_extra = 193
    unpacker = struct.Struct("<IIB")
    instance_field = None
    instance_offset = -1

    def __init__(self, standard_mode: int, custom_mode: int, intended_custom_mode: int) -> None:
        super().__init__(self.id, self.msgname)
        self._fieldnames = self.fieldnames
        self._instance_field = self.instance_field
        self._instance_offset = self.instance_offset
        self.standard_mode = standard_mode
        self.custom_mode = custom_mode
        self.intended_custom_mode = intended_custom_mode

    def pack(self, mav: Any, force_mavlink1: bool = False) -> bytes:
        """Return the frame as sent by `mav`."""
        payload = self.unpacker.pack(self.custom_mode, self.intended_custom_mode, self.standard_mode)
        return bytes(self._pack(mav, self.crc_extra, payload, force_mavlink1=force_mavlink1))


# A newer pymavlink may contain it.
mavlink.mavlink_map.setdefault(CURRENT_MODE, MAVLink_current_mode_message)
