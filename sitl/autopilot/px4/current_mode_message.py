"""CURRENT_MODE (436) of MAVLink's common set, to send; the dialect ardupilotmega does not contain it."""

from __future__ import annotations

import struct
from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as mavlink

CURRENT_MODE, CRC_EXTRA = 436, 193


class CurrentMode(mavlink.MAVLink_message):  # type: ignore[misc]
    """Mode that is flown, and the one that the pilot chose: they differ in a failsafe."""

    def __init__(self, standard_mode: int, custom_mode: int, intended_custom_mode: int) -> None:
        super().__init__(CURRENT_MODE, "CURRENT_MODE")
        self.standard_mode, self.custom_mode = standard_mode, custom_mode
        self.intended_custom_mode = intended_custom_mode

    def pack(self, mav: Any, force_mavlink1: bool = False) -> bytes:
        """Return the frame as sent by `mav`."""
        payload = struct.pack("<IIB", self.custom_mode, self.intended_custom_mode, self.standard_mode)
        return bytes(self._pack(mav, CRC_EXTRA, payload, force_mavlink1=force_mavlink1))
