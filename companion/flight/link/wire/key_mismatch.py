"""Mismatch of the keys of MAVLink signing: this computer or the vehicle refuses what the other sends."""

from __future__ import annotations

from enum import Enum

from companion.flight.link.wire.signing import Verdict


class KeyMismatch(Enum):
    """Mismatch, as the pilot reads it."""

    NO_KEY = "vehicle signs, no --mavlink-key"
    NOT_SIGNED = "vehicle does not sign, we do"
    OTHER_KEY = "vehicle signs with another key"
    OLD_TIMES = "vehicle signs with old times"

    @property
    def remedy(self) -> str:
        """Remedy, in a sentence."""
        return _REMEDIES[self]

    @staticmethod
    def of(verdict: Verdict | None) -> KeyMismatch | None:
        """Return the mismatch that a verdict on the autopilot's frames shows, None if it shows none."""
        return None if verdict is None else _BY_VERDICT.get(verdict)


_REMEDIES = {
    KeyMismatch.NO_KEY: "it ignores what slz sends: give slz the vehicle's key by --mavlink-key FILE",
    KeyMismatch.NOT_SIGNED: (
        "slz refuses what is not signed: set the key on the vehicle (and PX4's MAV_SIGN_CFG), or start slz"
        " without --mavlink-key"
    ),
    KeyMismatch.OTHER_KEY: "give slz the vehicle's key by --mavlink-key FILE, or set this key on the vehicle",
    KeyMismatch.OLD_TIMES: (
        "its clock is behind by over a minute, or its frames are repeated: let it have GPS time, and check"
        " the date of this computer"
    ),
}
_BY_VERDICT: dict[Verdict, KeyMismatch] = {
    "unsigned": KeyMismatch.NOT_SIGNED,
    "forged": KeyMismatch.OTHER_KEY,
    "replayed": KeyMismatch.OLD_TIMES,
}
