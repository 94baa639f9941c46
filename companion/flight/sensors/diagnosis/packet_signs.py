"""Time covered, azimuths and source of the clock by a sensor's packets themselves."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Protocol, runtime_checkable


@dataclass(slots=True)
class PacketSigns:
    """Counts that a decoder keeps beside its counters, for the diagnosis.

    Attributes
    ----------
    covered_ns
        Time that the packets received cover by their own statement.
    azimuth_packets
        Packets by part of the circle, in the order of the turn; empty where packets do not say.
    azimuth_deg
        Start of the first part, and degrees of each.
    lines
        Laser lines in one plane each, 0 where a line sees all the view.
    near_m
        A return nearer than that comes from the window.
    clock
        Source of the stamps: 'free', 'ptp' or 'gps'; empty where packets do not say.
    pulse
        What is wrong with the pulse of a GPS receiver, empty if nothing or unknown.
    described
        Whether the packets are read by metadata of the sensor (Ouster).
    destination
        Host to which that metadata says that it sends, empty where unknown.
    """

    covered_ns: int = 0
    azimuth_packets: list[int] = field(default_factory=list)
    azimuth_deg: tuple[float, float] = (0.0, 10.0)
    lines: int = 0
    near_m: float = 0.3
    clock: str = ""
    pulse: str = ""
    described: bool = False
    destination: str = ""


@runtime_checkable
class HasSigns(Protocol):
    """A decoder that keeps them."""

    signs: PacketSigns
