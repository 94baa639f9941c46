"""Point mass that obeys commands, to fly the executive without a simulator."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import MISSING, fields, replace

import numpy as np

import params
from companion.flight.landing.executive import Executive
from companion.flight.landing.situation import MissingInput, Phase, Severity, Situation, VehicleCommands
from slz import (
    Box,
    Choice,
    Corridors,
    Grid,
    LandingPoint,
    LocalFrame,
    MapReport,
    MovingObject,
    Nearby,
    PointState,
    Report,
    SelectedPoint,
    SurfaceHere,
    Wire,
    Zone,
)
from slz.surface.surface_kinds import UNKNOWN_SURFACE
from slz.terrain.footing import ANY_FOOTING

STEP_S, TURN_DEGS = 0.1, 30.0
GUIDED_PHASES = [Phase.SURVEY, Phase.APPROACH, Phase.DESCEND, Phase.CLIMB, Phase.HOLD]
FRAME = LocalFrame(47.0, 8.0, 400.0)
GRID = Grid(-200, -200, 0.2, 2000, 2000)

OTHERWISE = {"fit", "blocked", "no_map_reason", "heading_rad", "blocked_above", "moving", "asked_enu_ms"}
# Attributes of a flight that its situation shows unchanged, and their values at the beginning.
AS_IN_SITUATION = {
    field.name: field.default
    for field in fields(Situation)
    if field.default is not MISSING and field.name not in OTHERWISE
} | {"connected": True, "armed": True, "lidar_ok": True, "battery_pct": 80.0}


def zone(
    zone_id: int,
    east: float,
    north: float,
    clearance: float = 5.0,
    certainty: float = 0.99,
    surface: SurfaceHere = UNKNOWN_SURFACE,
) -> Zone:
    """A zone of which only what the executive reads is filled in."""
    best = LandingPoint(np.array([east, north, 0.0]), clearance, 2 * clearance, 1.0, certainty)
    best = replace(best, surface=surface)
    empty = np.zeros((0, 2), np.int32)
    return Zone(
        id=zone_id,
        box=Box(0, 1, 0, 1),
        cells=np.ones((1, 1), np.uint8),
        area_m2=100.0,
        certainty=1.0,
        n_safe=1,
        n_unsafe=0,
        n_uncertain=0,
        slope_deg=1.0,
        roughness=0.01,
        boundary_cells=empty,
        corners_enu_m=np.zeros((0, 3)),
        obstacles=(),
        best=best,
    )


class Flight:
    """Executive, point mass and an operator's view of both."""

    def __init__(
        self, zones: list[Zone], *, auto: bool = True, height: float = 30.0, **settings: object
    ) -> None:
        self.parameters = params.build({"survey_s": 5.0, **settings})
        self.executive = Executive(self.parameters, auto)
        self.zones = zones
        self.mode = "GUIDED"
        self.state: Callable[[float, np.ndarray], PointState] = lambda _height, _point: PointState.SAFE
        for name, value in AS_IN_SITUATION.items():
            setattr(self, name, value)
        self.obeys = self.sinks = self.turns = True
        self.blind = False
        self.estimate_is_off_m = np.zeros(3)
        self.position = np.array([0.0, 0.0, height])
        self.velocity = self.velocity_wanted = np.zeros(3)
        self.selected: np.ndarray | None = None
        self.time_s = 0.0
        self.texts: list[str] = []
        self.severities: list[Severity] = []
        self.phases: list[Phase] = [Phase.IDLE]
        self.commands: list[tuple[float, Phase, str, VehicleCommands]] = []
        self.blocked: Callable[[Flight], bool] = lambda _flight: False
        self.blocked_above: Callable[[Flight], bool] = lambda _flight: False
        self.corridors: Callable[[Flight], Corridors | None] = lambda _flight: None
        self.wires: tuple[Wire, ...] = ()
        self.flown: np.ndarray | None = None  # velocity flown whatever is asked
        self.push = np.zeros(3)  # added to the velocity flown: wind, or another's hand
        self.home_m = 0.0  # height of home over the ground below
        self.fits = self.landed_state_known = self.sees_ground = True
        self.asked: np.ndarray | None = None
        self.lost = MissingInput.LIDAR_LOST
        self.far_zones: list[Zone] = []
        self.prior_zones: list[Zone] = []
        self.heading_deg: float | None = 0.0
        self.footing = ANY_FOOTING
        self.around: Nearby | None = None
        self.moving: Callable[[Flight], tuple[MovingObject, ...]] = lambda _flight: ()
        self.surface: Callable[[np.ndarray], SurfaceHere] = self.surface_of_zone

    @property
    def now_ns(self) -> int:
        return round(self.time_s * 1e9)

    def situation(self) -> Situation:
        selected = None
        if self.selected is not None:
            state = self.state(float(self.position[2]), self.selected)
            selected = SelectedPoint(
                self.selected, state, "near", 0.0, 1.0, 0.05, 0.99, 1, None, self.footing
            )
            selected = replace(selected, surface=self.surface(self.selected), corridors=self.corridors(self))
        near, far = MapReport(GRID, tuple(self.zones)), MapReport(GRID, tuple(self.far_zones))
        height_m = float(self.position[2]) if self.sees_ground else math.nan
        choice = Choice(100.0, height_m, 0.0, False, 0, 1.0)
        report = Report(int(self.time_s) * 10**9, FRAME, near, far, choice, selected, 1000, 1000, 0, 0, {})
        prior = MapReport(GRID, tuple(self.prior_zones))
        report = replace(report, prior=prior, wires=self.wires, nearby=self.around)
        return Situation(
            now_ns=self.now_ns,
            guided=self.mode in ("GUIDED", "OFFBOARD"),
            landing=self.mode == "LAND",
            mode=self.mode,
            on_ground=bool(self.position[2] < 0.05) if self.landed_state_known else None,
            fit=self.fits,
            position_enu_m=None if self.blind else self.position + self.estimate_is_off_m,
            velocity_enu_ms=None if self.blind else self.velocity.copy(),
            height_above_home_m=float(self.position[2]) - self.home_m,
            report=report,
            selected=selected,
            blocked=self.blocked(self),
            no_map_reason=self.lost,
            heading_rad=None if self.heading_deg is None else math.radians(self.heading_deg),
            blocked_above=self.blocked_above(self),
            moving=self.moving(self),
            asked_enu_ms=self.asked,
            **{name: getattr(self, name) for name in AS_IN_SITUATION},
        )

    def surface_of_zone(self, point: np.ndarray) -> SurfaceHere:
        zones = [*self.zones, *self.far_zones, *self.prior_zones]
        here = [one for one in zones if np.hypot(*(one.best.enu_m - point)[:2]) < 1]
        return here[0].best.surface if here else UNKNOWN_SURFACE

    def step(self) -> VehicleCommands:
        commands = self.executive.step(self.situation())
        self.commands.append((self.time_s, self.executive.phase, self.mode, commands))
        self.texts += [text for _, text in commands.texts]
        self.severities += [severity for severity, _ in commands.texts]
        if self.executive.phase is not self.phases[-1]:
            self.phases.append(self.executive.phase)
        if commands.select_enu_m is not None:
            self.selected = commands.select_enu_m
        if self.obeys and commands.mode:
            self.mode = commands.mode.upper()
        self.asked = None
        if self.mode == "GUIDED" and commands.velocity_enu_ms is not None:
            self.velocity_wanted = self.velocity = commands.velocity_enu_ms.copy()
            if self.blocked(self):
                self.velocity = self.velocity * [0, 0, 1]
            if self.blocked_above(self):
                self.velocity[2] = min(0.0, self.velocity[2])
            self.asked = self.velocity.copy()
            if self.turns and commands.yaw_rad is not None and self.heading_deg is not None:
                left_deg = math.remainder(math.degrees(commands.yaw_rad) - self.heading_deg, 360)
                self.heading_deg += max(-TURN_DEGS * STEP_S, min(TURN_DEGS * STEP_S, left_deg))
        elif self.mode == "LAND":
            self.velocity = np.array([0.0, 0.0, -1.0 if self.sinks else 0.0])
        elif self.mode not in ("GUIDED", "LAND"):
            self.velocity = np.zeros(3)
        self.velocity = self.velocity + self.push if self.flown is None else self.flown
        self.position = self.position + self.velocity * STEP_S
        self.position[2] = max(0.0, self.position[2])
        self.time_s += STEP_S
        return commands

    def jump(self, *by_m: float) -> None:
        """Let the position estimate jump; the vehicle stays, and the map begins anew."""
        self.estimate_is_off_m = self.estimate_is_off_m + by_m
        self.epoch += 1
        self.selected = None

    def until(self, done: Callable[[Flight], bool], limit_s: float = 300.0) -> Flight:
        end = self.time_s + limit_s
        while not done(self):
            self.step()
            assert self.time_s < end, f"not in {limit_s} s: {self.executive.phase} {self.texts}"
        return self

    def fly_to(self, phase: Phase) -> Flight:
        return self.until(lambda f: f.executive.phase is phase)

    def having(self, **changes: object) -> Flight:
        """Let something happen to the vehicle, its sensors or its surroundings from now on."""
        for name, value in changes.items():
            assert hasattr(self, name), name
            setattr(self, name, value)
        return self

    def is_silent_since(self, first: int) -> bool:
        """Return whether no velocity, mode or target was commanded since a step."""
        return not any(
            one.velocity_enu_ms is not None or one.mode is not None or one.target_enu_m is not None
            for *_, one in self.commands[first:]
        )

    def silent_for(self, seconds: float) -> bool:
        """Fly on, and return whether nothing was commanded."""
        first = len(self.commands)
        return self.run(seconds).is_silent_since(first)

    def run(self, seconds: float) -> Flight:
        for _ in range(round(seconds / STEP_S)):
            self.step()
        return self


def flown_to(phase: Phase, **settings: object) -> Flight:
    """A flight in a phase; climbing and holding after an abort in the descent."""
    flight = Flight([zone(1, 20, 0)], **settings)
    if phase in (Phase.CLIMB, Phase.HOLD):
        flight.fly_to(Phase.DESCEND).run(3)
        if phase is Phase.HOLD:
            flight.executive.orders.abort(flight.situation())
        else:
            flight.state = lambda _height, _point: PointState.UNSAFE
        flight.fly_to(phase)
    else:
        flight.fly_to(phase)
    return flight


__all__ = ["FRAME", "GRID", "GUIDED_PHASES", "Flight", "Phase", "PointState", "flown_to", "replace", "zone"]
