"""STATUSTEXT messages, split into chunks, and NAMED_VALUE_FLOAT."""

from __future__ import annotations

from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as mavlink

CHUNK_BYTES = 50
MAX_CHUNKS = 8


def statustext(text: str, severity: int, text_id: int) -> list[Any]:
    """Return the STATUSTEXT messages of a text; beyond 400 characters it is cut and ends in `...`.

    Characters beyond ASCII become `?`: ground stations disagree on them and may cut one between two chunks.

    Parameters
    ----------
    severity
        MAV_SEVERITY, 0 emergency to 7 debug.
    text_id
        1 to 65535, different for every text, so that receivers can join its chunks. Not used for a text that
        fits one message.
    """
    data = text.encode("ascii", "replace")
    if len(data) > MAX_CHUNKS * CHUNK_BYTES:
        data = data[: MAX_CHUNKS * CHUNK_BYTES - 3] + b"..."
    if len(data) <= CHUNK_BYTES:
        return [mavlink.MAVLink_statustext_message(severity, data)]
    chunks = [data[at : at + CHUNK_BYTES] for at in range(0, len(data), CHUNK_BYTES)]
    if len(chunks[-1]) == CHUNK_BYTES:
        chunks.append(b"")  # only a chunk that is not full ends a text (MAVLink, STATUSTEXT.chunk_seq)
    return [
        mavlink.MAVLink_statustext_message(severity, chunk, text_id, number)
        for number, chunk in enumerate(chunks)
    ]


def named_value(name: str, value: float, time_boot_ms: int) -> Any:
    """Return a NAMED_VALUE_FLOAT; names are cut at ten bytes."""
    return mavlink.MAVLink_named_value_float_message(time_boot_ms & 0xFFFFFFFF, name.encode()[:10], value)
