"""Messages of a recording."""

import json

import pytest
from hypothesis import given
from hypothesis import strategies as st

from companion.flight.mapping.window_event import WindowEvent, runs
from companion.flight.recorder import journal
from companion.flight.recorder.journal import BadRecordError

PACKETS = st.lists(st.tuples(st.integers(0, 2**63), st.binary(max_size=40)), max_size=5)
POINTS = st.lists(st.none() | st.tuples(*[st.floats(allow_nan=False)] * 3), max_size=3)


@given(PACKETS)
def test_packets_come_out_as_they_went_in(batch: journal.Batch) -> None:
    assert journal.unpack_batch(journal.pack_batch(batch)) == batch


@given(PACKETS.filter(bool), st.data())
def test_a_batch_cut_off_within_a_packet_is_told(batch: journal.Batch, data: st.DataObject) -> None:
    whole = journal.pack_batch(batch)
    ends = {len(journal.pack_batch(batch[:k])) for k in range(len(batch) + 1)}
    cut = data.draw(st.integers(0, len(whole)).filter(lambda n: n not in ends))
    with pytest.raises(BadRecordError, match="within a packet"):
        journal.unpack_batch(whole[:cut])


@given(st.lists(st.integers(0, 50), unique=True).map(sorted), POINTS, st.booleans())
def test_a_window_s_event_comes_out_as_it_went_in(
    numbers: list[int], points: list[tuple[float, float, float] | None], anew: bool
) -> None:
    event = WindowEvent(3, runs(numbers), tuple(points), anew, (("min_certainty", 0.9), ("roof", "avoid")))
    assert event.numbers() == numbers
    assert journal.unpack_event(journal.pack_window(event)) == event


def test_a_request_for_the_time_is_an_event_too() -> None:
    assert journal.unpack_event(b'{"time_asked_ns": 17}') == 17


@pytest.mark.parametrize(
    "data",
    [
        b"",
        b"[]",
        b"{}",
        b"\xff",
        b'{"window": 1}',
        b'{"window": {"number": 1, "scans": [[1]]}}',
        b'{"time_asked_ns": {}}',
    ],
)
def test_what_is_no_event_is_told(data: bytes) -> None:
    with pytest.raises(BadRecordError, match="event"):
        journal.unpack_event(data)


def test_a_window_is_one_json_object_that_people_can_read() -> None:
    assert json.loads(journal.pack_window(WindowEvent(1, ((4, 7),))))["window"]["scans"] == [[4, 7]]
