"""Geofence: a circle around home and a ceiling, like ArduCopter's AC_Fence."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from pymavlink.dialects.v20 import ardupilotmega as mavlink

F64 = NDArray[np.float64]

CEILING, CIRCLE = 1, 2
NAMES = {CEILING: "Max Alt", CIRCLE: "Circle"}
RECOVERY_NS = 10_000_000_000


@dataclass(slots=True)
class Fence:
    """Fences selected by FENCE_TYPE's bits, and their breaches."""

    parameters: dict[str, float]
    breached: int = 0
    count: int = 0
    breach_boot_ms: int = 0
    recovery_until_ns: int = 0

    @property
    def enabled(self) -> bool:
        """Whether any fence is active."""
        return bool(
            self.parameters["FENCE_ENABLE"] and int(self.parameters["FENCE_TYPE"]) & (CEILING | CIRCLE)
        )

    def check(self, from_home_enu_m: F64, now_ns: int, boot_ms: int) -> int:
        """Check the position; return the bits of the fences left since the last call."""
        if not self.enabled:
            self.breached = 0
            return 0
        if now_ns < self.recovery_until_ns:
            return 0
        outside = self._outside(from_home_enu_m)
        new = outside & ~self.breached
        if new:
            self.count += 1
            self.breach_boot_ms = boot_ms
        self.breached = outside
        return new

    def recover(self, now_ns: int) -> None:
        """Suspend the checks for ten seconds after a change of mode outside the fence."""
        if self.breached:
            self.recovery_until_ns = now_ns + RECOVERY_NS

    def _outside(self, from_home_enu_m: F64) -> int:
        p = self.parameters
        east, north, up = (float(v) for v in from_home_enu_m)
        outside = CEILING if up >= p["FENCE_ALT_MAX"] else 0
        outside |= CIRCLE if math.hypot(east, north) >= p["FENCE_RADIUS"] else 0
        return outside & int(p["FENCE_TYPE"])

    def status(self) -> mavlink.MAVLink_fence_status_message:
        """Return FENCE_STATUS."""
        kind = mavlink.FENCE_BREACH_MAXALT if self.breached & CEILING else mavlink.FENCE_BREACH_NONE
        kind = mavlink.FENCE_BREACH_BOUNDARY if self.breached & CIRCLE else kind
        return mavlink.MAVLink_fence_status_message(
            int(self.breached != 0), self.count, kind, self.breach_boot_ms
        )


def names(bits: int) -> str:
    """Return the names of fences as in ArduCopter's texts."""
    return " and ".join(name for bit, name in NAMES.items() if bits & bit)
