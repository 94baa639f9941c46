"""Faults of the companion's own computer, which the simulator cannot make."""

from __future__ import annotations

import asyncio
import time
from collections.abc import Callable
from concurrent.futures import Executor
from functools import partial
from typing import TYPE_CHECKING, Any
from unittest import mock

import numpy as np

from companion.flight.recorder import recording_writer
from companion.runtime.lockstep_loop import LockstepLoop
from sitl.faults.fault import Fault

if TYPE_CHECKING:
    from sitl.simulation import Simulation
    from tests.campaign.sortie import Sortie

STALL_TICKS = (5, 30)  # of 10 ms
LATE_S = (0.5, 4.0)
CLOCK_S = 3600.0


class SlowLoop(LockstepLoop):
    """Lock-step loop whose computations can be late, and which itself can sleep through some ticks.

    Attributes
    ----------
    late_s
        So much simulated time passes before the result of a computation is there.
    stall_ticks
        So many ticks pass before the loop looks again.
    """

    def __init__(self, advance: Callable[[], int]) -> None:
        self.late_s = 0.0
        self.stall_ticks = 1
        super().__init__(lambda: [advance() for _ in range(self.stall_ticks)][-1])

    def run_in_executor(self, executor: Executor | None, func: Callable[..., Any], *args: Any) -> Any:
        result = super().run_in_executor(executor, func, *args)
        return result if not self.late_s else self.create_task(self._late(result, self.late_s))

    async def _late(self, result: asyncio.Future[Any], late_s: float) -> Any:
        value = await result
        await asyncio.sleep(late_s)
        return value


class SlowComputer(Fault):
    """Windows are computed up to four seconds late, and nothing at all runs for up to 0.3 s at a time."""

    def __init__(self, sortie: Sortie, rng: np.random.Generator) -> None:
        self._loop = sortie.loop
        self._late_s = float(rng.uniform(*LATE_S))
        self._ticks = int(rng.integers(*STALL_TICKS))

    def start(self, simulation: Simulation) -> None:
        self._loop.late_s, self._loop.stall_ticks = self._late_s, self._ticks

    def stop(self, simulation: Simulation) -> None:
        self._loop.late_s, self._loop.stall_ticks = 0.0, 1


class _Patched(Fault):
    """Other parts stand in for some of the program's while it lasts."""

    _patches: list[Any]

    def start(self, simulation: Simulation) -> None:
        for patch in self._patches:
            patch.start()

    def stop(self, simulation: Simulation) -> None:
        for patch in self._patches:
            patch.stop()


class FullDisk(_Patched):
    """The disk of the recording has no room left: every look at it says so, every write of it fails."""

    def __init__(self, sortie: Sortie, rng: np.random.Generator) -> None:
        self._patches = [
            mock.patch.object(
                recording_writer.os, "fsync", side_effect=OSError(28, "No space left on device")
            ),
            mock.patch.object(
                recording_writer.McapWriter, "_write", side_effect=OSError(28, "No space left on device")
            ),
        ][: 1 + int(rng.integers(2))]


class WallClockStep(_Patched):
    """The time of day is set by an hour, as when GPS or a network first tells it."""

    def __init__(self, sortie: Sortie, rng: np.random.Generator) -> None:
        step_s = CLOCK_S if rng.random() < 0.5 else -CLOCK_S
        self._patches = [
            mock.patch.object(time, name, partial(_stepped, getattr(time, name), step))
            for name, step in (("time", step_s), ("time_ns", round(step_s * 1e9)))
        ]


def _stepped(clock: Callable[[], float], step: float) -> float:
    return clock() + step


class Killed(Fault):
    """The program is killed without a word, and started again when the fault ends."""

    def __init__(self, sortie: Sortie, rng: np.random.Generator) -> None:
        self._sortie = sortie

    def start(self, simulation: Simulation) -> None:
        self._sortie.kill()

    def stop(self, simulation: Simulation) -> None:
        self._sortie.restart()


_BUILDERS: dict[str, Callable[[Sortie, np.random.Generator], Fault]] = {
    "slow_computer": SlowComputer,
    "full_disk": FullDisk,
    "wall_clock": WallClockStep,
    "killed": Killed,
}
NAMES: tuple[str, ...] = tuple(_BUILDERS)


def build(name: str, sortie: Sortie, rng: np.random.Generator) -> Fault:
    """Return a fault of the companion's computer by its name."""
    return _BUILDERS[name](sortie, rng)
