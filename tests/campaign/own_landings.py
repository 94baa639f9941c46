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
from collections.abc import Callable, Iterator
from dataclasses import asdict, dataclass, field
from typing import Any

import numpy as np
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from sitl.autopilot.modes import Mode
from sitl.autopilot.px4.px4_modes import Px4Mode
from sitl.intruders.moving_bodies import Walker
from sitl.simulation import Simulation
from sitl.truth.touchdown import fault_of
from sitl.truth.truth import safe_map
from tests.bench.landings import FLYING_COMMANDS, SETPOINTS
from tests.campaign.sortie import LIDAR_MS
from tests.e2e.harness import Mission

CELL_M, REACH_M = 0.5, 50.0
SCENES = "streets", "dense", "stadium", "car_park_dry", "river", "swaying_trees", "flat_roofs"
NEAR: dict[str, Any] = {"zone_m": 80.0, "max_range_m": 60.0, "adaptive": "off", "pose_rate_hz": 20.0}
"""Settings of the companion: targets are within 30 m."""
HEIGHT_M, LOWEST_M, BESIDE_M = 18.0, 8.0, 4.0  # above home, what stands at a place, and what is so near
LAND_S = 200.0
SECOND = 1_000_000_000
CRITICAL_V, EMPTY_V = 14.17, 10.0
COMPANION = 191
ONLY_PLACE = 0b110111111000  # type_mask of a position target
BACK_AND_FORTH_M = 15.0


@dataclass(frozen=True, slots=True)
class Cause:
    """Parameters by which something ends in a landing, and what happens; `returns`: home is the place."""

    parameters: dict[str, float] = field(default_factory=dict)
    happens: Callable[[Mission], None] = lambda _: None
    returns: bool = False
    restarts: bool = False


def _battery_at(volts: float) -> Callable[[Mission], None]:
    def happens(m: Mission) -> None:
        m.sim.autopilot.battery_sag_v += m.sim.autopilot.battery_v - volts

    return happens


def _pilot_sets(mode: int) -> Callable[[Mission], None]:
    return lambda m: m.sim.pilot.set_mode(mode)  # type: ignore[union-attr]


def _transmitter_off(m: Mission) -> None:
    m.sim.autopilot.receiver.transmitting = False


def _station_lost(m: Mission) -> None:
    m.sim.autopilot.failsafes.station_heard_ns = m.sim.now_ns - 15 * SECOND


def _fence_around_home(m: Mission) -> None:
    home, here = m.sim.autopilot.navigator.home_enu_m, m.sim.vehicle.truth.pos_enu_m
    m.sim.autopilot.parameters["FENCE_RADIUS"] = max(2.0, float(np.hypot(*(here - home)[:2])) - 2.0)


ARDUCOPTER = {
    "land": Cause(happens=_pilot_sets(Mode.LAND)),
    "battery_land": Cause({"BATT_FS_LOW_ACT": 1.0, "BATT_LOW_TIMER": 1.0}, _battery_at(EMPTY_V)),
    "battery_rtl": Cause({"BATT_FS_LOW_ACT": 2.0, "BATT_LOW_TIMER": 1.0}, _battery_at(EMPTY_V), returns=True),
    "transmitter": Cause({"FS_THR_ENABLE": 1.0}, _transmitter_off, returns=True),
    # Nobody's heartbeats
    "station": Cause({"FS_GCS_ENABLE": 1.0, "SYSID_MYGCS": 42.0}, _station_lost, returns=True),
    "fence": Cause({"FENCE_ENABLE": 1.0, "FENCE_TYPE": 2.0, "FENCE_ACTION": 2.0}, _fence_around_home),
    "restart": Cause(happens=_pilot_sets(Mode.LAND), restarts=True),
}
PX4 = {
    "land": Cause(happens=_pilot_sets(Px4Mode.AUTO_LAND)),
    "battery_land": Cause({"COM_LOW_BAT_ACT": 2.0}, _battery_at(CRITICAL_V)),
    "battery_rtl": Cause({"COM_LOW_BAT_ACT": 3.0}, _battery_at(CRITICAL_V), returns=True),
    "transmitter": Cause({"NAV_RCL_ACT": 2.0}, _transmitter_off, returns=True),
    "station": Cause({"NAV_DLL_ACT": 2.0, "COM_DL_LOSS_T": -1.0}, returns=True),
    "fence": Cause({"GF_MAX_VER_DIST": HEIGHT_M - 4.0, "GF_ACTION": 3.0}, returns=True),
    "restart": Cause(happens=_pilot_sets(Px4Mode.AUTO_RTL), returns=True, restarts=True),
}
CAUSES = {"ardupilot": ARDUCOPTER, "px4": PX4}
LANDS = Mode.LAND, Mode.RTL, Px4Mode.AUTO_LAND, Px4Mode.AUTO_RTL
SWITCHED_OFF = {"ardupilot": {"PLND_ENABLED": 0.0}, "px4": {"RTL_PLD_MD": 0.0}}
"""What lets no landing follow a target: `act` is the only help."""


