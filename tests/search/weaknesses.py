"""Five weaknesses that can be planted in the decisions of a flight; the program itself has none of them.

Each is narrow: it is whole only where several conditions meet, and fades with the distance from there, which
is seen as a late answer long before anything is unsafe. A weakness without such a slope is found no sooner
than by chance, by any search.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, replace
from functools import partial
from unittest import mock

import numpy as np

from companion.flight.landing.situation import Phase, Situation, VehicleCommands
from slz import PointState, SelectedPoint
from tests.search.flight import SearchFlight, Weakness

BLIND_S = 3.2  # about: from 4 m down to where a landing is not broken off any more
SHIFT_M = 4.0  # less would reach nothing: what stands nearer breaks the landing off
LEAST_SHARE = 0.05
UNKNOWN_HEIGHT_M = 0.5  # of what the map alone shows


def fading(*off: float) -> float:
    """Return 1 where all conditions meet, 0.37 at a width from there, 0.14 at two, nothing beyond three."""
    share = math.exp(-math.hypot(*off))
    return share if share > LEAST_SHARE else 0.0


def turn_deg(value_deg: float, peak_deg: float) -> float:
    """Return the turn from one angle to another, -180 to 180."""
    return (value_deg - peak_deg + 180.0) % 360.0 - 180.0


@dataclass(frozen=True, slots=True)
class Moment:
    """What the decisions see when something comes: heights, wind and angles; and delays, of the scenario.

    height_m: of the vehicle over the point. tall_m: of what came, over the ground. bearing_deg: from
    the point to what came, compass. late_s: of every computed window. delay_s: of every message.
    """

    height_m: float
    wind_ms: float
    wind_from_deg: float
    heading_deg: float
    tall_m: float
    bearing_deg: float
    late_s: float
    delay_s: float
    lost: bool


def moment(flight: SearchFlight, s: Situation) -> Moment:
    """Return the moment of a situation."""
    aim, intrusion = flight.companion.executive.progress.aim, s.intrusion
    tall, bearing = UNKNOWN_HEIGHT_M, 0.0
    if aim.enu_m is not None:
        place, seen = aim.enu_m[:2], [(one.height_m, one.enu_m) for one in s.moving]
        if intrusion is not None:
            seen = [(intrusion.height_m, intrusion.enu_m[:2])]
        if seen:
            tall, where = min(seen, key=lambda one: float(np.hypot(*(one[1] - place))))
            east, north = (float(v) for v in where - place)
            bearing = math.degrees(math.atan2(east, north)) % 360.0
    return Moment(
        height_m=aim.height_left_m,
        wind_ms=0.0 if s.wind is None else s.wind.speed_ms,
        wind_from_deg=0.0 if s.wind is None else math.degrees(s.wind.from_rad),
        heading_deg=math.degrees(s.heading_rad or 0.0) % 360.0,
        tall_m=tall,
        bearing_deg=bearing,
        late_s=flight.scenario.number("late_s"),
        delay_s=flight.scenario.number("link_delay_s"),
        lost=not s.lidar_ok,
    )


class _Blind:
    """Source of situations that hides what came for a while, or that the LiDAR is lost.

    What moves is hidden too, before it has come, wherever the weakness is there at all: the landing does not
    wait for it. Where it is not there, the situation is as it was.
    """

    def __init__(self, flight: SearchFlight, share: Callable[[Moment], float]) -> None:
        self._flight, self._share = flight, share
        self._true = flight.companion.deciding.situations.situation
        self._clean: SelectedPoint | None = None
        self._until_ns: int | None = None

    def situation(self) -> Situation:
        s = self._true()
        if self._flight.phase not in (Phase.DESCEND, Phase.FINAL):
            self._clean, self._until_ns = s.selected, None
            return s
        came = s.selected is None or s.selected.state is not PointState.SAFE
        share = self._share(moment(self._flight, s))
        if not came and s.lidar_ok:
            self._clean = s.selected
            hidden = share > 0.0 and (self._until_ns is None or s.now_ns < self._until_ns)
            return replace(s, moving=()) if hidden else s
        if self._until_ns is None:
            self._until_ns = s.now_ns + round(BLIND_S * share * 1e9)
        if s.now_ns >= self._until_ns or self._clean is None:
            return s
        return replace(s, selected=self._clean, intrusion=None, lidar_ok=True, moving=())


@contextmanager
def _blind(flight: SearchFlight, share: Callable[[Moment], float]) -> Iterator[None]:
    with mock.patch.object(
        flight.companion.deciding.situations, "situation", _Blind(flight, share).situation
    ):
        yield


def crosswind(m: Moment) -> float:
    """What comes is ignored for seconds if it is 1.1 m high, the wind is strong, and the nose about south."""
    return fading((m.wind_ms - 6.0) / 1.0, turn_deg(m.heading_deg, 200.0) / 15.0, (m.tall_m - 1.1) / 0.15)


def between_heights(m: Moment) -> float:
    """The watch stops between two heights, for what is 0.7 m high and comes on from the east."""
    return fading((m.height_m - 3.6) / 0.4, turn_deg(m.bearing_deg, 90.0) / 15.0, (m.tall_m - 0.7) / 0.15)


def stale_evidence(m: Moment) -> float:
    """The age of the evidence is ignored in the autopilot's landing, when the LiDAR is lost at 3.8 m."""
    share = fading((m.height_m - 3.8) / 0.4, (m.wind_ms - 4.0) / 0.8, turn_deg(m.heading_deg, 90.0) / 20.0)
    return share if m.lost else 0.0


