"""Operator's orders to the landing executive, from MAVLink, parameters or the page."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from enum import Enum, auto

import numpy as np

from companion.flight.landing.executive import Executive
from companion.flight.landing.situation import Reply, Situation, Vector


class OrderKind(Enum):
    """Kinds of orders."""

    ABORT = auto()
    LAND_AT_BEST = auto()
    LAND_IN_ZONE = auto()
    LAND_AT_POINT = auto()
    LAND_NOW = auto()  # at the zone reached soonest, from any mode
    SELECT_ZONE = auto()  # selects its best point
    SELECT_POINT = auto()
    LAND_AT_SELECTED = auto()


# Numbers of the orders, the same as MAV_CMD_USER_1 and as SLZ_DO. 3 is a point, with its place.
NUMBERS = {
    1: OrderKind.LAND_AT_BEST,
    2: OrderKind.LAND_IN_ZONE,
    5: OrderKind.SELECT_ZONE,
    6: OrderKind.LAND_AT_SELECTED,
    7: OrderKind.ABORT,
    8: OrderKind.LAND_NOW,
}
OF_ZONES = frozenset({OrderKind.LAND_IN_ZONE, OrderKind.SELECT_ZONE})


@dataclass(frozen=True, slots=True)
class Order:
    """One order.

    Attributes
    ----------
    zone_id
        ID of the zone, for LAND_IN_ZONE and SELECT_ZONE.
    point_enu_m
        (3,) east, north, up in the map frame, for LAND_AT_POINT and SELECT_POINT.
    """

    kind: OrderKind
    zone_id: int | None = None
    point_enu_m: Vector | None = None


class OrderDesk:
    """Executes the operator's orders.

    Parameters
    ----------
    executive
        Landing executive.
    situation
        Returns the present situation.
    reach_m
        Greatest horizontal distance of an accepted point from the map's origin.
    """

    def __init__(self, executive: Executive, situation: Callable[[], Situation], reach_m: float) -> None:
        self._executive = executive
        self._situation = situation
        self._reach_m = reach_m

    @property
    def order_count(self) -> int:
        """Order counter: incremented when an order is accepted, aborted or finished."""
        return self._executive.order_count

    def selected_zone(self) -> int:
        """Return the ID of the zone that contains the selected point, 0 for none."""
        selected = self._situation().selected
        return 0 if selected is None or selected.zone_id is None else selected.zone_id

    def carry_out(self, order: Order) -> Reply:
        """Execute an order, or return the reason of its refusal."""
        orders, situation = self._executive.orders, self._situation()
        match order:
            case Order(OrderKind.ABORT):
                return orders.abort(situation)
            case Order(OrderKind.LAND_AT_BEST):
                return orders.land_at_best(situation)
            case Order(OrderKind.LAND_NOW):
                return orders.land_now(situation)
            case Order(OrderKind.LAND_AT_SELECTED):
                return orders.land_at_selected(situation)
            case Order(OrderKind.LAND_IN_ZONE, zone_id=int(zone_id)):
                return orders.land_in_zone(situation, zone_id)
            case Order(OrderKind.SELECT_ZONE, zone_id=int(zone_id)):
                return orders.select_zone(situation, zone_id)
            case Order(point_enu_m=np.ndarray() as enu_m) if float(np.hypot(*enu_m[:2])) > self._reach_m:
                return Reply(False, "the point is too far away")
            case Order(OrderKind.LAND_AT_POINT, point_enu_m=np.ndarray() as enu_m):
                return orders.land_at_point(situation, enu_m)
            case Order(OrderKind.SELECT_POINT, point_enu_m=np.ndarray() as enu_m):
                return orders.select_point(enu_m)
        raise ValueError(f"{order}: it has neither zone nor point")
