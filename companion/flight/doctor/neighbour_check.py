"""Check for other MAVLink systems on the link, beside the vehicle or in its place."""

from __future__ import annotations

from companion.flight.doctor.finding import Finding
from companion.flight.link.vehicle_identity import NAME_IT, VehicleIdentity, several

ONE = "one aircraft, or --system"


def neighbour_findings(identity: VehicleIdentity) -> list[Finding]:
    """Judge the autopilots heard; empty without any, or if the vehicle is alone or was named."""
    heard = identity.candidates | identity.passed_over
    if identity.ambiguous:
        found = several(identity.candidates.values()).partition(":")[0]
        return [Finding("autopilot", "fail", found, ONE, NAME_IT)]
    if identity.system is None and heard:
        found = " and ".join(map(str, heard.values()))
        return [Finding("autopilot", "fail", f"only {found}", ONE, f"connect to the vehicle, or {NAME_IT}")]
    others = [str(c) for system, c in sorted(identity.candidates.items()) if system != identity.system]
    if not others or identity.named is not None:
        return []
    found = f"{' and '.join(others)} beside system {identity.system}"
    remedy = (
        f"run with --system {identity.system}: at a start that hears both at once, neither is the vehicle"
    )
    return [Finding("other vehicles", "fail", found, ONE, remedy)]
