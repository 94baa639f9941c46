"""Clock of the simulated sensor, which runs with real time whatever the simulator's does."""

from __future__ import annotations

from collections import deque

SECOND_NS = 1_000_000_000
# The control loop on the simulator's rate settles within a second or two.
PULL_PER_S = 2.0
RATE_PULL_PER_S2 = 1.0
# A delayed message changes the estimate by no more than this.
MOST_NS = 20_000_000
# If this many consecutive messages are late by more than this, or one is early by more, the simulator lost or
# made up time.
SLIP_NS = 15_000_000
SLIP_COUNT = 20
# Beyond this error, the simulator was paused, and the sensor with it.
PAUSE_NS = 1_000_000_000


class SensorTime:
    """Conversion of an autopilot's time since boot to a clock of real seconds.

    A simulator in real time may run some percent slow, unlike the quartz of a real sensor, and a receiver
    designed for quartz clocks would misplace such stamps by a tenth of a second. So a control loop follows
    the rate between the two clocks smoothly: a delayed message must not move the stamps. On a busy computer
    the simulator loses time in steps. The sensor's clock does not, and its stamps continue with real time.
    """

    def __init__(self) -> None:
        self._boot_ns: int | None = None
        self._arrival_ns = 0  # the arrival, on the sensor's clock, minus the real time
        self._offset_ns = 0.0  # the sensor's clock minus the time since boot
        self._rate = 0.0
        self._errors_ns: deque[float] = deque(maxlen=SLIP_COUNT)

    @property
    def running(self) -> bool:
        """Whether `restart` was called."""
        return self._boot_ns is not None

    def restart(self, boot_ns: int, arrival_ns: int, at_ns: int) -> None:
        """Start or restart: this boot time, received at this real time, is the sensor's time `at_ns`."""
        self._boot_ns, self._arrival_ns = boot_ns, at_ns - arrival_ns
        self._offset_ns, self._rate = float(at_ns - boot_ns), 0.0
        self._errors_ns.clear()

    def to_sensor_ns(self, boot_ns: int, arrival_ns: int | None) -> int:
        """Return the sensor's time of a boot time received at a real time.

        None marks a message that waited unread for an unknown time and so carries no information on the rate.
        """
        step_s = max(0, boot_ns - (self._boot_ns or 0)) / SECOND_NS
        self._boot_ns = max(boot_ns, self._boot_ns or 0)
        self._offset_ns += self._rate * step_s
        if arrival_ns is None:
            return boot_ns + round(self._offset_ns)
        error_ns = arrival_ns + self._arrival_ns - boot_ns - self._offset_ns
        if abs(error_ns) > PAUSE_NS:
            self._arrival_ns -= round(error_ns)
            error_ns = 0.0
            self._errors_ns.clear()
        error_ns -= self._slipped_ns(error_ns)
        pull_ns = max(-MOST_NS, min(MOST_NS, error_ns))
        share = min(step_s, 0.1)
        self._rate += RATE_PULL_PER_S2 * share * pull_ns
        self._offset_ns += PULL_PER_S * share * pull_ns
        return boot_ns + round(self._offset_ns)

    def _slipped_ns(self, error_ns: float) -> float:
        """Correct a step of the simulator's time at once; return it, 0 without one."""
        self._errors_ns.append(error_ns)
        lost_ns = min(self._errors_ns) if len(self._errors_ns) == SLIP_COUNT else 0.0
        slip_ns = error_ns if error_ns < -SLIP_NS else lost_ns if lost_ns > SLIP_NS else 0.0
        if slip_ns:
            self._offset_ns += slip_ns
            self._errors_ns.clear()
        return slip_ns
