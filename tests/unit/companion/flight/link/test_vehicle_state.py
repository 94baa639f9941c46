"""Vehicle state, derived from its messages only."""

from __future__ import annotations

import math
from functools import reduce as fold
from typing import Any

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from companion.flight.link.autopilots.ardupilot import ARDUPILOT
from companion.flight.link.autopilots.px4 import PX4
from companion.flight.link.vehicle_state import VehicleState, is_autopilot, reduce
from companion.flight.link.wire.current_mode import MAVLink_current_mode_message
from tests.unit.companion.flight.link.messages import ARMED, attitude, heartbeat, position, received

MS, S = 1_000_000, 1_000_000_000


def after(*messages: Any, state: VehicleState | None = None) -> VehicleState:
    return fold(lambda s, m: reduce(s, m, 5 * S), messages, state or VehicleState())


def landed(value: int) -> Any:
    return received(mavlink.MAVLink_extended_sys_state_message(0, value))


def test_a_heartbeat_tells_autopilot_mode_and_arming() -> None:
    state = after(heartbeat(base_mode=ARMED, custom_mode=4, system=7))
    assert (state.sysid, state.autopilot, state.armed, state.mode) == (7, ARDUPILOT, True, "GUIDED")
    assert state.guided
    assert not state.landing
    assert state.last_heartbeat_ns == 5 * S


@pytest.mark.parametrize("first", [3, 250])  # numbers go on from 0 after 255
@pytest.mark.parametrize(
    ("behind", "later_ms", "mode"),
    [
        (-9, 300, "LAND"),  # the GUIDED of before LAND, late or delivered twice
        (-9, 600, "GUIDED"),  # too late to tell by a number of eight bits
        (9, 300, "GUIDED"),  # the pilot's
        (0, 300, "GUIDED"),  # of a sender that does not count
    ],
)
def test_a_heartbeat_that_a_later_one_overtook_changes_no_mode(
    first: int, behind: int, later_ms: int, mode: str
) -> None:
    state = reduce(VehicleState(), heartbeat(custom_mode=9, sequence=first), 5 * S)
    assert state.mode == "LAND"
    late = heartbeat(custom_mode=4, sequence=(first + behind) % 256)
    assert reduce(state, late, 5 * S + later_ms * 1_000_000).mode == mode


PX4_LOITER, PX4_OFFBOARD = 4 << 16 | 3 << 24, 6 << 16


def px4_heartbeat(custom_mode: int, sequence: int = 0, base_mode: int = 1) -> Any:
    kind = mavlink.MAV_AUTOPILOT_PX4
    return heartbeat(autopilot=kind, custom_mode=custom_mode, sequence=sequence, base_mode=base_mode)


def current_mode(custom_mode: int, sequence: int = 0, chosen: int | None = None) -> Any:
    chosen = custom_mode if chosen is None else chosen
    return received(MAVLink_current_mode_message(0, custom_mode, chosen), sequence=sequence)


def test_current_mode_tells_the_mode_between_two_heartbeats() -> None:
    state = reduce(VehicleState(), px4_heartbeat(PX4_LOITER, 10, ARMED), 5 * S)
    state = reduce(state, current_mode(PX4_OFFBOARD, 60), 5 * S + 300 * MS)
    assert (state.mode, state.guided, state.armed) == ("OFFBOARD", True, True)
    assert (state.mode_heard_ns, state.last_heartbeat_ns) == (5 * S + 300 * MS, 5 * S)
    state = reduce(state, px4_heartbeat(PX4_LOITER, 160, ARMED), 6 * S)
    assert state.mode == "AUTO.LOITER"


