"""Campaign of landings that the autopilot makes by itself, over unsafe ground, with and without `assist`.

One simulated vehicle takes off, flies over a place that is truly unsafe, and lands for a cause, again and
again. Each touchdown is judged by the exact world, and compared with where the vehicle would have come down
alone: straight below. In a return home is that place, as if something had come to stand where it took off.
"""

from __future__ import annotations

import argparse
import asyncio
import json
import math
import sys
from collections.abc import Awaitable, Callable
from dataclasses import asdict, dataclass
from functools import partial

import numpy as np
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from sitl.autopilot.modes import Mode
from sitl.truth.touchdown import fault_of
from sitl.truth.truth import safe_map
from tests.e2e.harness import Mission

ONLY_PLACE = 0b110111111000  # type_mask of a position target
CELL_M, REACH_M = 0.5, 50.0
SCENES = "streets", "dense", "stadium"
HEIGHT_M = 18.0
LOW_V = 4.0  # by which the battery's voltage falls
SECOND = 1_000_000_000


@dataclass(frozen=True, slots=True)
class Landed:
    """Outcome of one landing.

    alone, ended: why the touchdown is unsafe, by the truth, without slz and as it was; "" where it is safe.
    safe_away_m: distance from the place to the nearest safe ground, by the truth.
    """

    scene: str
    seed: int
    assist: str
    cause: str
    place_m: tuple[float, float]
    safe_away_m: float
    alone: str
    ended: str
    off_place_m: float
    texts: list[str]


class Session:
    """Landings of one simulated vehicle, one after the other."""

    def __init__(self, scene: str, seed: int, assist: str, causes: list[str], n: int) -> None:
        self.scene, self.seed, self.assist, self._causes = scene, seed, assist, causes
        self.mission = Mission(scene, seed=seed, auto=False, assist=assist, height_m=HEIGHT_M)
        self._world = self.mission.sim.scene.world
        self._places = self._unsafe_places(n)
        self.landed: list[Landed] = []

    def fly(self) -> list[Landed]:
        """Fly all landings; return those that came to an end."""
        try:
            self.mission.fly(self._script)
        except AssertionError as error:  # a collision, or a vehicle that does not land
            print(f"{self.scene} {self.seed}: ended early: {str(error)[:200]}", file=sys.stderr)
        return self.landed

    async def _script(self, m: Mission) -> None:
        for number, (east, north, away_m) in enumerate(self._places):
            cause = self._causes[number % len(self._causes)]
            await self._fly_over(east, north)
            heard = len(m.heard)
            if cause in RETURNS:
                m.sim.autopilot.navigator.home_enu_m[:2] = east, north
            await CAUSES[cause](m)
            await m.until(lambda: not m.sim.autopilot.armed, 200)
            await asyncio.sleep(0.5)
            self._judge(cause, (east, north), away_m, m.heard[heard:])
            self._mend()

    async def _fly_over(self, east: float, north: float) -> None:
        m = self.mission
        pilot, vehicle = m.sim.pilot, m.sim.vehicle
        assert pilot is not None
        pilot.done = False
        await m.until(lambda: pilot.done and m.sim.autopilot.height_above_home_m > HEIGHT_M - 1, 120)
        up_m = float(m.sim.autopilot.navigator.home_enu_m[2]) + HEIGHT_M
        there = np.array([east, north, up_m])
        lat, lon, alt = m.sim.autopilot.lla(there)
        target = mavlink.MAVLink_set_position_target_global_int_message(
            0, 1, 1, mavlink.MAV_FRAME_GLOBAL_INT, ONLY_PLACE, round(lat * 1e7), round(lon * 1e7), alt,
            *[0.0] * 8,
        )  # fmt: skip
        pilot.send(target)
        await m.until(lambda: math.hypot(*(vehicle.truth.pos_enu_m - there)[:2]) < 0.8, 120)
        await asyncio.sleep(4.0)

    def _judge(self, cause: str, place: tuple[float, float], away_m: float, texts: list[str]) -> None:
        contact = self.mission.sim.touchdown
        ended = "collision" if contact is None else fault_of(self._world, contact)
        heading = 0.0 if contact is None else contact["heading_deg"]
        without = fault_of(self._world, {"e": place[0], "n": place[1], "heading_deg": heading})
        off = math.nan if contact is None else math.hypot(contact["e"] - place[0], contact["n"] - place[1])
        spoken = [text for text in texts if "SLZ" in text or "PrecLand" in text or "ailsafe" in text]
        one = Landed(
            self.scene, self.seed, self.assist, cause, place, round(away_m, 1), without, ended,
            round(off, 2), spoken,
        )  # fmt: skip
        self.landed.append(one)
        print(json.dumps(asdict(one)), flush=True)

    def _mend(self) -> None:
        """Undo the cause: another battery, the transmitter on, no fence."""
        autopilot = self.mission.sim.autopilot
        autopilot.battery_sag_v, autopilot.failsafes.battery = 0.0, False
        autopilot.receiver.transmitting = True
        autopilot.parameters.update({"FENCE_ENABLE": 0.0, "FS_GCS_ENABLE": 0.0, "BATT_FS_LOW_ACT": 0.0})

    def _unsafe_places(self, n: int) -> list[tuple[float, float, float]]:
        """Return n truly unsafe places (east, north) near the start, and how far safe ground is away."""
        east, north, _ = self.mission.sim.scene.home_enu
        wide = 2 * REACH_M
        edges = east - wide, north - wide, east + wide, north + wide
        safe = np.asarray(safe_map(self._world, edges, CELL_M).safe, bool)
        rows, cols = np.indices(safe.shape)
        places = np.stack([edges[0] + (cols + 0.5) * CELL_M, edges[1] + (rows + 0.5) * CELL_M], axis=-1)
        near = np.hypot(places[..., 0] - east, places[..., 1] - north) < REACH_M
        unsafe = places[near & ~safe]
        np.random.default_rng(self.seed).shuffle(unsafe)
        found = []
        for place in unsafe:
            if self._world.height_m(*place.tolist()) < HEIGHT_M - 8.0 and len(found) < n:
                found.append((*place.tolist(), float(np.hypot(*(places[safe] - place).T).min())))
        return found


