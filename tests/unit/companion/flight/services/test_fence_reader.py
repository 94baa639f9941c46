"""Reading of the fence, from a scripted autopilot of either kind."""

from __future__ import annotations

import logging
import math
import struct
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from companion.flight.link.autopilot_health import Health
from companion.flight.link.autopilots.ardupilot import ARDUPILOT
from companion.flight.link.autopilots.autopilot_interface import OTHER
from companion.flight.link.autopilots.autopilot_interface import Autopilot as Kind
from companion.flight.link.autopilots.px4 import PX4
from companion.flight.link.mission_protocol import FENCE
from companion.flight.link.vehicle_state import VehicleState
from companion.flight.services.fence_reader import OWN_MARGIN_M, FenceReader
from slz import LocalFrame
from tests.unit.companion.flight.link.messages import received

S = 1_000_000_000
US, STATION = (1, 191), (255, 190)
HOME = (47.0, 8.0, 400.0)
FRAME = LocalFrame(*HOME)
INSIDE, OUTSIDE = (
    mavlink.MAV_CMD_NAV_FENCE_POLYGON_VERTEX_INCLUSION,
    mavlink.MAV_CMD_NAV_FENCE_POLYGON_VERTEX_EXCLUSION,
)
CIRCLE_INSIDE, CIRCLE_OUTSIDE = (
    mavlink.MAV_CMD_NAV_FENCE_CIRCLE_INCLUSION,
    mavlink.MAV_CMD_NAV_FENCE_CIRCLE_EXCLUSION,
)
FENCE_VALUES = {
    "FENCE_ENABLE": 1.0, "FENCE_TYPE": 7.0, "FENCE_RADIUS": 60.0,
    "FENCE_ALT_MAX": 50.0, "FENCE_ALT_MIN": -10.0, "FENCE_MARGIN": 3.0,
}  # fmt: skip
GF_VALUES = {"GF_ACTION": 2.0, "GF_MAX_HOR_DIST": 80.0, "GF_MAX_VER_DIST": 40.0}


def item(command: int, value: float, east: float, north: float) -> tuple[int, float, int, int]:
    lat, lon, _ = FRAME.lla([east, north, 0.0])
    return command, value, round(lat * 1e7), round(lon * 1e7)


def square(command: int, west: float, south: float, side: float) -> list[tuple[int, float, int, int]]:
    corners = [(west, south), (west + side, south), (west + side, south + side), (west, south + side)]
    return [item(command, 4, *corner) for corner in corners]


