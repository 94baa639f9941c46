"""Landing benchmark over all scenes; a car drives onto the point in every fourth, a pilot in every tenth.

python -m tests.bench.landings --flights 200 --jobs 2 --out landings.json
python -m tests.bench.landings --flights 100 --kind wind --coarse
python -m tests.bench.landings --flights 200 --kind hazard --coarse
python -m tests.bench.landings --flights 100 --kind gps_cut
"""

from __future__ import annotations

import argparse
import asyncio
import functools
import json
import multiprocessing
import sys
import time
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from companion.flight.landing.situation import Phase
from companion.runtime.program_version import program_version
from sitl import faults, scenes
from sitl.autopilot.modes import Mode
from sitl.intruders import Crosser, read
from tests.bench.crossers import CrossingWitness
from tests.bench.place_witness import PlaceWitness
from tests.e2e.harness import Mission

KINDS = ("mixed", "calm", "wind", "hazard", "jib", "crossing", "drift", "undrifted", "gps_cut")
HAZARD_BELOW_M = (5.0, 14.0)
ANY_HEIGHT_M = (2.5, 20.0)
CROSSERS = ("walker", "runner", "dog", "cyclist", "passing_car")
JIB_BEFORE_M = 3.0
WIND_MS = 10.0
CUT_BELOW_M, CUT_FROM_M = 25.0, 30.0
AIDED = {"VISO_TYPE": 1.0, "VISO_DELAY_MS": 200.0, "EK3_SRC2_POSXY": 6.0, "EK3_SRC2_VELXY": 6.0}
STRUCTURED = ("stadium", "streets", "buildings", "flat_roofs", "landing_site", "borrow_pit", "car_park")
FEATURELESS = ("plain", "snowfield")
SCENES = tuple(name for name in scenes.NAMES if name != "dust_out")  # whose dust blinds a LiDAR alone
FINE = {"tick_ns": 2_500_000, "lidar_ms": 20, "point_rate_hz": 50_000}
REAL = {"tick_ns": 10_000_000, "lidar_ms": 50, "point_rate_hz": 200_000}  # of a Mid-360
COARSE = {"tick_ns": 5_000_000, "lidar_ms": 50, "point_rate_hz": 25_000}
FLYING_COMMANDS = frozenset(
    {mavlink.MAV_CMD_DO_SET_MODE, mavlink.MAV_CMD_NAV_LAND, mavlink.MAV_CMD_DO_REPOSITION}
)
SETPOINTS = frozenset({"SET_POSITION_TARGET_LOCAL_NED", "SET_POSITION_TARGET_GLOBAL_INT", "SET_MODE"})


@dataclass(frozen=True, slots=True)
class Plan:
    """One flight: its scene and seed, and what goes on in it."""

    number: int
    scene: str
    hazards: str = "none"
    taken_over_in: Phase | None = None
    wind_ms: float = 3.0
    crossed: bool = False
    real: bool = False
    odometry: str = "off"
    faults: str = "none"

    @property
    def is_real(self) -> bool:
        """Whether the LiDAR has the rate of a real one."""
        return self.crossed or self.real


