"""The autopilot's parameters in flight: times of reading, reports, and values that are never called fine."""

from __future__ import annotations

import struct
from collections.abc import Iterable
from dataclasses import replace
from typing import Any

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from companion.flight.doctor.autopilot_fitness import AGAIN_NS, Fitness
from companion.flight.doctor.examination import fence_finding
from companion.flight.doctor.parameter_check import Version, version_finding
from companion.flight.landing.situation import Severity
from companion.flight.link.autopilots.ardupilot import ARDUPILOT
from companion.flight.link.autopilots.autopilot_interface import OTHER, UNKNOWN, Autopilot
from companion.flight.link.autopilots.px4 import PX4
from companion.flight.link.vehicle_state import VehicleState
from companion.flight.services.fence_reader import Area, AutopilotFence, FenceReader

MS, S = 1_000_000, 1_000_000_000
OF_4_6 = {"LAND_SPEED", "LAND_ALT_LOW"}  # of ArduCopter; 4.7 has others instead


class Script:
    """A vehicle that answers requests, as far as it is told to, and what the pilot is told."""

    def __init__(
        self, autopilot: Autopilot, auto: bool = True, odometry: bool = False, **values: float
    ) -> None:
        self.odometry = odometry
        self.fitness = Fitness(auto, odometry)
        self.vehicle = VehicleState(sysid=1, autopilot=autopilot, mode="LOITER")
        rows = autopilot.required(odometry)
        has = {row.name for row in rows if not row.optional} | OF_4_6
        self.values = {row.name: row.value for row in rows if row.name in has} | values
        self.lost: set[str] = set()
        self.missing: set[str] = set()
        self.connected, self.flying = True, False
        self.now = 0
        self.asked: list[str] = []

    def run(self, seconds: float, **changes: Any) -> list[str]:
        """Let time pass after a change, and return the texts."""
        self.vehicle = replace(self.vehicle, **changes)
        texts = []
        for _ in range(round(seconds / 0.05)):
            self.now += 50 * MS
            for request in self.fitness.due_requests(self.vehicle, self.connected, self.flying, self.now):
                self.asked.append(request.param_id)
                self._answer(self.asked[-1])
            for severity, text in self.fitness.pop_texts():
                assert len(text) <= 50, text
                assert severity in (Severity.WARNING, Severity.INFO)
                texts.append(text.removeprefix("SLZ: "))
        return texts

    def tell(self, name: str, value: float) -> None:
        """Send a value that nobody asked for, as after a PARAM_SET of a ground station."""
        self.values[name] = value
        self._answer(name)

    def _answer(self, name: str) -> None:
        if name in self.missing:
            self.fitness.on_parameter_message(
                mavlink.MAVLink_param_error_message(1, 191, name.encode(), -1, 1)
            )
        elif name in self.values and name not in self.lost:
            self.fitness.on_parameter_message(self._value(name))

    def _value(self, name: str) -> Any:
        rows = {row.name: row for row in self.vehicle.autopilot.required(self.odometry)}
        value, kind = self.values[name], mavlink.MAV_PARAM_TYPE_REAL32
        if rows[name].integer:
            value, kind = struct.unpack("<f", struct.pack("<i", int(value)))[0], mavlink.MAV_PARAM_TYPE_INT32
        return mavlink.MAVLink_param_value_message(name.encode(), value, kind, 900, 0)

    def hand_over(self, seconds: float = 5.0) -> list[str]:
        return self.run(seconds, armed=True, mode=self.vehicle.autopilot.guided_mode)


AUTOPILOTS = pytest.mark.parametrize("autopilot", [ARDUPILOT, PX4])
WRONG = pytest.mark.parametrize(
    ("autopilot", "name", "value", "said"),
    [
        (PX4, "COM_OBL_RC_ACT", 0.0, "COM_OBL_RC_ACT is 0, needs 5"),
        (PX4, "COM_OF_LOSS_T", 30.0, "COM_OF_LOSS_T is 30, needs 0.2 to 2"),
        (ARDUPILOT, "PLND_ENABLED", 0.0, "PLND_ENABLED is 0, needs 1"),
        (ARDUPILOT, "GUID_TIMEOUT", 60.0, "GUID_TIMEOUT is 60, needs 0.5 to 5"),
        (ARDUPILOT, "LAND_SPEED", 150.0, "LAND_SPEED is 150, needs 20 to 100"),
        (ARDUPILOT, "LAND_SPD_MS", 1.5, "LAND_SPD_MS is 1.5, needs 0.2 to 1"),
        (PX4, "MPC_LAND_SPEED", 1.5, "MPC_LAND_SPEED is 1.5, needs 0.3 to 1"),
    ],
)


