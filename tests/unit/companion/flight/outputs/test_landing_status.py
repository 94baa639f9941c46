"""Status stream: names that fit, numbers that the documentation explains, no unknown values."""

from __future__ import annotations

import math
import re
from dataclasses import replace

from companion.flight.landing.executive import Phase
from companion.flight.outputs.landing_status import PHASES, POINTS, Status, status_messages
from slz import PointState
from tests import REPOSITORY

STATUS = Status("descend", 3, 17.0, "safe", 0.99, 12.5, 210.0, 0, 0.3)
DOCUMENT = REPOSITORY / "docs" / "mavlink.md"


def told(status: Status) -> dict[str, float]:
    return {m.name: m.value for m in status_messages(status, 1234)}


def test_every_value_has_a_name_of_ten_bytes_at_most_and_is_documented() -> None:
    messages = status_messages(STATUS, 2**32 + 1234)
    assert all(len(m.name) <= 10 and m.time_boot_ms == 1234 for m in messages)
    documented = set(re.findall(r"^\| `(SLZ_[A-Z]+)` \|", DOCUMENT.read_text("utf-8"), re.MULTILINE))
    assert {m.name for m in messages} == documented


def test_phases_and_points_are_told_by_number() -> None:
    assert told(STATUS)["SLZ_PHASE"] == 3
    assert told(STATUS)["SLZ_POINT"] == 1
    assert told(replace(STATUS, phase="dance"))["SLZ_PHASE"] == -1
    assert {phase.value for phase in Phase} <= set(PHASES)
    assert {state.value for state in PointState} == set(POINTS[1:])


def test_what_is_unknown_is_not_told() -> None:
    unknown = Status("idle", 0, math.nan, "none", math.nan, math.inf, math.nan, 2, math.nan)
    assert told(unknown) == {"SLZ_PHASE": 0, "SLZ_ZONES": 0, "SLZ_POINT": 0, "SLZ_DROPS": 2}
