"""Plain that is so dry that the rotors raise dust below 30 m, which hides the ground from any LiDAR."""

from __future__ import annotations

from dataclasses import replace

from sitl.scenes import plain
from sitl.scenes.scene import Scene

DUST_BELOW_M = 30.0


def build(seed: int) -> Scene:
    """Return the plain of this seed, with dust."""
    return replace(
        plain.build(seed),
        name="dust_out",
        description="Open grassland so dry that the rotors' dust hides it from LiDARs below 30 m",
        dust_below_m=DUST_BELOW_M,
    )
