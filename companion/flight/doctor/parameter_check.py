"""Check of the autopilot's parameters against the required values, for `slz doctor` and in flight."""

from __future__ import annotations

from collections.abc import Collection

from companion.flight.doctor.finding import Finding
from params import Required

UNREAD = "could not be read"
ABSENT = "the autopilot does not have it"


def parameter_findings(
    rows: tuple[Required, ...], values: dict[str, float], absent: Collection[str] = ()
) -> list[Finding]:
    """Judge the autopilot's values; an unread value is a fault unless it is optional.

    Parameters
    ----------
    values
        Values read, by name.
    absent
        Names that the autopilot reports as unknown.
    """
    judged = (_finding(row, values.get(row.name), row.name in absent) for row in rows)
    return [finding for finding in judged if finding is not None]


def _finding(row: Required, value: float | None, absent: bool) -> Finding | None:
    if value is not None and row.accepts(value):
        return Finding(row.name, "ok", f"{value:g}", row.accepted_text())
    if value is None and row.optional:
        return None  # a parameter of another version
    found = f"{value:g}" if value is not None else ABSENT if absent else UNREAD
    remedy = f"set {row.name} to {row.value:g} and reboot: {row.why}"
    if value is None and not absent:
        remedy = (
            f"the link lost it, or the autopilot does not have it (before a reboot, or too old): {remedy}"
        )
    return Finding(row.name, "fail" if row.level == "needed" else "warn", found, row.accepted_text(), remedy)
