"""The autopilot's fence: an order beyond it is refused, and a landing by itself stays inside."""

from __future__ import annotations

import numpy as np
import pytest

from companion.flight.landing.orders.operator_order import Order, OrderKind
from companion.flight.landing.situation import Phase
from tests.e2e.brief import brief
from tests.e2e.harness import Mission

RADIUS_M, MARGIN_M = 25.0, 2.0
FENCE = {"FENCE_ENABLE": 1.0, "FENCE_RADIUS": RADIUS_M, "FENCE_MARGIN": MARGIN_M}


def fenced(*, auto: bool) -> Mission:
    mission = Mission("plain", auto=auto, **brief())
    mission.sim.autopilot.parameters.update(FENCE)
    return mission


def from_home_m(mission: Mission) -> float:
    autopilot = mission.sim.autopilot
    return float(np.hypot(*(mission.sim.vehicle.truth.pos_enu_m - autopilot.navigator.home_enu_m)[:2]))


@pytest.mark.timeout(300)
def test_an_order_33_m_from_home_is_refused_by_a_fence_of_25_m_and_a_landing_by_itself_stays_inside() -> None:
    farthest = []

    async def script(mission: Mission) -> None:
        await mission.until_phase(Phase.SURVEY)
        frame, autopilot = mission.companion.sensing.history.frame, mission.sim.autopilot
        assert frame is not None
        home = frame.enu_m(*autopilot.lla(autopilot.navigator.home_enu_m))
        order = Order(OrderKind.LAND_AT_POINT, point_enu_m=home + np.array([33.0, 0.0, 0.0]))
        reply = mission.companion.deciding.order_desk.carry_out(order)
        assert (reply.accepted, reply.reason) == (False, "point beyond the fence")

        def landed() -> bool:
            farthest.append(from_home_m(mission))
            return mission.phase is Phase.LANDED

        await mission.until(landed)

    mission = fenced(auto=True).fly(script)
    assert max(farthest) < RADIUS_M - MARGIN_M
    assert mission.touchdown_safe()
    assert mission.sim.autopilot.failsafes.fence.count == 0
