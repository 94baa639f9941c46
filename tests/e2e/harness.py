"""Simulator and companion in one process, joined by real sockets and one simulated clock."""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable
from pathlib import Path
from typing import Any

import numpy as np

import params
from companion.flight.app import Companion
from companion.flight.dashboard.page import PageEndpoint
from companion.flight.landing.situation import Phase
from companion.flight.sensing import Sources
from companion.flight.telling import Displays
from companion.runtime.lockstep_loop import LockstepLoop
from sitl.sensors.lidar_port import PTY
from sitl.simulation import Simulation
from tests.ports import free_port

TICK_NS, LIDAR_MS, POINT_RATE_HZ = 10_000_000, 50, 25_000  # coarser than by default, for time
COMPUTING_S = 0.04  # of a slow computer, for a window
# How each simulated LiDAR is spoken of on board: the URL of its port, and how it is mounted.
LIDARS: dict[str, tuple[str, dict[str, float]]] = {
    "mid360": ("livox:{port}", {}),
    "vlp16": ("velodyne:{port}", {"lidar_pitch_deg": 90.0}),
    "ouster": ("ouster:{port}?meta={metadata}", {"lidar_pitch_deg": 90.0}),
    "sf45": ("lightware:{port},921600", {"lidar_pitch_deg": 90.0}),
}


class Mission:
    """A simulated vehicle with a pilot, and the companion on board."""

    def __init__(
        self,
        scene: str = "plain",
        *,
        seed: int = 1,
        auto: bool = True,
        height_m: float = 18.0,
        record: Path | None = None,
        lidar: str = "mid360",
        metadata: Path | None = None,
        page: bool = False,
        simulated: dict[str, Any] | None = None,
        **settings: Any,
    ) -> None:
        self.mavlink_port = free_port()
        self.sim = Simulation.build(
            scene,
            mavlink=[f"udpout:127.0.0.1:{self.mavlink_port}"],
            lidar=lidar,
            lidar_to=PTY if lidar == "sf45" else ("127.0.0.1", free_port()),
            seed=seed,
            pilot_height_m=height_m,
            **{"tick_ns": TICK_NS, "lidar_ms": LIDAR_MS, "point_rate_hz": POINT_RATE_HZ} | (simulated or {}),
        )
        url, mounted = LIDARS[lidar]
        assert self.sim.lidar is not None
        self.lidar = url.format(port=self.sim.lidar.name, metadata=metadata)
        self.parameters = params.build({"survey_s": 8.0, "zone_m": 200.0, **mounted, **settings})
        self.loop = LockstepLoop(self.sim.advance, lambda _: COMPUTING_S)
        self.auto = auto
        self.record = record
        self.front = PageEndpoint("127.0.0.1:0") if page else None
        self.companion = self.new_companion()
        self.task: asyncio.Task[None] | None = None

    def new_companion(self) -> Companion:
        return Companion(
            f"udpin:127.0.0.1:{self.mavlink_port}",
            Sources(self.lidar),
            self.parameters,
            auto=self.auto,
            record=self.record,
            displays=Displays(self.front),
        )

    def fly(self, script: Callable[[Mission], Awaitable[None]]) -> Mission:
        """Run a script beside the companion, then stop it and see that nothing is left."""
        try:
            self.loop.run_until_complete(self._fly(script))
        finally:
            self.sim.close()
            self.loop.close()
        assert not self.sim.autopilot.faults, "the simulated autopilot failed to read a message"
        return self

    async def _fly(self, script: Callable[[Mission], Awaitable[None]]) -> None:
        self.start()
        await script(self)
        await self.stop()
        left = {task.get_name() for task in asyncio.all_tasks()} - {asyncio.current_task().get_name()}  # type: ignore[union-attr]
        assert not left, f"tasks left: {left}"

    def start(self) -> None:
        self.task = asyncio.get_running_loop().create_task(self.companion.run(), name="companion")

    async def stop(self) -> None:
        assert self.task is not None
        self.companion.stop()
        await self.task

    async def until(self, done: Callable[[], bool], limit_s: float = 240.0) -> None:
        """Wait in simulated time; fail when the companion ends or the time is up."""
        assert self.task is not None
        end = self.loop.time() + limit_s
        while not done():
            if self.task.done():
                self.task.result()
            assert self.loop.time() < end, f"{self.phase} {self.companion.executive.tally} {self.heard[-8:]}"
            await asyncio.sleep(0.05)

    async def until_phase(self, phase: Phase, limit_s: float = 240.0) -> None:
        await self.until(lambda: self.phase is phase, limit_s)

    @property
    def phase(self) -> Phase:
        return self.companion.executive.phase

    @property
    def heard(self) -> list[str]:
        """Texts on the pilot's screen."""
        assert self.sim.pilot is not None
        return self.sim.pilot.heard

    @property
    def height_m(self) -> float:
        e, n, u = (float(v) for v in self.sim.vehicle.truth.pos_enu_m)
        return u - self.sim.scene.world.height_m(e, n)

    def touchdown_error_m(self) -> float:
        contact, chosen = self.sim.touchdown, self.companion.executive.tally.chosen_enu_m
        frame = self.companion.sensing.history.frame
        assert contact is not None
        assert chosen is not None
        assert frame is not None
        there = self.sim.autopilot.enu_m(*frame.lla(chosen))
        return float(np.hypot(there[0] - contact["e"], there[1] - contact["n"]))

    def touchdown_safe(self) -> bool:
        """Judge ground and gear at the touchdown by the exact world, cars where they stand now."""
        return not self.touchdown_fault()

    def touchdown_fault(self) -> str:
        """Return why the touchdown is unsafe; empty where it is safe."""
        from sitl.truth.touchdown import fault_of

        contact = self.sim.touchdown
        assert contact is not None
        return fault_of(self.sim.scene.world, contact)
