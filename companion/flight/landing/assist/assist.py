"""Assist: where the autopilot's own landings end.

LANDING_TARGET is at the nearest place that is safe to land on and reached on a straight free way, as long as
the vehicle is in the air and slz leads it nowhere. Autopilots follow it in landings alone: the pilot's, and
those of a failsafe, of RTL and of a mission. From the beginning of a landing the target stays where it is,
unless its place, or the way there, becomes unsafe and another is near. A landing that is not led has no
target. Nothing is commanded, except by `SLZ_ASSIST` act, where a landing takes no target.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from companion.flight.landing.aim import Aim, PointSelection
from companion.flight.landing.assist.landing_here import Here, LandingHere
from companion.flight.landing.assist.landing_places import (
    LOW_M,
    LandingPlace,
    is_landable,
    is_way_free,
    nearest_place,
)
from companion.flight.landing.assist.own_landing import SECOND, AssistTally, OwnLanding, lost_of, why_not_led
from companion.flight.landing.landing_progress import LandingProgress
from companion.flight.landing.orders.confirmation import must_be_confirmed
from companion.flight.landing.pilot_texts import PilotTexts
from companion.flight.landing.situation import Severity, Situation, Vector, known
from companion.flight.landing.sticks import StickWatch
from companion.flight.landing.ways.endurance import is_battery_low
from companion.flight.landing.zone_choice import SoonestZone
from params import Parameters
from slz import PointState, Report

UNSAFE_NS = SECOND // 4  # of a target's place or way, before another one is looked for
LOST_NS = SECOND  # of position, GPS or estimate, before the target is withdrawn
ASTRAY_M, ASTRAY_BELOW_M, ASTRAY_NS = 2.0, 6.0, 2 * SECOND  # so far aside and so low, it follows no target
MAP_NS = 3 * SECOND  # in which a map that begins may come, at a start in a landing
HERE_M = 2.5  # a place nearer than this is below
SELECT_NS = SECOND  # a report judges the target so long after it was selected


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
    has_acted
        Whether slz took a landing of this flight over, which it does once.
    """

    def __init__(
        self,
        parameters: Parameters,
        progress: LandingProgress,
        texts: PilotTexts,
        selection: PointSelection,
        soonest: SoonestZone,
    ) -> None:
        self._p, self._progress, self._texts = parameters, progress, texts
        self._selection, self._soonest = selection, soonest
        self.now: LandingHere | None = None
        self.aim, self.tally = Aim(), AssistTally()
        self._place: LandingPlace | None = None
        self._report: Report | None = None
        self._landing: OwnLanding | None = None  # of the present mode
        self._sticks = StickWatch()
        self._selected_ns = 0
        self.has_acted = False

    @property
    def leads(self) -> bool:
        """True while a landing of the autopilot's follows the target."""
        return self._landing is not None and self._landing.is_led

    def target(self, s: Situation, *, commanding: bool) -> Vector | None:
        """Return the target (3,) to send where slz has none of its own, None for none.

        commanding: slz commands the vehicle, so that a landing is not the autopilot's own.
        """
        flies = s.connected and s.armed and s.on_ground is False
        self.now = self._look(s) if flies else None
        self.has_acted = self.has_acted and s.armed
        self._follow_mode(s)
        landing = self._landing
        if (commanding and s.lands_itself) or not (flies or self.leads):
            self._stop_leading(landing)
        elif landing is not None and landing.is_led and not flies:
            pass  # on the ground: the target stays until it is disarmed
        elif landing is not None and s.lands_itself and landing.is_led:
            self._lead(landing, s)
        elif self._p.assist == "off":
            self._stop_leading(landing)
        elif landing is not None and s.lands_itself:
            self._begin(landing, s)
        else:
            self._offer(landing, s)
        self.aim.follow(s)
        self._progress.leads_own_landing = self.leads
        return None if self.aim.enu_m is None else self.aim.on_ground_enu_m

    def place_to_take_over(self, s: Situation) -> Vector | None:
        """Return the place (3,) to which slz shall lead a landing that takes no target, None for none."""
        landing, place = self._landing, self._place
        if self._p.assist != "act" or self.has_acted or landing is None or place is None:
            return None
        takes_none = s.lands_itself and not s.follows_target and not landing.has_moved_sticks
        height_m = 0.0 if s.position_enu_m is None else float(s.position_enu_m[2] - place.enu_m[2])
        good = s.battery_pct is not None and not is_battery_low(s, self._p) and not s.gps_glitching
        is_near = self.now is not None and self.now.here is Here.NEAR
        fits = takes_none and good and is_near and height_m >= LOW_M and s.lidar_ok and not lost_of(s)
        return place.enu_m if fits else None

    def forget(self) -> None:
        """Forget places: the position estimate jumped, or a new map begins."""
        self._report = self._place = None

    def change_frame(self, moved: Callable[[Vector], Vector]) -> None:
        """Convert the target and refused places to another map frame; `moved` maps a point to it."""
        self.forget()
        if self.aim.enu_m is not None:
            self.aim.set_target(moved(self.aim.on_ground_enu_m))
        if self._landing is not None:
            self._landing.refused = [moved(place) for place in self._landing.refused]

    def move(self, jump_m: Vector) -> None:
        """Shift the target of a landing by a jump of the position estimate: the vehicle did not move."""
        self.forget()
        self.aim.move(jump_m)
        if self._landing is not None:
            self._landing.refused = [place + jump_m for place in self._landing.refused]

    # ---- parts ----------------------------------------------------------------------------------

    def _look(self, s: Situation) -> LandingHere:
        """Find the nearest place anew, once per report, and return what it means."""
        if not s.lidar_ok:
            self._report = self._place = None
            return LandingHere(Here.UNKNOWN)
        if s.report is self._report and self.now is not None:
            return self.now
        self._report, landing = s.report, self._landing
        before = self.aim.enu_m if self._place is None else self._place.enu_m
        place = nearest_place(s, self._p, before, () if landing is None else landing.refused)
        self._place, here = place, s.position_enu_m
        if place is not None and here is not None:
            below = place.away_m <= HERE_M and is_landable(s.report, here)
            return LandingHere(Here.SAFE if below else Here.NEAR, place.away_m, place.bearing_deg)
        zone = self._soonest.zone(s)
        return LandingHere() if zone is None or here is None else LandingHere.towards(here, zone.best.enu_m)

    def _follow_mode(self, s: Situation) -> None:
        """Begin and end the memory of a landing with its mode."""
        landing = self._landing
        if landing is not None and (not s.armed or s.mode != landing.mode):
            self._tell_touchdown(landing, s)
            self._landing = landing = None
        if s.lands_itself and landing is None:
            self._landing = landing = OwnLanding(s.mode, s.now_ns)
        if not s.lands_itself:
            self._sticks.note_rest(s.sticks_us)
        elif landing is not None and self._sticks.are_moved(s.sticks_us):
            # In a failsafe they may be those of a receiver that hears nobody; the autopilot drops its target.
            landing.has_moved_sticks |= not s.failsafe

    def _offer(self, landing: OwnLanding | None, s: Situation) -> None:
        """Send the nearest place, or that of a landing that flies there level, as on PX4, while in reach."""
        if landing is not None:
            landing.is_led = False
        before = None if landing is None or not landing.told else self.aim.enu_m
        if lost_of(s):
            self._drop_target()
        elif before is None or not (is_landable(s.report, before) and is_way_free(s, self._p, before)):
            self._set_target(self._place)

    def _begin(self, landing: OwnLanding, s: Situation) -> None:
        """Let the landing follow the nearest place; without one it has no target, and the pilot reads why."""
        place, now = self._place, self.now or LandingHere()
        if landing.has_moved_sticks:
            if landing.is_new("sticks"):
                self._texts.say(Severity.NOTICE, f"{s.mode}: sticks moved, not led")
        elif place is not None and not lost_of(s) and s.follows_target:
            landing.is_led = True
            self.tally.led += landing.is_new("led")
            self._aim_at(place, s)
            if now.here is Here.SAFE:
                if landing.is_new("below"):
                    self._texts.say(Severity.NOTICE, f"{s.mode}: safe below, led down")
            elif landing.is_new(f"{place.enu_m.round()}"):
                self._texts.say(Severity.NOTICE, f"{s.mode}: led {now.way} to safe ground")
            return
        else:
            self._tell_why_not(landing, s)
        self._drop_target()

    def _tell_why_not(self, landing: OwnLanding, s: Situation) -> None:
        """Say once why a landing is not led; a map that has just begun is waited for."""
        begins = not s.lidar_ok and not lost_of(s) and s.now_ns - landing.since_ns < MAP_NS
        if not begins and landing.is_new("why not"):
            severity, text = why_not_led(s, self.now or LandingHere())
            self._texts.say(severity, f"{s.mode}: {text}")
            self.tally.unled.append(text)

    def _lead(self, landing: OwnLanding, s: Situation) -> None:
        """Keep the target, or move it where its place or way is unsafe and another one is near."""
        lost = lost_of(s)
        if landing.has_moved_sticks:
            self._texts.say(Severity.NOTICE, f"{s.mode}: sticks moved, no longer led")
        elif landing.lasts_ns("lost", bool(lost), s.now_ns) >= LOST_NS:
            self._texts.say(Severity.CRITICAL, f"{s.mode}: {lost}, no longer led")
            landing.told.add("why not")
        else:
            self._watch_target(landing, s)
            return
        landing.is_led = False
        self._drop_target()

    def _watch_target(self, landing: OwnLanding, s: Situation) -> None:
        """Move an unsafe target, and call the pilot for one that stays or is not followed."""
        now_ns = s.now_ns
        if not self.aim.is_at(s.selected) and now_ns - self._selected_ns >= SELECT_NS:  # a new map began
            self._select(known(self.aim.enu_m), s)
        astray = self.aim.away_m > ASTRAY_M and self.aim.height_left_m < ASTRAY_BELOW_M
        if landing.lasts_ns("astray", astray, now_ns) >= ASTRAY_NS and landing.is_new("astray"):
            self._texts.say(Severity.CRITICAL, "target not followed: take over")
        unsafe_ns = landing.lasts_ns("unsafe", self._is_unsafe(s), now_ns)
        if unsafe_ns < 0 or (s.intrusion is None and unsafe_ns < UNSAFE_NS):
            return
        place = None if self.aim.is_low(self._p) else self._other_place(landing, s)
        if place is not None:
            landing.lasting.clear()
            landing.told -= {"none near", "astray"}
            self.tally.moved += 1
            self._aim_at(place, s)
            way = LandingHere.towards(known(s.position_enu_m), place.enu_m).way
            self._texts.say(Severity.WARNING, f"target unsafe: led {way} instead")
        elif landing.is_new("none near"):
            self._texts.say(Severity.CRITICAL, "target unsafe, none near: take over")

    def _other_place(self, landing: OwnLanding, s: Situation) -> LandingPlace | None:
        """Return the nearest place beside the target and those refused before, None without one."""
        target = known(self.aim.enu_m)
        if not any((target == one).all() for one in landing.refused):
            landing.refused.append(target)
        self._place = None if s.position_enu_m is None else nearest_place(s, self._p, None, landing.refused)
        return self._place

    def _is_unsafe(self, s: Situation) -> bool:
        """Return whether the newest report refuses the target's place, or the way to one that is far.

        What it does not judge stays; near the ground only what came counts.
        """
        selected = s.selected
        if selected is not None and self.aim.is_at(selected) and selected.judged_by == "near":
            if self.aim.is_low(self._p):
                return s.intrusion is not None
            surface = selected.surface
            doubtful = surface.water > self._p.water_suspicion or must_be_confirmed(surface, self._p)
            if doubtful or selected.state is PointState.UNSAFE:
                return True
        far = self.aim.away_m > HERE_M and s.lidar_ok and not lost_of(s)
        return far and not is_way_free(s, self._p, known(self.aim.enu_m))

    def _tell_touchdown(self, landing: OwnLanding, s: Situation) -> None:
        off_m = self.aim.away_m
        if landing.is_led and (not s.armed or s.on_ground is True) and np.isfinite(off_m):
            self.tally.off_m.append(round(off_m, 2))
            self._texts.say(Severity.NOTICE, f"{landing.mode}: landed, {off_m:.2f} m off the target")

    def _stop_leading(self, landing: OwnLanding | None) -> None:
        if landing is not None:
            landing.is_led = False
        self._drop_target()

    def _aim_at(self, place: LandingPlace, s: Situation) -> None:
        """Lead a landing to a place, which is judged from the next report on."""
        self._set_target(place)
        self._select(place.enu_m, s)

    def _select(self, enu_m: Vector, s: Situation) -> None:
        self._selection.select(enu_m)
        self._selected_ns = s.now_ns

    def _set_target(self, place: LandingPlace | None) -> None:
        if place is None:
            self._drop_target()
        elif self.aim.enu_m is None or not np.array_equal(self.aim.enu_m, place.enu_m):
            self.aim.set_target(place.enu_m)

    def _drop_target(self) -> None:
        if self.aim.enu_m is not None:
            self.aim = Aim()
