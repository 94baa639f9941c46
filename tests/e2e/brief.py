"""Settings of a flight that costs a third: low, short, and with the campaign's small map and few pulses.

For what a flight shows of modes, orders and the link. Accuracy is measured by those without these settings.
"""

from __future__ import annotations

from typing import Any

from tests.campaign.sortie import AUTOPILOT, CHEAP, HEIGHT_M, LIDAR_MS, POINT_RATE_HZ


def brief(*, parameters: dict[str, float] | None = None, **settings: Any) -> dict[str, Any]:
    """Return arguments of a `Mission`, with other parameters of the autopilot and other settings."""
    simulated = {
        "lidar_ms": LIDAR_MS,
        "point_rate_hz": POINT_RATE_HZ,
        "parameters": AUTOPILOT | (parameters or {}),
    }
    return {"height_m": HEIGHT_M, **CHEAP, **settings, "simulated": simulated | settings.get("simulated", {})}
