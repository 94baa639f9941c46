"""Selection of a point, from the request until the newest report judges it."""

from __future__ import annotations

from companion.flight.landing.aim import same_place
from companion.flight.landing.situation import Vector
from slz import SelectedPoint


class PointSelection:
    """Newest selected point, and whether the pipeline is still to be asked to judge it."""

    def __init__(self) -> None:
        self._newest: Vector | None = None
        self._pending = False

    def select(self, enu_m: Vector | None) -> None:
        """Select a point: the pipeline judges it from its next report on."""
        self._newest, self._pending = enu_m, enu_m is not None

    def clear(self) -> bool:
        """Clear the selection; return whether there was one."""
        had_one = self._newest is not None
        self.select(None)
        return had_one

    @property
    def enu_m(self) -> Vector | None:
        """Newest selected point (3,), None without one."""
        return self._newest

    def collect(self) -> Vector | None:
        """Return the point to send to the pipeline, once after each selection."""
        pending, self._pending = self._pending, False
        return self._newest if pending else None

    def is_judged_by(self, selected: SelectedPoint | None) -> bool:
        """Return whether a report's selected point is the newest one, or nothing else was selected."""
        return self._newest is None or (selected is not None and same_place(selected.enu_m, self._newest))
