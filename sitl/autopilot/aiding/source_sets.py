"""Source sets of ArduPilot's EKF3: which sensor gives position, velocity and heading (AP_NavEKF_Source)."""

from __future__ import annotations

from enum import IntEnum

SETS = 3
DEFAULTS: dict[str, float] = {
    f"EK3_SRC{number}_{axis}": value if number == 1 or axis == "POSZ" else 0
    for number in range(1, SETS + 1)
    for axis, value in (("POSXY", 3), ("VELXY", 3), ("POSZ", 1), ("VELZ", 3), ("YAW", 1))
}
"""Parameters and their values: GPS, barometer and compass in the first set, a barometer in the others."""


class Source(IntEnum):
    """Values of EK3_SRCn_POSXY, _VELXY and _YAW that are modelled; any other is none."""

    NONE = 0
    COMPASS = 1
    GPS = 3
    EXTERNAL = 6


_BY_NUMBER = {int(source): source for source in Source}


class SourceSets:
    """Active source set, as MAV_CMD_SET_EKF_SOURCE_SET selects it; the first after a start.

    The height stays with the barometer, whatever EK3_SRCn_POSZ says.
    """

    def __init__(self, parameters: dict[str, float]) -> None:
        self._parameters = parameters
        self.restart()

    def select(self, number: float) -> bool:
        """Make a set the active one; return False for a number other than 1 to 3."""
        if int(number) not in range(1, SETS + 1):
            return False
        self.active = int(number)
        self._names = {axis: f"EK3_SRC{self.active}_{axis}" for axis in ("POSXY", "VELXY", "YAW")}
        return True

    def restart(self) -> None:
        """Make the first set the active one."""
        self.select(1)

    @property
    def position(self) -> Source:
        """Source of the horizontal position."""
        return self._source("POSXY")

    @property
    def velocity(self) -> Source:
        """Source of the horizontal velocity."""
        return self._source("VELXY")

    @property
    def heading(self) -> Source:
        """Source of the heading."""
        return self._source("YAW")

    @property
    def has_external_position(self) -> bool:
        """Whether any set takes its horizontal position from external navigation."""
        values = (self._parameters[f"EK3_SRC{number}_POSXY"] for number in range(1, SETS + 1))
        return any(int(value) == Source.EXTERNAL for value in values)

    def _source(self, axis: str) -> Source:
        return _BY_NUMBER.get(int(self._parameters[self._names[axis]]), Source.NONE)