@dataclass
class Autopilot:
    """An autopilot with a fence, spoken to by the protocols."""

    parameters: dict[str, float]
    items: list[tuple[int, float, int, int]] = field(default_factory=list)
    kind: Kind = ARDUPILOT
    deaf_to: tuple[str, ...] = ()
    tells_absence: bool = False
    refuses: int | None = None
    home: tuple[float, float, float] | None = HOME
    fenced: bool = False
    guided: bool = False
    armed: bool = True
    connected: bool = True
    frame: int = mavlink.MAV_FRAME_GLOBAL
    reader: FenceReader = field(default_factory=FenceReader)
    sent: list[str] = field(default_factory=list)
    now_s: float = 1.0
    reboots: int = 0

    @property
    def vehicle(self) -> VehicleState:
        mode = self.kind.guided_mode if self.guided else "LOITER"
        return VehicleState(
            sysid=1, autopilot=self.kind, armed=self.armed, mode=mode or "", home_lla=self.home,
            reboots=self.reboots, health=Health(fenced=self.fenced),
        )  # type: ignore[arg-type]  # fmt: skip

    def run(self, seconds: float = 2.0, *, quiet: bool = True) -> Autopilot:
        end = self.now_s + seconds
        while self.now_s < end:
            now_ns = round(self.now_s * S)
            self._hear(self.reader.poll(now_ns, self.vehicle, self.connected, US, quiet=quiet))
            self.now_s += 0.05
        return self

    @property
    def known(self) -> bool:
        return self.reader.is_known(self.vehicle)

    def holds(self, east: float, north: float) -> bool:
        return self.reader.geofence(self.vehicle, FRAME).holds(np.array([east, north, 0.0]))

    def heights_m(self) -> tuple[float, float]:
        fence = self.reader.geofence(self.vehicle, FRAME)
        return fence.lowest_m, fence.highest_m

    def readings(self) -> int:
        return self.sent.count("MISSION_REQUEST_LIST")

    def say_value(self, name: str) -> None:
        value, kind = self.parameters[name], mavlink.MAV_PARAM_TYPE_REAL32
        if self.kind is PX4 and value == int(value):
            kind = mavlink.MAV_PARAM_TYPE_INT32
            value = struct.unpack("<f", struct.pack("<i", int(value)))[0]
        self.reader.on_parameter(
            received(mavlink.MAVLink_param_value_message(name.encode(), value, kind, 1, 0))
        )

    def _hear(self, messages: list[Any]) -> None:
        for m in messages:
            kind = m.get_type()
            self.sent.append(kind)
            if kind in self.deaf_to or getattr(m, "param_id", "") in self.deaf_to:
                continue
            if kind == "PARAM_REQUEST_READ":
                name = m.param_id.decode() if isinstance(m.param_id, bytes) else m.param_id
                if name in self.deaf_to:
                    continue
                if name in self.parameters:
                    self.say_value(name)
                elif self.tells_absence:
                    error = mavlink.MAV_PARAM_ERROR_DOES_NOT_EXIST
                    self.reader.on_parameter(
                        received(mavlink.MAVLink_param_error_message(*US, name.encode(), -1, error))
                    )
            elif self.refuses is not None:
                self._say(mavlink.MAVLink_mission_ack_message(*US, self.refuses, FENCE))
            elif kind == "MISSION_REQUEST_LIST":
                self._say(mavlink.MAVLink_mission_count_message(*US, len(self.items), FENCE))
            elif kind == "MISSION_REQUEST_INT":
                command, value, lat_e7, lon_e7 = self.items[m.seq]
                self._say(
                    mavlink.MAVLink_mission_item_int_message(
                        *US, m.seq, self.frame, command, 0, 1, value, 0, 0, 0, lat_e7, lon_e7, 0.0, FENCE
                    )
                )

    def _say(self, message: Any) -> None:
        self._hear(self.reader.on_mission(received(message), round(self.now_s * S), 1, US))


# ---- what the fence is ----------------------------------------------------------------------------


def test_circle_ceiling_and_areas_of_ardupilot_are_kept_with_its_margin_and_ours() -> None:
    autopilot = Autopilot(FENCE_VALUES, [*square(OUTSIDE, 10, 10, 10), item(CIRCLE_INSIDE, 50, 0, 0)]).run(5)
    assert autopilot.known
    margin = 3 + OWN_MARGIN_M
    assert [autopilot.holds(0, n) for n in (-50 + margin - 0.1, 50 - margin - 0.1, 50 - margin + 0.1)] == [
        False, True, False,
    ]  # fmt: skip
    north_m = (10 - margin - 0.1, 10 - margin + 0.1, 15, 20 + margin + 0.1)
    assert [autopilot.holds(15, n) for n in north_m] == [True, False, False, True]
    assert autopilot.heights_m() == (-math.inf, pytest.approx(50 - margin))


@pytest.mark.parametrize(
    ("changed", "holds_50_m", "highest_m"),
    [
        ({}, True, 45.0),
        ({"FENCE_TYPE": 1}, True, 45.0),
        ({"FENCE_TYPE": 2}, True, math.inf),
        ({"FENCE_RADIUS": 54}, False, 45.0),
        ({"FENCE_MARGIN_XY": 9}, False, 45.0),
        ({"FENCE_MARGIN": 9}, False, 39.0),
        ({"FENCE_ENABLE": 0, "FENCE_RADIUS": 30}, True, math.inf),
        ({"FENCE_ENABLE": 0, "FENCE_RADIUS": 30, "FENCE_AUTOENABLE": 3}, False, 45.0),
    ],
)
def test_parameters_of_ardupilot(changed: dict[str, float], holds_50_m: bool, highest_m: float) -> None:
    autopilot = Autopilot(FENCE_VALUES | changed).run(5)
    assert autopilot.known
    assert autopilot.holds(50, 0) is holds_50_m
    assert autopilot.heights_m()[1] == pytest.approx(highest_m)


def test_a_floor_is_kept_where_it_is_configured() -> None:
    assert Autopilot(FENCE_VALUES | {"FENCE_TYPE": 15}).run(5).heights_m()[0] == pytest.approx(-5.0)


