"""Objects that come to a landing: onto the point, across it, or over the vehicle."""

from __future__ import annotations

from sitl.intruders.intruder import HIGHEST_M, Intruder
from sitl.intruders.moving_bodies import (
    BouncingBall,
    Crosser,
    Cyclist,
    Dog,
    DrivenCar,
    PassingCar,
    Runner,
    SwungJib,
    Walker,
)

__all__ = ["HIGHEST_M", "KINDS", "BouncingBall", "Crosser", "DrivenCar", "Intruder", "SwungJib", "read"]

KINDS: dict[str, type[Intruder]] = {
    kind.what: kind for kind in (DrivenCar, SwungJib, Walker, Runner, Dog, Cyclist, PassingCar, BouncingBall)
}


def read(text: str, seed: int = 1) -> list[Intruder]:
    """Return the intruders of an option, such as `car@15` or `jib@12,car@10`; none for `none`.

    Raises
    ------
    ValueError
        A kind is unknown or named twice, or a height is not within 0 and 200 m.
    """
    if text == "none":
        return []
    found = {}
    for part in text.split(","):
        kind, _, height = part.partition("@")
        try:
            below_m = float(height)
        except ValueError:
            below_m = 0.0
        if kind not in KINDS or kind in found or not 0 < below_m <= HIGHEST_M:
            raise ValueError(
                f"--intruder {text!r}: write KIND@HEIGHT, such as car@15, up to {HIGHEST_M:g} m; "
                f"several by commas, each once, of {', '.join(KINDS)}"
            )
        found[kind] = KINDS[kind](below_m, seed)
    return list(found.values())