@AUTOPILOTS
def test_a_vehicle_set_up_for_us_is_fit_and_nothing_is_said(autopilot: Autopilot) -> None:
    script = Script(autopilot)
    assert not script.fitness.fit  # unknown
    assert script.run(5) == []
    assert script.fitness.fit
    assert script.hand_over() == []
    assert script.fitness.fit
    assert script.fitness.summary() == {"read": True, "fit": True, "wrong": []}


@WRONG
def test_what_is_dangerous_is_told_at_the_start_and_refuses_a_landing_by_itself_at_each_hand_over(
    autopilot: Autopilot, name: str, value: float, said: str
) -> None:
    script = Script(autopilot, **{name: value})
    assert script.run(5) == [said]
    assert not script.fitness.fit
    assert script.fitness.texts == (said,)
    for _ in range(2):
        assert script.hand_over() == [f"no landing by itself: {name}"]
        assert not script.fitness.fit
        assert script.run(30, mode="LOITER") == []
    assert script.fitness.summary()["wrong"][0]["name"] == name


class Unread(FenceReader):
    """A fence of which nothing was read yet, and the end of a reading as it is told."""

    is_read = False  # type: ignore[assignment]
    known = False

    def is_known(self, vehicle: VehicleState) -> bool:
        return self.known


@pytest.mark.parametrize(("auto", "said"), [(True, "no landing by itself"), (False, "landing is at risk")])
def test_a_fence_that_was_not_read_counts_as_a_critical_parameter(auto: bool, said: str) -> None:
    script, fence = Script(ARDUPILOT, auto), Unread()
    script.fitness = Fitness(auto, fence=fence)
    assert script.run(5) == script.hand_over() == []  # it is being read
    assert not script.fitness.fit
    fence.is_read = True
    assert script.run(5) == [f"{said}: fence not read"]
    assert script.run(60) == []
    fence.known = True
    script.run(1)
    assert script.fitness.fit


@WRONG
def test_an_order_is_carried_out_and_warned_of(
    autopilot: Autopilot, name: str, value: float, said: str
) -> None:
    script = Script(autopilot, auto=False, **{name: value})
    assert script.run(5) == [said]
    assert script.hand_over() == [f"landing is at risk: {name}"]
    script.flying = True
    assert script.run(5) == [f"landing is at risk: {name}"]


def test_what_is_changed_in_flight_is_seen_at_the_next_hand_over() -> None:
    script = Script(PX4)
    script.run(5)
    script.values["COM_OBL_RC_ACT"] = 0.0  # by a ground station on another link
    assert script.run(30) == []
    assert script.hand_over() == ["COM_OBL_RC_ACT is 0, needs 5", "no landing by itself: COM_OBL_RC_ACT"]
    assert not script.fitness.fit


def test_between_the_hand_over_and_the_answers_it_is_not_fit() -> None:
    script = Script(PX4)
    script.run(5)
    script.lost = set(script.values)
    script.hand_over(0.1)
    assert not script.fitness.fit
    assert script.fitness.faults == ()  # not known to be wrong


def test_a_value_set_right_is_told_and_counts_at_once() -> None:
    script = Script(PX4, COM_OBL_RC_ACT=0.0)
    script.hand_over()
    script.tell("COM_OBL_RC_ACT", 5.0)
    assert script.fitness.fit
    assert script.run(1) == ["autopilot's parameters are right now"]
    script.tell("COM_OBL_RC_ACT", 4.0)
    assert not script.fitness.fit
    assert script.run(1) == ["COM_OBL_RC_ACT is 4, needs 5"]


@AUTOPILOTS
def test_lost_answers_are_asked_for_again(autopilot: Autopilot) -> None:
    script = Script(autopilot)
    script.lost = set(script.values)
    script.run(2)
    script.lost = set()
    assert script.run(5) == []
    assert script.fitness.fit