def test_a_fence_that_a_switch_enabled_is_kept_though_its_parameter_says_no() -> None:
    autopilot = Autopilot(FENCE_VALUES | {"FENCE_ENABLE": 0}).run(5)
    assert autopilot.holds(100, 0)
    autopilot.fenced = True
    assert not autopilot.holds(100, 0)


@pytest.mark.parametrize(("options", "inside"), [(0, False), (2, True)])
def test_areas_of_inclusion_are_intersected_unless_the_option_unites_them(options: int, inside: bool) -> None:
    areas = [*square(INSIDE, -30, -20, 40), *square(INSIDE, 0, -20, 40)]
    autopilot = Autopilot(FENCE_VALUES | {"FENCE_OPTIONS": options}, areas).run(5)
    assert autopilot.known
    assert autopilot.holds(25, 0) is inside
    assert not autopilot.holds(0, 30)


def test_px4_distances_and_areas() -> None:
    autopilot = Autopilot(GF_VALUES, [item(CIRCLE_OUTSIDE, 10, 30, 0)], PX4).run(5)
    assert autopilot.known
    assert [autopilot.holds(0, n) for n in (77.9, 78.1)] == [True, False]
    assert [autopilot.holds(e, 0) for e in (17.9, 18.1, 42.1)] == [True, False, True]
    assert autopilot.heights_m() == (-math.inf, pytest.approx(38.0))


@pytest.mark.parametrize("changed", [{"GF_ACTION": 0}, {"GF_MAX_HOR_DIST": 0, "GF_MAX_VER_DIST": 0}])
def test_px4_without_an_action_or_a_distance_has_no_circle(changed: dict[str, float]) -> None:
    autopilot = Autopilot(GF_VALUES | changed, kind=PX4).run(5)
    assert autopilot.known
    assert autopilot.holds(500, 0)


@pytest.mark.parametrize("home_lon", [8.0, 179.95])
def test_edges_are_straight_in_degrees_as_the_autopilots_draw_them(home_lon: float) -> None:
    """Edges of 20 km: in the map frame the middle of the northern one is 8 m beyond the line of its ends."""
    frame = LocalFrame(HOME[0], home_lon, HOME[2])
    north_deg, south_deg = (round(frame.lla([0.0, north, 0.0])[0] * 1e7) for north in (100.0, -100.0))
    west_e7, east_e7 = (round(((home_lon + part + 180) % 360 - 180) * 1e7) for part in (-0.13, 0.13))
    corners = [(south_deg, west_e7), (south_deg, east_e7), (north_deg, east_e7), (north_deg, west_e7)]
    autopilot = Autopilot(GF_VALUES, [(INSIDE, 4, *corner) for corner in corners], PX4, home=None).run(5)
    fence = autopilot.reader.geofence(autopilot.vehicle, frame)
    rooms_m = fence.room_m(np.array([[0.0, 90.0], [0.0, -90.0], [50.0, 0.0]]))
    assert rooms_m == pytest.approx([10 - OWN_MARGIN_M, 10 - OWN_MARGIN_M, 100 - OWN_MARGIN_M], abs=0.1)


def test_the_point_of_return_is_no_boundary() -> None:
    back = item(mavlink.MAV_CMD_NAV_FENCE_RETURN_POINT, 0, 200, 0)
    assert Autopilot(FENCE_VALUES, [back]).run(5).known


# ---- unknown is not safe --------------------------------------------------------------------------


def test_nothing_is_known_before_it_is_read_or_where_it_is_not_answered(
    caplog: pytest.LogCaptureFixture,
) -> None:
    autopilot = Autopilot(FENCE_VALUES)
    assert not autopilot.known
    assert not Autopilot(FENCE_VALUES, deaf_to=("FENCE_RADIUS",)).run(60).known
    caplog.clear()
    half = Autopilot(FENCE_VALUES, deaf_to=("MISSION_REQUEST_LIST",))
    with caplog.at_level(logging.WARNING):
        assert not half.run(60).known
    assert [record.args for record in caplog.records] == [("items: timeout",)]
    assert not half.holds(58, 0)  # the circle is kept all the same
    half.deaf_to = ()
    assert half.run(20).known


