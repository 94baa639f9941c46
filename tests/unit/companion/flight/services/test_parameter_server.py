"""The parameter protocol, message by message."""

from __future__ import annotations

import math
import struct
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pymavlink.dialects.v20 import ardupilotmega as mavlink

import params
from companion.flight.services.parameter_server import LIST_INTERVAL_NS, ParameterServer
from companion.flight.services.settings import Settings
from companion.runtime.state_directory import StateDir
from tests.unit.companion.flight.link.messages import received

REAL32, INT32 = mavlink.MAV_PARAM_TYPE_REAL32, mavlink.MAV_PARAM_TYPE_INT32
US = (1, 191)


class Desk:
    """A server, its settings, and the texts it shows."""

    def __init__(self, **values: Any) -> None:
        self.settings = Settings(params.build(values))
        self.server = ParameterServer(self.settings)
        self.texts: list[tuple[str, bool]] = []
        self.server.on_change_result.subscribe(lambda *text: self.texts.append(text))

    def tell(self, message: Any) -> list[Any]:
        return [received(m) for m in self.server.on_message(received(message, 255, 190), *US)]

    def set(self, name: str, value: float, kind: int = REAL32, to: tuple[int, int] = US) -> list[Any]:
        return self.tell(mavlink.MAVLink_param_set_message(*to, name.encode(), value, kind))

    def read(self, name: str = "", index: int = -1, to: tuple[int, int] = US) -> list[Any]:
        return self.tell(mavlink.MAVLink_param_request_read_message(*to, name.encode(), index))

    def listed(self, to: tuple[int, int] = US) -> None:
        assert self.tell(mavlink.MAVLink_param_request_list_message(*to)) == []

    def sent(self, seconds: float, begin_ns: int = 0) -> list[Any]:
        steps = range(begin_ns, begin_ns + round(seconds * 1e9), 10_000_000)
        return [m for at in steps for m in self.server.poll(at)]


def kinds(messages: list[Any]) -> list[str]:
    return [m.get_type() for m in messages]


@pytest.mark.parametrize("to", [US, (1, 0), (0, 0)])
def test_the_list_holds_every_parameter_once_at_twenty_a_second(to: tuple[int, int]) -> None:
    desk = Desk()
    desk.listed(to)
    listed = [received(m) for m in desk.sent(60)]
    assert [m.param_id for m in listed] == [row.mavlink for row in params.rows()]
    assert [m.param_index for m in listed] == list(range(len(params.rows())))
    assert {m.param_count for m in listed} == {len(params.rows())}
    desk.listed()
    assert len(desk.sent(1, 10**12)) == pytest.approx(1e9 / LIST_INTERVAL_NS, abs=1)


@pytest.mark.parametrize("to", [(2, 191), (1, 1), (2, 0)])
def test_what_is_for_others_is_left_alone(to: tuple[int, int]) -> None:
    desk = Desk()
    desk.listed(to)
    assert desk.sent(1) == desk.set("SLZ_FINAL_H", 20, to=to) == desk.read("SLZ_FINAL_H", to=to) == []
    assert desk.settings.stored.final_height_m == 12


def test_two_stations_that_ask_in_turn_both_get_the_end_of_the_list() -> None:
    desk = Desk()
    names: set[str] = set()
    for second in range(10):
        desk.listed()
        names |= {m.param_id for m in desk.sent(1, second * 10**9)}
    assert len(names) == len(params.rows())


def test_numbers_whole_numbers_and_choices_have_their_types() -> None:
    desk = Desk(fusing="max")
    got = {name: desk.read(name)[0] for name in ("SLZ_FINAL_H", "SLZ_HIST_BINS", "SLZ_FUSING")}
    assert [(m.param_value, m.param_type) for m in got.values()] == [(12, REAL32), (300, INT32), (1, INT32)]
    assert desk.read(index=0)[0].param_id == params.rows()[0].mavlink


def test_a_change_is_kept_answered_and_in_force_at_once_where_it_may_be() -> None:
    desk = Desk()
    live = desk.settings.live
    answer = desk.set("SLZ_FINAL_H", 20)
    assert [(m.param_id, m.param_value) for m in answer] == [("SLZ_FINAL_H", 20)]
    assert live.final_height_m == 20
    assert desk.set("SLZ_CELL_M", 0.1)[0].param_value == pytest.approx(0.1)
    assert (live.cell_m, desk.settings.stored.cell_m) == (0.2, 0.1)
    assert desk.texts == [
        ("SLZ: SLZ_FINAL_H 20 m now", True),
        ("SLZ: SLZ_CELL_M 0.1 m at the next start", True),
    ]
    assert (desk.server.changed, desk.server.refused) == (2, 0)


