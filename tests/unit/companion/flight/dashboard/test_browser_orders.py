"""Orders that a browser may send."""

import json

import pytest
from hypothesis import given
from hypothesis import strategies as st

from companion.flight.dashboard.browser_orders import (
    MOST_BYTES,
    BadMessageError,
    Confirm,
    Facts,
    SelectZone,
    SetParameter,
    Simple,
    parse,
)

POINT = {"east_m": 1.5, "north_m": -2}


def test_every_order_is_read() -> None:
    assert parse('{"id": 1, "do": "select_zone", "zone": 3}') == SelectZone(id=1, do="select_zone", zone=3)
    assert parse(json.dumps({"id": 2, "do": "confirm", **POINT})) == Confirm(
        id=2, do="confirm", east_m=1.5, north_m=-2.0
    )
    assert isinstance(parse(json.dumps({"id": 3, "do": "facts", **POINT})), Facts)
    assert [parse(json.dumps({"id": 4, "do": do})) for do in ("abort", "land_best", "land_now")] == [
        Simple(id=4, do=do) for do in ("abort", "land_best", "land_now")
    ]
    assert parse('{"id": 5, "do": "set", "name": "survey_s", "value": 9}') == SetParameter(
        id=5, do="set", name="survey_s", value=9
    )


@pytest.mark.parametrize(
    "text",
    [
        "",
        "abort",
        "[]",
        "null",
        '{"id": 1}',
        '{"do": "abort"}',
        '{"id": -1, "do": "abort"}',
        '{"id": 1, "do": "fly"}',
        '{"id": 1, "do": "abort", "more": 1}',
        '{"id": "1", "do": "abort"}',
        '{"id": 1, "do": "select_zone", "zone": 0}',
        '{"id": 1, "do": "select_zone", "zone": "3"}',
        '{"id": 1, "do": "select_zone", "zone": 3.5}',
        '{"id": 1, "do": "select_zone", "zone": true}',
        '{"id": 1, "do": "confirm"}',
        '{"id": 1, "do": "confirm", "east_m": NaN, "north_m": 0}',
        '{"id": 1, "do": "confirm", "east_m": 1e300, "north_m": 0}',
        '{"id": 1, "do": "confirm", "east_m": Infinity, "north_m": 0}',
        '{"id": 1, "do": "set", "name": "x", "value": true}',
        '{"id": 1, "do": "set", "name": "x", "value": [1]}',
        '{"id": 1, "do": "abort"}' + " " * MOST_BYTES,
    ],
)
def test_what_is_no_order_is_refused_in_one_line(text: str) -> None:
    with pytest.raises(BadMessageError) as refusal:
        parse(text)
    assert "\n" not in str(refusal.value)
    assert len(str(refusal.value)) < 300


@given(st.text(max_size=200) | st.binary(max_size=200).map(lambda b: b.decode("latin-1")))
def test_anything_else_never_raises_anything_else(text: str) -> None:
    with pytest.raises(BadMessageError):
        parse(text)
