"""Flight of a scenario, full (sockets, threads) or in memory with coarser ticks, and its outcome."""

from __future__ import annotations

import asyncio
import functools
import math
import time
from collections.abc import Callable
from contextlib import AbstractContextManager, ExitStack, nullcontext, suppress
from dataclasses import dataclass, replace
from typing import Any
from unittest import mock

import numpy as np
import pymap3d
from pymavlink.dialects.v20 import ardupilotmega as mavlink

import params
from companion.flight import app
from companion.flight.app import Companion
from companion.flight.landing.situation import Phase
from companion.flight.mapping import pipeline_worker
from companion.flight.sensing import Sources
from companion.runtime.errors import UsageError
from sitl import scenes
from sitl.faults import FaultyWire
from sitl.scenes import Scene
from sitl.sensors.lidar_port import UdpPort
from sitl.simulation import Simulation
from sitl.wire.wire import LinkModel, MemoryWire, Wire, open_wire
from tests.campaign.onboard import SlowLoop
from tests.campaign.witness import COMPANION
from tests.e2e.harness import LIDAR_MS, POINT_RATE_HZ, TICK_NS, Mission
from tests.ports import free_port
from tests.search.hazard import Hazard
from tests.search.margin import HazardClearance, margin_of, missed_m_deg, parts_of, response_of, score_of
from tests.search.memory_loop import LOCAL, MemoryLoop
from tests.search.scenario import Scenario
from tests.search.troubles import troubles

FULL, CHEAP, COARSE = "full", "cheap", "coarse"
DETAILS = {
    FULL: {"tick_ns": TICK_NS, "lidar_ms": LIDAR_MS, "point_rate_hz": POINT_RATE_HZ},
    CHEAP: {"tick_ns": 20_000_000, "lidar_ms": 100, "point_rate_hz": 25_000},
    COARSE: {"tick_ns": 20_000_000, "lidar_ms": 160, "point_rate_hz": 16_000},
}
"""By the detail of a flight: cheap ones are counted; coarse ones, which show less in time, are searched."""
HEIGHT_M = 6.0
START_M = 6.0  # from the place that the point is near: straight below, a Mid-360 sees nothing
AUTOPILOT = {"WPNAV_SPEED_UP": 500.0, "LAND_SPEED": 100.0}
SETTINGS = {
    "survey_s": 3.0,
    "survey_height_m": HEIGHT_M,
    "adaptive": "off",  # so few returns would stretch the windows to two seconds
    "zone_m": 24.0,
    "max_range_m": 20.0,
    "pose_rate_hz": 10.0,
    "landing_target_hz": 5.0,
    "obstacle_hz": 2.0,
    "hazard_size_m": 1.0,  # so few returns would make it look closer for 15 s
}
MAVLINK_PORT = 14_550  # in memory
LOOK_S, LIMIT_S, ORDER_AGAIN_S = 0.1, 60.0, 0.5
PORT_TRIES = 3
TAKE_OFF_NS = 15_000_000_000
APPROACH_S = 16.0  # after the order the descent begins, or the point counts as refused
REACTED_S = 1.5  # a landing that was broken off, or that waits, is watched so long
Weakness = Callable[["SearchFlight"], AbstractContextManager[Any]]
SAFE, UNSAFE, ABORTED, REFUSED, TAKEN = "safe", "unsafe", "aborted", "refused", "failsafe"
ENDS = (SAFE, UNSAFE, ABORTED, REFUSED, TAKEN)


@dataclass(frozen=True, slots=True)
class Outcome:
    """What came of a flight.

    end: one of `ENDS`; "refused": it did not begin to descend; "failsafe": the autopilot landed by itself,
    and nothing was unsafe before.
    parts: of the margin. response: how it answered what happened. score: what the search minimises.
    missed: distance (m) and compass bearing from the ordered point to the touchdown, where both are known.
    """

    end: str
    margin: float
    score: float
    parts: dict[str, float]
    response: dict[str, float]
    aborts: list[str]
    touchdown: dict[str, Any] | None
    simulated_s: float
    cpu_s: float
    missed: tuple[float, float] | None = None

    @property
    def unsafe(self) -> bool:
        return self.margin < 0.0


