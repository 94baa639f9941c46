"""Landings in wind: into it, and not in too much of it."""

import math

import pytest

from companion.flight.landing.situation import Phase
from tests.e2e.brief import brief
from tests.e2e.harness import Mission

pytestmark = pytest.mark.long

FROM_DEG = 310.0


def off_wind_deg(mission: Mission) -> float:
    contact = mission.sim.touchdown
    assert contact is not None
    return abs(math.degrees(math.remainder(math.radians(contact["heading_deg"] - FROM_DEG), 2 * math.pi)))


@pytest.mark.parametrize(
    ("seed", "drag_fusion", "source"),
    [
        pytest.param(1, 0.23, "autopilot", marks=pytest.mark.bench),
        (2, 0.0, "tilt"),
    ],  # on request, for its time
)
def test_lands_into_a_wind_of_eight_metres_per_second(seed: int, drag_fusion: float, source: str) -> None:
    blown = {"wind_ms": 8.0, "wind_from_deg": FROM_DEG, "gust_ms": 1.0}
    drag = {"EK3_DRAG_MCOEF": drag_fusion}
    mission = Mission(seed=seed, **brief(simulated=blown, parameters=drag, max_wind_ms=16.0))

    async def script(m: Mission) -> None:
        await m.until_phase(Phase.LANDED)
        await m.until(lambda: not m.sim.autopilot.armed, 10)

    mission.fly(script)
    assert mission.companion.sensing.wind.summary()["source"] == source
    assert off_wind_deg(mission) < 15
    assert mission.touchdown_safe()
    assert mission.touchdown_error_m() <= 0.6
    assert mission.companion.executive.tally.aborts == 0


def test_waits_in_too_much_wind_and_lands_in_an_emergency() -> None:
    mission = Mission(seed=3, **brief(simulated={"wind_ms": 8.0, "gust_ms": 1.0}, max_wind_ms=6.0))

    async def script(m: Mission) -> None:
        await m.until(lambda: any("wind too strong for this point" in text for text in m.heard))
        assert m.phase is Phase.IDLE
        assert m.companion.executive.orders.land_now(m.companion.deciding.situations.situation()).accepted
        await m.until_phase(Phase.LANDED)

    mission.fly(script)
    assert mission.touchdown_safe()
