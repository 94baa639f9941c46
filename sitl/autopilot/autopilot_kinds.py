"""Autopilots that can be simulated, by name: what flies, who takes off with it, and what may be set."""

from __future__ import annotations

from collections.abc import Callable, Container
from dataclasses import dataclass

from sitl.autopilot import parameters
from sitl.autopilot.autopilot import Autopilot
from sitl.autopilot.pilot import Pilot
from sitl.autopilot.px4 import px4_parameters
from sitl.autopilot.px4.px4_autopilot import Px4Autopilot
from sitl.autopilot.px4.px4_pilot import Px4Pilot


@dataclass(frozen=True, slots=True)
class AutopilotKind:
    """Classes of an autopilot and of its pilot, and its parameters.

    known: from the given parameters to the names that exist beside them. in_range: whether one may be set to
    a value.
    """

    autopilot: type[Autopilot]
    pilot: type[Pilot]
    known: Callable[[dict[str, float]], Container[str]]
    in_range: Callable[[str, float], bool]


def _known(given: dict[str, float]) -> Container[str]:
    return parameters.with_defaults({"EKF2_EN": given.get("EKF2_EN", 0.0)})


KINDS = {
    "ardupilot": AutopilotKind(Autopilot, Pilot, _known, parameters.in_range),
    "px4": AutopilotKind(
        Px4Autopilot, Px4Pilot, lambda given: px4_parameters.TYPES, px4_parameters.is_settable
    ),
}
