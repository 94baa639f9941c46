"""Stick input of the pilot."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from sitl.autopilot.radio_receiver import AT_REST, PITCH, ROLL
from sitl.faults.fault import Fault

if TYPE_CHECKING:
    from sitl.simulation import Simulation

DEFLECTION_US = (150.0, 400.0)


class PilotStick(Fault):
    """Deflection of the transmitter's roll or pitch stick, held and released at the end."""

    def __init__(self, rng: np.random.Generator) -> None:
        self._channel = (ROLL, PITCH)[int(rng.integers(2))]
        sign = 1 if rng.random() < 0.5 else -1
        self._pulse_us = AT_REST[self._channel] + sign * round(float(rng.uniform(*DEFLECTION_US)))

    def start(self, simulation: Simulation) -> None:
        simulation.autopilot.receiver.transmitter[self._channel] = self._pulse_us

    def stop(self, simulation: Simulation) -> None:
        simulation.autopilot.receiver.transmitter[self._channel] = AT_REST[self._channel]