def plan(number: int, kind: str) -> Plan:
    """Return the flight of a number; the same number is the same flight.

    Kinds: mixed has a car in every fourth and a pilot who takes over in every tenth flight; calm has neither
    them nor wind; wind blows up to `WIND_MS`; hazard has a car in every flight, which drives onto the point;
    jib has a crane's jib before it, which swings over the vehicle; crossing has something that passes the
    point, seen at the rate of a real sensor. Over structured scenes, at that rate: drift lands by the map,
    undrifted without the odometry, and gps_cut (each tenth over a featureless scene) with GPS denied below
    25 m and the odometry sent to the autopilot.
    """
    rng = np.random.default_rng(number)
    phases = (Phase.SURVEY, Phase.APPROACH, Phase.DESCEND, Phase.FINAL)
    scene = SCENES[number % len(SCENES)]
    below_m, phase = float(rng.uniform(*HAZARD_BELOW_M)), phases[int(rng.integers(len(phases)))]
    if kind == "calm":
        return Plan(number, scene, wind_ms=0.0)
    if kind == "wind":
        return Plan(number, scene, wind_ms=float(rng.uniform(0.0, WIND_MS)))
    if kind in ("drift", "undrifted"):
        over = STRUCTURED[number % len(STRUCTURED)]
        return Plan(number, over, real=True, odometry="map" if kind == "drift" else "off")
    if kind == "gps_cut":
        over = FEATURELESS if number % 10 == 9 else (*STRUCTURED, "dense")
        cut = f"gps_denied@{CUT_BELOW_M:g}"
        scene = over[number % len(over)]
        return Plan(number, scene, real=True, odometry="autopilot", faults=cut)
    car = f"car@{below_m:.2f}"
    below_m = float(rng.uniform(*ANY_HEIGHT_M))
    if kind == "hazard":
        return Plan(number, scene, f"car@{below_m:.2f}")
    if kind == "jib":
        return Plan(number, scene, f"jib@{below_m + JIB_BEFORE_M:.2f},car@{below_m:.2f}")
    if kind == "crossing":
        return Plan(number, scene, f"{CROSSERS[number % len(CROSSERS)]}@{below_m:.2f}", crossed=True)
    return Plan(number, scene, car if number % 4 == 3 else "none", phase if number % 10 == 4 else None)


class Witness:
    """Counts what the companion commands while the vehicle is in a mode of the pilot's."""

    def __init__(self, mission: Mission) -> None:
        self._autopilot = mission.sim.autopilot
        self._receive = self._autopilot.receive
        self.commands = 0
        self._autopilot.receive = self.receive  # type: ignore[method-assign]

    def receive(self, message: Any, link: int, now_ns: int) -> None:
        """Look at a message on its way to the autopilot."""
        kind = message.get_type()
        commands = kind in SETPOINTS or getattr(message, "command", None) in FLYING_COMMANDS
        pilots = self._autopilot.armed and self._autopilot.mode not in (Mode.GUIDED, Mode.LAND)
        self.commands += commands and pilots and message.get_srcComponent() == 191
        self._receive(message, link, now_ns)


def fly(flight: Plan, *, coarse: bool = False) -> dict[str, Any]:
    """Fly one landing and return what came of it."""
    started = time.perf_counter()
    sensor = REAL if flight.is_real else COARSE if coarse else FINE
    height_m, survey_s = (20.0, 8.0) if flight.crossed else (25.0, 15.0)
    simulated: dict[str, Any] = {"wind_ms": flight.wind_ms}
    if flight.odometry == "autopilot":
        height_m, simulated["parameters"] = CUT_FROM_M, AIDED
    mission = Mission(
        flight.scene,
        seed=flight.number,
        height_m=height_m,
        survey_s=survey_s,
        simulated=sensor | simulated,
        max_wind_ms=20.0,
        odometry=flight.odometry,
    )
    mission.sim.every_tick.extend(faults.read(flight.faults, flight.number))
    place = PlaceWitness(mission)
    witness = Witness(mission)
    intruders = read(flight.hazards, flight.number)
    crossings = [CrossingWitness(mission, one) for one in intruders if isinstance(one, Crosser)]
    mission.sim.intruders = [*intruders, *crossings]

    async def script(m: Mission) -> None:
        if flight.taken_over_in is not None:
            await m.until_phase(flight.taken_over_in, 400)
            assert m.sim.pilot is not None
            m.sim.pilot.set_mode(Mode.LOITER)
            await m.until_phase(Phase.IDLE, 3)
            await asyncio.sleep(5)
            m.sim.pilot.set_mode(Mode.GUIDED)
        await m.until(lambda: m.phase is Phase.LANDED or place.is_called, 600)
        if not place.is_called:
            await m.until(lambda: not m.sim.autopilot.armed, 10)

    error = ""
    try:
        mission.fly(script)
    except AssertionError as failure:
        error = str(failure).splitlines()[0][:300]
    landed = mission.sim.touchdown is not None
    tally = mission.companion.executive.tally
    return {
        **asdict(flight),
        "taken_over_in": flight.taken_over_in and flight.taken_over_in.value,
        "landed": landed and not error,
        "safe": landed and mission.touchdown_safe(),
        "error_m": mission.touchdown_error_m() if landed else None,
        **place.figures(),
        "estimated_error_m": _estimated_error_m(mission) if landed else None,
        "aborts": tally.abort_reasons,
        "hazard_arrived": any(i.arrived for i in intruders),
        "crossing": crossings[0].figures() if crossings else None,
        "collision": mission.sim.vehicle.collision,
        "off_wind_deg": _off_wind_deg(mission) if landed else None,
        "commands_while_pilot_flies": witness.commands,
        "simulated_s": round(mission.loop.time(), 1),
        "wall_s": round(time.perf_counter() - started, 1),
        "failure": error,
    }


