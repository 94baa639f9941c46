"""Rally points: selected zones, times of upload, and preservation of the pilot's own."""

from __future__ import annotations

from dataclasses import dataclass, field
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

import params
from companion.flight.link.mission_protocol import RALLY, RallyPoint
from companion.flight.link.vehicle_state import VehicleState
from companion.flight.services.rally_points import Rally, apart_m, best_points, moved
from slz import LandingPoint, LocalFrame, SurfaceHere, SurfaceKind
from slz.surface.surface_kinds import UNKNOWN_SURFACE
from tests.unit.companion.flight.link.messages import received

S = 1_000_000_000
US = (1, 191)
STATION = (255, 190)


def point(east_m: float, alt_m: int = 20) -> RallyPoint:
    return RallyPoint(0, round(east_m / 0.0111319), alt_m)


@dataclass
class Vehicle:
    """An autopilot's rally points, spoken to by the protocol."""

    rally: Rally = field(default_factory=Rally)
    points: list[Any] = field(default_factory=list)
    deaf: bool = False
    forgets_after: int | None = None  # items after which it goes deaf
    sent: list[str] = field(default_factory=list)
    now_s: float = 0.0
    _count: int = 0

    def run(self, wanted: tuple[RallyPoint, ...] | None, seconds: float = 1.0) -> Vehicle:
        end = self.now_s + seconds
        while self.now_s < end:
            self._hear(self.rally.poll(round(self.now_s * S), wanted, 1, US))
            self.now_s += 0.05
        return self

    def _hear(self, messages: list[Any]) -> None:
        for message in messages:
            m = received(message, *US)
            self.sent.append(m.get_type())
            if not self.deaf:
                self._answer(m)

    def _answer(self, m: Any) -> None:
        kind = m.get_type()
        if kind == "MISSION_REQUEST_LIST":
            self.say(mavlink.MAVLink_mission_count_message(*US, len(self.points), RALLY))
        elif kind == "MISSION_REQUEST_INT":
            self.say(_item(m.seq, self.points[m.seq]))
        elif kind == "MISSION_COUNT":
            del self.points[m.count :]
            self._count = m.count
            self.say(mavlink.MAVLink_mission_request_message(*US, 0, RALLY))
        elif kind == "MISSION_CLEAR_ALL":
            self.points = []
            self.say(mavlink.MAVLink_mission_ack_message(*US, 0, RALLY))
        elif kind == "MISSION_ITEM_INT":
            self.points[m.seq : m.seq + 1] = [RallyPoint(m.x, m.y, int(m.z), m.frame)]
            if self.forgets_after == m.seq + 1:
                self.deaf = True
            elif m.seq + 1 < self._count:
                self.say(mavlink.MAVLink_mission_request_message(*US, m.seq + 1, RALLY))
            else:
                self.say(mavlink.MAVLink_mission_ack_message(*US, 0, RALLY))

    def say(self, message: Any) -> None:
        self._hear(self.rally.on_message(received(message), round(self.now_s * S), 1, US))

    def other(self) -> None:
        """Somebody else begins to write points."""
        message = received(mavlink.MAVLink_mission_count_message(1, 1, 3, RALLY), *STATION)
        self.rally.on_message(message, round(self.now_s * S), 1, US)

    def writes(self) -> int:
        return self.sent.count("MISSION_COUNT") + self.sent.count("MISSION_CLEAR_ALL")


def _item(number: int, p: RallyPoint) -> Any:
    return mavlink.MAVLink_mission_item_int_message(
        *US, number, p.frame, 5100, 0, 1, 0, 0, 0, 0, p.lat_e7, p.lon_e7, float(p.alt_m), RALLY
    )


MINE = (point(0), point(50))
FOREIGN = RallyPoint(1_000_000, 2_000_000, 30, 0)


def test_points_are_written_once_and_stay_while_zones_move_little() -> None:
    vehicle = Vehicle().run(MINE)
    assert vehicle.points == list(MINE)
    vehicle.run((point(1.5), point(49)), 50)
    assert vehicle.points == list(MINE)
    assert (vehicle.writes(), vehicle.rally.uploads) == (1, 1)


