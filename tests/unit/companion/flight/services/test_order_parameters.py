"""Orders as parameters, set by a ground station."""

from __future__ import annotations

import json
from typing import Any, cast

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from companion.flight.landing.orders.mavlink_orders import KINDS
from companion.flight.landing.orders.operator_order import Order, OrderDesk, OrderKind
from companion.flight.landing.situation import Reply
from companion.flight.link.statustext import CHUNK_BYTES
from companion.flight.services import order_parameters
from companion.flight.services.order_parameters import ORDERS, REPEAT_NS, OrderParameters
from companion.flight.services.parameter_server import ParameterServer
from params import Row, rows
from tests import REPOSITORY
from tests.unit.companion.flight.link.messages import received

US = (1, 191)


class Listener:
    """Notes the orders in place of the executive."""

    def __init__(self) -> None:
        self.orders: list[Order] = []
        self.selected = 0
        self.order_count = 0
        self.refuses = ""
        self.asks = False

    def carry_out(self, order: Order) -> Reply:
        self.orders.append(order)
        if self.refuses:
            return Reply(False, self.refuses, self.asks)
        if order.kind is OrderKind.SELECT_ZONE and order.zone_id != 7:
            return Reply(False, f"no zone {order.zone_id}")
        self.selected = order.zone_id or self.selected
        return Reply(True, "landing")

    def selected_zone(self) -> int:
        return self.selected


class Desk:
    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.now_ns, self.listener = 10**9, Listener()
        monkeypatch.setattr(order_parameters, "now_ns", lambda: self.now_ns)
        self.server = ParameterServer(OrderParameters(cast(OrderDesk, self.listener)))
        self.texts: list[tuple[str, bool]] = []
        self.server.on_change_result.subscribe(lambda *text: self.texts.append(text))

    def set(self, name: str, value: float) -> list[tuple[str, Any]]:
        message = mavlink.MAVLink_param_set_message(*US, name.encode(), value, mavlink.MAV_PARAM_TYPE_INT32)
        answers = self.server.on_message(received(message, 255, 190), *US)
        return [(m.get_type(), getattr(m, "param_value", None)) for m in answers]

    def later(self) -> list[float]:
        return [m.param_value for at in range(0, 10**9, 10**7) for m in self.server.poll(at)]


@pytest.fixture
def desk(monkeypatch: pytest.MonkeyPatch) -> Desk:
    return Desk(monkeypatch)


@pytest.mark.parametrize(
    ("value", "kind"),
    [
        (1, OrderKind.LAND_AT_BEST),
        (6, OrderKind.LAND_AT_SELECTED),
        (7, OrderKind.ABORT),
        (8, OrderKind.LAND_NOW),
    ],
)
def test_an_order_is_carried_out_read_back_and_reads_as_none(desk: Desk, value: int, kind: OrderKind) -> None:
    assert desk.set("SLZ_DO", value) == [("PARAM_VALUE", value)]
    assert desk.listener.orders == [Order(kind)]
    assert desk.later() == [0]
    assert desk.texts == [(f"SLZ: SLZ_DO {value}: landing", True)]


def test_a_zone_is_selected(desk: Desk) -> None:
    assert desk.set("SLZ_SELECT", 7) == [("PARAM_VALUE", 7)]
    assert desk.listener.orders == [Order(OrderKind.SELECT_ZONE, 7)]
    assert desk.later() == []


def test_a_refused_order_tells_the_reason(desk: Desk) -> None:
    assert desk.set("SLZ_SELECT", 8) == [("PARAM_ERROR", None), ("PARAM_VALUE", 0)]
    assert desk.texts == [("SLZ: SLZ_SELECT 8: no zone 8", False)]


def test_a_number_orders_the_same_as_a_parameter_and_as_a_command() -> None:
    assert {number: kind for number, kind in KINDS.items() if number in ORDERS} == ORDERS
    assert {KINDS[0], KINDS[4]} == {KINDS[7], KINDS[8]}  # its older numbers


@pytest.mark.parametrize(
    ("value", "reason"),
    [
        (2, "selected point is 6 now"),
        (3, "emergency is 8 now"),
        (4, "abort is 7, emergency 8 now"),
        (5, "no such order"),
    ],
)
def test_a_number_that_once_ordered_something_else_is_refused_with_the_new_one(
    desk: Desk, value: int, reason: str
) -> None:
    assert desk.set("SLZ_DO", value)[0][0] == "PARAM_ERROR"
    assert desk.listener.orders == []
    assert desk.texts == [(f"SLZ: SLZ_DO {value}: {reason}", False)]
    assert len(desk.texts[0][0]) <= CHUNK_BYTES