def test_a_heartbeat_sent_before_a_current_mode_changes_arming_but_no_mode() -> None:
    state = reduce(VehicleState(), px4_heartbeat(PX4_LOITER, 10), 5 * S)
    state = reduce(state, current_mode(PX4_OFFBOARD, 60), 6 * S)
    state = reduce(state, px4_heartbeat(PX4_LOITER, 55, ARMED), 6 * S + 20 * MS)
    assert (state.mode, state.armed, state.last_heartbeat_ns) == ("OFFBOARD", True, 6 * S + 20 * MS)


@pytest.mark.parametrize(
    ("chosen", "failsafe"),
    [(PX4_OFFBOARD, True), (PX4_LOITER, False), (0, False)],  # 0: it does not say
)
def test_a_mode_that_the_pilot_did_not_choose_is_a_failsafe_before_the_heartbeat_says_so(
    chosen: int, failsafe: bool
) -> None:
    state = reduce(VehicleState(), px4_heartbeat(PX4_OFFBOARD, 10, ARMED), 5 * S)
    state = reduce(state, current_mode(PX4_LOITER, 60, chosen), 5 * S + 300 * MS)
    assert (state.mode, state.failsafe) == ("AUTO.LOITER", failsafe)
    state = reduce(state, current_mode(PX4_OFFBOARD, 90), 6 * S)
    assert not state.failsafe


def test_a_mode_before_the_first_heartbeat_is_of_no_known_autopilot() -> None:
    assert after(current_mode(PX4_OFFBOARD)) == VehicleState()


@pytest.mark.parametrize(
    ("main", "sub", "name"),
    [(6, 0, "OFFBOARD"), (4, 9, "AUTO.PRECLAND"), (4, 6, "AUTO.LAND"), (3, 0, "POSCTL")],
)
def test_px4_modes_have_main_and_sub(main: int, sub: int, name: str) -> None:
    custom = main << 16 | sub << 24
    state = after(heartbeat(autopilot=mavlink.MAV_AUTOPILOT_PX4, custom_mode=custom))
    assert state.mode == name
    assert state.guided == (name == "OFFBOARD")
    assert state.landing == (name == "AUTO.PRECLAND")  # AUTO.LAND goes to no target: it is another's


def test_every_mode_that_can_be_asked_for_is_recognised_when_it_comes() -> None:
    for name in ARDUPILOT.modes:
        numbers = ARDUPILOT.mode_parameters(mavlink.MAV_TYPE_HELICOPTER, name)
        assert numbers is not None
        assert ARDUPILOT.mode_name(mavlink.MAV_TYPE_HELICOPTER, int(numbers[0])) == name
    for name in PX4.modes:
        numbers = PX4.mode_parameters(2, name)
        assert numbers is not None
        assert PX4.mode_name(2, int(numbers[0]) << 16 | int(numbers[1]) << 24) == name


def test_modes_of_other_vehicles_are_not_taken_for_a_copter_s() -> None:
    assert ARDUPILOT.mode_name(mavlink.MAV_TYPE_FIXED_WING, 4) == "MODE(4)"
    assert ARDUPILOT.mode_parameters(mavlink.MAV_TYPE_FIXED_WING, "GUIDED") is None
    assert ARDUPILOT.mode_parameters(2, "OFFBOARD") is None


@pytest.mark.parametrize(
    ("changes", "is_one"),
    [
        ({}, True),
        ({"component": 191}, False),
        ({"autopilot": mavlink.MAV_AUTOPILOT_INVALID}, False),
        ({"kind": mavlink.MAV_TYPE_GCS}, False),
    ],
)
def test_only_an_autopilot_is_one(changes: dict[str, int], is_one: bool) -> None:
    assert is_autopilot(heartbeat(**changes)) is is_one