async def _land(m: Mission) -> None:
    assert m.sim.pilot is not None
    m.sim.pilot.set_mode(Mode.LAND)
    await m.until(lambda: m.sim.autopilot.mode is Mode.LAND)


async def _battery(m: Mission, action: float) -> None:
    m.sim.autopilot.parameters.update({"BATT_FS_LOW_ACT": action, "BATT_LOW_TIMER": 1.0})
    m.sim.autopilot.battery_sag_v = m.sim.autopilot.battery_v - 10.0
    await m.until(lambda: m.sim.autopilot.mode in (Mode.LAND, Mode.RTL))


async def _transmitter(m: Mission) -> None:
    m.sim.autopilot.parameters["FS_THR_ENABLE"] = 1.0
    m.sim.autopilot.receiver.transmitting = False
    await m.until(lambda: m.sim.autopilot.mode is Mode.RTL)


async def _station(m: Mission) -> None:
    m.sim.autopilot.parameters.update({"FS_GCS_ENABLE": 1.0, "SYSID_MYGCS": 42.0})  # nobody's heartbeats
    m.sim.autopilot.failsafes.station_heard_ns = m.sim.now_ns - 4 * SECOND
    await m.until(lambda: m.sim.autopilot.mode is Mode.RTL)


async def _fence(m: Mission) -> None:
    home, here = m.sim.autopilot.navigator.home_enu_m, m.sim.vehicle.truth.pos_enu_m
    radius_m = max(2.0, float(np.hypot(*(here - home)[:2])) - 2.0)
    fence = {"FENCE_ENABLE": 1.0, "FENCE_TYPE": 2.0, "FENCE_RADIUS": radius_m, "FENCE_ACTION": 2.0}
    m.sim.autopilot.parameters.update(fence)
    await m.until(lambda: m.sim.autopilot.mode is Mode.LAND)


async def _restart(m: Mission) -> None:
    await _land(m)
    await m.stop()
    m.companion = m.new_companion()
    m.start()


CAUSES: dict[str, Callable[[Mission], Awaitable[None]]] = {
    "land": _land,
    "battery_land": partial(_battery, action=1.0),
    "battery_rtl": partial(_battery, action=2.0),
    "transmitter": _transmitter,
    "station": _station,
    "fence": _fence,
    "restart": _restart,
}

RETURNS = frozenset({"battery_rtl", "transmitter", "station"})


def main() -> None:
    """Fly the campaign and print a line per landing, and the shares at the end."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--scenes", nargs="+", default=SCENES)
    parser.add_argument("--causes", nargs="+", default=list(CAUSES), choices=list(CAUSES))
    parser.add_argument("--seeds", nargs="+", type=int, default=[1])
    parser.add_argument("--places", type=int, default=7, help="landings of each scene and seed")
    parser.add_argument("--assist", default="offer", choices=("off", "offer", "act"))
    options = parser.parse_args()
    found: list[Landed] = []
    for scene in options.scenes:
        for seed in options.seeds:
            found += Session(scene, seed, options.assist, options.causes, options.places).fly()
    for cause in options.causes:
        these = [one for one in found if one.cause == cause]
        alone, ended = (sum(not reason for reason in reasons) for reasons in _faults(these))
        print(f"{cause}: {len(these)} landings, safe alone {alone}, with {options.assist} {ended}")


def _faults(landed: list[Landed]) -> tuple[list[str], list[str]]:
    return [one.alone for one in landed], [one.ended for one in landed]


if __name__ == "__main__":
    main()