def _estimated_error_m(mission: Mission) -> float:
    """Return how far from the point the autopilot believes to stand: the part that is not its own drift."""
    chosen, frame = mission.companion.executive.tally.chosen_enu_m, mission.companion.sensing.history.frame
    estimate = mission.sim.autopilot.estimate
    assert chosen is not None
    assert frame is not None
    assert estimate is not None
    off = mission.sim.autopilot.enu_m(*frame.lla(chosen)) - estimate.pos_enu_m
    return float(np.hypot(off[0], off[1]))


def _off_wind_deg(mission: Mission) -> float:
    """Return the angle from the heading at the touchdown to where the mean wind comes from."""
    document = mission.sim.log.document()
    off = document["touchdown"]["heading_deg"] - document["wind"]["from_deg"]
    return abs(float(np.degrees(np.arctan2(np.sin(np.radians(off)), np.cos(np.radians(off))))))


def _quantiles(values: list[float]) -> dict[str, float]:
    return (
        {}
        if not values
        else {
            name: round(float(np.percentile(values, q)), 3)
            for name, q in (("p50", 50), ("p95", 95), ("max", 100))
        }
    )


def summary(flights: list[dict[str, Any]]) -> dict[str, Any]:
    """Return the figures of all flights."""
    hazards = [f for f in flights if f["hazard_arrived"]]
    return {
        "flights": len(flights),
        "landed": sum(f["landed"] for f in flights),
        "safe": sum(f["safe"] for f in flights),
        "collisions": sum(f["collision"] is not None for f in flights),
        "off_wind_deg": _quantiles([f["off_wind_deg"] for f in flights if f["landed"] and f["wind_ms"] > 2]),
        "error_m": _quantiles([f["error_m"] for f in flights if f["landed"]]),
        "estimated_error_m": _quantiles([f["estimated_error_m"] for f in flights if f["landed"]]),
        "world_error_m": _quantiles([f["world_error_m"] for f in flights if f["landed"]]),
        "went_on_without_gps": sum(f["went_on"] for f in flights),
        "called_without_gps": sum(f["told_s"] is not None for f in flights),
        "late": sum(f["crossing"]["late"] for f in flights if f["crossing"]),
        "needless_aborts": sum(f["crossing"]["needless"] for f in flights if f["crossing"]),
        "hazards": len(hazards),
        "hazards_broken_off": sum(bool(f["aborts"]) for f in hazards),
        "aborts_without_hazard": sum(len(f["aborts"]) for f in flights if f["hazards"] == "none"),
        "commands_while_pilot_flies": sum(f["commands_while_pilot_flies"] for f in flights),
    }


def main() -> None:
    """Fly them all and print the figures."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--flights", type=int, default=200)
    parser.add_argument("--kind", choices=KINDS, default="mixed")
    parser.add_argument("--coarse", action="store_true", help="half of the ticks and of the points")
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--out", type=Path, default=Path("landings.json"))
    own = parser.parse_args()
    plans = [plan(number, own.kind) for number in range(own.first, own.first + own.flights)]
    flights: list[dict[str, Any]] = []
    made_by = {"kind": own.kind, "coarse": own.coarse, "program": program_version()}
    with multiprocessing.get_context("spawn").Pool(own.jobs) as pool, own.out.open("w") as out:
        for flight in pool.imap_unordered(functools.partial(fly, coarse=own.coarse), plans):
            flights.append(flight)
            out.write(json.dumps(flight | made_by) + "\n")
            out.flush()
            print(json.dumps(flight), file=sys.stderr)
    print(json.dumps(summary(flights), indent=1))


if __name__ == "__main__":
    main()
