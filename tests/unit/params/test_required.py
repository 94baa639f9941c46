"""The parameter files for the autopilots: one table for ground stations and for the doctor."""

from importlib import resources

import pytest
from pymavlink import mavparm

from params import Required, required
from params.required import FILES, parse


def by_name(autopilot: str) -> dict[str, Required]:
    return {row.name: row for row in required(autopilot)}


@pytest.mark.parametrize("autopilot", sorted(FILES))
def test_every_parameter_says_why_and_satisfies_its_own_rule(autopilot: str) -> None:
    rows = required(autopilot)
    assert len(rows) >= 8
    for row in rows:
        assert row.why.endswith("."), row.name
        assert row.accepts(row.value)
        assert len(row.name) <= 16


def test_what_precision_landing_cannot_do_without_is_needed() -> None:
    ardupilot, px4 = by_name("ardupilot"), by_name("px4")
    assert {ardupilot[n].value for n in ("PLND_ENABLED", "PLND_TYPE")} == {1.0}
    assert ardupilot["PLND_ENABLED"].level == ardupilot["PLND_TYPE"].level == "needed"
    assert (px4["COM_OBL_RC_ACT"].value, px4["COM_OBL_RC_ACT"].level) == (5.0, "needed")
    assert not ardupilot["PLND_STRICT"].accepts(2.0)
    assert not px4["COM_OBL_RC_ACT"].accepts(0.0)


def test_ranges_and_choices_are_inclusive() -> None:
    ranged, chosen = by_name("ardupilot")["PLND_LAG"], by_name("ardupilot")["PLND_STRICT"]
    assert [ranged.accepts(v) for v in (0.019, 0.02, 0.1, 0.11)] == [False, True, True, False]
    assert [chosen.accepts(v) for v in (0, 1, 2)] == [True, True, False]
    assert ranged.accepted_text() == "0.02 to 0.1"
    assert chosen.accepted_text() == "0 or 1"
    assert by_name("px4")["PLD_HACC_RAD"].accepts(0.2)


def test_mavproxy_reads_the_same_values(capsys: pytest.CaptureFixture[str]) -> None:
    read = mavparm.MAVParmDict()
    file = resources.files("params").joinpath("autopilot/arducopter.parm")
    with resources.as_file(file) as path:
        assert read.load(str(path))
    assert "Invalid" not in capsys.readouterr().out
    assert dict(read) == {row.name: row.value for row in required("ardupilot") if row.loaded}


def test_qgroundcontrol_s_columns_are_five_between_tabs() -> None:
    text = resources.files("params").joinpath("autopilot/px4.params").read_text("utf-8")
    lines = [line for line in text.splitlines() if line and not line.startswith("#")]
    for line in lines:
        vehicle, component, name, value, kind = line.split("\t")
        assert (vehicle, component) == ("1", "1")
        assert (kind == "6") == ("." not in value), name
        assert kind in ("6", "9")


def test_what_some_versions_do_not_have_is_optional_and_what_others_replace_is_not_loaded() -> None:
    ardupilot, px4 = by_name("ardupilot"), by_name("px4")
    assert (ardupilot["RNGFND1_MAX"].optional, ardupilot["RNGFND1_MAX"].loaded) == (True, True)
    old = ardupilot["RNGFND1_MAX_CM"]  # up to 4.6
    assert (old.optional, old.loaded, old.value) == (True, False, 100 * ardupilot["RNGFND1_MAX"].value)
    assert {name for name, row in px4.items() if not row.loaded} == {
        "COM_RC_OVERRIDE", "MAN_OVERRIDE_SPD", "EAV_EN",
    }  # fmt: skip
    assert not any(row.critical and row.optional for row in (*ardupilot.values(), *px4.values()))
    assert [px4["RTL_TYPE"].accepts(value) for value in (5, 2)] == [True, False]


def test_an_autopilot_that_is_not_known_needs_nothing() -> None:
    assert required("other") == ()


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("A 1\nA 2", "line 2: A stands twice"),
        ("A", "line 1: neither"),
        ("#: maybe\nA 1", "unknown rule 'maybe'"),
        ("#: accept 2..3\nA 1", "outside what it accepts"),
        ("A one", "line 1"),
    ],
)
def test_a_broken_file_is_refused(text: str, said: str) -> None:
    with pytest.raises(ValueError, match=said):
        parse(text)