@pytest.mark.parametrize("value", [9, -1, 0.5, float("nan"), 1e9])
def test_what_is_no_order_is_refused_and_orders_nothing(desk: Desk, value: float) -> None:
    assert desk.set("SLZ_DO", value)[0][0] == "PARAM_ERROR"
    assert desk.listener.orders == []


def test_a_parameter_set_again_for_a_lost_answer_is_one_order(desk: Desk) -> None:
    desk.set("SLZ_DO", 1)
    desk.now_ns += REPEAT_NS // 2
    assert desk.set("SLZ_DO", 1) == [("PARAM_VALUE", 1)]
    desk.now_ns += REPEAT_NS
    desk.set("SLZ_DO", 1)
    assert desk.listener.orders == [Order(OrderKind.LAND_AT_BEST)] * 2


def test_an_abort_is_carried_out_each_time_it_comes(desk: Desk) -> None:
    for _ in range(3):
        desk.now_ns += REPEAT_NS // 10
        desk.set("SLZ_DO", 7)
    assert desk.listener.orders == [Order(OrderKind.ABORT)] * 3


@pytest.mark.parametrize(("name", "value"), [("SLZ_DO", 1), ("SLZ_SELECT", 7)])
def test_a_refused_order_is_asked_anew_at_once(desk: Desk, name: str, value: int) -> None:
    desk.listener.refuses = "set GUIDED first"
    assert desk.set(name, value)[0][0] == "PARAM_ERROR"
    desk.now_ns += REPEAT_NS // 2
    desk.listener.refuses = ""
    assert desk.set(name, value) == [("PARAM_VALUE", value)]
    assert len(desk.listener.orders) == 2


@pytest.mark.parametrize(("name", "value"), [("SLZ_DO", 1), ("SLZ_SELECT", 7)])
def test_an_order_that_another_one_or_the_pilot_ended_is_meant_anew(
    desk: Desk, name: str, value: int
) -> None:
    desk.set(name, value)
    desk.listener.order_count += 1
    desk.now_ns += REPEAT_NS // 2
    desk.set(name, value)
    assert len(desk.listener.orders) == 2


def test_saved_parameters_loaded_back_order_nothing(desk: Desk) -> None:
    assert desk.set("SLZ_DO", 0) == [("PARAM_VALUE", 0)]
    assert desk.set("SLZ_SELECT", 0) == [("PARAM_VALUE", 0)]
    assert desk.listener.orders == []


def test_the_actions_for_qgroundcontrol_are_orders_of_ours() -> None:
    """Format: docs.qgroundcontrol.com, Custom MAVLink Actions."""
    file = json.loads((REPOSITORY / "docs" / "qgroundcontrol_actions.json").read_text())
    assert (file["version"], file["fileType"]) == (1, "MavlinkActions")
    assert {(a["mavCmd"], a["compId"]) for a in file["actions"]} == {(mavlink.MAV_CMD_USER_1, 191)}
    assert [KINDS[a["param1"]] for a in file["actions"]] == [
        OrderKind.LAND_AT_BEST,
        OrderKind.LAND_AT_SELECTED,
        OrderKind.LAND_NOW,
        OrderKind.ABORT,
    ]


def test_their_names_are_nobody_else_s() -> None:
    taken = {row.mavlink for row in rows()} | {row.name for row in rows()}
    own: tuple[Row, ...] = (order_parameters.SELECT_ROW, order_parameters.DO_ROW)
    assert not taken & {name for row in own for name in (row.mavlink, row.name)}


def test_a_station_that_sets_again_without_its_pilot_confirms_nothing(desk: Desk) -> None:
    """A parameter has no counter of its repetitions: they come each three seconds while answers are lost."""
    desk.listener.refuses, desk.listener.asks = "zone 2: roof, 25 m up: order again to confirm", True
    for _ in range(4):
        desk.set("SLZ_DO", 6)
        desk.now_ns += 3 * 10**9
    assert len(desk.listener.orders) == 1
    desk.now_ns += 2 * 10**9
    desk.set("SLZ_DO", 6)
    assert len(desk.listener.orders) == 2
    assert desk.texts[-2:] == [
        ("SLZ: SLZ_DO 6: sent again too soon to confirm", False),
        ("SLZ: SLZ_DO 6: zone 2: roof, 25 m up: order again to confirm", False),
    ]


def test_another_refusal_is_not_kept(desk: Desk) -> None:
    desk.listener.refuses = "set GUIDED first"
    for _ in range(2):
        desk.set("SLZ_DO", 6)
        desk.now_ns += 10**9
    assert len(desk.listener.orders) == 2
