"""Alarms for the pilot: shown as long as their reason exists."""

from typing import Any

import pytest

from companion.flight.dashboard.alarms import active_alarms

QUIET: dict[str, Any] = {
    "connected": True,
    "heard": True,
    "armed": True,
    "on_ground": False,
    "phase": "idle",
    "mode": "GUIDED",
    "lidar_ok": True,
    "blind": "LiDAR lost",
    "lidar_faults": [],
    "failsafe": False,
    "estimate_lost": "",
    "gps": "",
    "aim_enu_m": None,
    "east_m": 0.0,
    "battery_low": False,
    "no_commands": "",
    "key_mismatch": "",
    "unfit": [],
    "pipeline_failed": False,
    "blocked": False,
    "past": {},
}
SAFE: dict[str, Any] = {
    "state": "safe",
    "judged_by": "near",
    "may_be_water": False,
    "headings_deg": [0],
    "blocked_by": None,
}


def keys(state: dict[str, Any], selected: dict[str, Any] | None = None) -> list[str]:
    return [alarm["key"] for alarm in active_alarms(state, selected)]


def test_all_well_is_quiet() -> None:
    assert keys(QUIET, SAFE) == keys(QUIET, None) == []


def test_an_unsafe_landing_point_comes_first() -> None:
    found = active_alarms({**QUIET, "lidar_ok": False}, {**SAFE, "state": "unsafe"})
    assert [(alarm["level"], alarm["key"]) for alarm in found] == [
        ("critical", "point-unsafe"),
        ("critical", "no-lidar"),
    ]


def test_a_point_judged_in_the_past_is_no_alarm_but_the_silent_lidar_is() -> None:
    silent = {**QUIET, "lidar_ok": False, "past": {"map": 3.0, "verdict": 3.0}}
    for state in ("safe", "unsafe", "unknown"):
        assert keys(silent, {**SAFE, "state": state}) == ["no-lidar"]


def test_a_point_that_nobody_has_seen_is_a_warning() -> None:
    assert active_alarms(QUIET, {**SAFE, "state": "unknown", "judged_by": "none"})[0]["level"] == "warning"


def test_a_verdict_at_a_lost_position_is_none() -> None:
    lost = {**QUIET, "gps": "lost", "armed": True, "past": {"verdict": 0.1}}
    assert keys(lost, {**SAFE, "state": "unsafe"}) == ["gps"]


def test_a_point_that_it_flies_to_no_more_raises_no_alarm() -> None:
    unsafe = {**SAFE, "state": "unsafe", "enu_m": [10.0, 10.0, 0.0]}
    assert keys({**QUIET, "aim_enu_m": [10.1, 10.0, 0.0]}, unsafe) == ["point-unsafe"]
    assert keys({**QUIET, "aim_enu_m": [19.0, 10.0, 0.0]}, unsafe) == []


@pytest.mark.parametrize(
    ("selected", "text"),
    [
        ({"state": "unsafe"}, "LANDING POINT UNSAFE"),
        ({"state": "unsafe", "may_be_water": True}, "LANDING POINT UNSAFE: may be water"),
        (
            {"state": "unsafe", "headings_deg": [], "blocked_by": "rotor: 3.4 m high at 5.0 m"},
            "LANDING POINT UNSAFE: rotor: 3.4 m high at 5.0 m",
        ),
        ({"state": "unknown"}, "Landing point not judged: nothing seen there"),
        ({"state": "unknown", "may_be_water": True}, "Landing point not judged: may be water"),
    ],
)
def test_the_reason_is_told_with_the_state(selected: dict[str, Any], text: str) -> None:
    assert [alarm["text"] for alarm in active_alarms(QUIET, SAFE | selected)] == [text]


@pytest.mark.parametrize(
    ("change", "key"),
    [
        ({"connected": False}, "no-autopilot"),
        ({"heard": False}, "mode-unknown"),
        ({"lidar_ok": False}, "no-lidar"),
        ({"failsafe": True}, "failsafe"),
        ({"phase": "failsafe", "mode": "RTL"}, "failsafe"),
        ({"estimate_lost": "position"}, "estimate"),
        ({"gps": "lost", "armed": True}, "gps"),
        ({"gps": "glitch", "armed": True}, "gps"),
        ({"east_m": None}, "no-position"),
        ({"battery_low": True}, "battery"),
        ({"pipeline_failed": True}, "pipeline"),
        ({"blocked": True}, "blocked"),
        ({"no_commands": "fixed wing"}, "no-commands"),
        ({"unfit": ["COM_OBL_RC_ACT is 0, needs 5"]}, "unfit"),
    ],
)
def test_each_trouble_has_its_alarm(change: dict[str, Any], key: str) -> None:
    assert keys({**QUIET, **change}, SAFE) == [key]


def test_a_lidar_that_is_silent_on_the_ground_is_none() -> None:
    assert keys({**QUIET, "lidar_ok": False, "on_ground": True}) == []
    assert keys({**QUIET, "lidar_ok": False, "armed": False}) == []


def test_a_lost_link_is_one_alarm() -> None:
    assert keys({**QUIET, "connected": False, "lidar_ok": False, "blind": "link lost"}) == ["no-autopilot"]


def test_a_lost_link_tells_that_the_keys_of_signing_do_not_match() -> None:
    (alarm,) = active_alarms(
        {**QUIET, "connected": False, "key_mismatch": "vehicle does not sign, we do"}, None
    )
    assert alarm["text"] == "NO AUTOPILOT: vehicle does not sign, we do"


def test_an_autopilot_that_is_not_set_up_is_named_by_its_worst_parameter() -> None:
    (alarm,) = active_alarms(
        {**QUIET, "unfit": ["A is 0, needs 5", "B could not be read", "C is missing"]}, None
    )
    assert alarm["level"] == "warning"
    assert alarm["text"] == "Autopilot not set up: A is 0, needs 5 and 2 more: see slz doctor"


def test_each_fault_of_the_lidar_is_an_alarm_with_its_whole_sentence() -> None:
    faults = [{"cause": "dirty", "line": "dirt: clean it"}, {"cause": "step", "line": "it was set: do not"}]
    alarms = active_alarms(QUIET | {"lidar_faults": faults}, None)
    assert [(a["level"], a["key"], a["text"]) for a in alarms] == [
        ("warning", "lidar-dirty", "dirt: clean it"),
        ("warning", "lidar-step", "it was set: do not"),
    ]
