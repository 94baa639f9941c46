"""The parameter files for the autopilots: one table for ground stations and for the doctor."""

from importlib import resources

import pytest
from pymavlink import mavparm

from companion.flight.doctor.parameter_check import parameter_findings
from companion.flight.link.autopilots.ardupilot import ARDUPILOT
from companion.flight.link.autopilots.autopilot_interface import OTHER, Autopilot
from companion.flight.link.autopilots.px4 import PX4
from params import Required
from params.required import parse


def by_name(autopilot: Autopilot, odometry: bool = False) -> dict[str, Required]:
    return {row.name: row for row in autopilot.required(odometry)}


@pytest.mark.parametrize("odometry", [False, True])
@pytest.mark.parametrize("autopilot", [ARDUPILOT, PX4])
def test_every_parameter_says_why_and_satisfies_its_own_rule(autopilot: Autopilot, odometry: bool) -> None:
    rows = autopilot.required(odometry)
    assert len(rows) >= 8
    for row in rows:
        assert row.why.endswith("."), row.name
        assert row.accepts(row.value)
        assert len(row.name) <= 16


def test_what_precision_landing_cannot_do_without_is_needed() -> None:
    ardupilot, px4 = by_name(ARDUPILOT), by_name(PX4)
    assert {ardupilot[n].value for n in ("PLND_ENABLED", "PLND_TYPE")} == {1.0}
    assert ardupilot["PLND_ENABLED"].level == ardupilot["PLND_TYPE"].level == "needed"
    assert (px4["COM_OBL_RC_ACT"].value, px4["COM_OBL_RC_ACT"].level) == (5.0, "needed")
    assert not ardupilot["PLND_STRICT"].accepts(2.0)
    assert not px4["COM_OBL_RC_ACT"].accepts(0.0)


def test_a_landing_that_sinks_too_fast_to_be_broken_off_is_refused() -> None:
    ardupilot, px4 = by_name(ARDUPILOT), by_name(PX4)
    for row, fast in (
        (ardupilot["LAND_SPD_MS"], 1.5),
        (ardupilot["LAND_SPEED"], 150.0),
        (ardupilot["LAND_ALT_LOW_M"], 4.0),
        (ardupilot["LAND_ALT_LOW"], 400.0),
        (px4["MPC_LAND_SPEED"], 1.5),
        (px4["MPC_LAND_ALT2"], 3.0),
    ):
        assert row.critical, row.name
        assert not row.accepts(fast), row.name


def test_ranges_and_choices_are_inclusive() -> None:
    ranged, chosen = by_name(ARDUPILOT)["PLND_LAG"], by_name(ARDUPILOT)["PLND_STRICT"]
    assert [ranged.accepts(v) for v in (0.019, 0.02, 0.1, 0.11)] == [False, True, True, False]
    assert [chosen.accepts(v) for v in (0, 1, 2)] == [True, True, False]
    assert ranged.accepted_text() == "0.02 to 0.1"
    assert chosen.accepted_text() == "0 or 1"
    assert by_name(PX4)["PLD_HACC_RAD"].accepts(0.2)


def test_mavproxy_reads_the_same_values(capsys: pytest.CaptureFixture[str]) -> None:
    read = mavparm.MAVParmDict()
    for name, odometry in (("arducopter.parm", False), ("arducopter_odometry.parm", True)):
        with resources.as_file(resources.files("params").joinpath(f"autopilot/{name}")) as path:
            assert read.load(str(path))
        assert "Invalid" not in capsys.readouterr().out
        assert dict(read) == {row.name: row.value for row in ARDUPILOT.required(odometry)}


@pytest.mark.parametrize("name", ["px4.params", "px4_odometry.params"])
def test_qgroundcontrol_s_columns_are_five_between_tabs(name: str) -> None:
    text = resources.files("params").joinpath(f"autopilot/{name}").read_text("utf-8")
    lines = [line for line in text.splitlines() if line and not line.startswith("#")]
    for line in lines:
        vehicle, component, name, value, kind = line.split("\t")
        assert (vehicle, component) == ("1", "1")
        assert (kind == "6") == ("." not in value), name
        assert kind in ("6", "9")


def loaded(name: str) -> dict[str, float]:
    """Return what a ground station sets that loads a file of ours: each line that is no comment."""
    text = resources.files("params").joinpath(f"autopilot/{name}").read_text("utf-8")
    rows = [line.split() for line in text.splitlines() if line and not line.startswith("#")]
    return {row[-3] if len(row) == 5 else row[0]: float(row[3] if len(row) == 5 else row[1]) for row in rows}


@pytest.mark.parametrize("odometry", [False, True])
@pytest.mark.parametrize("autopilot", [ARDUPILOT, PX4])
def test_whoever_loads_the_file_satisfies_the_doctor_in_every_parameter_that_it_looks_at(
    autopilot: Autopilot, odometry: bool
) -> None:
    general, added = autopilot.parameter_file, autopilot.odometry_file
    assert general is not None
    assert added is not None
    values = loaded(general) | (loaded(added) if odometry else {})
    found = parameter_findings(autopilot.required(odometry), values)
    assert [finding.check for finding in found] == [row.name for row in autopilot.required(odometry)]
    assert [finding for finding in found if finding.state != "ok"] == []


