"""Radio control: the transmitter's channels, MAVLink overrides of them, and sticks as fractions."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

ROLL, PITCH, THROTTLE, YAW, SWITCH = range(5)
AT_REST = (1500, 1500, 1500, 1500, 1800, 1000, 1500, 1500)
"""Channels 1 to 8, us: sticks centred, throttle in the middle, mode switch on channel 5."""
CENTRE_US, FULL_US = 1500, 400
DEAD_US, THROTTLE_DEAD_US = 20, 100
OVERRIDE_NS = 3_000_000_000
LOST_NS = 1_000_000_000
RELEASED, IGNORED = 0, 65_535


@dataclass(frozen=True, slots=True)
class Sticks:
    """Deflections from -1 to 1, zero within the dead zone: right, forward, up and clockwise are positive."""

    right: float = 0.0
    forward: float = 0.0
    up: float = 0.0
    clockwise: float = 0.0

    @property
    def steering(self) -> bool:
        """True if roll or pitch is deflected."""
        return bool(self.right or self.forward)


RESTING = Sticks()


class RadioReceiver:
    """Receiver of a transmitter, whose channels may be overridden individually.

    Attributes
    ----------
    transmitter
        Channels 1 to 8 as sent by the transmitter, us.
    transmitting
        Whether the receiver hears the transmitter.
    """

    def __init__(self) -> None:
        self.transmitter = list(AT_REST)
        self.transmitting = True
        self._last = list(AT_REST)
        self._heard_ns = 0
        self._overrides: dict[int, tuple[int, int]] = {}

    def override(self, channels: Sequence[int], now_ns: int) -> None:
        """Override channels, us, for three seconds: 0 releases one, 65535 leaves it unchanged."""
        for number, value in enumerate(channels):
            if value == RELEASED:
                self._overrides.pop(number, None)
            elif value != IGNORED:
                self._overrides[number] = value, now_ns

    def channels(self, now_ns: int) -> list[int]:
        """Return channels 1 to 8, us; without a transmitter the last ones received."""
        if self.transmitting:
            self._last[:] = self.transmitter
            self._heard_ns = now_ns
        if not self._overrides:
            return self._last
        out = list(self._last)
        for number, (value, stamp_ns) in list(self._overrides.items()):
            if now_ns - stamp_ns > OVERRIDE_NS:
                del self._overrides[number]
            else:
                out[number] = value
        return out

    def lost(self, now_ns: int) -> bool:
        """Return whether neither transmitter nor override has been received for a second."""
        self.channels(now_ns)
        return not self._overrides and now_ns - self._heard_ns > LOST_NS

    def sticks(self, now_ns: int) -> Sticks:
        """Return the deflections; none while the radio is lost."""
        channels = self.channels(now_ns)
        if channels[:SWITCH] == list(AT_REST[:SWITCH]) or self.lost(now_ns):
            return RESTING
        return Sticks(
            right=_fraction(channels[ROLL], DEAD_US),
            forward=-_fraction(channels[PITCH], DEAD_US),
            up=_fraction(channels[THROTTLE], THROTTLE_DEAD_US),
            clockwise=_fraction(channels[YAW], DEAD_US),
        )


def _fraction(pulse_us: int, dead_us: int) -> float:
    off = pulse_us - CENTRE_US
    if abs(off) <= dead_us:
        return 0.0
    beyond = (abs(off) - dead_us) / (FULL_US - dead_us)
    return min(1.0, beyond) if off > 0 else -min(1.0, beyond)