def late_computer(m: Moment) -> float:
    """A computer late by about 0.6 s and wind from the north-west together let what comes be ignored."""
    return fading((m.late_s - 0.6) / 0.06, turn_deg(m.wind_from_deg, 315.0) / 15.0, (m.wind_ms - 5.0) / 0.7)


def clock_offset(m: Moment) -> float:
    """A link late by about 0.12 s, in a wind from the south, shifts position and landing target east."""
    return fading((m.delay_s - 0.12) / 0.02, turn_deg(m.wind_from_deg, 180.0) / 15.0, (m.wind_ms - 5.0) / 0.7)


@contextmanager
def _shifted(flight: SearchFlight) -> Iterator[None]:
    companion = flight.companion
    true, execute = companion.deciding.situations.situation, companion.executive.step

    def shift_m(s: Situation) -> np.ndarray:
        return np.array([SHIFT_M * clock_offset(moment(flight, s)), 0.0, 0.0])

    def situation() -> Situation:
        s = true()
        if s.position_enu_m is None or flight.phase not in (Phase.DESCEND, Phase.FINAL):
            return s
        return replace(s, position_enu_m=s.position_enu_m - shift_m(s))

    def step(s: Situation) -> VehicleCommands:
        commands = execute(s)
        if commands.target_enu_m is None or flight.phase not in (Phase.DESCEND, Phase.FINAL):
            return commands
        return replace(commands, target_enu_m=commands.target_enu_m + shift_m(s))

    with (
        mock.patch.object(companion.deciding.situations, "situation", situation),
        mock.patch.object(companion.executive, "step", step),
    ):
        yield


@contextmanager
def all_at_once(flight: SearchFlight) -> Iterator[None]:
    """Plant all five."""
    with ExitStack() as stack:
        for weakness in WEAKNESSES.values():
            stack.enter_context(weakness(flight))
        yield


SHARES = {one.__name__: one for one in (crosswind, between_heights, stale_evidence, late_computer)}
WEAKNESSES: dict[str, Weakness] = {
    **{name: partial(_blind, share=share) for name, share in SHARES.items()},
    "clock_offset": _shifted,
}
"""By name: plants a weakness in a flight while the context lasts."""