@pytest.mark.parametrize(
    ("messages", "expected"),
    [
        ([], "unknown"),
        ([heartbeat()], "on_ground"),
        ([heartbeat(base_mode=ARMED)], "unknown"),
        ([heartbeat(base_mode=ARMED), position(1, relative_mm=1000)], "unknown"),
        ([heartbeat(base_mode=ARMED), position(1, relative_mm=3000)], "in_air"),
        ([heartbeat(base_mode=ARMED), position(1, relative_mm=3000), landed(1)], "on_ground"),
        ([heartbeat(), landed(4)], "landing"),
        ([heartbeat(), landed(3), landed(0)], "on_ground"),
    ],
)
def test_landed_is_what_is_reported_else_what_is_beyond_doubt(messages: list[Any], expected: str) -> None:
    assert after(*messages).landed == expected


def test_position_velocity_and_attitude_come_in_metres_and_as_a_unit_quaternion() -> None:
    half = math.sqrt(0.5) * 1.01
    state = after(position(1000, relative_mm=12_500), attitude(1000, (half, 0, 0, half)))
    assert state.position_lla == pytest.approx((47.0, 8.0, 412.0))
    assert state.relative_alt_m == 12.5
    assert state.velocity_ned_ms == (1.0, -2.0, 0.5)
    assert state.heading_deg == 90.0
    assert state.attitude_wxyz == pytest.approx((math.sqrt(0.5), 0, 0, math.sqrt(0.5)), abs=1e-7)


@pytest.mark.parametrize("quaternion", [(math.nan, 0, 0, 0), (0, 0, 0, 0), (2, 0, 0, 0), (math.inf, 0, 0, 0)])
def test_what_is_no_rotation_changes_no_attitude(quaternion: Any) -> None:
    before = after(attitude(1000))
    assert after(attitude(1010, quaternion), state=before).attitude_wxyz == before.attitude_wxyz


def test_null_island_is_no_position() -> None:
    assert after(position(1000, lat=0, lon=0)).position_lla is None
    home = received(mavlink.MAVLink_home_position_message(0, 0, 0, 0, 0, 0, [1, 0, 0, 0], 0, 0, 0))
    assert after(home).home_lla is None


def test_battery_unknown_does_not_replace_what_was_known() -> None:
    def status(remaining: int) -> Any:
        return received(mavlink.MAVLink_sys_status_message(0, 0, 0, 0, 15_200, 0, remaining, *[0] * 6))

    state = after(status(71), status(-1))
    assert (state.battery_pct, state.battery_v) == (71.0, 15.2)


def test_a_reboot_forgets_what_was_true_before_it() -> None:
    flying = after(heartbeat(base_mode=ARMED), landed(2), position(90_000), attitude(90_010))
    rebooted = after(*map(attitude, range(500, 5501, 100)), state=flying)
    assert (rebooted.reboots, rebooted.boot_ms) == (1, 5500)
    assert (rebooted.position_lla, rebooted.home_lla, rebooted.reported_landed) == (None, None, "unknown")
    assert rebooted.sysid == 1


def test_one_message_held_up_on_its_way_is_no_reboot_and_changes_nothing() -> None:
    flying = after(heartbeat(), position(90_000), attitude(90_010))
    state = after(position(50_000, lat=1), position(90_020), position(40_000, lat=1), state=flying)
    assert state.reboots == 0
    assert state.position_lla == pytest.approx((47.0, 8.0, 412.0))


def test_messages_a_little_out_of_order_are_no_reboot() -> None:
    assert after(attitude(5000), attitude(4400), attitude(4300), attitude(5020)).reboots == 0


def local(boot_ms: int) -> Any:
    return received(mavlink.MAVLink_local_position_ned_message(boot_ms, boot_ms / 1000, 0, -9, 1, 0, 0))


def sticks(boot_ms: int) -> Any:
    pulses = [1000 + boot_ms % 1000] * 18
    return received(mavlink.MAVLink_rc_channels_message(boot_ms, 18, *pulses, 200))


def fix(boot_ms: int) -> Any:
    return received(
        mavlink.MAVLink_gps_raw_int_message(boot_ms * 1000, boot_ms % 4, 0, 0, 0, 70, 110, 0, 0, 9)
    )


