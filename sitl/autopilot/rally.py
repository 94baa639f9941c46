"""Rally points of the simulated autopilot, like ArduCopter's: each is stored on arrival."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from sitl.autopilot.mission_items import MissionItems, place_fault

F64 = NDArray[np.float64]

RALLY_POINT = 5100


class Rally(MissionItems):
    """Rally points."""

    kind, room, total = mavlink.MAV_MISSION_TYPE_RALLY, 84, "RALLY_TOTAL"
    replaces_at_end = False

    def points_enu_m(self) -> list[F64]:
        """Return the points in the estimate's frame; relative altitudes are above the current home."""
        home_up = float(self._ap.navigator.home_enu_m[2])
        found = []
        for point in self.items:
            enu = self._ap.enu_m(point.lat_e7 * 1e-7, point.lon_e7 * 1e-7, self._ap.origin_lla[2])
            enu[2] = point.alt_m + home_up if point.relative else point.alt_m - self._ap.origin_lla[2]
            found.append(enu)
        return found

    def _fault(self, message: Any) -> int:
        if message.command != RALLY_POINT:
            return int(mavlink.MAV_MISSION_UNSUPPORTED)
        return place_fault(message)
