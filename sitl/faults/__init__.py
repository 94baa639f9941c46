"""Fault injection between vehicle, sensors and companion: faults by name, started and ended in flight.

One family per file: `link_faults` (the companion's link), `autopilot_faults`, `stick_fault` (the pilot's
stick), `failsafe_faults` (triggers of the autopilot's failsafes), `neighbour_faults` (other systems on the
link), `lidar_faults`, `wind_faults`.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from sitl.faults import (
    autopilot_faults,
    failsafe_faults,
    lidar_faults,
    link_faults,
    neighbour_faults,
    stick_fault,
    wind_faults,
)
from sitl.faults.fault import Fault
from sitl.faults.faulty_wire import FaultyWire

__all__ = ["NAMES", "Fault", "FaultyWire", "build"]

_BUILDERS: dict[str, Callable[[np.random.Generator], Fault]] = {
    "link_loss": lambda rng: link_faults.LinkFault(link_faults.Loss()),
    "link_bursts": lambda rng: link_faults.LinkFault(link_faults.Bursts()),
    "link_delay": lambda rng: link_faults.LinkFault(link_faults.Delay()),
    "link_duplicates": lambda rng: link_faults.LinkFault(link_faults.Duplicates()),
    "link_reordering": lambda rng: link_faults.LinkFault(link_faults.Reordering()),
    "link_corruption": lambda rng: link_faults.LinkFault(link_faults.Corruption()),
    "reboot": lambda rng: autopilot_faults.Reboot(),
    "ekf_jump": autopilot_faults.EstimateJump,
    "gps_drift": autopilot_faults.EstimateDrift,
    "estimate_sway": autopilot_faults.EstimateSway,
    "autopilot_held_up": autopilot_faults.ClockStall,
    "pilot_mode": autopilot_faults.PilotMode,
    "pilot_stick": stick_fault.PilotStick,
    "gps_loss": failsafe_faults.GpsLoss,
    "battery_failsafe": failsafe_faults.BatteryFailsafe,
    "radio_failsafe": lambda rng: failsafe_faults.RadioFailsafe(),
    "fence_breach": failsafe_faults.FenceBreach,
    "second_vehicle": neighbour_faults.SecondVehicle,
    "second_station": neighbour_faults.SecondStation,
    "gimbal": neighbour_faults.Gimbal,
    "lidar_stop": lambda rng: lidar_faults.Stop(),
    "lidar_half": lambda rng: lidar_faults.PacketFault(lidar_faults.Halved()),
    "lidar_stuck": lambda rng: lidar_faults.PacketFault(lidar_faults.Stuck()),
    "lidar_garbage": lambda rng: lidar_faults.PacketFault(lidar_faults.Garbage(rng)),
    "lidar_clock": lidar_faults.ClockStep,
    "lidar_misaligned": lidar_faults.Misalignment,
    "lidar_dust": lambda rng: lidar_faults.Weather(*lidar_faults.DUST),
    "wind_missing": lambda rng: wind_faults.WindMissing(),
    "wind_absurd": lambda rng: wind_faults.WindAbsurd(),
    "lidar_rain": lambda rng: lidar_faults.Weather(*lidar_faults.RAIN),
    "lidar_plumes": lambda rng: lidar_faults.Weather(None, lidar_faults.PLUMES),
    "lidar_snow": lambda rng: lidar_faults.Weather(None, lidar_faults.SNOW),
}
NAMES: tuple[str, ...] = tuple(_BUILDERS)


def build(name: str, rng: np.random.Generator) -> Fault:
    """Return a fault by its name; its free choices (a direction, an axis) are drawn at random.

    Raises
    ------
    ValueError
        There is no fault of that name.
    """
    if name not in _BUILDERS:
        raise ValueError(f"fault {name!r} is unknown; choose one of {', '.join(NAMES)}")
    return _BUILDERS[name](rng)
