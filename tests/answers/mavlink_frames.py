"""MAVLink datagrams in one array, and their messages by name and field."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from pymavlink.dialects.v20 import ardupilotmega as dialect

MAGICS = frozenset({0xFE, 0xFD})
HEADER, CHECKSUM = 10, 2
VALUE, NAME = slice(4, 8), slice(8, 18)
"""Bytes of a NAMED_VALUE_FLOAT's payload."""


def stream(datagrams: Sequence[bytes]) -> dict[str, Any]:
    """Return datagrams as a tree: all bytes, and the size of each."""
    return {
        "mavlink_bytes": np.frombuffer(b"".join(datagrams), np.uint8),
        "mavlink_sizes": np.array([len(one) for one in datagrams], np.int64),
    }


def without_values(datagram: bytes, names: frozenset[str]) -> bytes:
    """Return a datagram with the value, and thus the checksum, of some NAMED_VALUE_FLOATs set to zero.

    The datagram holds one MAVLink 2 frame; others are returned unchanged.
    """
    if len(datagram) < HEADER + NAME.start or datagram[0] != 0xFD:
        return datagram
    end = HEADER + datagram[1]
    message, payload = int.from_bytes(datagram[7:10], "little"), datagram[HEADER:end]
    if message != dialect.MAVLINK_MSG_ID_NAMED_VALUE_FLOAT:
        return datagram
    if payload[NAME].rstrip(b"\0").decode("ascii", "replace") not in names:
        return datagram
    cleared = payload[: VALUE.start] + bytes(VALUE.stop - VALUE.start) + payload[VALUE.stop :]
    return datagram[:HEADER] + cleared + bytes(CHECKSUM) + datagram[end + CHECKSUM :]


def is_stream(tree: Any) -> bool:
    """Tell whether a tree was made by `stream`."""
    return isinstance(tree, dict) and tree.keys() == {"mavlink_bytes", "mavlink_sizes"}


def datagrams(tree: dict[str, Any]) -> list[bytes]:
    """Return the datagrams that `stream` was given."""
    raw = tree["mavlink_bytes"].tobytes()
    ends = np.cumsum(tree["mavlink_sizes"])
    starts = [0, *(int(end) for end in ends)]
    return [raw[start : int(end)] for start, end in zip(starts, ends, strict=False)]


def decoded(datagram: bytes) -> dict[str, Any]:
    """Return a datagram's messages, each by its name and place: sender, sequence and fields."""
    parser = dialect.MAVLink(None)
    parser.robust_parsing = True
    messages = parser.parse_buffer(datagram) or []
    found: dict[str, Any] = {}
    for k, message in enumerate(messages):
        header = {"sysid": message.get_srcSystem(), "compid": message.get_srcComponent()}
        fields = {name: value for name, value in message.to_dict().items() if name != "mavpackettype"}
        found[f"{message.get_type()}({k})"] = header | {"sequence": message.get_seq()} | fields
    return found