class SearchFlight(Mission):
    """Companion and simulator on a scenario, which begins hovering over the site.

    Attributes
    ----------
    hazard
        None where the scenario has none.
    descended
        Whether the vehicle has begun to descend to a point.
    has_taken_off
        False where the place of the start is so narrow that the rotors struck something: no landing at all.
    """

    loop: Any

    def __init__(self, scenario: Scenario, detail: str) -> None:
        self.scenario, self.in_memory = scenario, detail != FULL
        self.place = _built(scenario.text("scene"), int(scenario.number("seed"))).home_enu
        self.mavlink_port = MAVLINK_PORT if self.in_memory else free_port()
        lidar_port = free_port()  # bound in memory, too, for a moment
        rngs = [
            np.random.default_rng(s) for s in np.random.SeedSequence(int(scenario.number("seed"))).spawn(3)
        ]
        wire: Wire = MemoryWire() if self.in_memory else open_wire(f"udpout:{LOCAL}:{self.mavlink_port}")
        self.sim = Simulation(
            _scene(scenario),
            [FaultyWire(wire, rngs[0], lambda: self.sim.now_ns)],
            seed=int(scenario.number("seed")),
            lidar_to=(LOCAL, lidar_port),
            wind_ms=scenario.number("wind_ms"),
            wind_from_deg=scenario.number("wind_from_deg"),
            gust_ms=scenario.number("gust_ms"),
            parameters=AUTOPILOT,
            pilot_height_m=HEIGHT_M,
            ready_after_s=0.1,
            **DETAILS[detail],
        )
        self.lidar = f"livox:{LOCAL}:{lidar_port}"
        self._lidar_port = lidar_port
        self.parameters = params.build(SETTINGS | {"max_wind_ms": 20.0})
        self.auto, self.record, self.front = False, None, None
        self._take_off()
        self.has_taken_off = self.sim.vehicle.collision is None
        self.loop = self._without_sockets(wire) if self.in_memory else SlowLoop(self.sim.advance)
        self.loop.late_s = scenario.number("late_s")
        self.sim.router.model = LinkModel(delay_s=scenario.number("link_delay_s"))
        self.hazard = None if scenario.text("hazard") == "none" else Hazard(scenario, self.kept_en_m)
        self.clearance = HazardClearance(self.hazard)
        self.sim.intruders = [] if self.hazard is None else [self.hazard]
        spells = troubles(scenario, rngs[1])
        self.silence = spells.get("lidar_stop")
        self.sim.every_tick += [self.clearance, *spells.values()]
        self.companion: Companion = self.new_companion()
        self.task = None
        self.descended = False
        self._was_final = False
        self._ordered_s = 0.0
        self._reacted_ns: int | None = None
        self._margin_when_taken: float | None = None

    def new_companion(self) -> Companion:
        """Return a companion that knows its vehicle, and need not listen for it."""
        return Companion(
            f"udpin:{LOCAL}:{self.mavlink_port}", Sources(self.lidar), self.parameters, auto=False, system=1
        )

    def _take_off(self) -> None:
        """Climb without companion and LiDAR, which cost most."""
        self.sim.lidar_on = False
        while self.height_m < HEIGHT_M - 0.5 and self.sim.now_ns < TAKE_OFF_NS:
            self.sim.advance()
        self.sim.lidar_on = True

    def _without_sockets(self, wire: Wire) -> MemoryLoop:
        """Join companion and simulator without sockets."""
        assert isinstance(wire, MemoryWire)
        assert isinstance(self.sim.lidar, UdpPort)
        wire.received.clear()

        def advance() -> int:
            now_ns = self.sim.advance()
            if wire.received:
                frames, wire.received[:] = list(wire.received), []
                for frame in frames:
                    loop.deliver(MAVLINK_PORT, frame)
            return now_ns

        loop, port = MemoryLoop(advance), self._lidar_port
        loop.outgoing[MAVLINK_PORT] = wire.send
        self.sim.lidar.close()
        self.sim.lidar = MemoryPort(self.sim.lidar, lambda packet: loop.deliver(port, packet))
        return loop

    async def script(self, _: Mission) -> None:
        """Wait until the vehicle is down, has broken off a landing, or does not land."""
        assert self.task is not None
        end_s = self.loop.time() + LIMIT_S
        while self.phase is Phase.IDLE and self.loop.time() < end_s and self.has_taken_off:
            self._order()
            await asyncio.sleep(ORDER_AGAIN_S)
        self._ordered_s = self.loop.time()
        if self.in_memory:
            self._silence_station()
        while self.sim.autopilot.armed and self.loop.time() < end_s and not self._is_over():
            if self.task.done():
                self.task.result()
            await asyncio.sleep(LOOK_S)

    def _silence_station(self) -> None:
        """Take the ground station off the air: every message would be packed and parsed for it, too."""
        self.sim.router.wires = [wire for wire in self.sim.router.wires if isinstance(wire, FaultyWire)]
        self.sim.pilot = None

    @property
    def ordered_en_m(self) -> tuple[float, float]:
        """East and north of the ordered point."""
        east, north, _ = self.place
        return east + self.scenario.number("point_east_m"), north + self.scenario.number("point_north_m")

    @property
    def kept_en_m(self) -> tuple[float, float] | None:
        """East and north of the ordered point to the autopilot; None if it jumps with the estimate."""
        return None if self.scenario.text("fault") == "ekf_jump" else self.ordered_en_m

    def _order(self) -> None:
        """Order the landing at the scenario's point, as a ground station does."""
        assert self.sim.pilot is not None
        up = float(self.sim.vehicle.truth.pos_enu_m[2])
        lat, lon, alt = pymap3d.enu2geodetic(*self.ordered_en_m, up, *self.sim.origin_lla)
        self.sim.pilot.send(
            mavlink.MAVLink_command_int_message(
                1, COMPANION, mavlink.MAV_FRAME_GLOBAL, mavlink.MAV_CMD_USER_1, 0, 0,
                3.0, 1.0, 0.0, 0.0, round(lat * 1e7), round(lon * 1e7), alt,
            )
        )  # fmt: skip

    def _is_over(self) -> bool:
        executive, now_s = self.companion.executive, self.loop.time()
        if self._margin_when_taken is None and self.sim.autopilot.failsafes.in_charge:
            self._margin_when_taken = margin_of(parts_of(self.sim, self.clearance))
        self.descended = self.descended or executive.phase in (Phase.DESCEND, Phase.FINAL)
        waits = self._was_final and executive.phase is Phase.DESCEND
        self._was_final = executive.phase is Phase.FINAL
        if (executive.tally.aborts or waits) and self._reacted_ns is None:
            self._reacted_ns = self.sim.now_ns
        watched_ns = 0 if self._reacted_ns is None else self.sim.now_ns - self._reacted_ns
        slow = not self.descended and now_s - self._ordered_s > APPROACH_S
        return slow or watched_ns * 1e-9 > REACTED_S or self.sim.touchdown is not None

    def outcome(self, cpu_s: float) -> Outcome:
        """Judge the flight by the exact world."""
        tally = self.companion.executive.tally
        parts = parts_of(self.sim, self.clearance) if self.has_taken_off else {"hazard": 1.0}
        margin = margin_of(parts)
        missed = None if self.kept_en_m is None else missed_m_deg(self.sim, self.kept_en_m)
        response = response_of(self.sim, self.hazard, self.silence, self._reacted_ns, missed)
        taken = self._margin_when_taken if self.sim.autopilot.failsafes.in_charge else None
        has_landed = self.sim.touchdown is not None
        return Outcome(
            end_of(margin, taken, has_landed=has_landed, descended=self.descended),
            margin,
            round(score_of(parts, response), 5),
            parts,
            response,
            list(tally.abort_reasons),
            self.sim.touchdown,
            round(self.sim.now_ns * 1e-9, 1),
            round(cpu_s, 2),
            missed,
        )


