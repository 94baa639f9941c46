"""Stages of the default method, one file each, in the order in which a window passes them.

`BELIEF` tells which returns of a window to believe, `METHOD` what the ground below them is and where to
land. What a stage reads and sets are names: of flags of returns (`slz.window_returns.Flag`) in capitals, of
their `places`, and of parts of the ground (`slz.map_ground.Ground`).
"""

from __future__ import annotations

from params import Parameters
from slz.lanes import Stage, unmet
from slz.map_ground import Ground
from slz.stages.arrivals_stage import ArrivalStage
from slz.stages.corridors_stage import CorridorStage
from slz.stages.evidence_stage import FarEvidence, NearEvidence
from slz.stages.isolation_stage import Isolation
from slz.stages.prior_stage import PriorStage
from slz.stages.raised_stage import Raised
from slz.stages.range_gate_stage import RangeGate
from slz.stages.registration_stage import Registration
from slz.stages.resolution_stage import Resolution
from slz.stages.seen_air_stage import SeenAirStage
from slz.stages.surface_stage import SurfaceStage
from slz.stages.wires_stage import WireStage
from slz.stages.zones_stage import ZoneStage

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
