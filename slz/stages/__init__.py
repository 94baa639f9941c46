"""Stages of the default method, one file each, in the order in which a window passes them.

`BELIEF` selects the credible returns of a window; `METHOD` maps the ground below them and finds where to
land. What a stage reads and sets are names: of flags of returns (`slz.window_returns.Flag`) in capitals, of
their `places`, and of parts of the ground (`slz.map_ground.Ground`).
"""

from __future__ import annotations

from params import Parameters
from slz.lanes import Stage, unmet
from slz.map_ground import Ground
from slz.stages.map_stages import (
    CorridorStage,
    FarEvidence,
    NearEvidence,
    PriorStage,
    Resolution,
    SurfaceStage,
    ZoneStage,
)
from slz.stages.point_stages import (
    ArrivalStage,
    Isolation,
    Raised,
    RangeGate,
    Registration,
    SeenAirStage,
    WireStage,
)

BELIEF: tuple[Stage[Parameters], ...] = (RangeGate(), Isolation())
METHOD: tuple[Stage[Ground], ...] = (
    Resolution(),
    Registration(),
    SeenAirStage(),
    Raised(),
    SurfaceStage(),
    ArrivalStage(),
    WireStage(),
    FarEvidence(),
    NearEvidence(),
    ZoneStage(),
    CorridorStage(),
    PriorStage(),
)
GIVEN = frozenset({"places", "near", "far"})  # a window's returns, and the maps of the windows before it

if missing := unmet((*BELIEF, *METHOD), GIVEN):
    raise RuntimeError(f"stages read what none before them sets: {missing}")
