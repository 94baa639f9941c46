"""Component metadata: the files describe every parameter as the table does, and a station finds them."""

from __future__ import annotations

import json
import lzma
import re
from typing import Any

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

import params
from companion.flight.link.command_server import OperatorCommand
from companion.flight.link.wire.component_metadata_message import COMPONENT_METADATA
from companion.flight.services.component_metadata import (
    GENERAL,
    PARAMETER,
    MetadataRequests,
    file_uri,
    metadata_files,
    parameter_document,
)
from companion.flight.services.ftp_server import mavlink_crc32
from companion.flight.services.order_parameters import DO_ROW, SELECT_ROW
from tests.unit.companion.flight.link.messages import received

FILES = metadata_files(parameter_document(params.rows(), (SELECT_ROW, DO_ROW)), 191)
ROWS = {row.mavlink: row for row in (*params.rows(), SELECT_ROW, DO_ROW)}
# What the published schema allows; a reader refuses a file with anything else.
TYPES = {
    "name": str,
    "type": str,
    "shortDesc": str,
    "longDesc": str,
    "units": str,
    "default": (int, float),
    "min": (int, float),
    "max": (int, float),
    "decimalPlaces": int,
    "rebootRequired": bool,
    "volatile": bool,
    "group": str,
    "category": str,
    "values": list,
}


def document(path: str) -> Any:
    return json.loads(lzma.decompress(FILES[path], format=lzma.FORMAT_XZ))


def described() -> dict[str, dict[str, Any]]:
    return {each["name"]: each for each in document(PARAMETER)["parameters"]}


def test_every_parameter_is_described_once_in_its_order() -> None:
    listed = document(PARAMETER)["parameters"]
    assert [each["name"] for each in listed] == list(ROWS)
    assert document(PARAMETER).keys() == {"version", "parameters"}
    assert document(PARAMETER)["version"] == document(GENERAL)["version"] == 1


def test_fields_and_their_types_are_those_of_the_schema() -> None:
    for each in described().values():
        assert each.keys() <= TYPES.keys()
        assert {"name", "type", "shortDesc", "longDesc", "default"} <= each.keys()
        for key, value in each.items():
            assert isinstance(value, TYPES[key]), (each["name"], key)
        assert re.fullmatch(r"[.\-a-zA-Z0-9_{}]{1,16}", each["name"])
        assert each["type"] in ("Float", "Int32")
        assert 0 <= each.get("decimalPlaces", 0) <= 7
        for choice in each.get("values", []):
            assert choice.keys() == {"value", "description"}


def test_ranges_units_defaults_and_choices_are_those_of_the_table() -> None:
    for name, each in described().items():
        row = ROWS[name]
        assert row.sentence in each["longDesc"]
        assert row.name in each["longDesc"]
        assert each.get("units", "") == row.unit
        assert each.get("rebootRequired", False) is not row.live
        assert [c["description"] for c in each.get("values", [])] == list(row.airworthy_choices)
        if row.choices:
            assert all(row.choices[c["value"]] == c["description"] for c in each["values"])
            assert row.choices[each["default"]] == row.default
        else:
            assert (each["min"], each["max"], each["default"]) == (row.low, row.high, row.default)
        assert each["min"] <= each["default"] <= each["max"]


@pytest.mark.parametrize(
    ("name", "title", "places"),
    [("SLZ_FINAL_H", "Final height", 1), ("SLZ_CELL_M", "Cell", 3), ("SLZ_MIN_CERT", "Min certainty", 3)],
)
def test_a_title_has_words_without_the_unit_and_a_value_enough_digits(
    name: str, title: str, places: int
) -> None:
    each = described()[name]
    assert (each["shortDesc"], each["decimalPlaces"]) == (title, places)


def test_titles_are_different() -> None:
    titles = [each["shortDesc"] for each in described().values()]
    assert len(set(titles)) == len(titles)


def test_orders_are_not_saved_with_parameters() -> None:
    kept = {name for name, each in described().items() if not each.get("volatile")}
    assert kept == {row.mavlink for row in params.rows()}


def test_the_general_file_names_the_other_with_the_crc_of_its_bytes() -> None:
    (only,) = document(GENERAL)["metadataTypes"]
    assert only == {
        "type": 1,
        "uri": "mftp://[;comp=191]/parameter.json.xz",
        "fileCrc": mavlink_crc32(FILES[PARAMETER]),
    }


def test_the_files_are_small_enough_for_a_radio() -> None:
    assert sum(map(len, FILES.values())) < 8192


def request(number: float) -> OperatorCommand:
    return OperatorCommand(mavlink.MAV_CMD_REQUEST_MESSAGE, (number, 0, 0, 0), 0, 0, 0, None, 255, 190)


async def test_the_message_names_the_general_file() -> None:
    reply = MetadataRequests(FILES, 42).answer(request(COMPONENT_METADATA))
    assert (reply.result, reply.always, reply.reason) == (mavlink.MAV_RESULT_ACCEPTED, True, "")
    message = received(reply.message, 1, 42)
    assert (message.get_type(), message.get_msgId()) == ("COMPONENT_METADATA", 397)
    assert message.uri == file_uri(GENERAL, 42) == "mftp://[;comp=42]/general.json.xz"
    assert message.file_crc == mavlink_crc32(FILES[GENERAL])


@pytest.mark.parametrize("number", [0, 395, 396.5, float("nan"), -1])
def test_another_message_cannot_be_requested(number: float) -> None:
    reply = MetadataRequests(FILES, 191).answer(request(number))
    assert (reply.result, reply.message) == (mavlink.MAV_RESULT_UNSUPPORTED, None)


def test_the_checksum_seed_of_the_message_follows_from_its_fields() -> None:
    crc = mavlink.x25crc(b"COMPONENT_METADATA uint32_t time_boot_ms uint32_t file_crc char uri d").crc
    assert mavlink.mavlink_map[397].crc_extra == crc & 0xFF ^ crc >> 8
