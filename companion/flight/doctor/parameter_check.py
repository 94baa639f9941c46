"""Check of the autopilot's parameters against the required values, for `slz doctor` and in flight."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass

from companion.flight.doctor.finding import Finding
from companion.flight.link.autopilots.autopilot_interface import Autopilot
from params import Required

UNREAD = "could not be read"
ABSENT = "the autopilot does not have it"


# FIRMWARE_VERSION_TYPE, the lowest byte of flight_sw_version: lower bound of each kind.
_KINDS = ((255, "release"), (192, "release candidate"), (128, "beta"), (64, "alpha"), (0, "development"))


@dataclass(frozen=True, slots=True)
class Version:
    """Firmware version from AUTOPILOT_VERSION.flight_sw_version."""

    major: int
    minor: int
    patch: int
    kind: str

    @classmethod
    def unpack(cls, packed: int) -> Version:
        """Return the version packed in 32 bits."""
        major, minor, patch, kind = packed.to_bytes(4, "big")
        return cls(major, minor, patch, next(name for least, name in _KINDS if kind >= least))

    def __str__(self) -> str:
        return f"{self.major}.{self.minor}.{self.patch} {self.kind}"


def version_finding(autopilot: Autopilot, version: Version | None) -> Finding:
    """Judge the version; None if the autopilot did not report it."""
    if autopilot.versions is None:
        return Finding("firmware", "skipped", "no autopilot that is known")
    name, (oldest, newest) = autopilot.title, autopilot.versions
    needed = "{}.{} to {}.{}".format(*oldest, *newest)
    if version is None:
        remedy = "AUTOPILOT_VERSION was not answered: look at docs/hardware.md for what differs by version"
        return Finding("firmware", "warn", f"{name}, version not told", needed, remedy)
    found = f"{name} {version}"
    if (version.major, version.minor) < oldest:
        return Finding(
            "firmware", "warn", found, needed, "update it: slz was not written for so old a version"
        )
    if (version.major, version.minor) > newest:
        remedy = "slz was not tried with so new a version: fly it in simulation first (docs/quickstart.md)"
        return Finding("firmware", "warn", found, needed, remedy)
    return Finding("firmware", "ok", found, needed)


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
