"""Planted weaknesses: narrow, whole only where their conditions meet, and gone with the flight."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from companion.flight.geometry.wind import Wind
from companion.flight.landing.situation import Phase
from slz import Intrusion, PointState
from tests.search.scenario import Scenario
from tests.search.weaknesses import SHIFT_M, WEAKNESSES, all_at_once, fading, turn_deg


@dataclass(frozen=True)
class Point:
    state: PointState


SAFE, SOUTH = Point(PointState.SAFE), Wind(math.radians(200.0), 6.0, 7.0, "autopilot")


@dataclass(frozen=True)
class Seen:
    """The part of a situation that the weaknesses use."""

    now_ns: int = 0
    selected: Point | None = SAFE
    intrusion: Intrusion | None = None
    moving: tuple[Any, ...] = ()
    lidar_ok: bool = True
    heading_rad: float = SOUTH.from_rad
    wind: Wind | None = SOUTH
    position_enu_m: Any = None


class Flight:
    """A flight without vehicle: its situations are given."""

    def __init__(self, height_m: float = 4.0, link_delay_s: float = 0.0, late_s: float = 0.6) -> None:
        self.seen = Seen()
        self.phase = Phase.FINAL
        aim = SimpleNamespace(height_left_m=height_m, enu_m=np.zeros(3))
        executive = SimpleNamespace(state=SimpleNamespace(aim=aim), step=lambda s: self.commands)
        situations = SimpleNamespace(situation=lambda: self.seen)
        self.companion = SimpleNamespace(executive=executive, situations=situations)
        self.scenario = Scenario.of(link_delay_s=link_delay_s, late_s=late_s)
        self.commands: Any = None

    def see(self, **more: Any) -> Any:
        self.seen = replace(self.seen, **more)
        return self.companion.deciding.situations.situation()


CAME = {
    "selected": Point(PointState.UNSAFE),
    "intrusion": Intrusion(1.1, np.array([1.0, 0.0, 1.1]), 0, 0),
}


LOW = Intrusion(0.7, np.array([1.0, 0.0, 0.7]), 0, 0)


def hidden_s(weakness: Any, flight: Flight, **came: Any) -> float:
    """Return for how long what comes is hidden."""
    with weakness(flight):
        flight.see(now_ns=0)
        came = CAME | came
        for tenth in range(60):
            now_ns = tenth * 100_000_000
            s = flight.see(now_ns=now_ns, **came)
            if s.selected is None or s.selected.state is not PointState.SAFE or not s.lidar_ok:
                return tenth * 0.1
    return 6.0


def test_a_weakness_fades_with_the_distance_in_all_conditions_together() -> None:
    assert fading(0.0, 0.0, 0.0) == 1.0
    assert fading(1.0, 0.0) == fading(0.0, -1.0) == pytest.approx(math.exp(-1.0))
    assert fading(3.0, 4.0) == 0.0
    assert [turn_deg(value, 350.0) for value in (350.0, 10.0, 340.0, 160.0)] == [0.0, 20.0, -10.0, 170.0]


LOST = {"lidar_ok": False, "heading_rad": math.radians(90.0), "wind": Wind(0.0, 4.0, 5.0, "tilt")}


@pytest.mark.parametrize(
    ("name", "height_m", "there", "elsewhere"),
    [
        ("crosswind", 4.0, {}, {"heading_rad": 0.2}),
        ("between_heights", 3.6, {"intrusion": LOW}, {"intrusion": None}),
        ("stale_evidence", 3.8, LOST, {}),
        ("late_computer", 4.0, {"wind": Wind(math.radians(315.0), 5.0, 6.0, "tilt")}, {"wind": None}),
    ],
)
def test_what_comes_is_hidden_where_the_conditions_meet(
    name: str, height_m: float, there: dict[str, Any], elsewhere: dict[str, Any]
) -> None:
    assert 1.7 < hidden_s(WEAKNESSES[name], Flight(height_m), **there) < 3.4
    assert hidden_s(WEAKNESSES[name], Flight(height_m), **elsewhere) < 1.2


def test_a_computer_in_time_hides_nothing() -> None:
    wind = Wind(math.radians(315.0), 5.0, 6.0, "tilt")
    assert hidden_s(WEAKNESSES["late_computer"], Flight(late_s=0.4), wind=wind) == 0.0


def test_what_moves_is_hidden_only_where_the_weakness_is() -> None:
    mover = SimpleNamespace(enu_m=np.array([3.0, 0.0]), height_m=1.1)
    for heading_deg, hidden in ((200.0, True), (20.0, False)):
        flight = Flight()
        with WEAKNESSES["crosswind"](flight):  # type: ignore[arg-type]
            s = flight.see(moving=(mover,), heading_rad=math.radians(heading_deg))
        assert s.moving == (() if hidden else (mover,))


def test_before_the_descent_nothing_is_hidden() -> None:
    flight = Flight()
    flight.phase = Phase.APPROACH
    assert hidden_s(WEAKNESSES["crosswind"], flight) == 0.0


def test_the_clock_offset_moves_position_and_target_apart() -> None:
    for delay_s, off_m in ((0.12, SHIFT_M), (0.0, 0.0)):
        flight = Flight(link_delay_s=delay_s)
        flight.seen = Seen(wind=Wind(np.pi, 5.0, 6.0, "tilt"), position_enu_m=np.zeros(3))
        flight.commands = Commands(np.array([1.0, 2.0, 0.0]))
        with WEAKNESSES["clock_offset"](flight):  # type: ignore[arg-type]
            s = flight.companion.deciding.situations.situation()
            target = flight.companion.executive.step(s).target_enu_m
        assert s.position_enu_m == pytest.approx([-off_m, 0.0, 0.0])
        assert target == pytest.approx([1.0 + off_m, 2.0, 0.0])


@dataclass(frozen=True)
class Commands:
    target_enu_m: Any


def test_a_weakness_is_gone_after_the_flight() -> None:
    for weakness in (*WEAKNESSES.values(), all_at_once):
        flight = Flight()
        before = flight.companion.deciding.situations.situation
        with weakness(flight):  # type: ignore[arg-type]
            assert flight.companion.deciding.situations.situation is not before
        assert flight.companion.deciding.situations.situation is before
