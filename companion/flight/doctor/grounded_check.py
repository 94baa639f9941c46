"""Check of our own parameters: values that must not fly."""

from __future__ import annotations

from companion.flight.doctor.finding import Finding
from params import Parameters, grounded


def grounded_findings(parameters: Parameters) -> list[Finding]:
    """Return a fault for each value that `slz run` refuses."""
    return [
        Finding(
            one.row.mavlink,
            "fail",
            f"{one.value} {one.reason}",
            one.allowed,
            f"set {one.row.name} to {one.allowed}: slz run refuses {one.value}",
        )
        for one in grounded(parameters)
    ]