def home(boot_ms: int) -> Any:
    place = 470_000_000 + boot_ms, 80_000_000, 412_000
    return received(
        mavlink.MAVLink_home_position_message(*place, 0, 0, 0, [1, 0, 0, 0], 0, 0, 0, boot_ms * 1000)
    )


@pytest.mark.parametrize("late_ms", [20, 300, 900, 1500, 5000])
@pytest.mark.parametrize("kind", [position, attitude, local, sticks, fix, home])
def test_a_message_older_than_the_newest_of_its_kind_changes_nothing_whatever_its_age(
    kind: Any, late_ms: int
) -> None:
    """A router with two ways to the autopilot delivers every message once more, seconds later."""
    order = {"boot_ms", "order"}
    state = after(heartbeat(), attitude(89_000), kind(89_000), attitude(90_003), kind(90_003))
    again = after(kind(90_003 - late_ms), state=state)
    assert [
        name for name in state.__slots__ if name not in order and getattr(state, name) != getattr(again, name)
    ] == []


@pytest.mark.parametrize("place", [(math.nan, 0.0, -5.0), (1.0, math.inf, -5.0)])
def test_a_local_position_that_is_no_number_leaves_the_last_one(place: tuple[float, float, float]) -> None:
    def local(boot_ms: int, x: float, y: float, z: float) -> Any:
        return received(mavlink.MAVLink_local_position_ned_message(boot_ms, x, y, z, 0, 0, 0))

    state = after(heartbeat(), local(1000, 1.0, 2.0, -3.0), local(1100, *place))
    assert (state.local_ned_m, state.local_boot_ms) == ((1.0, 2.0, -3.0), 1000)


# ---- landings that the autopilot makes by itself ----------------------------------------------------

ARDUPILOT_MODES = {"STABILIZE": 0, "AUTO": 3, "GUIDED": 4, "LOITER": 5, "RTL": 6, "LAND": 9, "SMART_RTL": 21}
IN_AIR, LANDING, ON_GROUND = 2, 4, 1


@pytest.mark.parametrize(
    ("mode", "reported", "lands"),
    [
        ("LAND", LANDING, True),
        ("LAND", ON_GROUND, False),
        ("RTL", IN_AIR, False),  # on its way
        ("RTL", LANDING, True),
        ("SMART_RTL", LANDING, True),
        ("AUTO", IN_AIR, False),
        ("AUTO", LANDING, True),
        ("LOITER", LANDING, False),
        ("GUIDED", IN_AIR, False),
    ],
)
def test_ardupilot_says_when_a_mode_lands(mode: str, reported: int, lands: bool) -> None:
    state = after(heartbeat(base_mode=ARMED, custom_mode=ARDUPILOT_MODES[mode]), landed(reported))
    assert (state.own_landing is not None) == lands
    assert state.own_landing is None or state.own_landing.follows_target


@pytest.mark.parametrize(
    ("sub_mode", "reported", "lands", "follows"),
    [
        (6, IN_AIR, True, False),  # AUTO.LAND
        (9, IN_AIR, True, True),  # AUTO.PRECLAND
        (5, IN_AIR, False, False),  # AUTO.RTL, on its way, or level to its target
        (5, LANDING, True, True),
        (4, IN_AIR, False, False),  # AUTO.MISSION
        (4, LANDING, True, True),
        (3, LANDING, False, False),  # AUTO.LOITER
    ],
)
def test_px4_says_when_a_mode_lands(sub_mode: int, reported: int, lands: bool, follows: bool) -> None:
    state = after(px4_heartbeat(4 << 16 | sub_mode << 24, base_mode=ARMED), landed(reported))
    assert (state.own_landing is not None) == lands
    assert (state.own_landing is not None and state.own_landing.follows_target) == follows


def test_a_disarmed_vehicle_lands_no_more() -> None:
    assert after(heartbeat(custom_mode=9), landed(LANDING)).own_landing is None
