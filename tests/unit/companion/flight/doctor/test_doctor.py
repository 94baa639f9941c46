"""The doctor's findings from measurements, with remedies."""

from __future__ import annotations

import logging
import math
import struct
import sys
from dataclasses import replace
from typing import Any

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from companion.cli import program
from companion.flight.doctor import machine_check
from companion.flight.doctor.consultation import document, table
from companion.flight.doctor.examination import grounded_findings
from companion.flight.doctor.finding import Finding, healthy
from companion.flight.doctor.lidar_check import lidar_findings
from companion.flight.doctor.link_check import link_findings
from companion.flight.doctor.machine_check import speed_finding, timer_finding, window_ms
from companion.flight.doctor.parameter_check import parameter_findings
from companion.flight.link.autopilots.ardupilot import ARDUPILOT
from companion.flight.link.autopilots.autopilot_interface import Autopilot
from companion.flight.link.autopilots.px4 import PX4
from companion.flight.link.link_statistics import LinkStatistics
from companion.flight.link.message_rates import expected, wanted
from companion.flight.link.parameter_reader import RETRY_NS, TRIES, ParameterReader
from companion.flight.link.vehicle_state import VehicleState
from companion.flight.sensors.diagnosis import explanation
from companion.flight.sensors.diagnosis.lidar_diagnosis import Episode
from params import build, load
from params.required import parse

STREAMS = wanted(ARDUPILOT, 50.0)
GOOD = LinkStatistics(
    received=6000,
    from_vehicle=5000,
    lost=2,
    bad=0,
    bad_bytes=0,
    unknown=0,
    sent=100,
    dropped=0,
    foreign=0,
    copies=0,
    old=0,
    opened=1,
    rates_hz={stream.name: stream.rate_hz for stream in STREAMS},
    missing=(),
    time_source="timesync",
    round_trip_ms=2.5,
    residual_ms=0.4,
    worst_residual_ms=1.1,
    delay_p50_ms=0.0,
    delay_p99_ms=0.5,
    drift_ppm=3.0,
    time_resets=0,
    implausible_stamps=0,
    commands_executed=0,
    commands_repeated=0,
    unsigned=0,
    forged=0,
    replayed=0,
    orders_refused=0,
)
VEHICLE = VehicleState(sysid=1, autopilot=ARDUPILOT, vehicle_type=2, mode="GUIDED", last_heartbeat_ns=1)
ROWS = parse("# On.\nA 1\n# Lag.\n#: accept 0.1..0.3\n#: wanted\nB 0.2")


def states(findings: list[Finding]) -> dict[str, str]:
    return {finding.check: finding.state for finding in findings}


# ---- link ----------------------------------------------------------------------------------------------


def test_a_good_link_has_nothing_to_remedy() -> None:
    findings = link_findings("udpin:x", VEHICLE, GOOD, STREAMS)
    assert {finding.state for finding in findings} == {"ok"}
    assert not any(finding.remedy for finding in findings)


def test_a_vehicle_that_is_never_commanded_is_a_fault() -> None:
    findings = link_findings("udpin:x", replace(VEHICLE, vehicle_type=1), GOOD, STREAMS)
    assert states(findings)["vehicle"] == "fail"
    assert "commands nothing" in next(f.remedy for f in findings if f.check == "vehicle")


PX4_STREAMS = expected(PX4, 50.0)
PX4_GOOD = replace(GOOD, rates_hz={stream.name: stream.arrives_hz for stream in PX4_STREAMS})


