"""What comes to a landing: options, ways and speeds."""

from __future__ import annotations

import numpy as np
import pytest

from companion.desk.demo.demo_options import INTRUDERS
from sitl.intruders import KINDS, DrivenCar, SwungJib, read
from sitl.intruders.moving_bodies import BESIDE_M, FROM_M, RESTITUTION, ROLLING, path_m
from sitl.world.primitives import Ellipsoid
from sitl.world.world import World
from tests.unit.sitl.test_simulation import flown_onto

SPOT = (3.0, 2.0, 0.0)


def test_options_name_kinds_and_heights() -> None:
    assert read("none") == []
    jib, car = read("jib@12,car@10.5")
    assert isinstance(jib, SwungJib)
    assert isinstance(car, DrivenCar)
    assert (jib.below_m, car.below_m) == (12.0, 10.5)
    assert set(INTRUDERS) == set(KINDS), "slz demo offers others than the simulator has"
    assert all(type(read(f"{kind}@9")[0]) is KINDS[kind] for kind in KINDS)


@pytest.mark.parametrize(
    "text", ["", "car", "car@", "car@0", "car@nan", "cow@9", "car@9,car@8", "car@9,", "car@201"]
)
def test_other_options_are_refused_with_what_to_write(text: str) -> None:
    with pytest.raises(ValueError, match="write KIND@HEIGHT"):
        read(text)


def test_a_walker_passes_the_point_and_goes_on() -> None:
    (walker,) = read("walker@15", seed=4)
    s = flown_onto(SPOT, walker)
    starts, gone = s.log.events
    assert (starts["event"], gone["event"]) == ("walker starts", "walker gone by")
    a, b = np.array([starts["e"], starts["n"]]), np.array([gone["e"], gone["n"]])
    way = b - a
    assert np.hypot(*way) == pytest.approx(2 * FROM_M, abs=0.1)
    speed = np.hypot(*way) / (gone["t"] - starts["t"])
    assert 0.9 <= speed <= 1.8
    off = np.array(SPOT[:2]) - a
    assert (
        abs(off[0] * way[1] - off[1] * way[0]) / np.hypot(*way) <= BESIDE_M + 0.5
    )  # and the estimate's error
    z = s.scene.world.height_m(gone["e"], gone["n"])
    assert z - s.scene.world.height_m(gone["e"] + 3, gone["n"]) == pytest.approx(1.75, abs=0.3)


def test_a_ball_bounces_rolls_and_stops_by_friction() -> None:
    times = np.arange(0.0, 60.0, 0.01)
    way, over, rests = (np.array(v) for v in zip(*(path_m(9.0, 3.0, float(t)) for t in times), strict=True))
    assert (np.diff(way) >= 0.0).all()
    assert over.min() >= 0.0
    assert over.max() == pytest.approx(3.0**2 / (2 * 9.81), abs=1e-3)
    # Without a kick upwards it rolls: v^2 / (2 mu g).
    assert path_m(6.0, 0.0, 60.0) == (pytest.approx(36.0 / (2 * ROLLING * 9.81)), 0.0, True)
    speed = np.diff(way) / 0.01
    assert (np.diff(speed[over[1:] == 0.0]) <= 1e-6).all()
    assert rests[-1]
    assert not rests[100]
    # Each bounce is lower, by the square of the restitution.
    tops = [over[k] for k in range(1, len(over) - 1) if over[k - 1] < over[k] >= over[k + 1]]
    assert tops[1] / tops[0] == pytest.approx(RESTITUTION**2, rel=0.01)


def test_a_ball_comes_to_the_point_and_ends_at_rest_on_the_ground() -> None:
    (ball,) = read("ball@15", seed=4)
    s = flown_onto(SPOT, ball)
    starts, stopped = s.log.events
    assert (starts["event"], stopped["event"]) == ("ball starts", "ball has stopped")
    part = s.scene.world.movers["ball"].placed()[0]
    assert isinstance(part, Ellipsoid)
    assert 0.25 <= 2 * part.radius_z_m <= 0.4
    below_m = World(s.scene.world.ground).height_m(part.x_m, part.y_m)
    assert part.z_m - part.radius_z_m == pytest.approx(below_m, abs=0.05)
