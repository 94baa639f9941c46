"""Firmware version: from its packed form to the doctor's text."""

from __future__ import annotations

import pytest

from companion.flight.doctor.parameter_check import Version, version_finding
from companion.flight.link.autopilots.ardupilot import ARDUPILOT
from companion.flight.link.autopilots.autopilot_interface import OTHER, Autopilot
from companion.flight.link.autopilots.px4 import PX4


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
