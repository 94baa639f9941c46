"""Ports for programs under test."""

from __future__ import annotations

import socket
from collections import deque

_given: deque[int] = deque(maxlen=200)


def free_port(kind: socket.SocketKind = socket.SOCK_DGRAM) -> int:
    """Return a port that nobody has just now, and that was not given lately: two asked for are two."""
    while True:
        with socket.socket(socket.AF_INET, kind) as probe:
            probe.bind(("127.0.0.1", 0))
            port = int(probe.getsockname()[1])
        if port not in _given:
            _given.append(port)
            return port
