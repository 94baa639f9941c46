"""What goes wrong between vehicle, sensors and companion: by name, begun and ended in flight.

One family a file: `link` (the companion's line), `autopilot`, `stick` (the pilot's hand), `losses` (what its
failsafes answer), `neighbours` (others on the line), `lidar`.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from sitl.faults import autopilot, lidar, link, losses, neighbours, stick
from sitl.faults.fault import Fault
from sitl.faults.line import SpoiltWire

__all__ = ["NAMES", "Fault", "SpoiltWire", "build"]

_BUILDERS: dict[str, Callable[[np.random.Generator], Fault]] = {
    "link_loss": lambda rng: link.LinkFault(link.Loss()),
    "link_bursts": lambda rng: link.LinkFault(link.Bursts()),
    "link_delay": lambda rng: link.LinkFault(link.Delay()),
    "link_duplicates": lambda rng: link.LinkFault(link.Duplicates()),
    "link_reordering": lambda rng: link.LinkFault(link.Reordering()),
    "link_corruption": lambda rng: link.LinkFault(link.Corruption()),
    "reboot": lambda rng: autopilot.Reboot(),
    "ekf_jump": autopilot.EstimateJump,
    "gps_drift": autopilot.EstimateDrift,
    "autopilot_held_up": autopilot.HeldUp,
    "pilot_mode": autopilot.PilotMode,
    "pilot_stick": stick.PilotStick,
    "gps_loss": losses.GpsLoss,
    "battery_failsafe": losses.BatteryFailsafe,
    "radio_failsafe": lambda rng: losses.RadioFailsafe(),
    "fence_breach": losses.FenceBreach,
    "second_vehicle": neighbours.SecondVehicle,
    "second_station": neighbours.SecondStation,
    "gimbal": neighbours.Gimbal,
    "lidar_stop": lambda rng: lidar.Stop(),
    "lidar_half": lambda rng: lidar.PacketFault(lidar.Halved()),
    "lidar_stuck": lambda rng: lidar.PacketFault(lidar.Stuck()),
    "lidar_garbage": lambda rng: lidar.PacketFault(lidar.Garbage(rng)),
    "lidar_clock": lidar.ClockStep,
    "lidar_misaligned": lidar.Misalignment,
    "lidar_dust": lambda rng: lidar.Weather(*lidar.DUST),
    "lidar_rain": lambda rng: lidar.Weather(*lidar.RAIN),
}
NAMES: tuple[str, ...] = tuple(_BUILDERS)


def build(name: str, rng: np.random.Generator) -> Fault:
    """Return a fault by its name; what it leaves open (a direction, an axis) is drawn.

    Raises
    ------
    ValueError
        There is no fault of that name.
    """
    if name not in _BUILDERS:
        raise ValueError(f"fault {name!r} is unknown; choose one of {', '.join(NAMES)}")
    return _BUILDERS[name](rng)