@pytest.mark.parametrize(
    ("rates", "refused", "state"),
    [
        ({}, (), "ok"),
        ({"CURRENT_MODE": 1.5}, (), "ok"),
        ({"CURRENT_MODE": 0.5}, (), "warn"),
        ({"CURRENT_MODE": 0.0}, (), "skipped"),
        ({"CURRENT_MODE": 0.0}, ("CURRENT_MODE",), "skipped"),
    ],
)
def test_a_px4_with_its_heartbeat_once_a_second_is_healthy(
    rates: dict[str, float], refused: tuple[str, ...], state: str
) -> None:
    statistics = replace(PX4_GOOD, rates_hz=PX4_GOOD.rates_hz | rates, refused=refused)
    findings = link_findings("udpin:x", replace(VEHICLE, autopilot=PX4), statistics, PX4_STREAMS)
    assert healthy(findings)
    assert states(findings)["rate of HEARTBEAT"] == "ok"
    assert states(findings)["rate of CURRENT_MODE"] == state


def test_a_px4_without_heartbeats_is_not() -> None:
    statistics = replace(PX4_GOOD, rates_hz=PX4_GOOD.rates_hz | {"HEARTBEAT": 0.0})
    findings = link_findings("udpin:x", replace(VEHICLE, autopilot=PX4), statistics, PX4_STREAMS)
    assert states(findings)["rate of HEARTBEAT"] == "fail"


@pytest.mark.parametrize(
    ("wrong", "check", "state"),
    [
        ({"rates_hz": GOOD.rates_hz | {"ATTITUDE_QUATERNION": 12.0}}, "rate of ATTITUDE_QUATERNION", "fail"),
        ({"rates_hz": GOOD.rates_hz | {"BATTERY_STATUS": 0.0}}, "rate of BATTERY_STATUS", "warn"),
        ({"lost": 500}, "frames lost", "warn"),
        ({"time_source": "arrival"}, "time synchronisation", "fail"),
        ({"round_trip_ms": 80.0}, "round trip", "fail"),
        ({"residual_ms": 9.0}, "residual of the clocks", "fail"),
    ],
)
def test_what_is_wrong_with_a_link_has_a_remedy(wrong: dict[str, Any], check: str, state: str) -> None:
    findings = link_findings("udpin:x", VEHICLE, replace(GOOD, **wrong), STREAMS)
    bad = [finding for finding in findings if finding.state != "ok"]
    assert states(bad) == {check: state}
    assert bad[0].remedy


@pytest.mark.parametrize(
    ("heard", "said"),
    [
        ({"bad_bytes": 900}, "baud rate"),
        ({"received": 40}, "no autopilot's heartbeat"),
        ({"opened": 1}, "nothing arrives"),
        ({"opened": 0}, "cannot be opened"),
    ],
)
def test_silence_is_told_apart(heard: dict[str, int], said: str) -> None:
    nothing = replace(GOOD, received=0, lost=0, opened=1, rates_hz={})
    (finding,) = link_findings("tcp:x", VehicleState(), replace(nothing, **heard), STREAMS)
    assert finding.state == "fail"
    assert said in finding.remedy


# ---- parameters ----------------------------------------------------------------------------------------


def value(name: str, number: float, kind: int = mavlink.MAV_PARAM_TYPE_REAL32) -> Any:
    """Return a PARAM_VALUE as it is decoded."""
    codec = mavlink.MAVLink(None)
    packed = mavlink.MAVLink_param_value_message(name.encode(), number, kind, 1, 0).pack(codec)
    (message,) = codec.parse_buffer(bytearray(packed))
    return message


def test_parameters_are_asked_for_again_and_then_given_up() -> None:
    reader = ParameterReader(ROWS, ARDUPILOT)
    now, asked = 0, 0
    while not reader.done:
        requests = reader.due(1, now)
        asked += len(requests)
        assert reader.due(1, now) == []
        now += RETRY_NS
        assert now < 20 * RETRY_NS
    assert asked == TRIES * len(ROWS)


def test_few_requests_are_under_way_at_once() -> None:
    reader = ParameterReader(ARDUPILOT.required(), ARDUPILOT)
    first = reader.due(1, 0)
    assert 0 < len(first) <= 4
    reader.on_message(value("PLND_ENABLED", 1.0))
    assert len(reader.due(1, 1)) == 1