@AUTOPILOTS
def test_what_cannot_be_read_is_said_and_not_fine_until_it_is(autopilot: Autopilot) -> None:
    script = Script(autopilot)
    name = next(row.name for row in autopilot.required() if row.critical)
    script.lost = {name}
    assert script.run(5) == [f"{name} could not be read"]
    assert script.hand_over() == [f"no landing by itself: {name}"]
    assert script.run(60) == []  # it is asked for again, and not told again
    script.lost = set()
    assert script.run(AGAIN_NS / S + 5) == ["autopilot's parameters are right now"]
    assert script.fitness.fit


@AUTOPILOTS
def test_an_autopilot_that_answers_nothing_is_told_in_three_texts(autopilot: Autopilot) -> None:
    script = Script(autopilot)
    script.lost = set(script.values)
    texts = script.run(40)  # five requests of each, four at once
    assert len(texts) == 3
    assert texts[0].endswith("could not be read")
    assert texts[2].endswith("more are wrong: see slz doctor")
    assert not script.fitness.fit


def test_what_the_autopilot_says_it_does_not_have_is_not_asked_for_again() -> None:
    script = Script(ARDUPILOT)
    script.missing = {"PLND_TYPE"}
    assert script.run(5) == ["PLND_TYPE is missing"]
    assert script.asked.count("PLND_TYPE") == 1
    assert not script.fitness.fit


def test_a_parameter_of_another_version_is_no_fault_and_not_waited_for() -> None:
    script = Script(PX4)
    assert {row.name for row in PX4.required() if row.optional} >= {"EAV_EN", "MAN_OVERRIDE_SPD"}
    assert script.run(0.5) == []
    assert script.fitness.fit
    assert script.fitness.summary()["read"]
    assert script.run(10) == []


def test_the_first_reading_waits_for_critical_parameters_that_only_some_versions_have() -> None:
    script = Script(ARDUPILOT, LAND_SPD_MS=1.5)
    script.lost = {"LAND_SPD_MS"}
    assert script.run(1.0) == []
    assert not script.fitness.fit  # whether this version has it is not yet known
    script.lost = set()
    assert script.run(3.0) == ["LAND_SPD_MS is 1.5, needs 0.2 to 1"]
    assert not script.fitness.fit


def test_a_version_without_a_critical_parameter_is_fit_once_it_has_not_answered() -> None:
    script = Script(ARDUPILOT)
    assert script.run(1.0) == []
    assert not script.fitness.fit
    assert script.run(4.0) == []
    assert script.fitness.fit
    assert script.hand_over(1.0) == []
    assert script.fitness.fit  # known by now: it is not waited for again


@pytest.mark.parametrize(("autopilot", "once"), [(ARDUPILOT, 1), (PX4, 0)])
def test_a_reading_asks_once_for_what_a_plane_alone_has(autopilot: Autopilot, once: int) -> None:
    script = Script(autopilot)
    script.run(20)
    assert script.asked.count("Q_ENABLE") == once
    script.hand_over(20)
    assert script.asked.count("Q_ENABLE") == 2 * once
    script.run(20, is_plane=True, reboots=1)
    assert script.asked.count("Q_ENABLE") == 2 * once


def test_it_reads_again_after_a_reboot_and_after_a_lost_link() -> None:
    script = Script(PX4)
    script.run(5)
    script.values["COM_OBL_RC_ACT"] = 0.0
    assert script.run(5, reboots=1) == ["COM_OBL_RC_ACT is 0, needs 5"]
    script.values["COM_OBL_RC_ACT"] = 5.0
    script.connected = False
    assert script.run(5) == []
    script.connected = True
    assert script.run(5) == ["autopilot's parameters are right now"]


@pytest.mark.parametrize("autopilot", [OTHER, UNKNOWN])
def test_an_autopilot_that_is_not_known_is_not_fit(autopilot: Autopilot) -> None:
    script = Script(autopilot)
    assert script.run(5) == []
    assert not script.fitness.fit


def names(rows: Iterable[Any]) -> set[str]:
    return {row.name for row in rows if row.critical}


def test_what_makes_a_fall_of_the_companion_or_a_late_abort_dangerous_is_critical() -> None:
    assert names(PX4.required()) == {
        "COM_OBL_RC_ACT", "COM_OF_LOSS_T", "MPC_LAND_SPEED", "MPC_LAND_ALT2", "MPC_LAND_RC_HELP", "GF_ACTION",
    }  # fmt: skip
    assert names(ARDUPILOT.required()) == {
        "PLND_ENABLED", "PLND_TYPE", "PLND_STRICT", "GUID_TIMEOUT",
        "LAND_SPD_MS", "LAND_ALT_LOW_M", "LAND_SPEED", "LAND_ALT_LOW",
        "PLND_YAW_ALIGN", "PLND_LAND_OFS_X", "PLND_LAND_OFS_Y", "PLND_ORIENT", "GUID_OPTIONS",
    }  # fmt: skip


