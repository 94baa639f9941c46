"""Day of flights on the simulated clock: take-off, survey, landing, rest, repeated."""

from __future__ import annotations

import asyncio
from collections import Counter
from pathlib import Path
from typing import Any

from companion.flight.landing.situation import Phase
from sitl.autopilot.modes import Mode
from sitl.simulation import Simulation
from tests.campaign import sortie
from tests.e2e.harness import Mission
from tests.soak.gauges import Gauges

SCENE = "streets"
FLIGHT_S, REST_S, LOOK_S = 400.0, 5.0, 300.0


class Day:
    """One companion that is never stopped, one vehicle that flies again and again."""

    def __init__(self, hours: float, path: Path, seed: int) -> None:
        self.mission = Mission(
            SCENE,
            seed=seed,
            height_m=sortie.HEIGHT_M,
            simulated={
                "point_rate_hz": sortie.POINT_RATE_HZ,
                "lidar_ms": sortie.LIDAR_MS,
                "tick_ns": sortie.TICK_NS,
                "parameters": sortie.AUTOPILOT,
                "ready_after_s": 1.0,
            },
            **sortie.CHEAP,
        )
        self._hours = hours
        self._gauges = Gauges(path)
        self._next_look_s = 0.0
        self.came_of: Counter[str] = Counter()

    def fly(self) -> Gauges:
        """Fly until the hours are over."""
        self.mission.sim.every_tick[:] = [_forget]
        try:
            self.mission.fly(self._script)
        finally:
            self._gauges.close()
        return self._gauges

    async def _script(self, mission: Mission) -> None:
        await mission.until(lambda: mission.companion.link.ready)
        end_s = mission.loop.time() + self._hours * 3600
        while mission.loop.time() < end_s:
            await self._flight(mission)
            now_s = mission.loop.time()
            if now_s >= self._next_look_s:
                self._next_look_s = now_s + LOOK_S
                self._gauges.read(mission.companion, now_s, self.came_of.total())

    async def _flight(self, mission: Mission) -> None:
        autopilot, pilot = mission.sim.autopilot, mission.sim.pilot
        assert pilot is not None
        autopilot.battery_pct = 100.0  # another one
        pilot.done = False
        flown = await self._reached(mission, lambda: mission.phase is Phase.LANDED and not autopilot.armed)
        if flown:
            self.came_of["safe" if mission.touchdown_safe() else "unsafe"] += 1
        else:
            self.came_of["pilot landed"] += 1
            pilot.set_mode(Mode.LAND)
            await self._reached(mission, lambda: not autopilot.armed)
        pilot.heard.clear()
        pilot.acks.clear()
        await asyncio.sleep(REST_S)

    async def _reached(self, mission: Mission, done: Any) -> bool:
        end_s = mission.loop.time() + FLIGHT_S
        while not (mission.sim.pilot is not None and mission.sim.pilot.done and done()):
            assert mission.task is not None
            if mission.task.done():
                mission.task.result()
            if mission.loop.time() > end_s:
                return False
            await asyncio.sleep(0.1)
        return True


def _forget(simulation: Simulation) -> None:
    """Keep no list of what was flown: only the companion is under test."""
    simulation.autopilot.mode_changes.clear()
