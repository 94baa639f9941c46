"""Orders as MAVLink parameters, for ground stations that set parameters but send no MAV_CMD_USER_1."""

from __future__ import annotations

from companion.flight.landing.orders.operator_order import NUMBERS, OF_ZONES, Order, OrderDesk, OrderKind
from companion.flight.services.settings import Change
from companion.runtime.clock import now_ns
from params import Row

SELECT_ROW = Row(
    name="select",
    mavlink="SLZ_SELECT",
    unit="",
    kind=int,
    low=0,
    high=2**24,
    choices=(),
    default=0,
    source="operator",
    sentence="Zone to select by its ID: its best point comes under watch. Reads as the zone under watch.",
    live=True,
)
DO_ROW = Row(
    name="do",
    mavlink="SLZ_DO",
    unit="",
    kind=int,
    low=0,
    high=8,
    choices=(),
    default=0,
    source="operator",
    sentence="Order: 1 land at the best zone, 6 at the selected point, 7 abort, 8 emergency. Reads as 0.",
    live=True,
)
ORDERS = {number: kind for number, kind in NUMBERS.items() if kind not in OF_ZONES}
# Numbers with another meaning before version 0.3, when MAV_CMD_USER_1 had other ones.
RENUMBERED = {
    2: "selected point is 6 now",
    3: "emergency is 8 now",
    4: "abort is 7, emergency 8 now",
}
# A station that missed the answer sets the parameter again: a repeat, while the first order is valid.
REPEAT_NS = 3_000_000_000
RESENT_NS = 4_000_000_000  # of an order to be confirmed: from one setting to the next


class OrderParameters:
    """SLZ_SELECT and SLZ_DO; neither is stored, so that a file of saved parameters orders nothing.

    Attributes
    ----------
    rows
        The two parameters.
    do
        Always 0.
    """

    def __init__(self, desk: OrderDesk) -> None:
        self._desk = desk
        self._last: tuple[str, int, int] | None = None  # last accepted order: name, value, order count
        self._last_ns = 0
        self._asked: tuple[str, int] | None = None  # order that waits for its confirmation
        self._asked_ns = 0
        self.rows = (SELECT_ROW, DO_ROW)
        self.do = 0

    @property
    def stored(self) -> OrderParameters:
        """Holder of the values, as `ParameterHolder` requires."""
        return self

    @property
    def select(self) -> int:
        """Selected zone, 0 for none."""
        return self._desk.selected_zone()

    def change(self, name: str, value: int) -> Change:
        """Execute an order, or return the reason of its refusal."""
        if value == 0:
            return Change(True, "")
        row = SELECT_ROW if name == "select" else DO_ROW
        if row.high is not None and not 0 < value <= row.high:
            return Change(False, f"{row.mavlink}: must be 0 to {row.high:g}")
        if (name, value, self._desk.order_count) == self._last and now_ns() - self._last_ns < REPEAT_NS:
            return Change(True, "")
        if name == "do" and value not in ORDERS:
            return Change(False, f"SLZ_DO {value}: {RENUMBERED.get(value, 'no such order')}")
        order = Order(OrderKind.SELECT_ZONE, value) if name == "select" else Order(ORDERS[value])
        if (name, value) == self._asked and self._is_resent():
            return Change(False, f"{row.mavlink} {value}: sent again too soon to confirm")
        reply = self._desk.carry_out(order)
        self._asked, self._asked_ns = ((name, value) if reply.asks else None), now_ns()
        repeatable = reply.accepted and order.kind is not OrderKind.ABORT  # an abort is executed each time
        self._last = (name, value, self._desk.order_count) if repeatable else None
        self._last_ns = now_ns()
        return Change(reply.accepted, f"{row.mavlink} {value}: {reply.reason}")

    def _is_resent(self) -> bool:
        """Return whether a station, rather than the pilot, may have set the parameter again."""
        before_ns, self._asked_ns = self._asked_ns, now_ns()
        return self._asked_ns - before_ns < RESENT_NS
