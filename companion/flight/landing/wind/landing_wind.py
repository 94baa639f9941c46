"""Wind in a landing: the heading into it, the limit for gusts, and the drift by a gust."""

from __future__ import annotations

import math

from companion.flight.geometry.wind import Wind
from companion.flight.landing.landing_progress import LandingProgress
from companion.flight.landing.outage import GpsLoss
from companion.flight.landing.pilot_texts import PilotTexts
from companion.flight.landing.situation import Severity, Situation
from companion.flight.landing.ways.endurance import is_battery_low
from params import Parameters

FROM_MS, UNTIL_MS = 2.0, 1.2  # mean speed from which the wind counts, and below which it ceases to
FOLLOW_RAD = math.radians(5.0)  # turn of the wind that the heading follows
CALM_SHARE = 0.9  # of the limit, to which gusts must fall before a landing begins again
FORGET_NS = 60_000_000_000  # an unknown wind does not lift an exceeded limit sooner: the span of gusts
REPORT_AGAIN_NS = 30_000_000_000  # while a landing waits for less wind
RESPONSE_S = 0.1  # displacement by a gust over its excess of the mean wind; derived in `gust_drift_m`


class LandingWind:
    """Heading and limit of the landing under way, and the report that it waits for less wind."""

    def __init__(
        self, parameters: Parameters, progress: LandingProgress, texts: PilotTexts, gps_loss: GpsLoss
    ) -> None:
        self._p, self._progress, self._texts, self._gps_loss = parameters, progress, texts, gps_loss
        self.into_wind, self.limit = IntoWind(), WindLimit()
        self._reported_ns: int | None = None

    def follow(self, s: Situation) -> None:
        """Update heading and limit from the present wind."""
        self.into_wind.follow(s.wind if self._p.into_wind == "on" else None)
        self.limit.follow(s.wind, self._p.max_wind_ms, s.now_ns)

    def too_windy(self, s: Situation, urgent: bool | None = None) -> str:
        """Return the reason against a landing while gusts exceed the limit, else "".

        There is none against an urgent one (by default the landing under way), without GPS, nor with a low
        battery.
        """
        gust_ms = self.limit.gust_ms
        exempt = self._gps_loss.is_on or (self._progress.is_urgent if urgent is None else urgent)
        if gust_ms is None:
            return ""
        reason = f"wind too strong for this point: {gust_ms:.0f} m/s"
        return "" if exempt or is_battery_low(s, self._p) else reason

    def report(self, s: Situation) -> None:
        """Report each half minute that a landing waits for less wind."""
        if self._reported_ns is None or s.now_ns - self._reported_ns > REPORT_AGAIN_NS:
            self._reported_ns = s.now_ns
            self._texts.say(Severity.WARNING, self.too_windy(s))


class IntoWind:
    """Heading into the wind, held until the wind has turned by more than 5 degrees.

    Below 2 m/s the direction is not used: an error of the tilt by two degrees is as large.

    Attributes
    ----------
    heading_rad
        Clockwise from north; None without enough wind.
    """

    def __init__(self) -> None:
        self.heading_rad: float | None = None
        self._frozen = False

    def follow(self, wind: Wind | None) -> None:
        """Follow the present wind, None while it is unknown, unless frozen."""
        if self._frozen:
            return
        least_ms = FROM_MS if self.heading_rad is None else UNTIL_MS
        if wind is None or wind.speed_ms < least_ms:
            self.heading_rad = None
        elif self.heading_rad is None or abs(_turn_rad(wind.from_rad, self.heading_rad)) > FOLLOW_RAD:
            self.heading_rad = wind.from_rad

    def freeze(self, frozen: bool) -> None:
        """Keep the heading from the beginning of a descent, or follow the wind again."""
        self._frozen = frozen


class WindLimit:
    """Limit of gusts, and whether they exceed it.

    Attributes
    ----------
    gust_ms
        Last known gust while the limit is exceeded, None otherwise.
    """

    def __init__(self) -> None:
        self.gust_ms: float | None = None
        self._known_ns = 0

    def follow(self, wind: Wind | None, limit_ms: float, now_ns: int) -> None:
        """Compare the present wind, None while it is unknown; an unknown wind exceeds nothing."""
        if wind is None:
            if now_ns - self._known_ns > FORGET_NS:
                self.gust_ms = None
            return
        self._known_ns = now_ns
        share = 1.0 if self.gust_ms is None else CALM_SHARE
        self.gust_ms = wind.gust_ms if wind.gust_ms > share * limit_ms else None


def gust_drift_m(wind: Wind | None) -> float:
    """Return the bound of the drift by a gust, 0 while the wind is unknown.

    A gust stronger than the mean by w accelerates the vehicle by its drag times w (0.2 1/s, see
    `drag_per_s`). A controller that returns a position error at 1 1/s, and an error of velocity at 2 1/s,
    balances that at a distance of 0.2 / (1 x 2) s times w. These are the gains of ArduCopter (PSC_POSXY_P 1,
    PSC_VELXY_P 2) and PX4 (MPC_XY_P 0.95, MPC_XY_VEL_P_ACC 1.8). Their integrators remove the mean wind, but
    are too slow for a gust.
    """
    return 0.0 if wind is None else RESPONSE_S * (wind.gust_ms - wind.speed_ms)


def _turn_rad(to_rad: float, from_rad: float) -> float:
    return math.remainder(to_rad - from_rad, 2 * math.pi)
