"""Progress of a landing: data that phases, interruptions and judgements share."""

from __future__ import annotations

from dataclasses import dataclass, field

from companion.flight.landing.aim import Aim
from companion.flight.landing.situation import LandingRequest, Phase, Tally, Vector
from companion.flight.landing.ways.approach_path import ApproachPath


@dataclass(slots=True)
class LandingProgress:
    """Progress of a landing.

    Attributes
    ----------
    phase, since_ns, late_ns
        Present phase, its beginning, and its time limit.
    aim
        Target point.
    request, started_ns, refused
        The accepted request, its time, and the points that its landing broke off from.
    path
        The approach path of the descent, None while that is straight down.
    keeps_request
        The last landing was broken off for a reason that is not its point's: it is tried again.
    is_ordered_abort
        The last abort holds until the next order.
    n_given
        Number of times that the landing gave way to moving objects.
    safe_since_ns
        In the approach: beginning of the time over the point during which it was safe.
    level_since_ns
        Before an automatic start: beginning of the time in which the vehicle was airborne, guided and level.
    order_count
        Order counter: incremented when an order is accepted, aborted or finished.
    tally
        Events so far, for the summary.
    leads_own_landing
        A landing of the autopilot's own follows our target.
    is_taken_over
        The landing under way was the autopilot's own: nobody ordered it, and a stick ends it.
    """

    phase: Phase = Phase.IDLE
    since_ns: int = 0
    late_ns: int = 0
    aim: Aim = field(default_factory=Aim)
    request: LandingRequest | None = None
    started_ns: int = 0
    refused: list[Vector] = field(default_factory=list)
    path: ApproachPath | None = None
    keeps_request: bool = False
    is_ordered_abort: bool = False
    n_given: int = 0
    safe_since_ns: int | None = None
    level_since_ns: int | None = None
    order_count: int = 0
    tally: Tally = field(default_factory=Tally)
    leads_own_landing: bool = False
    is_taken_over: bool = False

    @property
    def is_urgent(self) -> bool:
        """True if the landing under way takes what is reached soonest."""
        return self.request is not None and self.request.urgent