def test_px4_s_integers_are_read_by_their_bytes() -> None:
    (number,) = struct.unpack("<f", struct.pack("<i", 5))
    px4, ardupilot = ParameterReader(ROWS, PX4), ParameterReader(ROWS, ARDUPILOT)
    for reader in (px4, ardupilot):
        reader.on_message(value("A", number, mavlink.MAV_PARAM_TYPE_INT32))
    assert px4.values["A"] == 5.0
    assert ardupilot.values["A"] == pytest.approx(number)


def test_a_value_that_is_no_number_is_asked_for_again() -> None:
    reader = ParameterReader(ROWS, ARDUPILOT)
    reader.on_message(value("A", math.nan))
    assert reader.values == {}
    reader.on_message(value("A", 1.0))
    assert reader.values == {"A": 1.0}


@pytest.mark.parametrize(
    ("values", "expected"),
    [
        ({"A": 1.0, "B": 0.3}, {"A": "ok", "B": "ok"}),
        ({"A": 0.0, "B": 0.5}, {"A": "fail", "B": "warn"}),
        ({}, {"A": "fail", "B": "warn"}),
    ],
)
def test_parameters_are_judged_by_the_file(values: dict[str, float], expected: dict[str, str]) -> None:
    findings = parameter_findings(ROWS, values)
    assert states(findings) == expected
    for finding in findings:
        assert bool(finding.remedy) == (finding.state != "ok")
    assert healthy(findings) == ("fail" not in expected.values())


@pytest.mark.parametrize(
    ("autopilot", "name", "value"), [(ARDUPILOT, "VISO_TYPE", 1.0), (PX4, "EKF2_EV_CTRL", 7.0)]
)
def test_an_autopilot_that_waits_for_an_odometry_that_is_not_sent_is_a_warning(
    autopilot: Autopilot, name: str, value: float
) -> None:
    for odometry, state in ((False, "warn"), (True, "ok")):
        rows = tuple(row for row in autopilot.required(odometry) if row.name == name)
        (finding,) = parameter_findings(rows, {name: value})
        assert finding.state == state
        assert ("SLZ_ODOMETRY" in finding.remedy) == (state == "warn")
    assert parameter_findings(rows[:0], {}) == []


@pytest.mark.parametrize(
    ("setting", "check"), [("odometry=autopilot", "SLZ_ODOMETRY"), ("mode=source", "SLZ_MODE")]
)
def test_a_value_that_must_not_fly_is_a_fault_with_its_reason(setting: str, check: str) -> None:
    assert grounded_findings(load()) == []
    (finding,) = grounded_findings(load("quadcopter", [setting]))
    assert (finding.check, finding.state) == (check, "fail")
    assert finding.found.startswith(setting.partition("=")[2])
    assert "slz run refuses" in finding.remedy


# ---- LiDAR, computer -----------------------------------------------------------------------------------

SMALL = {"zone_m": 60.0, "adaptive": "off"}
COUNTS = {"packets": 20_000, "returns": 1_500_000, "lost_packets": 0, "clock_resets": 0}


@pytest.mark.parametrize(
    ("wrong", "check", "state"),
    [
        ({}, "", ""),
        ({"lost_packets": 900}, "LiDAR packets lost", "fail"),
        ({"returns": 900}, "LiDAR returns", "warn"),
        ({"malformed": 3}, "LiDAR packets spoilt", "warn"),
        ({"clock_resets": 1}, "LiDAR clock", "fail"),
    ],
)
def test_a_lidar_is_judged_by_its_packets(wrong: dict[str, int], check: str, state: str) -> None:
    findings = lidar_findings("livox:x", 10.0, 20_000, COUNTS | wrong)
    assert {f.check: f.state for f in findings if f.state != "ok"} == ({check: state} if check else {})


@pytest.mark.parametrize(
    ("counts", "said"),
    [
        ({}, "cable"),
        ({"malformed": 9}, "something else"),
        ({"malformed": 9, "wrong_sensor": 9}, "another maker"),
    ],
)
def test_a_silent_lidar_fails(counts: dict[str, int], said: str) -> None:
    (finding,) = lidar_findings("livox:x", 10.0, 0, counts)
    assert finding.state == "fail"
    assert said in finding.remedy


