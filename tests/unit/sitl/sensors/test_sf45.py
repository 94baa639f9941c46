"""Simulated SF45: the first of the echoes of wire and ground."""

from __future__ import annotations

import struct

import numpy as np
import pytest

from sitl.sensors.lidar_mount import Mount
from sitl.sensors.sf45 import Sf45
from sitl.world.primitives import Wire
from sitl.world.world import World
from tests.unit.sitl.still_world import flat_world, hover

DOWN = Mount(lever_frd_m=(0.0, 0.0, 0.0), pitch_deg=90.0)


@pytest.mark.parametrize(
    ("below_m", "thick_m", "range_m"), [(10.0, 0.020, 10.0), (10.0, 0.005, 45.0), (5.0, 0.005, 5.0)]
)
def test_a_wire_bright_enough_for_its_range_is_the_first_return(
    below_m: float, thick_m: float, range_m: float
) -> None:
    """The threshold at 10 m is a brightness of 0.032: 20 mm return 0.062, 5 mm 0.016; at 5 m it is 0.008."""
    wire = Wire((-9.0, 0.0, 45.0 - below_m), (9.0, 0.0, 45.0 - below_m), thick_m / 2)
    lidar = Sf45(np.random.default_rng(1), mount=DOWN, noise_m=0.0, scanning=False, streaming=True)
    frames = lidar.scan(0, 10_000_000, hover(z=45.0), World(flat_world().ground, [wire]))
    (distance,) = struct.unpack("<h", frames[4:6])
    assert distance / 100 == pytest.approx(range_m, abs=0.02)