@dataclass(frozen=True, slots=True)
class Landed:
    """Outcome of one landing.

    alone, ended: why the touchdown is unsafe, by the truth, without slz and as it was; "" where it is safe.
    safe_away_m: distance from the place to the nearest safe ground, by the truth.
    commands: of the companion, from the cause on.
    """

    kind: str
    scene: str
    seed: int
    assist: str
    cause: str
    place_m: tuple[float, float]
    safe_away_m: float
    alone: str
    ended: str
    off_place_m: float
    commands: int
    texts: list[str]


class Crowd:
    """People who walk back and forth, each on a way of its own, all over the place."""

    def __init__(self, sim: Simulation, n: int, seed: int) -> None:
        rng = np.random.default_rng(seed)
        east, north, _ = sim.scene.home_enu
        self._from = np.array([east, north]) + rng.uniform(-REACH_M, REACH_M, (n, 2))
        self._bearing, self._speed = rng.uniform(0, math.tau, n), rng.uniform(0.8, 1.6, n)
        self._next_ns = 0
        for number, (x, y) in enumerate(self._from):
            sim.scene.world.add_mover(f"person {number}", Walker.parts, x, y, self._bearing[number])
        sim.every_tick.append(self.walk)

    def walk(self, sim: Simulation) -> None:
        """Move everybody ten times a second."""
        if sim.now_ns < self._next_ns:
            return
        self._next_ns = sim.now_ns + SECOND // 10
        gone = self._speed * sim.now_ns * 1e-9 % (2 * BACK_AND_FORTH_M)
        along = BACK_AND_FORTH_M - np.abs(gone - BACK_AND_FORTH_M)
        east, north = self._from.T + along * np.array([np.cos(self._bearing), np.sin(self._bearing)])
        for number, bearing in enumerate(self._bearing):
            sim.scene.world.move(f"person {number}", east[number], north[number], bearing)