def test_what_some_versions_do_not_have_is_optional() -> None:
    ardupilot, px4 = by_name(ARDUPILOT), by_name(PX4)
    new, old = ardupilot["RNGFND1_MAX"], ardupilot["RNGFND1_MAX_CM"]  # up to 4.6
    assert (new.optional, old.optional, old.value) == (True, True, 100 * new.value)
    assert {name for name, row in px4.items() if row.optional} == {
        "COM_RC_OVERRIDE", "MAN_OVERRIDE_SPD", "EAV_EN", "EKF2_EV_CTRL",
    }  # fmt: skip
    assert {name for name, row in ardupilot.items() if row.critical and row.optional} == {
        "LAND_SPD_MS", "LAND_ALT_LOW_M", "LAND_SPEED", "LAND_ALT_LOW", "PLND_ORIENT",
    }  # fmt: skip
    assert not any(row.critical and row.optional for row in px4.values())
    assert [px4["RTL_TYPE"].accepts(value) for value in (5, 2)] == [True, False]


def test_the_odometry_s_file_wins_where_both_name_a_parameter() -> None:
    for autopilot, name, without, with_it in (
        (ARDUPILOT, "VISO_TYPE", 0.0, 1.0),
        (PX4, "EKF2_EV_CTRL", 0.0, 7.0),
    ):
        off, on = by_name(autopilot)[name], by_name(autopilot, odometry=True)[name]
        assert (off.value, off.level) == (without, "wanted")
        assert (on.value, on.level) == (with_it, "needed")
        assert not off.accepts(with_it)
        assert not on.accepts(without)
        assert set(by_name(autopilot)) < set(by_name(autopilot, odometry=True))


def test_gps_stays_the_first_source_and_the_heading_that_of_the_compass() -> None:
    ardupilot, px4 = by_name(ARDUPILOT, odometry=True), by_name(PX4, odometry=True)
    assert [ardupilot[f"EK3_SRC{n}_POSXY"].value for n in (1, 2)] == [3, 6]
    assert (ardupilot["EK3_SRC2_VELXY"].value, ardupilot["EK3_SRC2_YAW"].value) == (6, 1)
    assert [px4["EKF2_EV_CTRL"].accepts(value) for value in (5, 7, 8, 15)] == [True, True, False, False]


def test_an_autopilot_that_is_not_known_needs_nothing() -> None:
    assert OTHER.required() == OTHER.required(odometry=True) == ()


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


# Values by which messages of slz act in another way, by the autopilots' source; each needs a remedy.
BENT = {
    ARDUPILOT: [
        ("PLND_YAW_ALIGN", 9000, True), ("PLND_LAND_OFS_X", 70, True), ("PLND_LAND_OFS_Y", -10, True),
        ("PLND_CAM_POS_X", 0.1, False), ("PLND_CAM_POS_Y", -0.1, False), ("PLND_CAM_POS_Z", 0.5, False),
        ("PLND_ORIENT", 0, True),
        ("PLND_OPTIONS", 1, False), ("PLND_OPTIONS", 2, False), ("PLND_OPTIONS", 4, False),
        ("PLND_ACC_P_NSE", 0.01, False), ("PLND_TIMEOUT", 20, False), ("PLND_ALT_MIN", 0, False),
        ("PLND_ALT_MAX", 50, False), ("LAND_SPD_HIGH_MS", 4, False), ("LAND_SPEED_HIGH", 400, False),
        ("WP_SPD_DN", 5, False), ("WPNAV_SPEED_DN", 500, False), ("GUID_OPTIONS", 16, True),
        ("GUID_OPTIONS", 32, True), ("GUID_OPTIONS", 128, True), ("PRX1_ORIENT", 1, False),
        ("PRX1_YAW_CORR", 90, False), ("EK3_RNG_USE_HGT", 50, False),
    ],
    PX4: [
        ("PLD_SRCH_ALT", 2, False), ("PLD_SRCH_TOUT", 0, False), ("MPC_LAND_ALT1", 2, False),
        ("MPC_Z_VEL_MAX_DN", 4, False), ("MPC_LAND_RC_HELP", 1, True), ("MPC_LAND_CRWL", 1.5, False),
        ("EKF2_HGT_REF", 2, False), ("GF_ACTION", 4, True), ("GF_SOURCE", 1, False), ("GF_PREDICT", 1, False),
    ],
}  # fmt: skip
ROWS = [(autopilot, *row) for autopilot, rows in BENT.items() for row in rows]


@pytest.mark.parametrize(("autopilot", "name", "value", "critical"), ROWS)
def test_what_bends_our_messages_is_found_with_its_remedy(
    autopilot: Autopilot, name: str, value: float, critical: bool
) -> None:
    row = by_name(autopilot)[name]
    right, wrong = (parameter_findings((row,), {name: v})[0] for v in (row.value, value))
    assert row.critical is critical
    assert right.state == "ok"
    assert wrong.state == ("fail" if row.level == "needed" else "warn")
    assert wrong.remedy is not None
    assert wrong.remedy.startswith(f"set {name} to {row.value:g} and reboot: ")
    assert len(wrong.remedy) > 60


@pytest.mark.parametrize("value", [0, 1, 4, 5, 8, 64, 77])
def test_options_of_guided_that_change_nothing_for_us_are_accepted(value: int) -> None:
    assert by_name(ARDUPILOT)["GUID_OPTIONS"].accepts(value)
    assert not by_name(ARDUPILOT)["GUID_OPTIONS"].accepts(value | 16)


def test_each_speed_has_both_of_its_names() -> None:
    rows = by_name(ARDUPILOT)
    for new, old in (("LAND_SPD_HIGH_MS", "LAND_SPEED_HIGH"), ("WP_SPD_DN", "WPNAV_SPEED_DN")):
        assert rows[new].optional
        assert rows[old].optional
        assert rows[old].value == 100 * rows[new].value
