"""Streams of MAVLink datagrams: kept whole, compared by message and field."""

from __future__ import annotations

from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as dialect

from tests.answers.differences import differences, grouped
from tests.answers.mavlink_frames import datagrams, decoded, is_stream, stream, without_values
from tests.answers.variable import variable_values


def named(name: bytes, value: float, sequence: int = 7) -> bytes:
    codec = dialect.MAVLink(None, srcSystem=1, srcComponent=191)
    codec.seq = sequence
    return bytes(dialect.MAVLink_named_value_float_message(1000, name, value).pack(codec))


def lines(before: list[bytes], after: list[bytes]) -> list[str]:
    return list(grouped(differences({"sent": stream(before)}, {"sent": stream(after)})))


def test_datagrams_come_back() -> None:
    sent = [named(b"SLZ_N", 1.0), b"", named(b"SLZ_N", 2.0)]
    assert is_stream(stream(sent))
    assert datagrams(stream(sent)) == sent


def test_a_changed_field_is_named() -> None:
    before = [named(b"SLZ_N", 1.0), named(b"SLZ_N", 1.0)]
    after = [named(b"SLZ_N", 1.0), named(b"SLZ_N", 1.5)]
    assert lines(before, after) == ["sent[1].NAMED_VALUE_FLOAT(0).value: 1.0 before, 1.5 after"]


def test_a_changed_sequence_number_is_named() -> None:
    assert lines([named(b"SLZ_N", 1.0, 7)], [named(b"SLZ_N", 1.0, 8)]) == [
        "sent[0].NAMED_VALUE_FLOAT(0).sequence: 7 before, 8 after"
    ]


def test_bytes_that_are_no_message_are_told_as_bytes() -> None:
    assert lines([b"\xfd\x01"], [b"\xfd\x02"]) == ["sent[0]: fd01 before, fd02 after"]


def test_a_missing_datagram_is_named() -> None:
    one, other = named(b"SLZ_N", 1.0), named(b"SLZ_A", 1.0)
    assert lines([one, one], [one]) == ["sent.length: 2 datagrams before, 1 after"]
    first, last = lines([one, other, one], [other, one])
    assert first.startswith("sent[0].NAMED_VALUE_FLOAT(0).name: ")
    assert last == "sent.length: 3 datagrams before, 2 after"


def test_a_value_by_the_wall_clock_is_cleared_and_nothing_else() -> None:
    names = variable_values()
    assert names == {"SLZ_LATE"}
    late = without_values(named(b"SLZ_LATE", 3.5), names)
    assert late == without_values(named(b"SLZ_LATE", 4.5), names)
    assert late != without_values(named(b"SLZ_LATE", 3.5, sequence=8), names)
    for kept in (named(b"SLZ_N", 3.5), b"", b"\xfd", bytes(40)):
        assert without_values(kept, names) == kept


def test_messages_are_told_by_name_and_sender() -> None:
    fields: dict[str, Any] = decoded(named(b"SLZ_N", 1.0))["NAMED_VALUE_FLOAT(0)"]
    assert (fields["sysid"], fields["compid"], fields["name"]) == (1, 191, "SLZ_N")
