"""Landings of the autopilot's own, with a LANDING_TARGET that is only offered, as measured on ArduCopter.

The measurements are 33 landings of ArduCopter 4.8.0-dev beside a script that streamed targets at 20 Hz and
commanded nothing. Wind is off; all touchdowns are within 0.1 m of the target there, here within `ON_M`.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from sitl.autopilot.modes import Mode
from tests.unit.sitl.autopilot.targeted_flight import Place, TargetedFlight
from tests.unit.sitl.bench_flight import Bench

ON_M = 0.1
SPEED_SHARE = 0.15  # tolerance of a speed: ArduCopter's velocity loop overshoots more
LANDING, IN_AIR = mavlink.MAV_LANDED_STATE_LANDING, mavlink.MAV_LANDED_STATE_IN_AIR
FOUND, COMPLETE, LOST = "PrecLand: Target Found", "PrecLand: Init Complete", "PrecLand: Target Lost"
MEASURES, RETRYING = "PrecLand: Failsafe Measures", "PrecLand: Retrying"
QUICK = {"WPNAV_SPEED": 1000.0, "WPNAV_SPEED_UP": 500.0, "WPNAV_SPEED_DN": 250.0, "LAND_SPEED": 100.0}
MEASURED = {"LAND_SPEED": 50.0, "WPNAV_SPEED_UP": 250.0}


class Flight(TargetedFlight):
    """Vehicle in GUIDED with a rangefinder, and a target (east, north) that is streamed while it is set."""

    def __init__(self, height_m: float, east_m: float = 0.0, **parameters: float) -> None:
        super().__init__(Bench(wind_ms=0.0))
        self.bench.autopilot.parameters.update(QUICK | parameters)
        self.speeds: list[float] = []
        self.tilts: list[float] = []
        self.bench.run(5.1)
        self.command(mavlink.MAV_CMD_DO_SET_MODE, 1, Mode.GUIDED)
        self.command(mavlink.MAV_CMD_COMPONENT_ARM_DISARM, 1)
        self.command(mavlink.MAV_CMD_NAV_TAKEOFF, 0, 0, 0, 0, 0, 0, height_m)
        self.run(height_m / 5 + 3)
        if east_m:
            self.bench.autopilot.navigator.guided.position_enu_m = np.array([east_m, 0, height_m])
            self.run(8)

    def command(self, number: int, *values: float) -> Flight:
        assert self.bench.command(number, *values) == 0
        return self

    def offer(self, east: float, north: float = 0.0, seconds: float = 2.3) -> Flight:
        """Stream a target for as long as its filter needs."""
        self.target = (east, north)
        return self.run(seconds)

    def enter(self, mode: Mode) -> Flight:
        """Change the mode, and forget what was recorded before."""
        for record in (self.heights, self.speeds, self.tilts, self.bench.sent):
            del record[:]
        return self.command(mavlink.MAV_CMD_DO_SET_MODE, 1, mode)

    def tell(self) -> None:
        truth = self.bench.truth
        range_cm = max(0, int(self.height_m * 100))
        self.bench.tell(mavlink.MAVLink_distance_sensor_message(0, 10, 7000, range_cm, 0, 0, 25, 0))
        if self.target is not None:
            self.bench.landing_target(*self.target, up=-0.1)  # seen from 0.1 m above the feet
        _, x, y, _ = truth.quat_wxyz
        self.heights.append(self.height_m)
        self.speeds.append(float(np.hypot(*truth.vel_enu_ms[:2])))
        self.tilts.append(math.degrees(math.acos(1 - 2 * (x * x + y * y))))


# ---- LAND -----------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("away_m", "fastest_ms"), [(1.5, 1.6), (2.4, 2.2), (4.0, 3.1), (8.0, 4.3), (15.0, 5.8), (30.0, 8.1)]
)
def test_land_flies_to_a_target_however_far_away_it_is(away_m: float, fastest_ms: float) -> None:
    # From 7 m a vehicle that leans towards a target 30 m away has it above its own level, and drops it.
    flight = Flight(20 if away_m > 15 else 7).offer(away_m).enter(Mode.LAND).land()
    assert flight.off_m() < ON_M
    assert max(flight.speeds) == pytest.approx(fastest_ms, rel=SPEED_SHARE)
    assert 15 < max(flight.tilts) < 30
    assert flight.landed_states() == [IN_AIR, LANDING] or flight.landed_states() == [LANDING]
    assert LOST not in flight.texts()


@pytest.mark.parametrize(("nearest_m", "held"), [(2.5, True), (0.0, False)])
def test_beyond_a_distance_from_the_target_it_holds_its_height(nearest_m: float, held: bool) -> None:
    flight = Flight(5, PLND_XY_DIST_MAX=nearest_m).offer(15).enter(Mode.LAND)
    flight.until(lambda: flight.away_m((15, 0)) < 2.6)
    assert (flight.height_m > 4.8) == held
    assert flight.land().off_m() < ON_M


def test_a_stream_that_begins_with_land_leads_after_two_seconds() -> None:
    flight = Flight(7).enter(Mode.LAND).offer(2, seconds=1.9)
    assert max(flight.speeds) < 0.1
    assert flight.land().off_m() < ON_M


def test_a_target_that_begins_at_three_metres_is_dashed_for() -> None:
    flight = Flight(4, PLND_STRICT=0, **MEASURED).enter(Mode.LAND).below(3).offer(4)
    assert flight.land().off_m() < ON_M
    assert max(flight.speeds) == pytest.approx(3.1, rel=SPEED_SHARE)
    assert 15 < max(flight.tilts) < 25
    fastest = int(np.argmax(flight.speeds))
    assert flight.heights[fastest] == pytest.approx(1.8, abs=0.2)


@pytest.mark.parametrize("height_m", [8, 3])
def test_a_target_that_moves_is_followed_at_once(height_m: float) -> None:
    flight = Flight(height_m + 1).offer(0).enter(Mode.LAND).below(height_m)
    flight.offer(3, seconds=2)
    assert max(flight.speeds) > 1.8
    assert flight.land().off_m() < ON_M


def test_a_stream_that_stops_for_three_seconds_is_found_again() -> None:
    flight = Flight(7).offer(1.5).enter(Mode.LAND).below(6)
    target, flight.target = flight.target, None
    flight.run(3).target = target
    assert flight.land().off_m() < ON_M
    assert flight.texts() == [LOST, FOUND, COMPLETE]


def test_a_stream_that_stops_for_eight_seconds_costs_a_climb() -> None:
    flight = Flight(7, **MEASURED).offer(1.5).enter(Mode.LAND).below(6)
    target, flight.target = flight.target, None
    began_ns = flight.bench.now_ns
    flight.run(8).target = target
    lowest = min(flight.heights)
    assert lowest == pytest.approx(2.7, abs=0.3)
    flight.land()
    assert max(flight.heights[flight.heights.index(lowest) :]) == pytest.approx(8.2, abs=0.8)
    assert (flight.bench.now_ns - began_ns) / 1e9 == pytest.approx(35, abs=5)
    assert flight.texts() == [LOST, RETRYING, FOUND, COMPLETE]
    assert flight.off_m() < ON_M


def test_without_a_target_a_landing_hovers_for_seven_seconds() -> None:
    flight = Flight(9, **MEASURED).enter(Mode.LAND).land()
    assert flight.texts() == [MEASURES]
    hover = [height for height in flight.heights if abs(height - 7.8) < 0.1]
    assert len(hover) * 0.05 == pytest.approx(7.3, abs=0.5)
    assert flight.off_m((0, 0)) < ON_M


@pytest.mark.parametrize(
    ("parameters", "hovers", "retries"),
    [
        ({"PLND_STRICT": 0}, False, 0),
        ({"PLND_STRICT": 1, "PLND_RET_MAX": 1}, False, 1),
        ({"PLND_STRICT": 2, "PLND_RET_MAX": 0}, True, 0),
        ({"PLND_STRICT": 1, "RNGFND1_TYPE": 0}, False, 0),
        ({"PLND_STRICT": 1, "PLND_RET_BEHAVE": 1}, False, 1),
    ],
)
def test_a_target_lost_for_good_is_sought_again_and_then_strictness_decides(
    parameters: dict[str, float], hovers: bool, retries: int
) -> None:
    flight = Flight(6, **MEASURED | parameters).offer(1).enter(Mode.LAND).below(5)
    flight.target = None
    flight.run(6.5)
    if retries:
        lowest = flight.heights.index(min(flight.heights))
        flight.until(lambda: "PrecLand: Retry Completed" in flight.texts())
        assert max(flight.heights[lowest:]) == pytest.approx(5 + 1.5, abs=0.3)
    if hovers:
        before_m = flight.height_m
        assert flight.run(10).height_m == pytest.approx(before_m, abs=0.5)
    else:
        flight.land()
    assert flight.texts().count(RETRYING) == retries


@pytest.mark.parametrize(("options", "returns"), [(0, False), (2, True)])
def test_a_stick_ends_a_precision_landing_unless_it_may_go_on(options: int, returns: bool) -> None:
    flight = Flight(7, PLND_OPTIONS=options).offer(1.5).enter(Mode.LAND).run(2.5)
    flight.bench.autopilot.receiver.transmitter[0] = 1900
    flight.run(1)
    flight.bench.autopilot.receiver.transmitter[0] = 1500
    flight.land()
    assert flight.off_m() < ON_M if returns else 0.6 < flight.off_m() < 2.0
    assert flight.bench.autopilot.navigator.repositioned is not returns


@pytest.mark.parametrize("mode", [Mode.GUIDED, Mode.LOITER, Mode.BRAKE])
def test_a_stream_pulls_no_other_mode(mode: Mode) -> None:
    flight = Flight(5).offer(4).enter(mode).run(5)
    assert flight.away_m((0, 0)) < 0.1
    assert flight.landed_states() == [IN_AIR]


# ---- RTL and SMART_RTL ----------------------------------------------------------------------------


@pytest.mark.parametrize("mode", [Mode.RTL, Mode.SMART_RTL])
@pytest.mark.parametrize("offered_below_m", [100, 4])
def test_a_return_lands_on_a_target_beside_home(mode: Mode, offered_below_m: float) -> None:
    flight = Flight(5, 15, RTL_ALT=700, RTL_LOIT_TIME=1000)
    if offered_below_m > 20:
        flight.offer(0, 5)
    flight.enter(mode).until(lambda: LANDING in flight.landed_states() or flight.away_m((0, 0)) < 0.5)
    assert max(flight.heights) < 8  # no pull on the way
    flight.until(lambda: LANDING in flight.landed_states())
    assert flight.away_m((0, 0)) < 1.5  # no pull in the loiter stage
    flight.below(offered_below_m).offer(0, 5)
    assert flight.land().off_m() < ON_M
    assert flight.landed_states() == [IN_AIR, LANDING]


def test_rtl_loiters_above_home_before_it_lands() -> None:
    flight = Flight(5, 8, RTL_ALT=600).enter(Mode.RTL)
    flight.until(lambda: flight.away_m((0, 0)) < 0.7)
    began_ns = flight.bench.now_ns
    flight.until(lambda: flight.bench.autopilot.navigator.is_landing(Mode.RTL))
    assert (flight.bench.now_ns - began_ns) / 1e9 == pytest.approx(5, abs=0.2)
    assert flight.height_m == pytest.approx(6, abs=0.3)


def test_rtl_with_a_final_altitude_uses_no_target_and_does_not_land() -> None:
    flight = Flight(5, 8, RTL_ALT=600, RTL_ALT_FINAL=300, RTL_LOIT_TIME=0)
    flight.offer(0, 5).enter(Mode.RTL).run(14)
    assert flight.away_m((0, 0)) < 0.2
    assert flight.height_m == pytest.approx(3, abs=0.3)
    assert flight.landed_states() == [IN_AIR]


def test_smart_rtl_flies_the_path_back() -> None:
    flight = Flight(4, 12)
    flight.bench.autopilot.navigator.guided.position_enu_m = np.array([12.0, 9.0, 4.0])
    flight.run(6).enter(Mode.SMART_RTL).until(lambda: flight.away_m((12, 0)) < 1.5)
    assert flight.until(lambda: LANDING in flight.landed_states()).away_m((0, 0)) < 1.0
    assert flight.height_m > 1.5


# ---- failsafes ------------------------------------------------------------------------------------


def low_battery(flight: Flight) -> None:
    flight.bench.autopilot.battery_sag_v = flight.bench.autopilot.battery_v - 10.4
    flight.bench.autopilot.parameters["BATT_LOW_TIMER"] = 0.5


def lost_radio(flight: Flight) -> None:
    flight.bench.autopilot.receiver.transmitting = False


def lost_station(flight: Flight) -> None:
    station = mavlink.MAVLink_heartbeat_message(mavlink.MAV_TYPE_GCS, 8, 0, 0, 4, 3)
    flight.bench.autopilot.parameters["FS_GCS_TIMEOUT"] = 2
    flight.bench.tell(station)


def left_fence(flight: Flight) -> None:
    flight.bench.autopilot.parameters.update({"FENCE_ENABLE": 1, "FENCE_RADIUS": 5})


@pytest.mark.parametrize(
    ("cause", "parameters", "mode"),
    [
        (low_battery, {"BATT_FS_LOW_ACT": 1}, "LAND"),
        (low_battery, {"BATT_FS_LOW_ACT": 2}, "RTL"),
        (lost_radio, {"FS_THR_ENABLE": 5}, "SMART_RTL"),
        (lost_station, {"FS_GCS_ENABLE": 5}, "LAND"),
        (lost_station, {"FS_GCS_ENABLE": 1}, "RTL"),
        (left_fence, {"FENCE_ACTION": 1}, "RTL"),
    ],
)
def test_a_failsafe_lands_on_an_offered_target(
    cause: Callable[[Flight], None], parameters: dict[str, float], mode: str
) -> None:
    flight = Flight(4, 8, RTL_ALT=500, RTL_LOIT_TIME=500, **parameters)
    flight.offer(*((12, 0) if mode == "LAND" else (0, 3)))
    cause(flight)
    flight.until(lambda: flight.mode == mode, 4)
    if mode == "LAND":
        before_m = flight.height_m
        flight.run(3)
        assert flight.away_m((12, 0)) < 0.5  # in the failsafe's pause of four seconds
        assert flight.height_m == pytest.approx(before_m, abs=0.2)
    assert flight.land().off_m() < ON_M


@pytest.mark.parametrize(
    ("mode", "parameters", "text", "after"),
    [
        (Mode.LOITER, {}, "GCS Failsafe - Continuing Pilot Control", "LOITER"),
        (Mode.LOITER, {"FS_OPTIONS": 0}, "GCS Failsafe", "RTL"),
        (Mode.LAND, {}, "GCS Failsafe", "RTL"),
        (Mode.LAND, {"FS_OPTIONS": 8}, "GCS Failsafe - Continuing Landing", "LAND"),
    ],
)
def test_options_decide_what_goes_on_without_a_ground_station(
    mode: Mode, parameters: dict[str, float], text: str, after: str
) -> None:
    flight = Flight(9, FS_GCS_ENABLE=1, **parameters).enter(mode)
    lost_station(flight)
    assert flight.run(2.5).mode == after
    assert text in flight.texts()


def test_a_landing_of_the_battery_failsafe_is_not_ended_by_a_lost_radio() -> None:
    flight = Flight(9, BATT_FS_LOW_ACT=1)
    low_battery(flight)
    flight.until(lambda: flight.mode == "LAND")
    lost_radio(flight)
    assert flight.run(2).mode == "LAND"
    assert "Radio + Battery Failsafe - Continuing Landing" in flight.texts()


def test_the_landing_of_an_ekf_failsafe_uses_no_target() -> None:
    flight = Flight(6).offer(4)
    flight.bench.autopilot.aiding.lose_gps(0.0)
    flight.until(lambda: flight.mode == "LAND", 12).land()
    assert flight.off_m((0, 0)) < flight.off_m()


# ---- AUTO -----------------------------------------------------------------------------------------


def upload(flight: Flight, *rows: tuple[int, float, float, Place | None, float]) -> None:
    """Write a mission of home and rows of command, param1, param2, place and height above home."""
    home = (mavlink.MAV_CMD_NAV_WAYPOINT, 0.0, 0.0, (0.0, 0.0), 0.0)
    bench = flight.bench
    bench.tell(mavlink.MAVLink_mission_count_message(1, 1, len(rows) + 1, 0))
    for number, (command, first, second, place, height_m) in enumerate((home, *rows)):
        lat, lon = bench.autopilot.lla(np.array([*place, 0.0]))[:2] if place else (0.0, 0.0)
        where = round(lat * 1e7), round(lon * 1e7), height_m
        item = mavlink.MAVLink_mission_item_int_message(
            1, 1, number, 3, command, 0, 1, first, second, 0, 0, *where, 0
        )
        bench.tell(item)
    answers = [m for _, m in bench.autopilot.take_outgoing(bench.now_ns) if m.get_type() == "MISSION_ACK"]
    assert [m.type for m in answers] == [mavlink.MAV_MISSION_ACCEPTED]


@pytest.mark.parametrize("land_at", [None, (6.0, 6.0)])
def test_a_mission_ends_on_a_target_beside_its_landing(land_at: Place | None) -> None:
    flight = Flight(4)
    upload(
        flight,
        (mavlink.MAV_CMD_NAV_TAKEOFF, 0, 0, None, 6),
        (mavlink.MAV_CMD_NAV_WAYPOINT, 1, 0, (6, 0), 6),
        (mavlink.MAV_CMD_NAV_LAND, 0, 0, land_at, 0),
    )
    flight.offer(6, 3).command(mavlink.MAV_CMD_MISSION_START)
    flight.until(lambda: flight.away_m((6, 0)) < 1.0)  # the target pulls no cruise
    assert LANDING not in flight.landed_states()
    assert flight.land().off_m() < ON_M
    assert flight.landed_states()[-2:] == [IN_AIR, LANDING]
    assert not flight.run(4).bench.autopilot.armed


def test_a_mission_takes_off_from_the_ground_and_ends_in_a_return() -> None:
    flight = Flight(0.5)
    flight.enter(Mode.LAND).until(lambda: not flight.bench.autopilot.armed)
    upload(
        flight,
        (mavlink.MAV_CMD_NAV_TAKEOFF, 0, 0, None, 3),
        (mavlink.MAV_CMD_NAV_WAYPOINT, 0, 0, (5, 0), 3),
        (mavlink.MAV_CMD_NAV_RETURN_TO_LAUNCH, 0, 0, None, 0),
    )
    flight.bench.autopilot.parameters.update({"RTL_ALT": 300, "RTL_LOIT_TIME": 0})
    flight.enter(Mode.GUIDED).command(mavlink.MAV_CMD_COMPONENT_ARM_DISARM, 1)
    flight.command(mavlink.MAV_CMD_MISSION_START).until(lambda: "Reached command #2" in flight.texts())
    assert mavlink.MAV_LANDED_STATE_TAKEOFF in flight.landed_states()
    flight.until(lambda: not flight.bench.autopilot.armed)
    assert flight.away_m((0, 0)) < 0.3


def test_auto_without_a_mission_is_refused() -> None:
    flight = Flight(3)
    assert flight.bench.command(mavlink.MAV_CMD_MISSION_START) == mavlink.MAV_RESULT_FAILED
    assert flight.mode == "GUIDED"
