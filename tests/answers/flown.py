"""Streams of datagrams and reports that the probe recorded of a flight."""

from __future__ import annotations

import hashlib
import pickle
import struct
from pathlib import Path
from typing import Any

from tests.answers.mavlink_frames import MAGICS, stream, without_values
from tests.answers.tree import Tree
from tests.answers.variable import variable_values

DATAGRAM = struct.Struct("<HI")
BLOCK = 1000
"""Datagrams of a LiDAR that share a digest: their bytes would fill the disk."""


def streams(folder: Path) -> dict[str, Tree]:
    """Return what each process sent to each port, in the order of their first datagrams.

    MAVLink is kept whole but for values by the wall clock, other streams as digests of 1000 datagrams each.
    """
    timed = variable_values()
    found: dict[str, Tree] = {}
    for path in sorted(folder.glob("*.datagrams")):
        ports: dict[int, list[bytes]] = {}
        for port, data in _datagrams(path.read_bytes()):
            ports.setdefault(port, []).append(data)
        for k, sent in enumerate(ports.values()):
            if sent[0][0] in MAGICS:
                kept = [without_values(one, timed) for one in sent]
                found[f"process_{path.stem}.mavlink_{k}"] = stream(kept)
            else:
                found[f"process_{path.stem}.other_{k}"] = _digests(sent)
    return found


def reports(folder: Path) -> list[Tree]:
    """Return the reports of all pipelines of a flight, in their order."""
    found: list[Tree] = []
    for path in sorted(folder.glob("*.reports")):
        with path.open("rb") as file:
            while file.peek(1):
                found.append(pickle.load(file))
    return found


def _datagrams(data: bytes) -> list[tuple[int, bytes]]:
    found, start = [], 0
    while start < len(data):
        port, size = DATAGRAM.unpack_from(data, start)
        start += DATAGRAM.size
        found.append((port, data[start : start + size]))
        start += size
    return found


def _digests(sent: list[bytes]) -> dict[str, Any]:
    blocks = [sent[k : k + BLOCK] for k in range(0, len(sent), BLOCK)]
    return {
        "datagrams": len(sent),
        "sha256_of_1000": [hashlib.sha256(b"".join(block)).hexdigest() for block in blocks],
    }
