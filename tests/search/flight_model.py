"""Model of a flight: when it answers, by times and heights alone; a thousand times faster than a cheap one.

To compare forms of the search with each other, never as evidence: there is no companion in it. The times to
answer and their noise are about those of coarse flights; the shares of the planted weaknesses are the same.
"""

from __future__ import annotations

import json
import math
import zlib
from collections.abc import Callable

import numpy as np

from tests.search.flight import ABORTED, REFUSED, SAFE, UNSAFE, Outcome
from tests.search.hazard import FROM_M, IN_WAY_M, POST_M
from tests.search.margin import HAZARD_M, PLACE_M, RESPONSE_S, score_of
from tests.search.scenario import Scenario, is_default
from tests.search.weaknesses import BLIND_S, SHARES, SHIFT_M, Moment, clock_offset

SINK_MS = 0.9
SEEN_S, SEEN_NOISE_S = 0.72, 0.12  # to answer something in the way
LOST_S, LOST_NOISE_S = 0.95, 0.08  # to answer a silent LiDAR
BELOW_S = 0.35  # from an answer to when the vehicle climbs
REFUSED_SHARE = 0.05  # of all flights, whatever is in them
BROKEN_OFF_SHARE = 0.6  # of those with a link in bursts or a jump of the estimate, for this alone
ANSWERED_M = 2.0  # what stops farther beside the point is no reason to break off
NEVER = -math.inf  # height of an answer that does not come


