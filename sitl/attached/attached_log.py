"""True trajectory of a flight in another simulator, for evaluation."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pymap3d

from sitl.attached.pose_source import Place, PoseSource
from sitl.scenes import Scene
from sitl.truth.standing_gear import QUADCOPTER, Gear
from sitl.truth.touchdown import TIP_LIMIT_DEG, footing

STEP_NS = 200_000_000
# Height above its place on the ground from which the vehicle counts as flying.
FLOWN_M = 1.0


class AttachedLog:
    """Log of trajectory at 5 Hz, take-off and touchdowns, in the world's axes; times are the sensor's, s.

    Attributes
    ----------
    gear, tip_limit_deg
        The touchdowns are judged by them.
    """

    def __init__(self, scene: Scene) -> None:
        self._scene = scene
        self.gear: Gear = QUADCOPTER
        self.tip_limit_deg = TIP_LIMIT_DEG
        self._next_ns = 0
        self._stood_m: float | None = None
        self._flying = False
        self.trajectory: list[dict[str, Any]] = []
        self.takeoff: dict[str, float] | None = None
        self.touchdowns: list[dict[str, float]] = []

    def note(self, at_ns: int, enu_m: Place, heading_deg: float, source: PoseSource) -> None:
        """Record a true pose and the autopilot's reported state."""
        place = {"t": at_ns * 1e-9, "e": enu_m[0], "n": enu_m[1], "u": enu_m[2]}
        down = not source.armed or source.on_ground is True
        if down and self._flying:
            self._flying = False
            self.touchdowns.append(place | {"heading_deg": heading_deg})
        if down:
            self._stood_m = enu_m[2]
        elif not self._flying and self._stood_m is not None and enu_m[2] - self._stood_m > FLOWN_M:
            self._flying = True
            self.takeoff = self.takeoff or place
        elif self._stood_m is None and source.on_ground is False:
            self._flying = True  # already in flight when first followed
        if at_ns >= self._next_ns:
            self._next_ns = at_ns + STEP_NS
            rounded = {name: round(value, 3) for name, value in place.items()}
            self.trajectory.append({**rounded, "mode": source.mode, "armed": source.armed})

    def document(self, origin_lla: Place) -> dict[str, Any]:
        """Return the content of flight.json."""
        touchdowns = [self._judged(touchdown, origin_lla) for touchdown in self.touchdowns]
        return {
            "seed": self._scene.seed,
            "scene": self._scene.name,
            "origin": list(origin_lla),
            "takeoff": self.takeoff,
            "touchdown": touchdowns[-1] if touchdowns else None,
            "touchdowns": touchdowns,
            "trajectory": self.trajectory,
        }

    def _judged(self, touchdown: dict[str, float], origin_lla: Place) -> dict[str, Any]:
        found = footing(self._scene.world, touchdown, self.gear, self.tip_limit_deg)
        return {**_placed(touchdown, origin_lla), "footing": found._asdict()}

    def write(self, folder: Path, origin_lla: Place) -> None:
        """Write flight.json."""
        folder.mkdir(parents=True, exist_ok=True)
        (folder / "flight.json").write_text(json.dumps(self.document(origin_lla)) + "\n", "utf-8")


def _placed(event: dict[str, float], origin_lla: Place) -> dict[str, float]:
    lat, lon, alt = pymap3d.enu2geodetic(event["e"], event["n"], event["u"], *origin_lla)
    return {"lat": float(lat), "lon": float(lon), "alt": float(alt)} | event
