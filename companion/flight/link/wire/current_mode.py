"""CURRENT_MODE (436), a message of MAVLink's common set that the dialect ardupilotmega does not have yet.

PX4 sends it when its mode changes and twice a second, and its HEARTBEAT, whose rate is fixed, once a second.
"""

from __future__ import annotations

import struct
from typing import Any, ClassVar

from pymavlink.dialects.v20 import ardupilotmega as mavlink

CURRENT_MODE = 436


class MAVLink_current_mode_message(mavlink.MAVLink_message):  # type: ignore[misc]  # noqa: N801
    """The mode that the vehicle is in, and the one that its pilot chose.

    Attributes
    ----------
    custom_mode
        As in HEARTBEAT.
    intended_custom_mode
        Differs from it in a failsafe; 0 is unknown.
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
        """Return the frame as `mav` sends it."""
        payload = self.unpacker.pack(self.custom_mode, self.intended_custom_mode, self.standard_mode)
        return bytes(self._pack(mav, self.crc_extra, payload, force_mavlink1=force_mavlink1))


# A newer pymavlink may have it.
mavlink.mavlink_map.setdefault(CURRENT_MODE, MAVLink_current_mode_message)