class FlightModel:
    """One flight of a scenario with a weakness, None for none; the same scenario is the same flight."""

    def __init__(self, scenario: Scenario, weakness: str | None) -> None:
        self._scenario, self._weakness = scenario, weakness
        self._rng = np.random.default_rng(zlib.crc32(json.dumps(dict(scenario.values)).encode()))
        self._fault, number = scenario.text("fault"), scenario.number
        self._tall_m = number("hazard_height_m")
        size = {"post": POST_M, "ball": self._tall_m}.get(scenario.text("hazard"), number("hazard_size_m"))
        self._beside_m = number("hazard_aside_m") - size / 2
        self._comes = not is_default(scenario, "hazard")
        self._is_in_way = self._comes and self._beside_m < IN_WAY_M
        self._met_m = number("hazard_below_m") - SINK_MS * FROM_M / number("hazard_speed_ms")
        self._delay_s = number("link_delay_s") + 0.35 * number("late_s")

    def outcome(self) -> Outcome:
        """Return how the flight ends."""
        if self._rng.random() < REFUSED_SHARE:
            return _outcome(REFUSED, 1.0, {})
        breaks_off = self._rng.random() < BROKEN_OFF_SHARE and self._fault in ("link_bursts", "ekf_jump")
        if breaks_off and self._scenario.number("fault_below_m") > self._met_m:
            return _outcome(ABORTED, 0.3 if self._comes else 1.0, {})
        lost_m, lost_s = self._lost()
        answered_m = max(lost_m, self._seen_m())
        return self._landed() if answered_m <= 0.0 else self._broken_off(answered_m, lost_m, lost_s)

    def _broken_off(self, answered_m: float, lost_m: float, lost_s: float) -> Outcome:
        response = {"silence": lost_s} if lost_m == answered_m else {}
        if not self._comes or answered_m > self._scenario.number("hazard_below_m"):
            return _outcome(ABORTED, 1.0, response)
        if not self._is_in_way:
            return _outcome(ABORTED, max(0.02, self._beside_m / HAZARD_M), response)
        response["reaction"] = (self._met_m - answered_m) / SINK_MS
        left_m = answered_m - self._tall_m - SINK_MS * (BELOW_S + self._delay_s)
        return _outcome(ABORTED if left_m >= 0 else UNSAFE, left_m / HAZARD_M, response)

    def _landed(self) -> Outcome:
        """Come down beside the point, by noise, drift and a shift, maybe onto what stands there."""
        number = self._scenario.number
        missed_m = 0.1 + abs(self._rng.normal(0.0, 0.1)) + number("drift_ms") * self._rng.random()
        toward_deg = 360.0 * self._rng.random()
        if self._weakness == clock_offset.__name__:
            shift_m = SHIFT_M * clock_offset(self._moment(2.0, lost=False))
            missed_m, toward_deg = (missed_m + shift_m, 90.0) if shift_m > 0.0 else (missed_m, toward_deg)
        margin = -0.5 if self._is_in_way else 0.3 + 0.3 * self._rng.random()
        if self._comes and self._beside_m > ANSWERED_M:
            aside_m, aside_rad = number("hazard_aside_m"), math.radians(number("hazard_aside_deg"))
            apart_rad = aside_rad - math.radians(toward_deg)
            away_m = math.sqrt(aside_m**2 + missed_m**2 - 2 * aside_m * missed_m * math.cos(apart_rad))
            left_m = away_m - (aside_m - self._beside_m) - 0.7
            margin = min(margin, left_m / HAZARD_M if left_m > 0.0 else -0.3)
        missed = round(missed_m, 4), round(toward_deg, 4)
        return _outcome(SAFE if margin >= 0 else UNSAFE, margin, {"accuracy": missed_m}, missed)

    def _lost(self) -> tuple[float, float]:
        """Return at which height the flight answers a silent LiDAR, and how late."""
        if self._fault != "lidar_stop":
            return NEVER, 0.0
        below_m = self._scenario.number("fault_below_m")
        late_s = LOST_S + self._delay_s + self._rng.normal(0.0, LOST_NOISE_S)
        late_s += BLIND_S * self._share(below_m - SINK_MS * LOST_S, lost=True)
        answers = late_s < self._scenario.number("fault_s")
        return (below_m - SINK_MS * late_s if answers else NEVER), late_s

    def _seen_m(self) -> float:
        """Return at which height the flight answers what came."""
        if not self._is_in_way:
            is_near = self._comes and self._beside_m <= ANSWERED_M
            return self._met_m - SINK_MS * SEEN_S if is_near else NEVER
        late_s = (
            SEEN_S + 0.5 * max(0.0, 0.8 - self._tall_m) + self._rng.normal(0.0, SEEN_NOISE_S) + self._delay_s
        )
        if self._fault in ("lidar_half", "lidar_dust", "lidar_plumes"):
            late_s += 0.25 * self._rng.random()
        seen_m = self._met_m - SINK_MS * (late_s + BLIND_S * self._share(self._met_m, lost=False))
        silent_m = self._scenario.number("fault_below_m")
        if self._fault == "lidar_stop" and seen_m < silent_m:
            return min(seen_m, silent_m - SINK_MS * (self._scenario.number("fault_s") + SEEN_S))
        return seen_m

    def _share(self, height_m: float, *, lost: bool) -> float:
        share: Callable[[Moment], float] | None = SHARES.get(self._weakness or "")
        is_for_lost = self._weakness == "stale_evidence"
        return share(self._moment(height_m, lost=lost)) if share is not None and is_for_lost == lost else 0.0

    def _moment(self, height_m: float, *, lost: bool) -> Moment:
        """Return what the decisions see: with errors, the nose into the wind if there is one."""
        number, normal = self._scenario.number, self._rng.normal
        nose_deg = number("wind_from_deg") if number("wind_ms") > 1.5 else number("start_deg")
        return Moment(
            height_m=height_m,
            wind_ms=number("wind_ms") + 0.4 * number("gust_ms") * abs(normal()),
            wind_from_deg=number("wind_from_deg") + normal(0.0, 5.0),
            heading_deg=(nose_deg + normal(0.0, 4.0)) % 360.0,
            tall_m=self._tall_m * (1.0 + normal(0.0, 0.04)),
            bearing_deg=number("hazard_from_deg"),
            late_s=number("late_s"),
            delay_s=number("link_delay_s"),
            lost=lost,
        )


def _outcome(
    end: str, margin: float, late: dict[str, float], missed: tuple[float, float] | None = None
) -> Outcome:
    """Return an outcome; late: times, s, and the distance from the point, m, by part of the response."""
    response = {
        name: round(max(-1.0, 1.0 - value / (PLACE_M if name == "accuracy" else RESPONSE_S)), 5)
        for name, value in late.items()
    }
    parts = {"hazard": round(max(-1.0, margin), 5)}
    score = round(score_of(parts, response), 5)
    return Outcome(end, parts["hazard"], score, parts, response, [], None, 0.0, 0.0, missed)
