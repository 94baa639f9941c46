"""Stage: returns that are finite, in range of the sensor and of plausible height."""

from __future__ import annotations

from params import Parameters
from slz.kernels.points.range_gate import mark_usable
from slz.lanes import MAIN
from slz.window_returns import Flag, Returns

MOST_HEIGHT_M = 100_000.0  # nothing on the ground is higher or deeper


class RangeGate:
    """Marks the returns within `max_range_m`; all finite ones where the sensor's place is unknown."""

    name, lane = "range_gate", MAIN
    reads, sets = frozenset({"places"}), frozenset({"USABLE"})

    def run(self, returns: Returns, p: Parameters, /) -> None:
        """Set USABLE."""
        place = returns.places_m, returns.sensor_m
        mark_usable(*place, p.max_range_m**2, MOST_HEIGHT_M, returns.flags, Flag.USABLE)
