"""State and actions of the autopilot that its parts use."""

from __future__ import annotations

from collections.abc import Callable
from enum import IntEnum
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from sitl.autopilot.airframe import Airframe
from sitl.autopilot.guidance.precland import PrecisionLanding
from sitl.autopilot.modes import Navigator
from sitl.autopilot.position_aiding import PositionAiding
from sitl.autopilot.proximity import Proximity
from sitl.autopilot.radio_receiver import RadioReceiver
from sitl.autopilot.wind_estimator import WindEstimator
from sitl.vehicle.rigid_body import State

F64 = NDArray[np.float64]


class AutopilotView(Protocol):
    """See `Autopilot`."""

    origin_lla: tuple[float, float, float]
    parameters: dict[str, float]
    armed: bool
    airborne: bool
    battery_pct: float
    estimate: State | None
    rangefinder: tuple[int, float] | None
    truth_source: Callable[[], State] | None
    precland: PrecisionLanding
    proximity: Proximity
    aiding: PositionAiding
    receiver: RadioReceiver
    wind: WindEstimator
    airframe: Airframe
    target_enu_ms: F64

    @property
    def mode(self) -> IntEnum: ...

    @property
    def navigator(self) -> Navigator: ...

    @property
    def has_ekf2(self) -> bool: ...

    @property
    def now_ns(self) -> int: ...

    @property
    def boot_ns(self) -> int: ...

    @property
    def clock_ns(self) -> int: ...

    @property
    def estimate_boot_ns(self) -> int: ...

    @property
    def settled(self) -> bool: ...

    @property
    def position_ok(self) -> bool: ...

    @property
    def battery_v(self) -> float: ...

    @property
    def battery_used_mah(self) -> float: ...

    @property
    def height_above_home_m(self) -> float: ...

    def lla(self, enu_m: F64) -> tuple[float, float, float]: ...

    def enu_m(self, lat_deg: float, lon_deg: float, alt_m: float) -> F64: ...

    def send(self, message: Any, link: int | None = None) -> None: ...

    def send_text(self, text: str, severity: int = mavlink.MAV_SEVERITY_INFO) -> None: ...

    def set_mode(self, mode: IntEnum) -> bool: ...

    def arm(self) -> str | None: ...

    def disarm(self, *, force: bool = False) -> str | None: ...

    def take_off(self, height_m: float) -> str | None: ...
