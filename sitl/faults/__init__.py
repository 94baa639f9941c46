"""Fault injection between vehicle, sensors and companion: faults by name, started and ended in flight.

One family per file: `link_faults` (the companion's link), `autopilot_faults`, `flight_faults` (the pilot's
stick, triggers of the autopilot's failsafes, wind), `gps_faults`, `neighbour_faults` (other systems on the
link), `lidar_faults`, `stream_faults` (the LiDAR's packets and clock). `BelowHeight` starts one at a height
in the descent.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from sitl.faults import (
    autopilot_faults,
    flight_faults,
    gps_faults,
    lidar_faults,
    link_faults,
    neighbour_faults,
    stream_faults,
)
from sitl.faults.fault import Fault
from sitl.faults.flight_faults import BelowHeight
from sitl.faults.link_faults import FaultyWire

__all__ = ["AT_HEIGHT", "NAMES", "SIZED", "BelowHeight", "Fault", "FaultyWire", "build", "read"]

_BUILDERS: dict[str, Callable[[np.random.Generator], Fault]] = {
    "link_loss": lambda rng: link_faults.LinkFault(link_faults.Loss()),
    "link_bursts": lambda rng: link_faults.LinkFault(link_faults.Bursts()),
    "link_delay": lambda rng: link_faults.LinkFault(link_faults.Delay()),
    "link_duplicates": lambda rng: link_faults.LinkFault(link_faults.Duplicates()),
    "link_reordering": lambda rng: link_faults.LinkFault(link_faults.Reordering()),
    "link_corruption": lambda rng: link_faults.LinkFault(link_faults.Corruption()),
    "reboot": lambda rng: autopilot_faults.Reboot(),
    "ekf_jump": autopilot_faults.EstimateJump,
    "baro_jump": autopilot_faults.BarometerJump,
    "gps_drift": autopilot_faults.EstimateDrift,
    "estimate_sway": autopilot_faults.EstimateSway,
    "autopilot_held_up": autopilot_faults.ClockStall,
    "pilot_mode": autopilot_faults.PilotMode,
    "pilot_stick": flight_faults.PilotStick,
    "gps_loss": flight_faults.GpsLoss,
    "gps_denied": gps_faults.GpsDenial,
    "gps_first_lost": lambda rng: gps_faults.FirstReceiverLoss(),
    "gps_multipath": gps_faults.GpsMultipath,
    "gps_slow_drift": gps_faults.GpsSlowDrift,
    "gps_spoof": gps_faults.GpsSpoof,
    "gps_takeover": gps_faults.GpsTakeover,
    "yaw_drift": gps_faults.YawDrift,
    "battery_failsafe": flight_faults.BatteryFailsafe,
    "radio_failsafe": lambda rng: flight_faults.RadioFailsafe(),
    "fence_breach": flight_faults.FenceBreach,
    "second_vehicle": neighbour_faults.SecondVehicle,
    "second_station": neighbour_faults.SecondStation,
    "gimbal": neighbour_faults.Gimbal,
    "fly_here": neighbour_faults.FlyHere,
    "second_companion": neighbour_faults.SecondCompanion,
    "wing_flight": lambda rng: autopilot_faults.WingFlight(),
    "lidar_stop": lambda rng: lidar_faults.Stop(),
    "lidar_half": lambda rng: lidar_faults.PacketFault(lidar_faults.Halved()),
    "lidar_stuck": lambda rng: lidar_faults.PacketFault(lidar_faults.Stuck()),
    "lidar_garbage": lambda rng: lidar_faults.PacketFault(lidar_faults.Garbage(rng)),
    "lidar_clock": lidar_faults.ClockStep,
    "lidar_misaligned": lidar_faults.Misalignment,
    "lidar_dust": lambda rng: lidar_faults.Weather(*lidar_faults.DUST),
    "wind_missing": lambda rng: flight_faults.WindMissing(),
    "wind_absurd": lambda rng: flight_faults.WindAbsurd(),
    "lidar_rain": lambda rng: lidar_faults.Weather(*lidar_faults.RAIN),
    "lidar_plumes": lambda rng: lidar_faults.Weather(None, lidar_faults.PLUMES),
    "lidar_snow": lambda rng: lidar_faults.Weather(None, lidar_faults.SNOW),
    "lidar_loss": lambda rng: lidar_faults.PacketFault(stream_faults.Loss(rng)),
    "lidar_pauses": lambda rng: stream_faults.Pauses(),
    "lidar_cover": lambda rng: lidar_faults.PacketFault(stream_faults.Cover(rng)),
    "lidar_dirt": lambda rng: lidar_faults.PacketFault(stream_faults.Dirt(rng)),
    "lidar_row": lambda rng: lidar_faults.PacketFault(stream_faults.DeadRow(int(rng.integers(1, 3)))),
    "lidar_half_rate": lambda rng: lidar_faults.PacketFault(stream_faults.HalfRate()),
    "lidar_step": lambda rng: lidar_faults.PacketFault(stream_faults.stepped(rng)),
    "lidar_drift": lambda rng: lidar_faults.PacketFault(stream_faults.drifting(rng)),
    "lidar_elsewhere": lambda rng: stream_faults.Elsewhere(),
}
NAMES: tuple[str, ...] = tuple(_BUILDERS)
SIZED: dict[str, Callable[[np.random.Generator, float], Fault]] = {
    "baro_jump": autopilot_faults.BarometerJump,
    "gps_slow_drift": gps_faults.GpsSlowDrift,
    "gps_spoof": gps_faults.GpsSpoof,
    "gps_takeover": gps_faults.GpsTakeover,
    "yaw_drift": gps_faults.YawDrift,
}
"""Faults that take a size: a rate in m/s or degrees per second, a distance in m."""
AT_HEIGHT: tuple[str, ...] = (
    *("gps_loss", "gps_denied", "gps_first_lost", "gps_multipath", "gps_slow_drift", "gps_spoof"),
    *("gps_takeover", "gps_drift", "yaw_drift", "ekf_jump", "baro_jump", "estimate_sway", "reboot"),
    *("battery_failsafe", "radio_failsafe", "fence_breach", "lidar_stop"),
    *("fly_here", "second_companion", "wing_flight"),
)
"""Faults that `read` can start: those that need neither a faulty link nor a pilot."""


def build(name: str, rng: np.random.Generator, size: float | None = None) -> Fault:
    """Return a fault by its name; its free choices (a direction, an axis) are drawn at random.

    size: of a fault of `SIZED`; None draws it.

    Raises
    ------
    ValueError
        There is no fault of that name, or it takes no size.
    """
    if name not in _BUILDERS:
        raise ValueError(f"fault {name!r} is unknown; choose one of {', '.join(NAMES)}")
    if size is None:
        return _BUILDERS[name](rng)
    if name not in SIZED:
        raise ValueError(f"fault {name!r} takes no size; those that do are {', '.join(SIZED)}")
    return SIZED[name](rng, size)


def read(text: str, seed: int) -> list[BelowHeight]:
    """Return the faults of a text such as ``gps_denied@5,yaw_drift=0.5@8``, each below a height (m).

    Raises
    ------
    ValueError
        The text is no such list.
    """
    out = []
    for number, part in enumerate(text.split(",") if text != "none" else []):
        what, _, height = part.partition("@")
        name, _, size = what.partition("=")
        try:
            height_m, sized = float(height), float(size) if size else None
        except ValueError:
            raise ValueError(f"fault {part!r}: write NAME@HEIGHT or NAME=SIZE@HEIGHT") from None
        if name not in AT_HEIGHT:
            raise ValueError(f"fault {name!r} begins at no height; those that do are {', '.join(AT_HEIGHT)}")
        if not (0 < height_m < 1000 and (sized is None or -100 < sized < 100)):
            raise ValueError(f"fault {part!r}: its height or size is out of range")
        out.append(BelowHeight(build(name, np.random.default_rng([seed, number]), sized), height_m))
    return out
