"""PX4's flight modes by their custom_mode: main mode << 16 | sub mode << 24 (px4_custom_mode.h)."""

from __future__ import annotations

from enum import IntEnum


def number_of(main: int, sub: int = 0) -> int:
    """Return the custom_mode of a main and a sub mode."""
    return main << 16 | sub << 24


class Px4Mode(IntEnum):
    """Modes that this autopilot flies. DESCEND, without a position, has the number of AUTO.LAND."""

    MANUAL = number_of(1)
    ALTCTL = number_of(2)
    POSCTL = number_of(3)
    AUTO_TAKEOFF = number_of(4, 2)
    AUTO_LOITER = number_of(4, 3)
    AUTO_RTL = number_of(4, 5)
    AUTO_LAND = number_of(4, 6)
    AUTO_PRECLAND = number_of(4, 9)
    OFFBOARD = number_of(6)
    STABILIZED = number_of(7)

    @property
    def title(self) -> str:
        """Name as PX4 writes it."""
        return self.name.replace("AUTO_", "AUTO.")

    @property
    def standard(self) -> int:
        """MAV_STANDARD_MODE (getStandardModeFromNavState); 0 is none."""
        return _STANDARD.get(self, 0)


AUTO = (
    Px4Mode.AUTO_TAKEOFF,
    Px4Mode.AUTO_LOITER,
    Px4Mode.AUTO_RTL,
    Px4Mode.AUTO_LAND,
    Px4Mode.AUTO_PRECLAND,
)
MANUAL = (Px4Mode.MANUAL, Px4Mode.STABILIZED, Px4Mode.ALTCTL, Px4Mode.POSCTL)
"""Modes that the sticks fly; none runs without them (mode_requirements.cpp)."""
NEEDS_POSITION = (
    Px4Mode.POSCTL,
    Px4Mode.AUTO_TAKEOFF,
    Px4Mode.AUTO_LOITER,
    Px4Mode.AUTO_RTL,
    Px4Mode.AUTO_PRECLAND,
)
PREVENTS_ARMING = (Px4Mode.AUTO_RTL, Px4Mode.AUTO_LAND, Px4Mode.AUTO_PRECLAND)
# POSITION_HOLD, ALTITUDE_HOLD, SAFE_RECOVERY, LAND, TAKEOFF of MAV_STANDARD_MODE
_STANDARD = {
    Px4Mode.POSCTL: 1,
    Px4Mode.ALTCTL: 4,
    Px4Mode.AUTO_RTL: 5,
    Px4Mode.AUTO_LAND: 7,
    Px4Mode.AUTO_TAKEOFF: 8,
}


def mode_of(main: float, sub: float) -> Px4Mode | None:
    """Return the mode of DO_SET_MODE's parameters 2 and 3, None if it is not simulated."""
    sub = sub if int(main) == 4 else 0
    try:
        return Px4Mode(number_of(int(main), int(sub)))
    except ValueError:
        return None