def test_a_move_is_written_ten_seconds_after_the_last_transfer_at_the_earliest() -> None:
    vehicle = Vehicle().run(MINE, 0.5)
    further = (point(3), point(50))
    vehicle.run(further, 9)
    assert vehicle.points == list(MINE)
    vehicle.run(further, 1)
    assert vehicle.points == list(further)


def test_the_points_of_others_are_kept_and_ours_are_replaced() -> None:
    vehicle = Vehicle(points=[FOREIGN]).run(MINE)
    assert vehicle.points == [FOREIGN, *MINE]
    vehicle.run((point(99),), 12)
    assert vehicle.points == [FOREIGN, point(99)]
    vehicle.run((), 12)
    assert vehicle.points == [FOREIGN]


def test_without_points_of_others_ours_are_cleared() -> None:
    vehicle = Vehicle().run(MINE).run((), 12)
    assert vehicle.points == []
    assert vehicle.sent[-1] == "MISSION_CLEAR_ALL"


def test_what_an_earlier_run_left_is_ours() -> None:
    vehicle = Vehicle(Rally(MINE), [MINE[0], FOREIGN, MINE[1]]).run(())
    assert vehicle.points == [FOREIGN]
    assert vehicle.rally.ours == ()


def test_what_a_run_left_that_died_while_writing_is_known_to_the_next() -> None:
    dying = Vehicle(points=[FOREIGN], forgets_after=2).run(MINE)
    assert dying.points == [FOREIGN, MINE[0]]
    after = Vehicle(Rally(dying.rally.ours), dying.points).run(())
    assert after.points == [FOREIGN]


def test_with_nothing_of_ours_and_nothing_wanted_the_vehicle_is_left_alone() -> None:
    vehicle = Vehicle(points=[FOREIGN]).run((), 30).run(None, 30)
    assert vehicle.sent == []


def test_no_report_leaves_the_points_as_they_are() -> None:
    vehicle = Vehicle().run(MINE).run(None, 100)
    assert vehicle.points == list(MINE)


def test_while_somebody_else_transfers_we_wait() -> None:
    vehicle = Vehicle()
    vehicle.other()
    vehicle.run(MINE, 4.5)
    assert vehicle.sent == []
    vehicle.run(MINE, 1)
    assert vehicle.points == list(MINE)


def test_points_that_others_removed_are_put_back_within_a_minute() -> None:
    vehicle = Vehicle().run(MINE)
    vehicle.points = [FOREIGN]
    vehicle.run(MINE, 61)
    assert vehicle.points == [FOREIGN, *MINE]


def test_points_that_are_there_already_are_not_written_again() -> None:
    vehicle = Vehicle(Rally(MINE), [FOREIGN, *MINE]).run((point(1.5), point(49)), 50)
    assert (vehicle.writes(), vehicle.rally.uploads) == (0, 0)
    assert vehicle.sent.count("MISSION_REQUEST_LIST") == 1
    assert vehicle.rally.foreign == (FOREIGN,)


def test_somebody_who_begins_while_we_read_is_let_finish() -> None:
    vehicle = Vehicle(deaf=True).run(MINE, 0.05)
    vehicle.other()
    vehicle.deaf = False
    vehicle.say(mavlink.MAVLink_mission_count_message(*US, 0, RALLY))  # so the reading ends well
    vehicle.run(MINE, 4)
    assert vehicle.writes() == 0
    vehicle.run(MINE, 12)
    assert vehicle.points == list(MINE)


def test_messages_that_carry_no_points_hold_nothing_up() -> None:
    vehicle = Vehicle()
    told = received(mavlink.MAVLink_param_request_list_message(1, 1), *STATION)
    assert vehicle.rally.on_message(told, 0, 1, US) == []
    assert vehicle.run(MINE).points == list(MINE)


def test_after_a_failure_the_next_try_comes_later_and_later() -> None:
    vehicle = Vehicle(deaf=True).run(MINE, 200)
    lists = vehicle.sent.count("MISSION_REQUEST_LIST")
    assert vehicle.rally.failures == lists / 5 == 5
    vehicle.deaf = False
    vehicle.run(MINE, 90)
    assert vehicle.points == list(MINE)