def test_a_circle_without_a_home_is_unknown() -> None:
    autopilot = Autopilot(FENCE_VALUES, home=None).run(5)
    assert not autopilot.known
    autopilot.home = HOME
    assert autopilot.known


@pytest.mark.parametrize(
    "items",
    [
        square(INSIDE, 0, 0, 10)[:3],
        [item(INSIDE, 2, 0, 0), item(INSIDE, 2, 5, 5)],
        [item(INSIDE, 0, 0, 0)],
        [*square(INSIDE, 0, 0, 10)[:2], *square(OUTSIDE, 0, 0, 10)[:2]],
        [item(CIRCLE_INSIDE, 0, 0, 0)],
        [item(16, 0, 0, 0)],
        [(CIRCLE_INSIDE, 50, 950_000_000, 80_000_000)],
        [item(CIRCLE_INSIDE, math.nan, 0, 0)],
        [item(CIRCLE_INSIDE, 50, 0, 0)] * 1001,
    ],
    ids=["too few", "two corners", "none", "mixed", "no radius", "a waypoint", "no place", "NaN", "too many"],
)
def test_items_that_make_no_fence_are_unknown_and_those_before_are_kept(items: list[Any]) -> None:
    autopilot = Autopilot(FENCE_VALUES, square(INSIDE, -20, -20, 40)).run(5)
    assert autopilot.known
    autopilot.items = items
    assert not autopilot.run(40).known
    assert not autopilot.holds(30, 0)


def test_an_autopilot_without_a_fence_says_so_or_refuses_its_items() -> None:
    assert Autopilot({}, tells_absence=True).run(10).known
    assert Autopilot({}, refuses=mavlink.MAV_MISSION_UNSUPPORTED).run(10).known
    assert not Autopilot({}, refuses=mavlink.MAV_MISSION_DENIED).run(10).known
    assert not Autopilot({}).run(30).known


def test_items_in_a_local_frame_are_unknown() -> None:
    items = square(INSIDE, -20, -20, 40)
    assert not Autopilot(FENCE_VALUES, items, frame=mavlink.MAV_FRAME_LOCAL_NED).run(5).known
    assert Autopilot(FENCE_VALUES, items, frame=mavlink.MAV_FRAME_GLOBAL_TERRAIN_ALT).run(5).known


def test_unread_items_do_not_matter_to_a_fence_without_areas() -> None:
    deaf = Autopilot(FENCE_VALUES | {"FENCE_TYPE": 3}, deaf_to=("MISSION_REQUEST_LIST",)).run(60)
    assert deaf.known
    assert not deaf.holds(58, 0)


@pytest.mark.parametrize(
    ("sender", "kind"),
    [((1, 100), FENCE), ((2, 1), FENCE), ((1, 1), mavlink.MAV_MISSION_TYPE_MISSION)],
    ids=["a camera", "another vehicle", "a mission"],
)
def test_items_are_taken_from_the_autopilot_and_of_a_fence_alone(sender: tuple[int, int], kind: int) -> None:
    autopilot = Autopilot(FENCE_VALUES, square(OUTSIDE, 0, 0, 9), deaf_to=("MISSION_REQUEST_LIST",)).run(5)
    none = received(mavlink.MAVLink_mission_count_message(*US, 0, kind), *sender)
    assert not autopilot.reader.on_mission(none, round(autopilot.now_s * S), 1, US)
    assert not autopilot.run(1).known


def test_negative_margins_are_none() -> None:
    autopilot = Autopilot(FENCE_VALUES | {"FENCE_MARGIN": -9, "FENCE_MARGIN_XY": -9}).run(5)
    assert autopilot.heights_m()[1] == pytest.approx(50 - OWN_MARGIN_M)
    assert [autopilot.holds(east, 0) for east in (57, 59)] == [True, False]


def test_another_autopilot_is_not_asked() -> None:
    assert not Autopilot({}, kind=OTHER).run(5).sent


# ---- kept current ---------------------------------------------------------------------------------


def test_the_fence_is_read_again_each_half_minute_and_at_a_hand_over() -> None:
    autopilot = Autopilot(FENCE_VALUES).run(10)
    assert autopilot.readings() == 1
    autopilot.guided = True
    autopilot.run(10)
    assert autopilot.readings() == 2
    autopilot.items = [item(CIRCLE_OUTSIDE, 20, 0, 0)]
    assert not autopilot.run(32).holds(0, 0)