def test_a_silent_lidar_fails_by_its_cause_with_its_remedy() -> None:
    episodes = [Episode("silent", explanation.silent(), 0), Episode("firewall", explanation.firewall(), 1)]
    (finding,) = lidar_findings("livox:x", 10.0, 0, {}, episodes)
    assert (finding.check, finding.state) == ("LiDAR packets", "fail")
    assert finding.found.startswith("none at livox:x: the LiDAR answers commands")
    assert "ufw allow" in finding.remedy


def test_each_cause_is_found_once_the_latest_of_its_kind_with_its_remedy() -> None:
    told = [explanation.pauses(0.5), explanation.muted(), explanation.pauses(2.0)]
    episodes = [
        Episode(cause, why, 0) for cause, why in zip(("pauses", "muted", "pauses"), told, strict=True)
    ]
    findings = [f for f in lidar_findings("livox:x", 10.0, 20_000, COUNTS, episodes) if f.check == "LiDAR"]
    assert [(f.state, f.found, f.remedy) for f in findings] == [
        ("warn", "the LiDAR sent nothing for 2.0 s", told[2].remedy),
        ("fail", told[1].sentence, told[1].remedy),
    ]


def test_a_sensor_s_time_is_judged_where_it_has_one_to_follow() -> None:
    def said(**more: int) -> str | None:
        return states(lidar_findings("livox:x", 10.0, 20_000, COUNTS | more)).get("LiDAR time")

    assert said() is None
    assert said(clock_follows=1) == "ok"
    assert said(clock_follows=0) == "fail"


def test_this_computer_is_measured_with_windows_of_invented_ground(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(machine_check, "POINTS", 500)
    monkeypatch.setattr(machine_check, "window_ms", lambda p: window_ms(build(p.model_dump() | SMALL)))
    told = machine_check.machine_findings(load(), [0.5, 1.0])
    assert [finding.check for finding in told] == ["cores", "pipeline speed", "timer, p99 late", "date"]
    assert "for 500 points" in told[1].found


def test_a_slow_computer_fails_and_a_late_timer_warns() -> None:
    parameters = load()
    assert speed_finding(100.0, parameters).state == "ok"
    assert speed_finding(900.0, parameters).state == "fail"
    assert timer_finding([0.1] * 100).state == "ok"
    assert timer_finding([0.1] * 90 + [30.0] * 10).state == "warn"
    assert timer_finding([]).state == "ok"


def test_the_document_holds_every_finding_and_the_verdict() -> None:
    findings = [Finding("a", "ok", "1"), Finding("b", "warn", "2", "3", "do")]
    assert document(findings)["ok"] is True
    assert document([*findings, Finding("c", "fail", "")])["ok"] is False
    assert document(findings)["findings"][1] == {
        "check": "b",
        "state": "warn",
        "found": "2",
        "needed": "3",
        "remedy": "do",
    }
    assert table(findings).row_count == 2


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["--mavlink", "nonsense", "--lidar", "livox:127.0.0.1:0"], "MAVLink URL 'nonsense'"),
        (["--mavlink", "udpin:127.0.0.1:14550", "--lidar", "sonar:1"], "LiDAR 'sonar:1'"),
        (["--mavlink", "udpin:127.0.0.1:14550"], "missing option '--lidar'"),
    ],
)
def test_bad_usage_is_one_line_and_exit_code_2(
    words: list[str], said: str, capfd: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(logging, "basicConfig", lambda **_: None)
    monkeypatch.setattr(sys, "argv", ["slz", "doctor", *words])
    with pytest.raises(SystemExit) as left:
        program.main()
    assert left.value.code == 2
    out, err = capfd.readouterr()
    assert out == ""
    assert said in err
    assert err.count("\n") == 1