@pytest.mark.parametrize(
    ("name", "value", "why"),
    [
        ("SLZ_FINAL_H", 1000.0, "must be a number from 1 to 200 m"),
        ("SLZ_FINAL_H", math.nan, "must be a number from 1 to 200 m"),
        ("SLZ_FINAL_H", 1.0, "commit_height_m (1.5) must not exceed final_height_m (1.0)"),
        ("SLZ_HIST_BINS", 20.5, "must be a whole number from 10 to 10000"),
        ("SLZ_FUSING", 2.0, "must be mean or max"),
        ("SLZ_FUSING", -1.0, "must be mean or max"),
        ("SLZ_CELL_M", 3.5, "cell_m (3.5) must not exceed min_square_m (3.0)"),
        ("SLZ_ODOMETRY", 2.0, f"autopilot must not fly: {params.mapping_parameters.ODOMETRY_TO_AUTOPILOT}"),
        ("SLZ_ODOMETRY", 3.0, "must be off or map"),
        ("SLZ_MODE", 1.0, f"source must not fly: {params.mapping_parameters.SOURCE_MODE}"),
    ],
)
def test_a_wrong_value_is_refused_the_old_one_echoed_and_the_reason_told(
    name: str, value: float, why: str
) -> None:
    desk = Desk()
    before, old = desk.settings.stored, desk.read(name)[0].param_value
    error, echo = desk.set(name, value)
    assert (error.get_type(), error.error) == ("PARAM_ERROR", mavlink.MAV_PARAM_ERROR_VALUE_OUT_OF_RANGE)
    assert (error.target_system, error.target_component, error.param_id) == (255, 190, name)
    assert echo.param_value == old
    assert desk.settings.stored == desk.settings.running == before
    assert desk.texts == [(f"SLZ: {name}: {why}", False)]
    assert desk.server.refused == 1


def test_an_unknown_parameter_is_an_error_if_we_alone_were_asked() -> None:
    desk = Desk()
    for answer in (desk.set("SLZ_NONE", 1), desk.read("SLZ_NONE"), desk.read(index=9999)):
        assert [(m.get_type(), m.error) for m in answer] == [("PARAM_ERROR", 1)]
    assert desk.set("WPNAV_SPEED", 1, to=(1, 0)) == desk.read(index=3, to=(1, 0)) == []


def test_an_old_name_is_refused_with_today_s() -> None:
    desk = Desk()
    for answer in (desk.set("SLZ_MAX_SLOPE", 30), desk.read("SLZ_MAX_SLOPE")):
        assert kinds(answer) == ["PARAM_ERROR"]
    assert desk.texts == [("SLZ: SLZ_MAX_SLOPE is SLZ_WORST_SLOPE now", False)] * 2


def test_setting_what_is_already_set_tells_nothing_and_writes_nothing() -> None:
    desk = Desk()
    assert kinds(desk.set("SLZ_MIN_CERT", struct.unpack("<f", struct.pack("<f", 0.86))[0])) == ["PARAM_VALUE"]
    assert (desk.texts, desk.server.changed) == ([], 0)
    assert desk.settings.stored.min_certainty == 0.86


def test_single_precision_leaves_no_digits_behind() -> None:
    desk = Desk()
    desk.set("SLZ_MIN_CERT", 0.1)
    assert desk.settings.stored.min_certainty == 0.1


def test_on_px4_whole_numbers_travel_as_bytes() -> None:
    desk = Desk()
    desk.server.bytewise = True
    value = desk.read("SLZ_HIST_BINS")[0].param_value
    assert struct.unpack("<i", struct.pack("<f", value))[0] == 300
    desk.set("SLZ_HIST_BINS", struct.unpack("<f", struct.pack("<i", 400))[0], INT32)
    desk.set("SLZ_FINAL_H", 20)
    assert (desk.settings.stored.histogram_bins, desk.settings.stored.final_height_m) == (400, 20)


@given(st.binary(max_size=16), st.floats(width=32), st.integers(0, 255), st.booleans())
def test_nothing_on_the_wire_raises(name: bytes, value: float, kind: int, bytewise: bool) -> None:
    desk = Desk()
    desk.server.bytewise = bytewise
    for known in (b"SLZ_FUSING", b"SLZ_HIST_BINS", b"SLZ_FINAL_H", name):
        desk.tell(mavlink.MAVLink_param_set_message(1, 191, known, value, kind))
        desk.tell(mavlink.MAVLink_param_request_read_message(1, 191, known, -1))


def test_every_default_survives_the_trip_there_and_back() -> None:
    desk = Desk()
    for row in params.rows():
        value = desk.read(row.mavlink)[0]
        assert kinds(desk.set(row.mavlink, value.param_value, value.param_type)) == ["PARAM_VALUE"]
    assert desk.settings.stored == params.Parameters()
    assert desk.texts == []


def test_a_change_that_cannot_be_stored_is_refused(tmp_path: Path) -> None:
    state = StateDir(tmp_path / "state")
    desk = Desk()
    desk.settings = Settings(params.Parameters(), state)
    desk.server = ParameterServer(desk.settings)
    (tmp_path / "state").rename(tmp_path / "gone")
    assert kinds(desk.set("SLZ_FINAL_H", 20)) == ["PARAM_ERROR", "PARAM_VALUE"]
    assert desk.settings.running.final_height_m == 12


def test_messages_of_other_protocols_are_passed_over() -> None:
    desk = Desk()
    assert desk.tell(mavlink.MAVLink_param_value_message(b"SLZ_COVERAGE_M", 9.0, REAL32, 1, 0)) == []
    assert desk.tell(mavlink.MAVLink_mission_request_list_message(*US)) == []
    assert (desk.server.changed, desk.server.refused, desk.sent(1.0)) == (0, 0, [])
