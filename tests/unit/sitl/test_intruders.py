"""What comes to a landing: options, ways and speeds."""

from __future__ import annotations

import numpy as np
import pytest

from companion.desk.demo.demonstration import INTRUDERS
from sitl.intruders import KINDS, DrivenCar, SwungJib, read
from sitl.intruders.crosser import BESIDE_M, FROM_M
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
