"""Mapping of a sensor clock synchronised to this computer's master clock using PTP or GPS."""

from __future__ import annotations

import logging
from collections.abc import Callable

from companion.flight.sensors.device_clock import SensorClock

log = logging.getLogger(__name__)

SECOND_NS = 1_000_000_000
EARLY_NS = 1_000_000  # two clocks of one master differ by less
LATE_NS = 10_000_000  # the quickest packet of a second takes less


class SynchronisedClock:
    """Offset of a sensor clock whose seconds coincide with this computer's: determined once.

    Stamps may count from the hour, or be ahead by leap seconds (TAI, GPS time): whole seconds are taken from
    the first packet. If the quickest packet of a second seems to arrive more than 1 ms before its stamp or
    more than 10 ms after it, the clock counts as not synchronised and is mapped using arrivals until it
    agrees again.

    Parameters
    ----------
    wall_offset_ns
        Returns the offset of UTC from the companion's clock.
    delay_ns
        Known fixed delay between measurement and stamp.

    Attributes
    ----------
    keeps
        Whether the sensor's clock agrees with this computer's; None before any packet.
    """

    def __init__(self, wall_offset_ns: Callable[[], int], delay_ns: int = 0) -> None:
        self._wall_offset_ns = wall_offset_ns
        self._delay_ns = delay_ns
        self._free = SensorClock(delay_ns)
        self._ahead_ns: int | None = None  # whole seconds by which stamps are ahead of UTC
        self._begin_ns: int | None = None
        self._quickest_ns = SECOND_NS
        self.keeps: bool | None = None

    @property
    def resets(self) -> int:
        """Number of jumps of the sensor's time."""
        return self._free.resets

    @property
    def steps(self) -> int:
        """Number of times that the sensor's clock was set."""
        return self._free.steps

    @property
    def last_step_ns(self) -> int:
        """Size of the newest step, positive if the clock was set forward."""
        return self._free.last_step_ns

    @property
    def drift_ppm(self) -> float | None:
        """Rate of the sensor's clock over ours, ppm; None if unsure."""
        return self._free.drift_ppm

    def is_jump(self, stamp_ns: int, arrival_ns: int) -> bool:
        """Return whether only a jump of the sensor's clock can explain a packet."""
        return self._free.is_jump(stamp_ns, arrival_ns)

    def observe(self, stamp_ns: int, arrival_ns: int) -> None:
        """Update the estimate with the stamp of a packet's last point and the packet's arrival."""
        if self._ahead_ns is None or self.is_jump(stamp_ns, arrival_ns):
            taken_ns = arrival_ns + self._wall_offset_ns() - stamp_ns
            self._ahead_ns = -((taken_ns + EARLY_NS) // SECOND_NS) * SECOND_NS
            self._begin_ns, self._quickest_ns = None, SECOND_NS
        self._free.observe(stamp_ns, arrival_ns)
        taken_ns = arrival_ns + self._wall_offset_ns() - (stamp_ns - self._ahead_ns)
        self._quickest_ns = min(self._quickest_ns, taken_ns)
        if self._begin_ns is None or arrival_ns - self._begin_ns >= SECOND_NS:
            self._judge()
            self._begin_ns, self._quickest_ns = arrival_ns, SECOND_NS

    def offset_ns(self, stamp_ns: int) -> int:
        """Return the offset to add to a sensor stamp.

        Raises
        ------
        ValueError
            No packet was observed yet.
        """
        if not self.keeps or self._ahead_ns is None:
            return self._free.offset_ns(stamp_ns)
        return -self._ahead_ns - self._wall_offset_ns() - self._delay_ns

    def _judge(self) -> None:
        kept, self.keeps = self.keeps, -EARLY_NS <= self._quickest_ns <= LATE_NS
        if kept is not False and not self.keeps:
            log.error(
                "the LiDAR's clock is not this computer's: by its stamps the quickest packets take %.1f ms;"
                " mapped by arrivals",
                self._quickest_ns * 1e-6,
            )
        elif self.keeps and not kept:
            log.info("the LiDAR's clock is synchronised")