class Session:
    """Landings of one simulated vehicle, one after the other; `to_come` are causes and places left."""

    def __init__(
        self,
        scene: str,
        seed: int,
        assist: str,
        causes: list[str],
        n: int,
        *,
        kind: str = "ardupilot",
        people: int = 0,
    ) -> None:
        self.scene, self.seed, self.assist, self.kind, self._people = scene, seed, assist, kind, people
        parameters = SWITCHED_OFF[kind] if assist == "act" else {}
        parameters = {"RTL_RETURN_ALT": HEIGHT_M} | parameters if kind == "px4" else parameters
        built = {"autopilot_kind": kind, "parameters": parameters, "lidar_ms": LIDAR_MS}
        self.mission = Mission(
            scene, seed=seed, auto=False, assist=assist, height_m=HEIGHT_M, simulated=built, **NEAR
        )
        self._world = self.mission.sim.scene.world
        places = self._unsafe_places(n)
        self.to_come = [(causes[number % len(causes)], place) for number, place in enumerate(places)]
        if people:
            Crowd(self.mission.sim, people, seed)
        self._receive = self.mission.sim.autopilot.receive
        self.mission.sim.autopilot.receive = self._overhear  # type: ignore[method-assign]
        self._commands = 0
        self.landed: list[Landed] = []

    def fly(self) -> list[Landed]:
        """Fly all landings; return those that came to an end, the last of them in a crash perhaps."""
        try:
            self.mission.fly(self._script)
        except AssertionError as error:  # the vehicle does not get there, or does not land
            print(f"{self.scene} {self.seed}: ended early: {str(error)[:300]}", file=sys.stderr)
        return self.landed

    async def _script(self, m: Mission) -> None:
        while self.to_come:
            name, place = self.to_come.pop(0)
            cause = CAUSES[self.kind][name]
            await self._fly_over(*place[:2])
            heard, self._commands = len(m.heard), 0
            if cause.returns:
                m.sim.autopilot.navigator.home_enu_m[:2] = place[:2]
            before = {name: m.sim.autopilot.parameters[name] for name in cause.parameters}
            m.sim.autopilot.parameters.update(cause.parameters)
            cause.happens(m)
            await m.until(lambda: m.sim.autopilot.mode in LANDS, 30)
            if cause.restarts:
                await m.stop()
                m.companion = m.new_companion()
                m.start()
            await m.until(lambda: not m.sim.autopilot.armed, LAND_S)
            await asyncio.sleep(0.5)
            self._judge(name, place, m.heard[heard:])
            if m.sim.touchdown is None:
                return
            m.sim.autopilot.parameters.update(before)
            m.sim.autopilot.battery_sag_v, m.sim.autopilot.failsafes.battery = 0.0, False
            m.sim.autopilot.receiver.transmitting = True

    async def _fly_over(self, east: float, north: float) -> None:
        m = self.mission
        pilot, vehicle = m.sim.pilot, m.sim.vehicle
        assert pilot is not None
        pilot.done = False
        await m.until(lambda: pilot.done and m.sim.autopilot.height_above_home_m > HEIGHT_M - 1, 120)
        up_m = float(m.sim.autopilot.navigator.home_enu_m[2]) + HEIGHT_M
        there = np.array([east, north, up_m])
        lat, lon, alt = m.sim.autopilot.lla(there)
        if self.kind == "px4":
            pilot.command(mavlink.MAV_CMD_DO_REPOSITION, -1, 1, 0, np.nan, lat, lon, alt)
        else:
            pilot.send(mavlink.MAVLink_set_position_target_global_int_message(
                0, 1, 1, mavlink.MAV_FRAME_GLOBAL_INT, ONLY_PLACE, round(lat * 1e7), round(lon * 1e7), alt,
                *[0.0] * 8,
            ))  # fmt: skip
        await m.until(lambda: math.hypot(*(vehicle.truth.pos_enu_m - there)[:2]) < 0.8, 120)
        await asyncio.sleep(4.0)

    def _overhear(self, message: Any, link: int, now_ns: int) -> None:
        autopilot = self.mission.sim.autopilot  # PX4 reads setpoints in OFFBOARD alone
        moves = message.get_type() in SETPOINTS and autopilot.mode in autopilot.companion_modes
        commands = moves or getattr(message, "command", None) in FLYING_COMMANDS
        self._commands += commands and message.get_srcComponent() == COMPANION
        self._receive(message, link, now_ns)

    def _judge(self, cause: str, place: tuple[float, float, float], texts: list[str]) -> None:
        contact = self.mission.sim.touchdown
        ended = "collision" if contact is None else fault_of(self._world, contact)
        heading = 0.0 if contact is None else contact["heading_deg"]
        without = fault_of(self._world, {"e": place[0], "n": place[1], "heading_deg": heading})
        off = math.nan if contact is None else math.hypot(contact["e"] - place[0], contact["n"] - place[1])
        scene = f"{self.scene}, {self._people} people" if self._people else self.scene
        spoken = [text for text in texts if "SLZ" in text or "PrecLand" in text or "ailsafe" in text]
        one = Landed(
            self.kind, scene, self.seed, self.assist, cause, place[:2], round(place[2], 1), without, ended,
            round(off, 2), self._commands, spoken,
        )  # fmt: skip
        self.landed.append(one)
        print(json.dumps(asdict(one)), flush=True)

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
        flown_m = self._world.height_m(east, north) + HEIGHT_M
        found: list[tuple[float, float, float]] = []
        for place in unsafe:
            over_m = flown_m - self._world.height_m(*place.tolist())
            beside_m = flown_m - self._world.highest_about_m(*place.tolist(), BESIDE_M)
            if over_m > LOWEST_M and beside_m > BESIDE_M and len(found) < n:
                found.append((*place.tolist(), float(np.hypot(*(places[safe] - place).T).min())))
        return found


def sessions(options: argparse.Namespace) -> Iterator[Session]:
    """Yield the sessions of a campaign; after a crash, another vehicle flies over the places left."""
    causes = options.causes or list(CAUSES[options.kind])
    for scene in options.scenes:
        for seed in options.seeds:
            turned = causes[seed % len(causes) :] + causes[: seed % len(causes)]
            left: list[Any] | None = None
            while left is None or left:
                n = options.places
                session = Session(
                    scene, seed, options.assist, turned, n, kind=options.kind, people=options.people
                )
                session.to_come = session.to_come if left is None else left
                yield session
                left = session.to_come


def main() -> None:
    """Fly the campaign and print a line per landing, and the shares at the end."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--kind", default="ardupilot", choices=tuple(CAUSES))
    parser.add_argument("--scenes", nargs="+", default=SCENES)
    parser.add_argument("--causes", nargs="+", choices=list(ARDUCOPTER))
    parser.add_argument("--seeds", nargs="+", type=int, default=[1])
    parser.add_argument("--places", type=int, default=7, help="landings of each scene and seed")
    parser.add_argument("--people", type=int, default=0, help="who walk about within 50 m")
    parser.add_argument("--assist", default="offer", choices=("off", "offer", "act"))
    found = [one for session in sessions(parser.parse_args()) for one in session.fly()]
    for cause in dict.fromkeys(one.cause for one in found):
        these = [one for one in found if one.cause == cause]
        alone, ended = sum(not one.alone for one in these), sum(not one.ended for one in these)
        print(f"{cause}: {len(these)} landings, safe alone {alone}, with {these[0].assist} {ended}")


if __name__ == "__main__":
    main()