def test_the_fence_is_read_again_when_armed_and_when_the_link_is_back() -> None:
    autopilot = Autopilot(FENCE_VALUES, armed=False).run(6)
    autopilot.armed = True
    assert autopilot.run(6).readings() == 2
    autopilot.connected = False
    assert autopilot.run(6).readings() == 2
    autopilot.connected = True
    assert autopilot.run(6).readings() == 3


@pytest.mark.parametrize(
    ("vehicle", "kind"), [(7, FENCE), (1, mavlink.MAV_MISSION_TYPE_MISSION)], ids=["its own", "a mission"]
)
def test_a_transfer_with_another_vehicle_or_of_a_mission_changes_no_fence(vehicle: int, kind: int) -> None:
    autopilot = Autopilot(FENCE_VALUES).run(8)
    count = received(mavlink.MAVLink_mission_count_message(vehicle, 1, 1, kind), *STATION)
    autopilot.reader.on_mission(count, round(autopilot.now_s * S), 1, US)
    assert autopilot.run(12).readings() == 1


def test_a_parameter_that_is_changed_counts_within_seconds() -> None:
    autopilot = Autopilot(FENCE_VALUES).run(8)
    autopilot.parameters = FENCE_VALUES | {"FENCE_RADIUS": 25}
    autopilot.say_value("FENCE_RADIUS")
    assert not autopilot.run(6).holds(33, 0)
    for kind, values in ((ARDUPILOT, FENCE_VALUES), (PX4, GF_VALUES)):
        quiet = Autopilot(values, kind=kind).run(8)
        quiet.say_value(next(iter(values)))
        assert quiet.run(8).readings() == 1


def test_a_transfer_of_another_station_makes_it_read_again_when_that_is_over() -> None:
    autopilot = Autopilot(FENCE_VALUES).run(8)
    autopilot.items = [item(CIRCLE_OUTSIDE, 20, 0, 0)]
    count = received(mavlink.MAVLink_mission_count_message(1, 1, 1, FENCE), *STATION)
    autopilot.reader.on_mission(count, round(autopilot.now_s * S), 1, US)
    assert autopilot.run(4).readings() == 1
    assert not autopilot.run(6).holds(0, 0)


def test_a_parameter_that_some_versions_lack_keeps_its_value_while_it_is_not_answered() -> None:
    autopilot = Autopilot(
        FENCE_VALUES | {"FENCE_ENABLE": 0, "FENCE_AUTOENABLE": 3, "FENCE_MARGIN_XY": 9}
    ).run(8)
    autopilot.deaf_to = ("FENCE_AUTOENABLE", "FENCE_MARGIN_XY")
    assert autopilot.run(40).known
    assert autopilot.readings() == 2
    assert [autopilot.holds(east, 0) for east in (48, 50, 100)] == [True, False, False]


def test_the_circle_moves_with_home() -> None:
    autopilot = Autopilot(FENCE_VALUES).run(5)
    lat, lon, alt = FRAME.lla([100.0, 0.0, 7.0])
    autopilot.home = (float(lat), float(lon), float(alt))
    assert [autopilot.holds(e, 0) for e in (0, 100)] == [False, True]
    assert autopilot.heights_m()[1] == pytest.approx(52.0, abs=0.01)


def test_the_last_fence_holds_while_it_cannot_be_read_again_and_ends_with_a_reboot() -> None:
    autopilot = Autopilot(FENCE_VALUES).run(5)
    autopilot.deaf_to = ("PARAM_REQUEST_READ", "MISSION_REQUEST_LIST")
    assert autopilot.run(90).known
    assert not autopilot.holds(58, 0)
    autopilot.reboots = 1
    assert not autopilot.run(1).known


def test_it_waits_for_other_transfers() -> None:
    autopilot = Autopilot(FENCE_VALUES).run(10, quiet=False)
    assert autopilot.readings() == 0
    assert not autopilot.known
    assert autopilot.run(1).known


def test_the_same_fence_is_the_same_object() -> None:
    autopilot = Autopilot(FENCE_VALUES).run(5)
    fence = autopilot.reader.geofence(autopilot.vehicle, FRAME)
    assert autopilot.reader.geofence(autopilot.vehicle, replace(FRAME)) is fence
