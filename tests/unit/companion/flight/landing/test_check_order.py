"""Order in which each phase checks: of two events at once, the one that is first in the table decides."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

from companion.flight.geometry.geofence import Geofence
from companion.flight.geometry.wind import Wind
from companion.flight.landing import interruptions
from companion.flight.landing.situation import LandingRequest
from companion.flight.landing.ways.approach_path import ApproachPath
from slz import UNSAFE, Intrusion, MovingObject, SurfaceKind
from slz.surface.surface_kinds import UNKNOWN_SURFACE
from slz.terrain.footing import ANY_FOOTING
from tests.unit.companion.flight.landing.flight import (
    Flight,
    Phase,
    PointState,
    flown_to,
    zone,
)
from tests.unit.companion.flight.landing.ways.corridors import made

Event = Callable[[Flight], object]
S = 1_000_000_000
LOW_M = 4.0  # over the point: above the commit height, and low enough for a decision about moving objects
POINT = np.array([20.0, 0.0, 0.0])


def having(**values: object) -> Event:
    return lambda flight: [setattr(flight, name, value) for name, value in values.items()]


def progressed(**values: object) -> Event:
    return lambda flight: [setattr(flight.executive.progress, name, value) for name, value in values.items()]


def judged(state: PointState) -> Event:
    return having(state=lambda _height, _point: state)


def moving(radius_m: float) -> Event:
    def event(flight: Flight) -> None:
        one = MovingObject(1, flight.now_ns, POINT[:2], np.array([0.1, 0.0]), radius_m, 1.7)
        flight.moving = lambda _flight: (one,)

    return event


def landed(flight: Flight) -> None:
    flight.position[2] = 0.0
    flight.executive.progress.phase = Phase.LANDED
    flight.executive.progress.aim.set_target(POINT)


def gusts(flight: Flight) -> None:
    flight.wind = Wind(0.0, 15.0, 25.0, "autopilot")
    flight.step()


def began_without_position(flight: Flight) -> None:
    flight.blind = True
    assert flight.executive.orders.land_at_best(flight.situation()).accepted
    flight.blind = False


def unsafe_for_three_seconds(flight: Flight) -> None:
    judged(PointState.UNSAFE)(flight)
    flight.step()
    flight.time_s += 5.0


def blocked_up_to_the_highest(flight: Flight) -> None:
    having(blocked=lambda _flight: True)(flight)
    flight.position[:2] = 0.0
    flight.until(lambda f: f.texts.count("SLZ: obstacle ahead: climbing") == 6).run(0.2)
    flight.time_s += 3.0


def flying_out(flight: Flight) -> None:
    having(corridors=lambda _flight: replace(made(), enu_m=POINT))(flight)
    flight.until(lambda f: any("flying out" in text for text in f.texts))


def no_way_in(flight: Flight) -> None:
    having(corridors=lambda _flight: replace(made(all_of=int(UNSAFE)), enu_m=POINT))(flight)
    judged(PointState.SAFE)(flight)
    progressed(safe_since_ns=-10 * S)(flight)


def unseen(flight: Flight) -> None:
    judged(PointState.UNKNOWN)(flight)
    flight.time_s += 40.0


def without_gps(flight: Flight) -> None:
    flight.gps_lost = True
    flight.step()
    flight.intrusion = Intrusion(1.2, POINT, 0, 0)


late = progressed(late_ns=0)
no_lidar = having(lidar_ok=False)
beyond = having(fence=Geofence(lowest_m=20.0))
roof = having(surface=lambda _point: replace(UNKNOWN_SURFACE, kind=SurfaceKind.ROOF))
gear_stands_to_the_east = having(footing=replace(ANY_FOOTING, headings_deg=(90.0,)))
sloped = progressed(path=ApproachPath(0.0, 30.0, LOW_M, 50.0))
NOTES = None  # returns no commands: it notes or reports something, and the next check decides
OTHERWISE: Event = having()  # decides where nothing else does
# The checks of each phase in their order, and an event on which each decides.
TABLE: dict[Phase, dict[str, Event | None]] = {
    Phase.IDLE: {
        "landed": landed, "new_hand_over": NOTES, "automatic_start": having(mode="LOITER"),
        "inputs": having(fits=False), "climb": having(sees_ground=False), "wind": gusts, "start": OTHERWISE,
    },
    Phase.SURVEY: {
        "guided_mode": having(mode="LOITER"), "position": began_without_position, "scans": no_lidar,
        "wind": gusts, "ordered_point": progressed(request=LandingRequest(POINT)),
        "zone": having(zones=[zone(1, 20, 0)]), "question": NOTES,
        "search_time": progressed(since_ns=-400 * S),
        "look_aside": having(below=replace(UNKNOWN_SURFACE, water=0.6)), "corner": OTHERWISE,
    },
    Phase.APPROACH: {
        "scans": no_lidar, "arrival": NOTES, "point_unsafe": unsafe_for_three_seconds, "fence": beyond,
        "surface": roof, "obstacle": blocked_up_to_the_highest, "time_limit": late, "fly_out": flying_out,
        "way_down": no_way_in, "point_unseen": unseen, "way_over": OTHERWISE,
    },
    Phase.DESCEND: {
        "object_without_gps": without_gps, "crossing": moving(0.4), "point": judged(PointState.UNSAFE),
        "time_limit": late, "moving_in": moving(1.5), "approach_path": sloped,
        "land_mode": progressed(since_ns=-10 * S), "sink": OTHERWISE,
    },
    Phase.FINAL: {
        "object_without_gps": without_gps, "crossing": moving(0.4), "point": judged(PointState.UNSAFE),
        "heading": gear_stands_to_the_east, "landing_time": late, "moving_in": moving(1.5),
        "land_again": having(mode="GUIDED"), "target": OTHERWISE,
    },
    Phase.CLIMB: {
        "way_up": NOTES, "input_back": NOTES, "time_limit": NOTES, "guided_mode": having(mode="LOITER"),
        "height": having(position=np.array([20.0, 0.0, 8.0])), "scans": no_lidar,
        "steadiness": lambda flight: progressed(since_ns=flight.now_ns)(flight), "next_choice": OTHERWISE,
    },
    Phase.FAILSAFE: {"on_ground": having(armed=False), "next_mode": NOTES, "calm": NOTES},
}  # fmt: skip
SAME_CHECKS = {Phase.LANDED: Phase.IDLE, Phase.HOLD: Phase.CLIMB}
DECIDING = {phase: [name for name, event in row.items() if event] for phase, row in TABLE.items()}
PAIRS = [(phase, *names) for phase, deciding in DECIDING.items() for names in pairwise(deciding)]


def flying_in(phase: Phase, *events: str) -> Flight:
    """A flight in a phase in which nothing but the events decides; the last event happens first."""
    way = {"approach_path": "sloped"} if "fly_out" in events else {}
    flight = {
        Phase.IDLE: lambda: Flight([zone(1, 20, 0)]).run(0.1),
        Phase.SURVEY: lambda: Flight([]).fly_to(Phase.SURVEY).run(1),
    }.get(phase, lambda: flown_to(phase, **way))()
    if phase is Phase.SURVEY:
        flight.executive.progress.since_ns = -10 * S
    elif phase is not Phase.IDLE:
        height_m = {Phase.APPROACH: flight.position[2], Phase.CLIMB: 60.0}.get(phase, LOW_M)
        flight.position, flight.velocity = POINT + np.array([0.0, 0.0, height_m]), np.zeros(3)
        flight.step()
        flight.velocity = np.zeros(3)
        if phase in (Phase.CLIMB, Phase.FINAL):
            flight.executive.progress.since_ns = -10 * S
    for name in reversed(events):
        event = TABLE[phase][name]
        assert event is not None
        event(flight)
    return flight


@pytest.mark.parametrize("phase", Phase)
def test_the_checks_of_a_phase_are_those_of_the_table(phase: Phase) -> None:
    row = TABLE[SAME_CHECKS.get(phase, phase)]
    assert [check.__name__ for check in Flight([]).executive.checks[phase]] == list(row)  # type: ignore[attr-defined]


@pytest.mark.parametrize(("phase", "first", "second"), PAIRS)
def test_of_two_events_the_first_check_decides(phase: Phase, first: str, second: str) -> None:
    for events, expected in (((first, second), first), ((second,), second)):
        flight = flying_in(phase, *events)
        s, checks = flight.situation(), flight.executive.checks[phase]
        deciding = (check.__name__ for check in checks if check(s) is not None)  # type: ignore[attr-defined]
        assert next(deciding) == expected


def test_interruptions_are_checked_in_this_order() -> None:
    checks = Flight([]).executive.reactions.checks
    names = [check.__name__ for check in checks]  # type: ignore[attr-defined]
    assert names == ["void_abort", "refused_mode", "breach", "lost_pose", "late_landing"]


def test_every_event_has_a_file_that_the_list_names() -> None:
    listed = set(re.findall(r"^- `(\w+)`", interruptions.__doc__ or "", re.MULTILINE))
    files = {path.stem for path in Path(interruptions.__file__).parent.glob("*.py")}
    assert listed == files - {"__init__", "preconditions", "reactions"}
