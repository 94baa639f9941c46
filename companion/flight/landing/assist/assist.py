"""Assist: where the autopilot's own landings end.

LANDING_TARGET is at the nearest place that is safe to land on and reached on a straight free way, as long as
the vehicle is in the air and slz leads it nowhere. Autopilots follow it in landings alone: the pilot's, and
those of a failsafe, of RTL and of a mission. From the beginning of a landing the target stays where it is,
unless its place becomes unsafe and another is near. Nothing is commanded, except by `SLZ_ASSIST` act, where a
landing takes no target.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from companion.flight.landing.aim import Aim, PointSelection
from companion.flight.landing.assist.landing_here import Here, LandingHere
from companion.flight.landing.assist.landing_places import LandingPlace, is_landable, nearest_place
from companion.flight.landing.orders.confirmation import must_be_confirmed
from companion.flight.landing.pilot_texts import PilotTexts
from companion.flight.landing.situation import MissingInput, Severity, Situation, Vector, known
from companion.flight.landing.sticks import Pulses, are_moved
from companion.flight.landing.zone_choice import SoonestZone
from params import Parameters
from slz import PointState, Report

UNSAFE_NS = 250_000_000  # of a target's place, before another one is looked for
MAP_NS = 3_000_000_000  # in which a map that begins may come, at a start in a landing
LEFT_M = 5.0  # farther from the target than at the beginning: a mission that goes on, and no landing


@dataclass(slots=True)
class AssistTally:
    """Events so far, for the summary.

    led, moved: landings with a target, and targets that were moved. unled: why landings had none. off_m:
    distance from the target at each touchdown.
    """

    led: int = 0
    moved: int = 0
    unled: list[str] = field(default_factory=list)
    off_m: list[float] = field(default_factory=list)


@dataclass(slots=True)
class OwnLanding:
    """Landing under way. first_away_m: of its first target. ended: why it is led no more."""

    mode: str
    since_ns: int
    is_led: bool = False
    first_away_m: float = 0.0
    ended: str = ""
    is_told: bool = False
    unsafe_since_ns: int | None = None
    refused: list[Vector] = field(default_factory=list)


class Assist:
    """Target of the autopilot's own landings.

    Attributes
    ----------
    now
        What a landing here would find, by the newest report; None on the ground.
    aim
        Place of the target, while there is one.
    tally
        Events so far.
    """

    def __init__(
        self, parameters: Parameters, texts: PilotTexts, selection: PointSelection, soonest: SoonestZone
    ) -> None:
        self._p, self._texts, self._selection, self._soonest = parameters, texts, selection, soonest
        self.now: LandingHere | None = None
        self.aim, self.tally = Aim(), AssistTally()
        self._place: LandingPlace | None = None
        self._report: Report | None = None
        self._landing: OwnLanding | None = None
        self._rest_us: Pulses | None = None
        self._moved_in = ""  # mode of the landing in which the pilot moved the sticks
        self._has_acted = False

    @property
    def leads(self) -> bool:
        """True while a landing of the autopilot's follows the target."""
        return self._landing is not None and self._landing.is_led

    def target(self, s: Situation, *, commanding: bool) -> Vector | None:
        """Return the target (3,) to send where slz has none of its own, None for none.

        commanding: slz commands the vehicle, so that a landing is not the autopilot's own.
        """
        self._watch_sticks(s)
        landing = self._landing
        if landing is not None and (commanding or not s.armed or s.mode != landing.mode or self._goes_on(s)):
            self._end(landing, s)
        flies = s.connected and s.armed and s.on_ground is False
        self.now = self._look(s) if flies else None
        self._has_acted = self._has_acted and s.armed
        if self._p.assist == "off" or not (flies or self.leads):
            self._drop_target()
            return None
        if s.lands_itself and not commanding and self._landing is None:
            self._landing = OwnLanding(s.mode, s.now_ns)
        if self._landing is None:
            self._set_target(None if lost_of(s) else self._place)
        elif self._landing.is_led:
            self._lead(self._landing, s)
        elif not self._landing.ended:
            self._begin(self._landing, s)
        self.aim.follow(s)
        return None if self.aim.enu_m is None else self.aim.on_ground_enu_m

    def place_to_take_over(self, s: Situation) -> Vector | None:
        """Return the place (3,) to which slz shall lead a landing that takes no target; once in a flight."""
        landing, place = self._landing, self._place
        if self._p.assist != "act" or self._has_acted or landing is None or s.follows_target:
            return None
        if self.now is None or self.now.here is not Here.NEAR:
            return None
        if landing.ended or place is None or lost_of(s):
            return None
        self._has_acted = True
        return place.enu_m

    def change_frame(self, moved: Vector | None) -> None:
        """Forget places of the map before. moved: the target in the new one, None without one."""
        self._report = self._place = None
        if moved is None:
            self._drop_target()
        else:
            self.aim.set_target(moved)

    def move(self, jump_m: Vector) -> None:
        """Shift the target of a landing by a jump of the position estimate: the vehicle did not move."""
        self._report = self._place = None
        self.aim.move(jump_m)
        if self._landing is not None:
            self._landing.refused = [place + jump_m for place in self._landing.refused]

    # ---- parts ----------------------------------------------------------------------------------

    def _look(self, s: Situation) -> LandingHere:
        """Find the nearest place anew, once per report, and return what it means."""
        if s.report is self._report and s.report is not None and self.now is not None:
            return self.now
        self._report, landing = s.report, self._landing
        before = self.aim.enu_m if self._place is None else self._place.enu_m
        place = nearest_place(s, self._p, before, () if landing is None else landing.refused)
        self._place, here = place, s.position_enu_m
        if place is not None and here is not None:
            below = is_landable(s.report, here)
            return LandingHere(Here.SAFE if below else Here.NEAR, place.away_m, place.bearing_deg)
        zone = self._soonest.zone(s)
        return LandingHere() if zone is None or here is None else LandingHere.towards(here, zone.best.enu_m)

    def _watch_sticks(self, s: Situation) -> None:
        """Notice that the pilot moves the sticks in a landing, whoever began it."""
        if not s.lands_itself:
            self._rest_us, self._moved_in = s.sticks_us, ""
        elif are_moved(s.sticks_us, self._rest_us):
            self._moved_in = s.mode
        elif self._rest_us is None:
            self._rest_us = s.sticks_us

    def _begin(self, landing: OwnLanding, s: Situation) -> None:
        """Let the landing follow the nearest place, or say once why it does not."""
        place, lost, is_told = self._place, lost_of(s), landing.is_told
        now = self.now or LandingHere()
        if self._moved_in == s.mode:
            landing.ended = "sticks"
            self._texts.say(Severity.NOTICE, f"{s.mode}: sticks moved, not led")
        elif place is not None and not lost and s.follows_target:
            landing.is_led, landing.is_told, landing.first_away_m = True, False, place.away_m
            self.tally.led += 1
            self._aim_at(place)
            if now.here is Here.SAFE:
                self._texts.say(Severity.NOTICE, f"{s.mode}: safe below, led down")
            else:
                self._texts.say(Severity.NOTICE, f"{s.mode}: led {now.way} to safe ground")
        elif not is_told:
            landing.is_told = self._tell_why_not(s, lost, s.now_ns - landing.since_ns)

    def _tell_why_not(self, s: Situation, lost: str, lasts_ns: int) -> bool:
        """Say why a landing is not led, and return whether it was said; a map that begins is waited for."""
        say, now = self._texts.say, self.now or LandingHere()
        if not lost and not s.lidar_ok:
            if lasts_ns < MAP_NS:
                return False
            lost = s.no_map_reason.text
        if lost:
            say(Severity.CRITICAL, f"{s.mode}: {lost}, not led")
        elif now.here is Here.SAFE:
            say(Severity.NOTICE, f"{s.mode}: safe below, takes no target")
        elif now.here is Here.NEAR:
            say(Severity.CRITICAL, f"{s.mode}: safe is {now.way}, takes no target")
        elif now.way:
            say(Severity.CRITICAL, f"{s.mode}: nothing safe, nearest {now.way}")
        else:
            say(Severity.CRITICAL, f"{s.mode}: nothing safe in reach")
        self.tally.unled.append(lost or now.here.value)
        return True

    def _lead(self, landing: OwnLanding, s: Situation) -> None:
        """Keep the target, or move it where its place is unsafe and another one is near."""
        lost = lost_of(s)
        if lost:
            self._texts.say(Severity.CRITICAL, f"{s.mode}: {lost}, no longer led")
        elif self._moved_in == s.mode:
            self._texts.say(Severity.NOTICE, f"{s.mode}: sticks moved, no longer led")
        if lost or self._moved_in == s.mode:
            landing.is_led, landing.ended = False, lost or "sticks"
            self._drop_target()
            return
        if not self._is_unsafe(s) or self.aim.is_low(self._p):
            landing.unsafe_since_ns = None
            return
        if landing.unsafe_since_ns is None:
            landing.unsafe_since_ns = s.now_ns
        if s.intrusion is None and s.now_ns - landing.unsafe_since_ns < UNSAFE_NS:
            return
        target = known(self.aim.enu_m)
        if not any((target == one).all() for one in landing.refused):
            landing.refused.append(target)
        place = nearest_place(s, self._p, None, landing.refused)
        if place is not None:
            landing.unsafe_since_ns, landing.is_told = None, False
            self.tally.moved += 1
            self._place = place
            self._aim_at(place)
            way = LandingHere.towards(known(s.position_enu_m), place.enu_m).way
            self._texts.say(Severity.WARNING, f"target unsafe: led {way} instead")
        elif not landing.is_told:
            landing.is_told = True
            self._texts.say(Severity.CRITICAL, "target unsafe, none near: take over")

    def _is_unsafe(self, s: Situation) -> bool:
        """Return whether the newest report refuses the target's place; what it does not judge stays."""
        selected = s.selected
        if selected is None or not self.aim.is_at(selected) or selected.judged_by != "near":
            return False
        surface = selected.surface
        doubtful = surface.water > self._p.water_suspicion or must_be_confirmed(surface, self._p)
        return doubtful or selected.state is PointState.UNSAFE

    def _goes_on(self, s: Situation) -> bool:
        """Return whether the vehicle flies on, in a mode that lands at its end only."""
        landing = self._landing
        if landing is None or s.lands_itself:
            return False
        return not landing.is_led or self.aim.away_m > landing.first_away_m + LEFT_M

    def _end(self, landing: OwnLanding, s: Situation) -> None:
        """End a landing that touched down, or was left for another mode."""
        self._landing = None
        if not landing.is_led:
            return
        if (not s.armed or s.on_ground is True) and np.isfinite(self.aim.away_m):
            off_m = self.aim.away_m
            self.tally.off_m.append(round(off_m, 2))
            self._texts.say(Severity.NOTICE, f"{landing.mode}: landed, {off_m:.2f} m off the target")
        self._drop_target()

    def _aim_at(self, place: LandingPlace) -> None:
        """Lead a landing to a place, which is judged from the next report on."""
        self._set_target(place)
        self._selection.select(place.enu_m)

    def _set_target(self, place: LandingPlace | None) -> None:
        if place is None:
            self._drop_target()
        elif self.aim.enu_m is None or not np.array_equal(self.aim.enu_m, place.enu_m):
            self.aim.set_target(place.enu_m)

    def _drop_target(self) -> None:
        if self.aim.enu_m is not None:
            self.aim = Aim()


def lost_of(s: Situation) -> str:
    """Return the input that is lost without which a target would lead anywhere, else ""."""
    if s.estimate_lost:
        return f"{s.estimate_lost} lost"
    if s.position_enu_m is None or s.velocity_enu_ms is None:
        return MissingInput.POSITION_LOST.text
    return "GPS lost" if s.gps_lost and s.tracked is not True else ""