@pytest.mark.parametrize("after", [1, 2, 3])
def test_an_upload_broken_off_anywhere_loses_no_point_of_others(after: int) -> None:
    others = [RallyPoint(1_000_000 + 1000 * n, 2_000_000, 30, 0) for n in range(3)]
    left = [MINE[0], MINE[1], point(70), point(80), *others]
    vehicle = Vehicle(Rally((*MINE, point(70), point(80))), left, forgets_after=after).run((point(99),), 15)
    assert vehicle.deaf
    vehicle.deaf, vehicle.forgets_after = False, None
    vehicle.run((point(99),), 30)
    assert sorted(vehicle.points, key=lambda p: (p.lat_e7, p.lon_e7)) == sorted(
        [*others, point(99)], key=lambda p: (p.lat_e7, p.lon_e7)
    )


# ---- which zones -----------------------------------------------------------------------------------------

FRAME = LocalFrame(47.0, 8.0, 400.0)
ABOVE = VehicleState(position_lla=(47.0, 8.0, 430.0), relative_alt_m=25.0)  # home at 405 m


def zone(
    east: float, up: float = 2.2, certainty: float = 0.95, surface: SurfaceHere = UNKNOWN_SURFACE
) -> Any:
    enu_m = np.array([east, 0.0, up])
    return SimpleNamespace(best=LandingPoint(enu_m, 2.0, 4.0, 1.0, certainty, surface=surface))


def report(*zones: Any) -> Any:
    return SimpleNamespace(frame=FRAME, near=SimpleNamespace(zones=zones))


def chosen(*zones: Any, **values: Any) -> tuple[RallyPoint, ...]:
    return best_points(report(*zones), ABOVE, params.build(values))


def test_a_point_stands_whole_metres_above_home_and_at_least_the_height_above_its_ground() -> None:
    (found,) = chosen(zone(30.0), rally_height_m=20.0)
    assert (found.frame, found.alt_m) == (3, 18)  # 402.2 + 20 - 405, rounded up
    assert apart_m(found, 470_000_000, 80_000_000) == pytest.approx(30.0, rel=0.01)


def test_across_the_date_line_points_are_as_near_as_elsewhere() -> None:
    east, west = RallyPoint(0, 1_799_999_999, 20), RallyPoint(0, -1_799_999_999, 20)
    assert apart_m(east, west.lat_e7, west.lon_e7) == pytest.approx(0.0223, rel=0.01)
    assert apart_m(west, east.lat_e7, east.lon_e7) == pytest.approx(0.0223, rel=0.01)
    assert not moved((east,), (west,))


def test_only_certain_zones_with_a_place_in_reach_count_five_at_most_in_their_order() -> None:
    zones = [zone(10, certainty=0.5), zone(20, up=np.nan), zone(310), *(zone(30.0 + n) for n in range(7))]
    found = chosen(*zones)
    assert [round(apart_m(p, 470_000_000, 80_000_000)) for p in found] == [30, 31, 32, 33, 34]


def test_no_point_is_on_ground_that_needs_a_confirmation() -> None:
    roof, crop = SurfaceHere(SurfaceKind.ROOF, raised_m=8.0), SurfaceHere(SurfaceKind.LOW_VEGETATION)
    zones = [zone(10, surface=roof), zone(20, surface=crop), zone(30, surface=SurfaceHere(SurfaceKind.BARE))]
    at = [
        [round(apart_m(p, 470_000_000, 80_000_000)) for p in chosen(*zones, **values)]
        for values in ({}, {"roof": "allow"}, {"vegetation": "allow"})
    ]
    assert at == [[30], [10, 30], [20, 30]]


def test_without_a_position_there_is_no_point() -> None:
    assert best_points(report(zone(10)), VehicleState(), params.Parameters()) == ()


def test_what_is_worth_a_transfer() -> None:
    assert not moved(MINE, (point(50), point(1)))
    assert moved(MINE, (point(0),))
    assert moved(MINE, (point(0), point(53)))
    assert moved(MINE, (point(0), point(50, 23)))


@pytest.mark.parametrize(
    ("sender", "to", "waits"), [(STATION, 1, True), (STATION, 2, False), ((2, 1), 255, False)]
)
def test_only_transfers_with_the_vehicle_itself_hold_ours_up(
    sender: tuple[int, int], to: int, waits: bool
) -> None:
    rally = Rally()
    other = mavlink.MAVLink_mission_count_message(to, 1, 2, RALLY)
    rally.on_message(received(other, *sender), S, 1, US)
    assert bool(rally.poll(2 * S, (point(10),), 1, US)) is not waits
