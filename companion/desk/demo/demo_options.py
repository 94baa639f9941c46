"""Options of `slz demo`: scenes, sensors, intruders, limits, and refusals."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from companion.runtime.errors import UsageError

DUSTY = ("dust_reach_m=9",)
# A radar's heights are noisier than a LiDAR's, and it looks to the side: below 6 m it sees too little, and
# the last verified state applies, as in dust.
RADAR = ("range_noise_m=0.04", "height_noise_m=0.12", "relief_m=0.35", "commit_height_m=6", "dust_height_m=6")
ALONG_THE_VEHICLE = (
    *("lidar_x_m=0", "lidar_z_m=0.1", "lidar_pitch_deg=0", "lidar_min_m=1", "lidar_max_m=300"),
    *("angle_noise_deg=0", "lidar_timeout_s=2"),
)
# The simulated attitude errs by 0.1 degrees: 0.1 m of height at 60 m, beyond which the ground is not mapped.
LONG_RANGE = ("angle_noise_deg=0.1", "height_noise_m=0.105")
HIGH_M = 40.0  # the range of a Mid-360 to dark ground

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
class DemoSensor:
    """A sensor: its name, its name in the simulator, its URL's kind, an additional radar, its parameters."""

    name: str
    simulated: str
    kind: str
    radar: bool = False
    settings: tuple[str, ...] = ()

    def settings_for(self, scene: str) -> tuple[str, ...]:
        """Return the parameters for a scene, each as `name=value`."""
        dusty = scene == "dust_out" and self.kind == "livox"
        return (*self.settings, *(DUSTY if dusty else ()))


SENSORS = (
    DemoSensor("lidar", "mid360", "livox"),
    DemoSensor("opal", "opal", "livox", settings=(*LONG_RANGE, "lidar_pitch_deg=90", "lidar_z_m=0.05")),
    DemoSensor("flash", "flash", "flash", settings=("lidar_pitch_deg=90", "lidar_z_m=0.05")),
    DemoSensor("radar", "radar", "radar", settings=(*RADAR, *ALONG_THE_VEHICLE)),
    DemoSensor("lidar+radar", "mid360", "livox", radar=True, settings=(*RADAR, "lidar_timeout_s=2")),
)


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


def usual_sensor(survey_height_m: float) -> str:
    """Return the name of a sensor that sees the ground from a height: a Mid-360, or one of long range."""
    return "opal" if survey_height_m > HIGH_M else "lidar"


def sensor_named(name: str) -> DemoSensor:
    """Return the sensor of a name.

    Raises
    ------
    UsageError
        There is none.
    """
    for sensor in SENSORS:
        if sensor.name == name:
            return sensor
    raise UsageError(f"--sensor {name!r} is unknown: use {', '.join(s.name for s in SENSORS)}")
