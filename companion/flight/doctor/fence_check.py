"""Check that the autopilot's fence can be read, and what it is."""

from __future__ import annotations

import math

from companion.flight.doctor.finding import Finding
from companion.flight.services.fence_reader import AutopilotFence

REMEDY = (
    "look at the fence in the ground station and write it again, or disable it: as long as slz does not know "
    "it, --land auto does not begin, and an order may lead against it"
)


def fence_finding(fence: AutopilotFence | None) -> Finding:
    """Judge the fence as read; None if it could not be read, or its items make none."""
    if fence is None:
        return Finding("fence", "fail", "could not be read", "no fence, or one that is read", REMEDY)
    parts = []
    if math.isfinite(fence.radius_m):
        parts.append(f"circle of {fence.radius_m:g} m")
    if math.isfinite(fence.highest_m):
        parts.append(f"flown up to {fence.highest_m:g} m")
    if math.isfinite(fence.lowest_m):
        parts.append(f"down to {fence.lowest_m:g} m")
    if fence.areas:
        parts.append(f"{len(fence.areas)} area" + "s" * (len(fence.areas) > 1))
    if not parts:
        return Finding("fence", "ok", "none")
    return Finding("fence", "ok", f"{', '.join(parts)}; {fence.margin_m:g} m kept from it")
