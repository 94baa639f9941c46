"""Sensors of `slz demo`, with their parameters."""

from __future__ import annotations

from dataclasses import dataclass

from companion.runtime.errors import UsageError


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
SENSORS = (
    DemoSensor("lidar", "mid360", "livox"),
    DemoSensor("opal", "opal", "livox", settings=(*LONG_RANGE, "lidar_pitch_deg=90", "lidar_z_m=0.05")),
    DemoSensor("flash", "flash", "flash", settings=("lidar_pitch_deg=90", "lidar_z_m=0.05")),
    DemoSensor("radar", "radar", "radar", settings=(*RADAR, *ALONG_THE_VEHICLE)),
    DemoSensor("lidar+radar", "mid360", "livox", radar=True, settings=(*RADAR, "lidar_timeout_s=2")),
)
HIGH_M = 40.0  # the range of a Mid-360 to dark ground


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
