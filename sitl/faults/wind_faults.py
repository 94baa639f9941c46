"""Faults of the autopilot's wind estimate: no message any more, or impossible numbers."""

from __future__ import annotations

import itertools
import math
from typing import TYPE_CHECKING, Any

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from sitl.faults.fault import Fault

if TYPE_CHECKING:
    from sitl.simulation import Simulation

# Direction, speed and vertical speed: not numbers, endless, negative, faster than any wind on Earth.
ABSURD = (
    (math.nan, math.nan, math.nan),
    (90.0, math.inf, 0.0),
    (math.nan, 5.0, 0.0),
    (0.0, -4.0, 0.0),
    (180.0, 200.0, 0.0),
    (1e30, 3.0, 0.0),
)


class WindMissing(Fault):
    """The autopilot sends no WIND."""

    def start(self, simulation: Simulation) -> None:
        simulation.autopilot.wind.alter = lambda _message: None

    def stop(self, simulation: Simulation) -> None:
        simulation.autopilot.wind.alter = None


class WindAbsurd(Fault):
    """Impossible numbers in WIND, in turn."""

    def __init__(self) -> None:
        self._numbers = itertools.cycle(ABSURD)

    def start(self, simulation: Simulation) -> None:
        simulation.autopilot.wind.alter = self._spoilt

    def stop(self, simulation: Simulation) -> None:
        simulation.autopilot.wind.alter = None

    def _spoilt(self, _message: Any) -> Any:
        return mavlink.MAVLink_wind_message(*next(self._numbers))
