"""Options of `slz demo`: scenes, intruders, limits, and what is refused of them."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from companion.desk.demo.demo_sensors import SENSORS, DemoSensor
from companion.runtime.errors import UsageError

SCENES = (
    *("stadium", "plain", "hill", "streets", "mountains", "dense", "dust_out"),
    *("lakes", "ponds", "river", "flooded_field", "car_park_dry", "car_park_wet", "flat_roofs", "maize"),
    *("snowfield", "power_line", "swaying_trees", "corridor", "wall"),
)
TAKEOFF_M = {"dust_out": 40.0}
"""Take-off height by scene, where it is not 30 m: above the dust."""
INTRUDERS = ("car", "jib", "walker", "runner", "dog", "cyclist", "passing_car", "ball")
INTRUDER_BELOW_M = 200.0


@dataclass(frozen=True, slots=True)
class DemoOptions:
    """Options of a demonstration: scene, seed, speed, folder, intruder, sensor, limits and wind."""

    scene: str
    seed: int
    speedup: float
    out: Path
    intruder: str = "none"
    point_rate_hz: float = 200_000.0
    limit_s: float = 900.0
    sensor: DemoSensor = SENSORS[0]
    prior: Path | None = None
    wind_ms: float = 3.0
    wind_from_deg: float | None = None


def check(plan: DemoOptions) -> None:
    """Raise `UsageError` for options that the simulator would refuse, before it is started."""
    if plan.scene not in SCENES:
        raise UsageError(f"--scene {plan.scene!r} is unknown: use {', '.join(SCENES)}")
    for option, value, low, high in (
        ("speedup", plan.speedup, 0.0, 1000.0),
        ("point-rate", plan.point_rate_hz, 1000.0, 2_000_000.0),
        ("limit-s", plan.limit_s, 1.0, 86_400.0),
        ("wind", plan.wind_ms, 0.0, 50.0),
        ("wind-from", plan.wind_from_deg or 0.0, 0.0, 360.0),
    ):
        if not low <= value <= high:
            raise UsageError(f"--{option} {value:g}: must be a number from {low:g} to {high:.10g}")
    rate = plan.point_rate_hz
    if not rate.is_integer() or 10**9 % int(rate):
        below = next(n for n in range(int(rate), 0, -1) if 10**9 % n == 0)
        above = next(n for n in range(int(rate) + 1, 10**9 + 1) if 10**9 % n == 0)
        raise UsageError(
            f"--point-rate {rate:.10g}: must be a whole number that divides 10^9, such as {below} or {above}"
        )
    coming = plan.intruder.split(",")
    if plan.intruder != "none" and not (_are_once(coming) and all(map(_is_intruder, coming))):
        raise UsageError(
            f"--intruder {plan.intruder!r}: write KIND@HEIGHT, such as car@15, up to {INTRUDER_BELOW_M:g} m; "
            f"several by commas, each once, of {', '.join(INTRUDERS)}"
        )


def _are_once(intruders: list[str]) -> bool:
    kinds = [text.partition("@")[0] for text in intruders]
    return len(set(kinds)) == len(kinds)


def _is_intruder(text: str) -> bool:
    kind, _, height = text.partition("@")
    try:
        return kind in INTRUDERS and 0 < float(height) <= INTRUDER_BELOW_M
    except ValueError:
        return False
