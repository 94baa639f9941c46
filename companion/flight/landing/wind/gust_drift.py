"""Drift of a vehicle by gusts while the autopilot holds it over a point."""

from __future__ import annotations

from companion.flight.geometry.wind import Wind

RESPONSE_S = 0.1


def gust_drift_m(wind: Wind | None) -> float:
    """Return the bound of the drift by a gust, 0 while the wind is unknown.

    A gust stronger than the mean by w accelerates the vehicle by its drag times w (0.2 1/s, see
    `drag_per_s`). A controller that returns a position error at 1 1/s, and an error of velocity at 2 1/s,
    balances that at a distance of 0.2 / (1 x 2) s times w. These are the gains of ArduCopter (PSC_POSXY_P 1,
    PSC_VELXY_P 2) and PX4 (MPC_XY_P 0.95, MPC_XY_VEL_P_ACC 1.8). Their integrators remove the mean wind, but
    are too slow for a gust.
    """
    return 0.0 if wind is None else RESPONSE_S * (wind.gust_ms - wind.speed_ms)
