"""Cheapest flight with real packets and real MAVLink: low, short, and started in the air."""

from __future__ import annotations

import asyncio
from pathlib import Path

import numpy as np

import params
from companion.flight.app import Companion
from companion.flight.landing.situation import Phase
from sitl import faults, scenes
from sitl.intruders import DrivenCar
from sitl.simulation import Simulation
from sitl.wire.wire import open_wire
from tests.campaign import onboard
from tests.campaign.plan import Plan
from tests.campaign.witness import Witness
from tests.e2e.harness import Mission
from tests.ports import free_port

# A quarter of the ticks and a sixteenth of the pulses of the sensor, over a small map, from a low height.
TICK_NS, LIDAR_MS, POINT_RATE_HZ = 10_000_000, 100, 12_500
HEIGHT_M, CAR_BELOW_M = 12.0, 11.5
AUTOPILOT = {"WPNAV_SPEED_UP": 500.0, "LAND_SPEED": 100.0, "LAND_ALT_LOW": 800.0}
CHEAP = {
    "survey_s": 3.0,
    "survey_height_m": HEIGHT_M,
    "adaptive": "off",  # so few returns would stretch the windows to two seconds
    "zone_m": 80.0,
    "max_range_m": 60.0,
    "pose_rate_hz": 20.0,
    "landing_target_hz": 10.0,
    "obstacle_hz": 5.0,
}
NUMBERED = {float(k): phase for k, phase in enumerate(Phase)}
STEP_S = 0.05
REACH_S, AFTER_S, HANDS_OFF_S, HELD_S, RESTED_S = 60.0, 240.0, 8.0, 6.0, 2.0


class Sortie(Mission):
    """A vehicle that hovers where it took off, the companion on board, and a fault to come.

    Attributes
    ----------
    witness
        What could be seen of the flight from outside.
    """

    loop: onboard.SlowLoop

    def __init__(self, plan: Plan, folder: Path) -> None:
        self.plan = plan
        self._rng, line = (np.random.default_rng(s) for s in np.random.SeedSequence(plan.number).spawn(2))
        self.mavlink_port = free_port()
        wire = faults.FaultyWire(
            open_wire(f"udpout:127.0.0.1:{self.mavlink_port}"), line, lambda: self.sim.now_ns
        )
        self.sim = Simulation(
            scenes.build(plan.scene, plan.number),
            [wire],
            seed=plan.number,
            lidar_to=("127.0.0.1", free_port()),
            point_rate_hz=POINT_RATE_HZ,
            lidar_ms=LIDAR_MS,
            tick_ns=TICK_NS,
            wind_ms=plan.wind_ms,
            parameters=AUTOPILOT,
            pilot_height_m=HEIGHT_M,
            ready_after_s=0.1,
        )
        assert self.sim.lidar is not None
        self.lidar = f"livox:{self.sim.lidar.name}"
        self.parameters = params.build(CHEAP)
        self.auto, self.front = True, None
        self.record = folder / f"{plan.number}.mcap" if plan.fault == "full_disk" else None
        self._take_off()
        self.loop = onboard.SlowLoop(self.sim.advance)
        self.companion: Companion = self.new_companion()
        self.task: asyncio.Task[None] | None = None
        self.restarts = 0
        self.witness = Witness(self)

    def _take_off(self) -> None:
        """Climb without companion and LiDAR, which cost most."""
        self.sim.lidar_on = False
        while self.height_m < HEIGHT_M - 0.5:
            self.sim.advance()
        self.sim.lidar_on = True

    # ---- the flight -----------------------------------------------------------------------------

    @property
    def told(self) -> Phase | None:
        """The landing state that ground stations are told, None while they are told none."""
        assert self.sim.pilot is not None
        return NUMBERED.get(self.sim.pilot.named_values.get("SLZ_PHASE", -1.0))

    @property
    def down(self) -> bool:
        """Whether the flight is over: on the ground with motors off, or crashed."""
        return not self.sim.autopilot.armed

    @property
    def calls(self) -> list[tuple[int, str]]:
        """Component and text of what the pilot was told at CRITICAL."""
        assert self.sim.pilot is not None
        return list(self.sim.pilot.calls)

    async def script(self, _: Mission) -> None:
        """Wait for the state, let the fault begin, end it, and see what becomes of the flight."""
        self.sim.every_tick.append(lambda _: self.witness.look())
        if self.plan.state is Phase.CLIMB:
            self.sim.intruders.append(DrivenCar(CAR_BELOW_M))
        if not await self._until(lambda: self.told is self.plan.state, REACH_S):
            return
        if not await self._until(lambda: False, self.plan.after_s) and self.down:
            return
        await self._fail()
        await self._until(self._settled, AFTER_S)
        await self._until(lambda: False, RESTED_S)

    async def _fail(self) -> None:
        fault = self._fault()
        on_tick = fault.on_tick
        self.witness.fault_begins()
        fault.start(self.sim)
        self.sim.every_tick.append(on_tick)
        try:
            await self._until(lambda: self.down, self.plan.lasts_s)
        finally:
            self.sim.every_tick.remove(on_tick)
            fault.stop(self.sim)
            self.witness.fault_ends()

    def _fault(self) -> faults.Fault:
        name = self.plan.fault
        if name == "none":
            return faults.Fault()
        if name in onboard.NAMES:
            return onboard.build(name, self, self._rng)
        return faults.build(name, self._rng)

    def _settled(self) -> bool:
        """Whether the flight is over, somebody else has had it for a while, or it waits for somebody."""
        taken = self.witness.taken_for_s > HANDS_OFF_S
        return self.down or taken or self.witness.held_s > HELD_S

    async def _until(self, done: object, limit_s: float) -> bool:
        assert self.task is not None
        assert callable(done)
        end = self.loop.time() + limit_s
        while not done():
            if self.task.done() and not self.task.cancelled():
                self.task.result()
            if self.loop.time() >= end or (self.down and limit_s != RESTED_S):
                return bool(done())
            await asyncio.sleep(STEP_S)
        return True

    # ---- the companion's life -------------------------------------------------------------------

    def kill(self) -> None:
        """End the companion without its good-bye."""
        assert self.task is not None
        for wire in self.sim.router.wires:
            if isinstance(wire, faults.FaultyWire):
                wire.treatment = faults.link_faults.Loss()
        self.task.cancel()

    def restart(self) -> None:
        """Start another companion."""
        for wire in self.sim.router.wires:
            if isinstance(wire, faults.FaultyWire):
                wire.treatment = None
        self.restarts += 1
        self.companion = self.new_companion()
        self.start()
