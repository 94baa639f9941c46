"""AUTO.RTL of the simulated PX4, as in rtl.cpp and rtl_direct.cpp; wind is off."""

from __future__ import annotations

import numpy as np
import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from sitl.autopilot.px4.direct_return import DirectReturn, ReturnState
from sitl.autopilot.px4.precland_states import Precland
from sitl.autopilot.px4.px4_modes import Px4Mode
from sitl.autopilot.px4.px4_parameters import px4_defaults
from sitl.vehicle.rigid_body import State
from tests.unit.sitl.autopilot.px4.px4_flight import Px4Flight

LANDING = mavlink.MAV_LANDED_STATE_LANDING
HOME = np.zeros(3)


def returning(flight: Px4Flight) -> ReturnState:
    return flight.autopilot.navigator.direct_return.state


@pytest.mark.parametrize("mode", [0, 1, 2])
def test_it_lands_on_a_target_beside_home_where_it_may(mode: int) -> None:
    """Without a delay the landing begins at the height of the return."""
    flight = Px4Flight(4, 12, RTL_RETURN_ALT=6, RTL_PLD_MD=mode)
    flight.target = (0.0, 4.0)
    flight.enter(Px4Mode.AUTO_RTL).until(lambda: returning(flight) is ReturnState.LAND)
    assert flight.height_m == pytest.approx(6, abs=0.3)
    assert flight.away_m((0, 0)) < 2.5  # no pull on the way
    flight.land()
    assert flight.off_m() < 0.2 if mode else flight.off_m((0.0, 0.0)) < 0.3
    assert LANDING in flight.landed_states()


@pytest.mark.parametrize(("mode", "states"), [(1, ["FALLBACK"]), (2, ["START", "SEARCH", "FALLBACK"])])
def test_without_a_target_mode_1_lands_and_mode_2_searches(mode: int, states: list[str]) -> None:
    flight = Px4Flight(
        4, 6, RTL_RETURN_ALT=5, RTL_PLD_MD=mode, RTL_CONE_ANG=0, PLD_SRCH_ALT=6, PLD_SRCH_TOUT=2
    )
    flight.enter(Px4Mode.AUTO_RTL).land()
    assert [state for state in flight.states if state != "DONE"] == states
    assert flight.off_m((0.0, 0.0)) < 2.5  # in place, where it came within NAV_ACC_RAD


def test_with_a_delay_it_sinks_and_holds_before_it_lands() -> None:
    flight = Px4Flight(4, 12, RTL_RETURN_ALT=8, RTL_DESCEND_ALT=4, RTL_LAND_DELAY=3)
    flight.enter(Px4Mode.AUTO_RTL).until(lambda: returning(flight) is ReturnState.LOITER_HOLD)
    began_ns = flight.bench.now_ns
    assert flight.height_m == pytest.approx(4, abs=0.9)
    flight.until(lambda: returning(flight) is ReturnState.LAND)
    assert (flight.bench.now_ns - began_ns) / 1e9 == pytest.approx(3, abs=0.3)
    assert max(flight.heights) == pytest.approx(8, abs=0.3)
    assert flight.land().off_m((0.0, 0.0)) < 0.3


@pytest.mark.parametrize(
    ("place", "cone_deg", "up_m"),
    [
        ((50.0, 0.0, 10.0), 45, 30.0),
        ((8.0, 0.0, 3.0), 45, 8.0),
        ((3.0, 0.0, 2.0), 80, 4.0),  # at least twice NAV_ACC_RAD
        ((1.0, 0.0, 0.5), 45, 2.0),
        ((50.0, 0.0, 40.0), 45, 40.0),
        ((3.0, 0.0, 2.0), 0, 30.0),
    ],
)
def test_the_height_of_the_return_is_a_cone_near_home(
    place: tuple[float, float, float], cone_deg: float, up_m: float
) -> None:
    parameters = px4_defaults({"RTL_CONE_ANG": cone_deg})
    controller = DirectReturn(parameters, Precland(parameters))
    zeros = np.zeros(3)
    state = State(np.array(place), zeros, np.array([1.0, 0.0, 0.0, 0.0]), zeros, zeros)
    controller.start(state, HOME, [], 0)
    assert controller.up_m == pytest.approx(up_m)


@pytest.mark.parametrize(("kind", "goal"), [(0, 20.0), (1, 20.0), (2, 0.0)])
def test_rally_points_count_by_rtl_type(kind: int, goal: float) -> None:
    parameters = px4_defaults({"RTL_TYPE": kind})
    controller = DirectReturn(parameters, Precland(parameters))
    zeros = np.zeros(3)
    state = State(np.array([25.0, 0.0, 40.0]), zeros, np.array([1.0, 0.0, 0.0, 0.0]), zeros, zeros)
    setpoint = controller.start(state, HOME, [np.array([20.0, 0.0, 0.0]), np.array([5.0, 0.0, 0.0])], 0)
    assert setpoint.place_enu_m[0] == goal
