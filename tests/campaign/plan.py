"""Plans of the campaign's flights: fault, state of the landing, scene and duration."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from companion.flight.landing.situation import Phase
from sitl import faults
from tests.campaign import onboard

FAULTS: tuple[str, ...] = ("none", *faults.NAMES, *onboard.NAMES)
STATES = (Phase.SURVEY, Phase.APPROACH, Phase.DESCEND, Phase.FINAL, Phase.CLIMB)
CELLS: tuple[tuple[str, Phase], ...] = tuple((fault, state) for fault in FAULTS for state in STATES)
SCENES = ("landing_site", "landing_site", "streets", "buildings", "plain")
# How long after a state is told the fault begins, at most: as long as the state usually lasts.
LATEST_S = {Phase.SURVEY: 2.0, Phase.APPROACH: 4.0, Phase.DESCEND: 2.0, Phase.FINAL: 6.5, Phase.CLIMB: 2.0}
STRIDE = 41  # shares no factor with the number of cells: neighbours in number are different faults
LASTS_S = (4.0, 16.0)
# A hand on the stick is short; the filter gives its position up 7.4 s after the last fix.
OTHERS_LAST_S = {"pilot_stick": (3.0, 6.0), "gps_loss": (5.0, 20.0)}


@dataclass(frozen=True, slots=True)
class Plan:
    """One flight: the same number is the same flight."""

    number: int
    fault: str
    state: Phase
    scene: str
    after_s: float
    lasts_s: float
    wind_ms: float


def plan(number: int) -> Plan:
    """Return the flight of a number; each run of as many as there are cells holds each cell once."""
    fault, state = CELLS[number * STRIDE % len(CELLS)]
    rng = np.random.default_rng(number)
    return Plan(
        number=number,
        fault=fault,
        state=state,
        scene=SCENES[int(rng.integers(len(SCENES)))],
        after_s=float(rng.uniform(0.0, LATEST_S[state])),
        lasts_s=float(rng.uniform(*OTHERS_LAST_S.get(fault, LASTS_S))),
        wind_ms=float(rng.uniform(0.0, 6.0)),
    )


def number_of(fault: str, state: Phase, turn: int = 0) -> int:
    """Return the number of the first flight of a fault in a state, or of the one so many turns later."""
    place = CELLS.index((fault, state))
    first = next(n for n in range(len(CELLS)) if n * STRIDE % len(CELLS) == place)
    return first + turn * len(CELLS)
