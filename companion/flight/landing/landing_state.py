"""State shared by the phases and the interruptions of a landing, and the transitions between phases."""

from __future__ import annotations

from textwrap import shorten

import numpy as np

from companion.flight.geometry.geofence import Geofence
from companion.flight.landing.aim import Aim
from companion.flight.landing.hand_over import HandOver
from companion.flight.landing.interruptions.crossing import crossing
from companion.flight.landing.interruptions.gps_loss import GpsLoss
from companion.flight.landing.interruptions.outage import Outage
from companion.flight.landing.mode_ownership import ModeOwnership
from companion.flight.landing.point_selection import PointSelection
from companion.flight.landing.route import Route, Way
from companion.flight.landing.situation import (
    COMMANDING,
    LandingRequest,
    Phase,
    Severity,
    Situation,
    Tally,
    Vector,
    VehicleCommands,
)
from companion.flight.landing.ways.approach_path import ApproachPath, hover_height_m
from companion.flight.landing.ways.endurance import Endurance
from companion.flight.landing.ways.way_choice import is_blocked, straight_down_is_blocked
from companion.flight.landing.wind.into_wind import IntoWind
from companion.flight.landing.wind.wind_limit import WindLimit
from companion.flight.landing.zone_choice import must_be_confirmed, soonest
from params import Parameters
from slz import Corridors, PointState, Report, Zone
from slz.landing_point.corridors import corridor_radius_m
from slz.wires.detected_wire import nearest_wire

SECOND = 1_000_000_000
STUCK_NS = 60 * SECOND  # beyond twice the travel time of a phase
MOST_GIVEN = 3  # landings on a point that are broken off for what moves there
WIND_AGAIN_NS = 30 * SECOND
LANDING_MS = 0.5  # lowest sink rate of autopilots at the end of a landing


