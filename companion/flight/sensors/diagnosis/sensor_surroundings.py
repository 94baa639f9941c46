"""State of a silent sensor beside its packets: answers, presence on the network, destination."""

from __future__ import annotations

import socket
from dataclasses import dataclass
from pathlib import Path

from companion.flight.link.transport.multicast import is_multicast

ARP = Path("/proc/net/arp")
COMPLETE = 0x2
ANY, ANY_6 = "0.0.0.0", "::"


@dataclass(frozen=True, slots=True)
class Surroundings:
    """State of a sensor beside its packets.

    Attributes
    ----------
    answers
        Whether it has accepted its settings, None where nobody asks it.
    refused
        Why it refused them, empty if it did not.
    present
        Whether its address answers on the network, None where unknown.
    dropped
        Packets that the kernel dropped at the port so far, None where unknown.
    bound
        Address at which packets are received; ANY for all of this computer.
    """

    answers: bool | None = None
    refused: str = ""
    present: bool | None = None
    dropped: int | None = None
    bound: str = ANY


def is_present(address: str, table: Path = ARP) -> bool | None:
    """Return whether a neighbour with this address answers, by the kernel's ARP table; None if unknown."""
    try:
        lines = table.read_text("ascii").splitlines()[1:]
    except (OSError, ValueError):
        return None
    for line in lines:
        columns = line.split()
        if len(columns) > 2 and columns[0] == address:
            return bool(int(columns[2], 16) & COMPLETE)
    return None


def is_ours(address: str, bound: str = ANY) -> bool:
    """Return whether a packet to this address arrives at the bound one.

    A multicast arrives where its group is bound, a broadcast at `ANY` alone.
    """
    if address in (ANY, bound) or address.startswith("@"):
        return True
    if is_multicast(address) or bound not in (ANY, ANY_6):
        return False
    if address == "255.255.255.255":
        return True
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        try:
            probe.bind((address, 0))
        except OSError:
            return False
    return True
