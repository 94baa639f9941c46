"""MAVLink datagrams in one array, and their messages by name and field."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from pymavlink.dialects.v20 import ardupilotmega as dialect

MAGICS = frozenset({0xFE, 0xFD})


def stream(datagrams: Sequence[bytes]) -> dict[str, Any]:
    """Return datagrams as a tree: all bytes, and the size of each."""
    return {
        "mavlink_bytes": np.frombuffer(b"".join(datagrams), np.uint8),
        "mavlink_sizes": np.array([len(one) for one in datagrams], np.int64),
    }


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
