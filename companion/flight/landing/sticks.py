"""Watch of the pilot's roll and pitch sticks: at rest, or moved."""

from __future__ import annotations

STICK_US = 80  # beyond the dead zones of both autopilots
HELD_US = 150  # from the middle of the pulse: beyond the rest position of any calibrated transmitter
MIDDLE_US = 1500

Pulses = tuple[int, int]


class StickWatch:
    """Compares the sticks with where they rested before a landing."""

    def __init__(self) -> None:
        self._rest_us: Pulses | None = None

    def note_rest(self, now_us: Pulses | None) -> None:
        """Take these positions, which may be unseen, as the rest."""
        self._rest_us = now_us

    def are_moved(self, now_us: Pulses | None) -> bool:
        """Return whether sticks are away from their rest, or from their middle; unseen ones are not."""
        rest_us = self._rest_us = self._rest_us or now_us
        if now_us is None or rest_us is None:
            return False
        moved = any(abs(now - rest) > STICK_US for now, rest in zip(now_us, rest_us, strict=True))
        return moved or any(abs(now - MIDDLE_US) > HELD_US for now in now_us)
