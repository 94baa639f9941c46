"""The fence in the words of the doctor."""

from __future__ import annotations

import pytest

from companion.flight.doctor.examination import fence_finding
from companion.flight.services.fence_reader import Area, AutopilotFence

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
