"""MAV_CMD_USER_1: orders by number, and invalid points."""

from __future__ import annotations

import math
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from companion.flight.landing.orders.mavlink_orders import MavlinkOrders
from companion.flight.landing.orders.operator_order import OrderDesk
from companion.flight.landing.situation import Reply
from companion.flight.link.command_server import OperatorCommand
from slz import LocalFrame

FRAME = LocalFrame(47.0, 8.0, 400.0)
SITUATION = SimpleNamespace(selected=None)


class Executive:
    """Notes what it is asked, and accepts all."""

    def __init__(self) -> None:
        self.asked: list[tuple[Any, ...]] = []
        self.order_count = 0
        self.orders = self

    def __getattr__(self, name: str) -> Any:
        def order(*given: Any) -> Reply:
            self.asked.append((name, *(g for g in given if g is not SITUATION)))
            return Reply(accepted=True, reason="")

        return order


def desk(frame: LocalFrame | None = FRAME) -> tuple[MavlinkOrders, Executive]:
    executive = Executive()
    order_desk = OrderDesk(cast(Any, executive), lambda: cast(Any, SITUATION), 500.0)
    return MavlinkOrders(order_desk, SimpleNamespace(frame=frame)), executive


def command(*params: float, at: tuple[float, float, float] = (0, 0, 0), **more: Any) -> OperatorCommand:
    four = (*params, 0.0, 0.0, 0.0, 0.0)[:4]
    own = {"command": mavlink.MAV_CMD_USER_1, "frame": mavlink.MAV_FRAME_GLOBAL_INT} | more
    own |= {"sender_system": 255, "sender_component": 190}
    return OperatorCommand(params=four, x=at[0], y=at[1], z=at[2], **own)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("params", "asked"),
    [
        ((0.0,), ("abort",)),
        ((1.0,), ("land_at_best",)),
        ((2.0, 7.0), ("land_in_zone", 7)),
        ((4.0,), ("land_now",)),
        ((5.0, 9.0), ("select_zone", 9)),
        ((6.0,), ("land_at_selected",)),
        ((7.0,), ("abort",)),
        ((8.0,), ("land_now",)),
    ],
)
def test_each_number_is_its_order_and_no_other(params: tuple[float, ...], asked: tuple[Any, ...]) -> None:
    orders, executive = desk()
    assert orders.answer(command(*params)).result == mavlink.MAV_RESULT_ACCEPTED
    assert executive.asked == [asked]


@pytest.mark.parametrize(
    "params", [(9.0,), (-1.0,), (1.5,), (math.nan,), (2.0, 1.5), (2.0, math.nan), (5.0, 0.1), (3.0, 2.0)]
)
def test_what_is_no_order_is_denied_and_nothing_is_done(params: tuple[float, ...]) -> None:
    orders, executive = desk()
    reply = orders.answer(command(*params))
    assert reply.result == mavlink.MAV_RESULT_DENIED
    assert reply.reason.startswith("SLZ: USER_1 knows no ")
    assert executive.asked == []


def test_another_command_is_not_ours() -> None:
    orders, executive = desk()
    assert (
        orders.answer(command(1.0, command=mavlink.MAV_CMD_NAV_LAND)).result == mavlink.MAV_RESULT_UNSUPPORTED
    )
    assert executive.asked == []


@pytest.mark.parametrize(("land", "order"), [(0.0, "select_point"), (1.0, "land_at_point")])
@pytest.mark.parametrize("frame", [None, mavlink.MAV_FRAME_GLOBAL, mavlink.MAV_FRAME_GLOBAL_INT])
def test_a_point_is_where_its_latitude_and_longitude_say(land: float, order: str, frame: int | None) -> None:
    orders, executive = desk()
    lat, lon, alt = (float(v) for v in FRAME.lla(np.array([30.0, -40.0, 5.0])))
    assert (
        orders.answer(command(3.0, land, at=(lat, lon, alt), frame=frame)).result
        == mavlink.MAV_RESULT_ACCEPTED
    )
    ((name, enu),) = executive.asked
    assert name == order
    assert enu == pytest.approx([30.0, -40.0, 5.0], abs=1e-3)


def test_a_point_without_an_altitude_is_level_with_home() -> None:
    orders, executive = desk()
    orders.answer(command(3.0, 0.0, at=(47.0, 8.0, math.nan)))
    assert executive.asked[0][1] == pytest.approx([0.0, 0.0, 0.0], abs=1e-6)


@pytest.mark.parametrize(
    ("at", "frame", "reason"),
    [
        ((47.0, 8.0, 0.0), mavlink.MAV_FRAME_LOCAL_NED, "needs frame GLOBAL"),
        ((91.0, 8.0, 0.0), None, "no latitude, longitude"),
        ((47.0, 181.0, 0.0), None, "no latitude, longitude"),
        ((math.nan, 8.0, 0.0), None, "no latitude, longitude"),
        ((47.0, math.inf, 0.0), None, "no latitude, longitude"),
        ((47.01, 8.0, 400.0), None, "too far away"),
    ],
)
def test_what_is_no_point_is_denied(at: tuple[float, float, float], frame: int | None, reason: str) -> None:
    orders, executive = desk()
    reply = orders.answer(command(3.0, 1.0, at=at, frame=frame))
    assert reply.result == mavlink.MAV_RESULT_DENIED
    assert reason in reply.reason
    assert executive.asked == []


def test_before_any_position_there_is_no_point() -> None:
    orders, executive = desk(frame=None)
    assert "no position yet" in orders.answer(command(3.0, 1.0, at=(47.0, 8.0, 0.0))).reason
    assert executive.asked == []


def test_an_order_stands_until_another_or_its_end_and_an_abort_is_always_carried_out() -> None:
    orders, executive = desk()
    landing, abort = orders.answer(command(1.0)), orders.answer(command(0.0))
    assert (landing.always, landing.is_in_effect()) == (False, True)
    assert abort.always
    executive.order_count += 1
    assert not landing.is_in_effect()


@pytest.mark.parametrize(
    ("selected", "zone"),
    [(None, 0), (SimpleNamespace(zone_id=None), 0), (SimpleNamespace(zone_id=4), 4)],
)
def test_the_zone_under_watch(selected: Any, zone: int) -> None:
    situation: Any = SimpleNamespace(selected=selected)
    assert OrderDesk(cast(Any, Executive()), lambda: situation, 500.0).selected_zone() == zone
