"""Attachment of a message in rmw_zenoh: sequence number, time and publisher."""

from __future__ import annotations

import struct
from dataclasses import dataclass

GID_BYTES = 16
_FORM = struct.Struct(f"<qqB{GID_BYTES}s")


@dataclass(frozen=True, slots=True)
class Attachment:
    """Attachment. number: from 1 for each publisher. source_ns: since 1970. gid: ID of the publisher."""

    number: int
    source_ns: int
    gid: bytes

    def pack(self) -> bytes:
        """Return the bytes on the wire."""
        return _FORM.pack(self.number, self.source_ns, GID_BYTES, self.gid)


def unpack(data: bytes) -> Attachment | None:
    """Return the attachment in the bytes of a message; None if they are none."""
    if len(data) != _FORM.size:
        return None
    number, source_ns, length, gid = _FORM.unpack(data)
    return Attachment(number, source_ns, gid) if length == GID_BYTES else None