def end_of(margin: float, margin_when_taken: float | None, *, has_landed: bool, descended: bool) -> str:
    """Return one of `ENDS`.

    margin_when_taken: margin of the moment when a failsafe of the autopilot took over, None if none did; what
    was unsafe then is the companion's own.
    """
    if margin_when_taken is not None and margin_when_taken >= 0.0:
        return TAKEN
    if margin < 0.0:
        return UNSAFE
    if has_landed:
        return SAFE
    return ABORTED if descended else REFUSED


class MemoryPort(UdpPort):
    """LiDAR whose packets go to a function instead of a socket."""

    def __init__(self, port: UdpPort, deliver: Callable[[bytes], None]) -> None:
        self.sensor, self.name, self._deliver = port.sensor, port.name, deliver

    def scan(self, t0_ns: int, t1_ns: int, pose_at: Any, world: Any) -> None:
        for packet in self.sensor.scan(t0_ns, t1_ns, pose_at, world):
            self._deliver(packet)

    def close(self) -> None:
        """Nothing is open."""


def _scene(scenario: Scenario) -> Scene:
    scene = _built(scenario.text("scene"), int(scenario.number("seed")))
    scene.world.wash = None
    for name in tuple(scene.world.movers):
        scene.world.remove(name)  # of the flight before
    x, y, heading = scene.home_enu
    from_rad = math.radians(scenario.number("start_deg"))
    home = x + START_M * math.sin(from_rad), y + START_M * math.cos(from_rad), heading
    return replace(scene, dust_below_m=scenario.number("dust_below_m"), home_enu=home)


@functools.lru_cache(maxsize=96)
def _built(name: str, seed: int) -> Scene:
    """Return a scene, which takes as long to build as seconds of flight."""
    return scenes.build(name, seed)


class _WarmUp:
    """Compilation of all kernels, once a process."""

    def __init__(self) -> None:
        self._warm_up, self._done = pipeline_worker.warm_up, False

    def __call__(self, *args: Any) -> None:
        if not self._done:
            self._warm_up(*args)
            self._done = True


_warm_up = _WarmUp()


def fly(scenario: Scenario, detail: str = CHEAP, *, weakness: Weakness | None = None) -> Outcome:
    """Fly a scenario in one of `DETAILS` with the program as it is, or with a weakness planted in it."""
    for _ in range(PORT_TRIES - 1):
        with suppress(UsageError):  # another program took the LiDAR's port in between
            return _fly(scenario, detail, weakness)
    return _fly(scenario, detail, weakness)


def _fly(scenario: Scenario, detail: str, weakness: Weakness | None) -> Outcome:
    started_s = time.process_time()
    flight = SearchFlight(scenario, detail)
    with ExitStack() as stack:
        stack.enter_context(mock.patch.object(app, "gc"))  # a full collection costs as much as 5 s of flight
        stack.enter_context(mock.patch.object(pipeline_worker, "warm_up", _warm_up))
        stack.enter_context(nullcontext() if weakness is None else weakness(flight))
        flight.fly(flight.script)
    return flight.outcome(time.process_time() - started_s)
