"""COMPONENT_METADATA (397) of MAVLink's common set, which the dialect ardupilotmega does not contain yet."""

from __future__ import annotations

import struct
from typing import Any, ClassVar

from pymavlink.dialects.v20 import ardupilotmega as mavlink

COMPONENT_METADATA = 397
URI_BYTES = 100


class MAVLink_component_metadata_message(mavlink.MAVLink_message):  # type: ignore[misc]  # noqa: N801
    """Where a component's general metadata file is.

    Attributes
    ----------
    time_boot_ms
        Time since the component's start.
    file_crc
        CRC-32 of the file as it is served.
    uri
        MAVLink FTP URI of the file, at most 99 characters.
    """

    id = COMPONENT_METADATA
    msgname = "COMPONENT_METADATA"
    fieldnames = ("time_boot_ms", "file_crc", "uri")
    ordered_fieldnames = fieldnames
    fieldtypes = ("uint32_t", "uint32_t", "char")
    fielddisplays_by_name: ClassVar[dict[str, str]] = {}
    fieldenums_by_name: ClassVar[dict[str, str]] = {}
    fieldunits_by_name: ClassVar[dict[str, str]] = {"time_boot_ms": "ms"}
    native_format = bytearray(b"<IIc")
    orders = (0, 1, 2)
    lengths = (1, 1, URI_BYTES)
    array_lengths = (0, 0, URI_BYTES)
    crc_extra = 182
    unpacker = struct.Struct(f"<II{URI_BYTES}s")
    instance_field = None
    instance_offset = -1

    def __init__(self, time_boot_ms: int, file_crc: int, uri: bytes | str) -> None:
        super().__init__(self.id, self.msgname)
        self._fieldnames = self.fieldnames
        self._instance_field = self.instance_field
        self._instance_offset = self.instance_offset
        self.time_boot_ms = time_boot_ms
        self.file_crc = file_crc
        raw = uri.encode("ascii") if isinstance(uri, str) else uri
        self.uri = raw.partition(b"\0")[0].decode("ascii", "replace")

    def pack(self, mav: Any, force_mavlink1: bool = False) -> bytes:
        """Return the frame as sent by `mav`."""
        payload = self.unpacker.pack(self.time_boot_ms, self.file_crc, self.uri.encode("ascii"))
        return bytes(self._pack(mav, self.crc_extra, payload, force_mavlink1=force_mavlink1))


# A newer pymavlink may contain it.
mavlink.mavlink_map.setdefault(COMPONENT_METADATA, MAVLink_component_metadata_message)
