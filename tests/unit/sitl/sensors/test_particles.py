"""Particles in the simulated air: how many, how far, how weak; the same however time is divided."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from sitl.sensors.mid360 import Mid360
from sitl.sensors.optics import Noise
from sitl.sensors.particles import AIR, Particles
from sitl.sensors.pulse_lidar import PoseAt, Shots
from sitl.world.primitives import Ground, Kind
from sitl.world.world import World

SECOND = 1_000_000_000


def world() -> World:
    return World(Ground(-60, -60, 1.0, np.zeros((121, 121)), np.full((120, 120), Kind.GRASS, np.uint8)))


def hover() -> PoseAt:
    return lambda stamps: (
        np.tile([0.0, 0.0, 20.0], (len(stamps), 1)),
        np.tile([1.0, 0, 0, 0], (len(stamps), 1)),
    )


def fired(particles: Particles | None, *ends_ns: int) -> Shots:
    sensor = Mid360(np.random.default_rng(1), point_rate_hz=20_000, noise=Noise(particles=particles))
    shots = [sensor.shots(a, b, hover(), world()) for a, b in zip((0, *ends_ns), ends_ns, strict=False)]
    for later in shots[1:]:
        shots[0] = shots[0].followed_by(later)
    return shots[0]


@pytest.mark.parametrize("name", [name for name, air in AIR.items() if air is not None])
def test_the_share_the_reach_and_the_brightness_are_those_of_the_air(name: str) -> None:
    air = AIR[name]
    assert air is not None
    clear, shots = fired(None, SECOND), fired(air, SECOND)
    own = shots.echoes.dust & ~clear.echoes.dust
    assert np.mean(own) == pytest.approx(air.share * (1 + air.twins), rel=0.4)
    assert shots.echoes.range_m[own].max() <= air.reach_m
    low, high = air.bright
    assert low <= shots.bright[own].min()
    assert shots.bright[own].max() <= high
    assert (shots.echoes.range_m[~own] == clear.echoes.range_m[~own]).all()


def test_plumes_are_denser_in_places_and_thinner_in_others() -> None:
    def counts(patchy: float) -> NDArray[np.float64]:
        shots = fired(Particles(0.2, patchy=patchy, exponent=1.0), SECOND // 4)
        places = (shots.unit * shots.echoes.range_m[:, None])[shots.echoes.dust]
        return np.histogramdd(places, bins=8, range=[(-8, 8)] * 3)[0]

    even = counts(0.0)
    cells = even > 5
    assert ((counts(2.0) - even)[cells] ** 2 / even[cells]).mean() > 4, "of even counts it is 2"


def test_the_particles_do_not_depend_on_how_time_is_divided() -> None:
    one, many = fired(AIR["snow"], SECOND // 2), fired(AIR["snow"], 10_000_000, 170_000_000, SECOND // 2)
    assert (one.echoes.range_m == many.echoes.range_m).all()
    assert (one.bright == many.bright).all()
