"""Quality of service of a topic, in the notation of rmw_zenoh's liveliness tokens."""

from __future__ import annotations

from dataclasses import dataclass

# Of rmw/types.h; reliable, volatile and keep last are rmw_zenoh's defaults.
_BEST_EFFORT, _TRANSIENT_LOCAL = "2", "1"
_DEFAULT_DEPTH = 42


@dataclass(frozen=True, slots=True)
class Qos:
    """Quality of service.

    depth: messages kept, the last ones. reliable: else best effort. transient_local: one who subscribes later
    gets the last messages too; else volatile.
    """

    depth: int
    reliable: bool = True
    transient_local: bool = False

    def token(self) -> str:
        """Return reliability, durability, history, deadline, lifespan and liveliness; defaults are empty."""
        reliability = "" if self.reliable else _BEST_EFFORT
        durability = _TRANSIENT_LOCAL if self.transient_local else ""
        depth = "" if self.depth == _DEFAULT_DEPTH else str(self.depth)
        return f"{reliability}:{durability}:,{depth}:,:,:,,"


SENSOR_DATA = Qos(5, reliable=False)
LATCHED = Qos(1, transient_local=True)
