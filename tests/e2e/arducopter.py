"""Real ArduCopter SITL for flights."""

from __future__ import annotations

from importlib import resources
from typing import Any

from pymavlink import mavutil
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from tests.e2e.field import HOME, Field, Pilot

BASE_PORT = 5760
PORTS_APART = 10
# What makes the simulated airframe arm and fly; what we need comes from our own file.
FRAME = """
FRAME_CLASS 1
FRAME_TYPE 0
FS_THR_ENABLE 0
FS_GCS_ENABLE 0
BATT_MONITOR 4
COMPASS_OFS_X 5
COMPASS_OFS_Y 13
COMPASS_OFS_Z -18
COMPASS_OFS2_X 5
COMPASS_OFS2_Y 13
COMPASS_OFS2_Z -18
COMPASS_OFS3_X 5
COMPASS_OFS3_Y 13
COMPASS_OFS3_Z -18
INS_ACCOFFS_X 0.001
INS_ACCOFFS_Y 0.001
INS_ACCOFFS_Z 0.001
INS_ACCSCAL_X 1.001
INS_ACCSCAL_Y 1.001
INS_ACCSCAL_Z 1.001
INS_ACC2OFFS_X 0.001
INS_ACC2OFFS_Y 0.001
INS_ACC2OFFS_Z 0.001
INS_ACC2SCAL_X 1.001
INS_ACC2SCAL_Y 1.001
INS_ACC2SCAL_Z 1.001
ATC_RAT_YAW_P 0.3
ATC_RAT_YAW_I 0.02
MOT_THST_EXPO 0.65
MOT_THST_HOVER 0.39
MOT_BAT_VOLT_MIN 9.6
MOT_BAT_VOLT_MAX 12.8
SIM_TERRAIN 0
TERRAIN_ENABLE 0
"""


class ArduCopterPilot(Pilot):
    """Takes off in GUIDED, which obeys the companion already."""

    def mode_name(self, heartbeat: Any) -> str:
        return str(mavutil.mode_string_v10(heartbeat))

    def set_mode(self, name: str) -> None:
        number = float(mavutil.mode_mapping_byname(mavlink.MAV_TYPE_QUADROTOR)[name])
        self.command(mavlink.MAV_CMD_DO_SET_MODE, mavlink.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED, number)

    def ask_to_fly(self, height_m: float) -> None:
        if self.mode != "GUIDED":  # what is set before it is initialised does not last
            self.set_mode("GUIDED")
        elif not self.armed:
            self.acks.pop(mavlink.MAV_CMD_NAV_TAKEOFF, None)
            self.command(mavlink.MAV_CMD_COMPONENT_ARM_DISARM, 1.0)
        elif not self.accepted(mavlink.MAV_CMD_NAV_TAKEOFF):  # a second one starts it anew
            self.command(mavlink.MAV_CMD_NAV_TAKEOFF, *[0.0] * 6, height_m)

    def hand_over(self) -> None:
        self.until(lambda: self.mode == "GUIDED", 1, "GUIDED")


class ArduCopterField(Field):
    """A flight with ArduCopter; the pilot, the LiDAR and the companion each have a port of it."""

    landing_mode, guided_mode = "LAND", "GUIDED"

    def autopilot_words(self) -> list[str]:
        (self.folder / "frame.parm").write_text(FRAME, "utf-8")
        ours = resources.files("params").joinpath("autopilot/arducopter.parm").read_text("utf-8")
        (self.folder / "slz.parm").write_text(ours, "utf-8")
        home = ",".join(str(value) for value in (*HOME, 0.0))
        return [
            *(str(self.binary), "--model", "quad", "--speedup", "1", "--wipe", "--home", home),
            *("--defaults", "frame.parm,slz.parm", "-I", str(self.instance)),
        ]

    def new_pilot(self) -> Pilot:
        return ArduCopterPilot(self._url(0))

    def urls(self) -> tuple[str, str]:
        return self._url(2), self._url(3)

    def _url(self, port: int) -> str:
        return f"tcp:127.0.0.1:{BASE_PORT + PORTS_APART * self.instance + port}"
