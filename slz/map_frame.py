"""Frame of a map."""

from __future__ import annotations

from dataclasses import dataclass

from slz.frame import LocalFrame


@dataclass(frozen=True, slots=True)
class MapFrame(LocalFrame):
    """Frame of one map.

    number: differs between successive maps with the same origin, as after a jump of the position estimate.
    """

    number: int

    @classmethod
    def of(cls, frame: LocalFrame, number: int) -> MapFrame:
        return cls(frame.lat_deg, frame.lon_deg, frame.alt_m, number)