class LandingState:
    """State of the landing in progress.

    Attributes
    ----------
    parameters
        Speeds, heights and times of the `landing` section.
    auto
        Land without an order, once the vehicle is armed, airborne and in its guided mode.
    phase, since_ns, late_ns
        Present phase, its beginning, and its time limit.
    request, started_ns, refused
        The accepted request, its time, and the points that its landing broke off from.
    path
        The approach path of the descent, None while that is straight down.
    into_wind, wind_limit
        Heading into the wind, and whether gusts exceed `max_wind_ms`.
    endurance
        How long the battery lasts.
    gps_loss
        Loss of GPS that no odometry makes up for.
    keeps_request
        The last landing was broken off for a reason that is not its point's: it is tried again.
    is_ordered_abort
        The last abort holds until the next order.
    n_given
        How often the landing gave way to what moves.
    safe_since_ns
        In the approach: since then the vehicle has been over the point, which is safe.
    level_since_ns
        Before an automatic start: since then the vehicle has been airborne, guided and level.
    told_to_hand_over_ns
        Last time at which the pilot was told that a hand-over is needed.
    """

    def __init__(self, parameters: Parameters, auto: bool) -> None:
        self.parameters, self.auto = parameters, auto
        self.phase = Phase.IDLE
        self.since_ns = self.late_ns = self.started_ns = 0
        self.tally = Tally()
        self.order_count = 0
        self.ownership, self.hand_over = ModeOwnership(), HandOver()
        self.aim, self.route = Aim(), Route(parameters)
        self.selection, self.outage = PointSelection(), Outage()
        self.into_wind, self.wind_limit = IntoWind(), WindLimit()
        self.endurance = Endurance()
        self.gps_loss = GpsLoss(parameters)
        self.path: ApproachPath | None = None
        self.keeps_request = self.is_ordered_abort = False
        self.n_given = 0
        self.request: LandingRequest | None = None
        self.refused: list[Vector] = []
        self.safe_since_ns: int | None = None
        self.level_since_ns: int | None = None
        self.told_to_hand_over_ns: int | None = None
        self._wind_reported_ns: int | None = None
        self._beyond: tuple[Report, Geofence, frozenset[int]] | None = None  # and the zones beyond it
        self._texts: list[tuple[Severity, str]] = []
        self._lasting = ""

    # ---- texts ----------------------------------------------------------------------------------

    def say(self, severity: Severity, text: str) -> None:
        """Send the pilot a text with this step's commands."""
        self._texts.append((severity, f"SLZ: {text}"))

    def note_lasting(self, text: str) -> None:
        """Note what the landing waits for in this step, in the words in which it is said."""
        self._lasting = f"SLZ: {text}"

    def call(self, trouble: str, s: Situation) -> None:
        """Call the pilot, again each minute, about a vehicle that does not obey; begin nothing afterwards."""
        self.say(Severity.CRITICAL, f"{trouble}: take over")
        if self.phase not in (Phase.FINAL, Phase.HOLD):
            self.go(Phase.HOLD, s)
        self.late_ns = s.now_ns + STUCK_NS

    def call_for_hand_over(self, event: str, s: Situation) -> None:
        """Tell what hands over after an event: where the guided mode is on, setting it changes nothing."""
        if s.guided and self.auto:
            text = f"{event}: leave {s.mode}, set it again"
        else:
            text = f"{event}, {s.mode}: order again" if s.guided else f"{event}, {s.mode}: hand over again"
        self.say(Severity.WARNING, text)

    def collect_lasting(self) -> str:
        """Return the text about what was waited for since the last call, "" for nothing."""
        text, self._lasting = self._lasting, ""
        return text

    def collect_texts(self) -> tuple[tuple[Severity, str], ...]:
        """Return the texts since the last call."""
        texts, self._texts = tuple(self._texts), []
        return texts

    # ---- transitions ----------------------------------------------------------------------------

    def go(self, phase: Phase, s: Situation) -> None:
        """Enter a phase."""
        self.phase = phase
        self.into_wind.freeze(phase in (Phase.DESCEND, Phase.FINAL))
        self.order_count += phase not in (Phase.APPROACH, Phase.DESCEND, Phase.FINAL)
        self.since_ns = s.now_ns
        self.restart_limit(s)
        self.level_since_ns = None
        self.route.unblocked()

    def rest(self, phase: Phase, s: Situation) -> None:
        """End the request: nothing more is commanded."""
        self.request = None
        self.ownership.clear()
        self.outage.reset()
        self.go(phase, s)

    def start(self, request: LandingRequest, s: Situation) -> None:
        """Begin a requested landing."""
        self.request, self.started_ns = request, s.now_ns
        self.refused.clear()
        self.keeps_request, self.n_given = False, 0
        self.start_survey(s)

    def start_survey(self, s: Situation) -> None:
        """Begin the search for a zone, from where the vehicle is."""
        if s.position_enu_m is None:
            self.say(Severity.WARNING, "no position: waiting")
            self.route.forget()
        else:
            # After an abort close to the ground, an order does not end the climb.
            least_m = self.route.height_m if self.phase in COMMANDING else -np.inf
            self.route.start_search(s.position_enu_m, s.height_above_home_m, least_m)
        self.say(Severity.INFO, "surveying")
        self.outage.reset()
        self.go(Phase.SURVEY, s)

    def end_survey(self, s: Situation) -> None:
        """Let the present map count as the survey."""
        self.since_ns = s.now_ns - round(self.parameters.survey_s * 1e9)

    def break_off(
        self, reason: str, s: Situation, hold: bool = False, *, keeps_point: bool = False
    ) -> VehicleCommands:
        """Leave the point: stop, or climb at once where the autopilot is landing.

        keeps_point: it may be landed at later.
        """
        self.keeps_request, self.is_ordered_abort = keeps_point, hold
        self.tally.aborts += 1
        self.tally.abort_reasons.append(reason)
        self.say(Severity.WARNING, f"abort: {reason}")
        if self.aim.enu_m is not None and not hold and not keeps_point:
            self.refused.append(self.aim.enu_m)
        landing = self.phase is Phase.FINAL
        self.go(Phase.HOLD if hold else Phase.CLIMB, s)
        climb_ms = self.parameters.climb_speed_ms if landing and not self.gps_loss.is_on else 0.0
        return VehicleCommands(
            mode="guided" if landing else None, velocity_enu_ms=np.array([0.0, 0.0, climb_ms])
        )

    def restart_limit(self, s: Situation) -> None:
        """Set the time limit of the phase to a minute and twice its travel time from now."""
        way_s = 0.0
        match self.phase:
            case Phase.APPROACH:
                way_s = self.aim.away_m / self.parameters.approach_speed_ms
            case Phase.DESCEND:
                way_s = self.aim.height_left_m / self.parameters.descent_speed_ms
                if self.path is not None:
                    way_s += self.path.length_m / self.parameters.approach_speed_ms
            case Phase.FINAL:
                way_s = self.aim.height_left_m / LANDING_MS
            case Phase.CLIMB | Phase.HOLD if s.position_enu_m is not None:
                rise_m = max(0.0, self.route.height_m - float(s.position_enu_m[2]))
                way_s = rise_m / self.parameters.climb_speed_ms
        self.late_ns = s.now_ns + STUCK_NS + round(2e9 * way_s)

    # ---- questions ------------------------------------------------------------------------------

    @property
    def is_low(self) -> bool:
        """True if only dust would be seen of the point, or the landing is committed."""
        return self.aim.height_left_m <= self.committed_m

    @property
    def committed_m(self) -> float:
        """Height over the point below which its last verified state holds."""
        return max(self.parameters.commit_height_m, self.parameters.dust_height_m)

    @property
    def last_state_holds(self) -> bool:
        """True if the last verified state of the point holds: too low to see it, or without GPS."""
        return self.is_low or self.gps_loss.is_on

    def way(self, s: Situation) -> Way:
        """Return the route's response to what is ahead."""
        way = self.route.way(s)
        if way is Way.CLIMBING:
            self.say(Severity.INFO, "obstacle ahead: climbing")
        return way

    def why_not(self, s: Situation) -> str | None:
        """Return the reason against going on with the descent, or None."""
        if not s.lidar_ok:
            return s.no_map_reason.text
        judged = self.aim.judgement(s.selected)
        if judged is not PointState.SAFE:
            return f"point {judged.value}" + self.cause_suffix(s)
        if self.aim_is_beyond_fence(s):
            return "point beyond the fence"
        unconfirmed = self.unconfirmed(s)
        if unconfirmed is not None:
            return f"{unconfirmed}: not confirmed"
        return "way in blocked" + self.wire_suffix(s) if self._is_way_blocked(s) else None

    def beyond_fence(self, s: Situation, enu_m: Vector, zone_id: int | None = None) -> str:
        """Return what of a landing is beyond the autopilot's fence: the point or the way there; else ""."""
        name = "point" if zone_id is None else f"zone {zone_id}"
        if not s.fence.holds_landing(enu_m, hover_height_m(self.parameters)):
            return name
        here = s.position_enu_m
        return "" if here is None or s.fence.holds_way(here, enu_m) else f"way to {name}"

    def zones_beyond_fence(self, s: Situation) -> frozenset[int]:
        """Return the IDs of the zones whose best point is beyond the autopilot's fence; once a report."""
        report, fence = s.report, s.fence
        if report is None or fence.is_open:
            return frozenset()
        if self._beyond is None or self._beyond[0] is not report or self._beyond[1] is not fence:
            prior = () if report.prior is None else report.prior.zones
            zones = (*report.near.zones, *report.far.zones, *prior)
            points = np.array([zone.best.enu_m for zone in zones]).reshape(-1, 3)
            held = fence.holds_landings(points, hover_height_m(self.parameters))
            self._beyond = report, fence, frozenset(zones[k].id for k in np.flatnonzero(~held))
        return self._beyond[2]

    def is_inside_fence(self, s: Situation, zone: Zone) -> bool:
        """Return whether a zone's best point, and the way there, are inside the autopilot's fence."""
        return zone.id not in self.zones_beyond_fence(s) and not self.beyond_fence(s, zone.best.enu_m)

    def aim_is_beyond_fence(self, s: Situation) -> bool:
        """Return whether the autopilot's fence, as it is now, leaves the point out that is flown to."""
        return not s.fence.holds_landing(self.aim.on_ground_enu_m, hover_height_m(self.parameters))

    def give_way(self, s: Situation) -> VehicleCommands | None:
        """Break the landing off for what will be at the point at the touchdown; None without it.

        The same point is tried again, after `MOST_GIVEN` times another one. An urgent landing and one with a
        low battery give way once.
        """
        coming = crossing(s, self.aim, self.parameters)
        cannot_wait = self.is_urgent or self.is_battery_low(s)
        if not coming or (cannot_wait and self.n_given):
            return None
        self.n_given += 1
        keeps_point = self.n_given % MOST_GIVEN != 0
        return self.break_off(f"object of {coming[0].height_m:.1f} m moves in", s, keeps_point=keeps_point)

    def _is_way_blocked(self, s: Situation) -> bool:
        """Return whether something stands in the way down; an urgent landing goes straight down anyway."""
        corridors = self.corridors(s)
        if self.path is not None:
            return is_blocked(corridors, self.path)
        return straight_down_is_blocked(corridors) and not self.is_urgent

    def follow_wind(self, s: Situation) -> None:
        """Update heading and limit from the present wind."""
        p = self.parameters
        self.into_wind.follow(s.wind if p.into_wind == "on" else None)
        self.wind_limit.follow(s.wind, p.max_wind_ms, s.now_ns)

    def too_windy(self, s: Situation, urgent: bool | None = None) -> str:
        """Return the reason against a landing while gusts exceed the limit, else "".

        There is none against an urgent one (by default the landing under way), without GPS, nor with a low
        battery.
        """
        gust_ms = self.wind_limit.gust_ms
        exempt = self.gps_loss.is_on or (self.is_urgent if urgent is None else urgent)
        if gust_ms is None:
            return ""
        reason = f"wind too strong for this point: {gust_ms:.0f} m/s"
        return "" if exempt or self.is_battery_low(s) else reason

    def report_wind(self, s: Situation) -> None:
        """Report now and then that a landing waits for less wind."""
        reported_ns = self._wind_reported_ns
        if reported_ns is None or s.now_ns - reported_ns > WIND_AGAIN_NS:
            self._wind_reported_ns = s.now_ns
            self.say(Severity.WARNING, self.too_windy(s))

    @property
    def is_urgent(self) -> bool:
        """Whether the landing under way takes what is reached soonest."""
        return self.request is not None and self.request.urgent

    def unconfirmed(self, s: Situation) -> str | None:
        """Return the surface at the point, if a landing there lacks its confirmation; otherwise None."""
        selected, request = s.selected, self.request
        if selected is None or not self.aim.is_at(selected):
            return None
        surface = selected.surface
        if self.is_urgent or not must_be_confirmed(surface, self.parameters):
            return None
        if request is None and self.phase is Phase.FINAL:  # resumed: confirmed before the restart
            return None
        return None if request is not None and request.confirmed is surface.kind else surface.text

    def corridors(self, s: Situation) -> Corridors | None:
        """Return the ways in and out of the point in the newest report, None while they are not judged."""
        selected = s.selected
        return None if selected is None or not self.aim.is_at(selected) else selected.corridors

    def may_be_water(self, s: Situation) -> bool:
        """Return whether the newest report suspects water at the point."""
        selected = s.selected
        suspected = selected is not None and selected.surface.water > self.parameters.water_suspicion
        return suspected and self.aim.is_at(selected)

    def cause_suffix(self, s: Situation) -> str:
        """Return the end of a reason against the point: what came onto it, suspected water, or a wire."""
        came = s.intrusion
        if came is not None:
            return f": object of {came.height_m:.1f} m came"
        return self.water_suffix(s) or self.wire_suffix(s)

    def water_suffix(self, s: Situation) -> str:
        """Return the end of a reason against the point, where water is suspected there."""
        return ": may be water" if self.may_be_water(s) else ""

    def wire_suffix(self, s: Situation) -> str:
        """Return the end of a reason against the point or the way down, where a wire passes over both."""
        if s.report is None or self.aim.enu_m is None:
            return ""
        nearest = nearest_wire(s.report.wires, self.aim.enu_m)
        return "" if nearest is None or nearest[1] > corridor_radius_m(self.parameters) else ": wire"

    def is_battery_low(self, s: Situation) -> bool:
        """Return whether the charge is at or below the one at which to land."""
        return s.battery_pct is not None and 0 < self.parameters.battery_land_pct >= s.battery_pct

    def soonest_zone(self, s: Situation) -> Zone | None:
        """Return the usable zone that is reached soonest, None without one."""
        found = self.soonest_zone_and_s(s)
        return None if found is None else found[0]

    def soonest_zone_and_s(self, s: Situation) -> tuple[Zone, float] | None:
        """Return the usable zone that is reached soonest, and the time until touchdown (s)."""
        if s.report is None or s.position_enu_m is None:
            return None
        endurance_s = self.endurance.left_s(s.now_ns)
        return soonest(
            s.report, self.refused, self.parameters, s.position_enu_m, s.wind, endurance_s,
            lambda zone: self.is_inside_fence(s, zone),
        )  # fmt: skip


def bracketed(cause: str, most: int) -> str:
    """Return the cause's first words in a text, so long that this is one STATUSTEXT; "" without one."""
    words = shorten(cause.partition(":")[0], most, placeholder="") or cause[:most]
    return f" ({words})" if cause else ""
