"""True trajectory of a flight, for evaluation."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any, Protocol

import pymap3d

from sitl.autopilot.autopilot import Autopilot
from sitl.scenes.scene import Scene
from sitl.truth.standing_gear import QUADCOPTER, Gear
from sitl.truth.touchdown import TIP_LIMIT_DEG, footing
from sitl.vehicle.multirotor import Vehicle

STEP_NS = 200_000_000


class LoggedFlight(Protocol):
    """See `Simulation`."""

    scene: Scene
    vehicle: Vehicle
    autopilot: Autopilot
    origin_lla: tuple[float, float, float]

    @property
    def now_ns(self) -> int: ...

    @property
    def touchdown(self) -> dict[str, Any] | None: ...


class FlightLog:
    """Log of trajectory at 5 Hz, take-off, touchdown, modes and events.

    Attributes
    ----------
    gear, tip_limit_deg
        The touchdown is judged by them.
    """

    def __init__(self, simulation: LoggedFlight) -> None:
        self._simulation = simulation
        self.gear: Gear = QUADCOPTER
        self.tip_limit_deg = TIP_LIMIT_DEG
        self._next_ns = 0
        self.trajectory: list[dict[str, Any]] = []
        self.takeoff: dict[str, float] | None = None
        self.events: list[dict[str, Any]] = []

    def note(self) -> None:
        """Record the simulation's state after a tick."""
        s = self._simulation
        if self.takeoff is None and s.autopilot.airborne:
            e, n, u = (float(v) for v in s.vehicle.truth.pos_enu_m)
            self.takeoff = {"t": s.now_ns * 1e-9, "e": e, "n": n, "u": u}
        if s.now_ns < self._next_ns:
            return
        self._next_ns = s.now_ns + STEP_NS
        e, n, u = (round(float(v), 3) for v in s.vehicle.truth.pos_enu_m)
        self.trajectory.append(
            {
                "t": round(s.now_ns * 1e-9, 4),
                "e": e,
                "n": n,
                "u": u,
                "mode": s.autopilot.mode_name,
                "armed": s.autopilot.armed,
            }
        )

    def document(self) -> dict[str, Any]:
        """Return the content of flight.json."""
        s = self._simulation
        return {
            "seed": s.scene.seed,
            "scene": s.scene.name,
            "origin": list(s.origin_lla),
            "wind": self._wind(),
            "takeoff": self.takeoff,
            "touchdown": self._judged(s.touchdown),
            "collision": self._placed(s.vehicle.collision),
            "crashed": s.vehicle.collision is not None,
            "armed_at_end": s.autopilot.armed,
            "modes": [{"t": t * 1e-9, "mode": mode} for t, mode in s.autopilot.mode_changes],
            "events": self.events,
            "trajectory": self.trajectory,
        }

    def _wind(self) -> dict[str, float]:
        """Return the mean wind 10 m over the ground: where it blows from, and its speed."""
        east, north, _ = (float(v) for v in self._simulation.vehicle.wind.mean_enu_ms)
        from_deg = math.degrees(math.atan2(-east, -north)) % 360.0
        return {"from_deg": round(from_deg, 1), "speed_ms": round(math.hypot(east, north), 2)}

    def _judged(self, touchdown: dict[str, Any] | None) -> dict[str, Any] | None:
        placed = self._placed(touchdown)
        if placed is None:
            return None
        found = footing(self._simulation.scene.world, placed, self.gear, self.tip_limit_deg)
        return placed | {"footing": found._asdict()}

    def _placed(self, event: dict[str, Any] | None) -> dict[str, Any] | None:
        if event is None:
            return None
        origin = self._simulation.origin_lla
        lat, lon, alt = pymap3d.enu2geodetic(event["e"], event["n"], event["u"], *origin)
        place = {"t": event["t_ns"] * 1e-9, "lat": float(lat), "lon": float(lon), "alt": float(alt)}
        return place | event

    def write(self, folder: Path) -> None:
        """Write flight.json."""
        folder.mkdir(parents=True, exist_ok=True)
        (folder / "flight.json").write_text(json.dumps(self.document()) + "\n", "utf-8")
