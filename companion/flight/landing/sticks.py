"""Pilot's roll and pitch sticks: at rest, or moved since an autopilot's landing began."""

from __future__ import annotations

STICK_US = 80  # beyond the dead zones of both autopilots
HELD_US = 150  # from the middle of the pulse: beyond the rest position of any calibrated transmitter
MIDDLE_US = 1500

Pulses = tuple[int, int]


def are_moved(now_us: Pulses | None, rest_us: Pulses | None) -> bool:
    """Return whether sticks are away from where they rested, or from their middle; unseen ones are not."""
    if now_us is None or rest_us is None:
        return False
    moved = any(abs(now - rest) > STICK_US for now, rest in zip(now_us, rest_us, strict=True))
    return moved or any(abs(now - MIDDLE_US) > HELD_US for now in now_us)