@pytest.mark.parametrize(
    ("autopilot", "name", "value", "said"),
    [
        (ARDUPILOT, "VISO_TYPE", 0.0, "VISO_TYPE is 0, needs 1"),
        (ARDUPILOT, "EK3_SRC2_POSXY", 3.0, "EK3_SRC2_POSXY is 3, needs 6"),
        (PX4, "EKF2_EV_CTRL", 0.0, "EKF2_EV_CTRL is 0, needs 5 or 7"),
    ],
)
def test_what_the_odometry_needs_is_checked_only_while_it_is_sent(
    autopilot: Autopilot, name: str, value: float, said: str
) -> None:
    with_it = Script(autopilot, odometry=True, **{name: value})
    assert with_it.run(5) == [said]
    assert with_it.fitness.fit, "the vehicle lands without it as well"
    assert with_it.fitness.values[name] == value
    without = Script(autopilot, **{name: value})
    assert without.run(5) == []


# The fence in the words of the doctor.


TRIANGLE = Area(((0, 0), (0, 100), (100, 0)), 0.0, True)


@pytest.mark.parametrize(
    ("fence", "found"),
    [
        (AutopilotFence(), "none"),
        (AutopilotFence(radius_m=25.0, margin_m=4.0), "circle of 25 m; 4 m kept from it"),
        (AutopilotFence(highest_m=96.0, lowest_m=6.0), "flown up to 96 m, down to 6 m; 2 m kept from it"),
        (AutopilotFence(areas=(TRIANGLE,)), "1 area; 2 m kept from it"),
        (AutopilotFence(areas=(TRIANGLE, TRIANGLE)), "2 areas; 2 m kept from it"),
    ],
)
def test_a_fence_is_named_by_its_parts(fence: AutopilotFence, found: str) -> None:
    finding = fence_finding(fence)
    assert (finding.state, finding.found, finding.remedy) == ("ok", found, "")


def test_a_fence_that_cannot_be_read_is_a_fault_with_a_remedy() -> None:
    finding = fence_finding(None)
    assert finding.state == "fail"
    assert "--land auto does not begin" in finding.remedy


# Firmware version: from its packed form to the doctor's text.


def packed(major: int, minor: int, patch: int, kind: int) -> int:
    return major << 24 | minor << 16 | patch << 8 | kind


@pytest.mark.parametrize(
    ("kind", "name"),
    [(255, "release"), (192, "release candidate"), (193, "release candidate"), (128, "beta"), (64, "alpha"),
     (0, "development"), (7, "development")],
)  # fmt: skip
def test_a_version_is_unpacked_with_its_kind(kind: int, name: str) -> None:
    assert str(Version.unpack(packed(1, 17, 2, kind))) == f"1.17.2 {name}"


@pytest.mark.parametrize(
    ("autopilot", "version", "state", "said"),
    [
        (PX4, (1, 17, 0, 255), "ok", "PX4 1.17.0 release"),
        (PX4, (1, 18, 0, 128), "ok", "PX4 1.18.0 beta"),
        (PX4, (1, 13, 3, 255), "warn", "PX4 1.13.3 release"),
        (PX4, (1, 19, 0, 64), "warn", "PX4 1.19.0 alpha"),
        (PX4, (2, 0, 0, 255), "warn", "PX4 2.0.0 release"),
        (ARDUPILOT, (4, 7, 0, 255), "ok", "ArduPilot 4.7.0 release"),
        (ARDUPILOT, (4, 4, 4, 255), "warn", "ArduPilot 4.4.4 release"),
        (ARDUPILOT, (4, 8, 0, 0), "warn", "ArduPilot 4.8.0 development"),
        (ARDUPILOT, None, "warn", "ArduPilot, version not told"),
        (OTHER, None, "skipped", "no autopilot that is known"),
    ],
)
def test_a_version_is_judged_by_what_was_tried(
    autopilot: Autopilot, version: tuple[int, int, int, int] | None, state: str, said: str
) -> None:
    finding = version_finding(autopilot, None if version is None else Version.unpack(packed(*version)))
    assert (finding.state, finding.found) == (state, said)
    assert bool(finding.remedy) == (state == "warn")
