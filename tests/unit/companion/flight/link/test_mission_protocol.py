"""Rally transfers, message by message, on a scripted clock."""

from __future__ import annotations

import math
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from companion.flight.link.mission_protocol import (
    RALLY,
    RallyDownload,
    RallyPoint,
    Transfer,
    Upload,
)
from tests.unit.companion.flight.link.messages import received

S = 1_000_000_000
US = (1, 191)
POINTS = (RallyPoint(470_000_000, 80_000_000, 20), RallyPoint(470_001_000, 80_000_000, 25, 0))


def names(messages: list[Any]) -> list[str]:
    return [m.get_type() for m in messages]


def tell(transfer: Transfer, message: Any, at_s: float = 1.0) -> list[Any]:
    return [received(m, *US) for m in transfer.on_message(received(message), round(at_s * S))]


def ask(number: int, kind: str = "mission_request", to: tuple[int, int] = US) -> Any:
    return getattr(mavlink, f"MAVLink_{kind}_message")(*to, number, RALLY)


def count(number: int) -> Any:
    return mavlink.MAVLink_mission_count_message(*US, number, RALLY)


def ack(result: int = 0, to: tuple[int, int] = US, kind: int = RALLY) -> Any:
    return mavlink.MAVLink_mission_ack_message(*to, result, kind)


def item(number: int, point: RallyPoint, frame: int | None = None, alt: float | None = None) -> Any:
    return mavlink.MAVLink_mission_item_int_message(
        *US, number, point.frame if frame is None else frame, 5100, 0, 1, 0, 0, 0, 0,
        point.lat_e7, point.lon_e7, point.alt_m if alt is None else alt, RALLY,
    )  # fmt: skip


def upload(points: tuple[RallyPoint, ...] = POINTS) -> Upload:
    return Upload(1, *US, points)


@pytest.mark.parametrize("kind", ["mission_request", "mission_request_int"])
def test_an_upload_answers_either_request_with_integers_of_a_global_frame(kind: str) -> None:
    transfer = upload()
    begun = transfer.poll(0)[0]
    assert (begun.get_type(), begun.count, begun.mission_type) == ("MISSION_COUNT", 2, RALLY)
    items = [tell(transfer, ask(n, kind))[0] for n in (0, 1)]
    assert names(items) == ["MISSION_ITEM_INT"] * 2
    assert [(i.seq, i.frame, i.command, i.x, i.z) for i in items] == [
        (0, 3, 5100, 470_000_000, 20.0),
        (1, 0, 5100, 470_001_000, 25.0),
    ]
    assert transfer.outcome is None
    tell(transfer, ack())
    assert transfer.outcome == "done"


@pytest.mark.parametrize("frame", [5, 6])
def test_the_frames_that_send_px4_to_null_island_cannot_be_written(frame: int) -> None:
    with pytest.raises(ValueError, match="frame"):
        RallyPoint(1, 2, 3, frame)
    transfer = RallyDownload(1, *US)
    transfer.poll(0)
    tell(transfer, count(1))
    tell(transfer, item(0, POINTS[0], frame))
    assert [p.frame for p in transfer.items] == [{5: 0, 6: 3}[frame]]


def test_an_item_is_sent_again_when_it_is_asked_for_again() -> None:
    transfer = upload()
    transfer.poll(0)
    for _ in range(3):
        assert tell(transfer, ask(0))[0].seq == 0
    assert tell(transfer, ask(1))[0].seq == 1
    assert tell(transfer, ask(7)) == []


def test_the_count_is_repeated_until_the_vehicle_asks_and_then_it_is_the_one_to_ask() -> None:
    transfer = upload()
    sent = [m for tenth in range(40) for m in transfer.poll(tenth * S // 10)]
    assert names(sent) == ["MISSION_COUNT"] * 3
    tell(transfer, ask(0), 4.0)
    assert [m for tenth in range(40, 119) for m in transfer.poll(tenth * S // 10)] == []
    assert transfer.outcome is None
    transfer.poll(12 * S)
    assert transfer.outcome == "timeout"


def test_a_vehicle_that_never_answers_ends_it_after_five_tries() -> None:
    for transfer in (upload(), RallyDownload(1, *US), upload(())):
        sent = [m for tenth in range(200) for m in transfer.poll(tenth * S // 10)]
        assert len(sent) == 5
        assert transfer.outcome == "timeout"


def test_none_are_cleared() -> None:
    transfer = upload(())
    assert names(transfer.poll(0)) == ["MISSION_CLEAR_ALL"]
    tell(transfer, ack())
    assert transfer.outcome == "done"


def test_a_refusal_ends_it() -> None:
    transfer = upload()
    transfer.poll(0)
    tell(transfer, ack(mavlink.MAV_MISSION_DENIED))
    assert (transfer.outcome, transfer.refusal) == ("refused", mavlink.MAV_MISSION_DENIED)
    assert transfer.poll(10 * S) == tell(transfer, ask(0)) == []


def test_what_is_for_others_or_of_another_kind_or_too_early_is_left_alone() -> None:
    transfer = upload()
    transfer.poll(0)
    for message in (ask(0, to=(255, 190)), ack(to=(255, 190)), ack(kind=0), ack()):
        assert tell(transfer, message) == []
    assert transfer.outcome is None


def test_a_download_asks_for_each_item_and_thanks() -> None:
    transfer = RallyDownload(1, *US)
    assert names(transfer.poll(0)) == ["MISSION_REQUEST_LIST"]
    assert [m.seq for m in tell(transfer, count(2))] == [0]
    assert tell(transfer, item(1, POINTS[1])) == []  # not asked for yet
    assert [m.seq for m in tell(transfer, item(0, POINTS[0]))] == [1]
    assert names(transfer.poll(3 * S)) == ["MISSION_REQUEST_INT"]
    assert names(tell(transfer, item(1, POINTS[1]))) == ["MISSION_ACK"]
    assert (transfer.outcome, tuple(transfer.items)) == ("done", POINTS)


def test_an_empty_list_is_an_end_too() -> None:
    transfer = RallyDownload(1, *US)
    transfer.poll(0)
    assert names(tell(transfer, count(0))) == ["MISSION_ACK"]
    assert (transfer.outcome, transfer.items) == ("done", [])


@pytest.mark.parametrize("altitude", [math.nan, math.inf, 1e9])
def test_points_that_are_none_end_a_download(altitude: float) -> None:
    transfer = RallyDownload(1, *US)
    transfer.poll(0)
    tell(transfer, count(1))
    tell(transfer, item(0, POINTS[0], alt=altitude))
    assert transfer.outcome == "refused"


@given(
    st.lists(
        st.tuples(st.sampled_from(["count", "ask", "item", "ack"]), st.integers(0, 300), st.floats(width=32))
    )
)
def test_nothing_on_the_wire_raises(script: list[tuple[str, int, float]]) -> None:
    for transfer in (upload(), RallyDownload(1, *US)):
        transfer.poll(0)
        for kind, number, altitude in script:
            message = {
                "count": count(number),
                "ask": ask(number),
                "item": item(number, POINTS[0], number % 256, altitude),
                "ack": ack(number % 16),
            }[kind]
            tell(transfer, message)
