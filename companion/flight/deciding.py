"""Third part of a flight: from what is known to commands for the autopilot."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from companion.flight.command_execution import CommandExecution
from companion.flight.commander_watch import CommanderWatch
from companion.flight.decision_loop import DecisionLoop, FlownPath
from companion.flight.doctor.autopilot_fitness import Fitness
from companion.flight.landing.executive import Executive
from companion.flight.landing.landing_memory import LandingMemory
from companion.flight.landing.orders.mavlink_orders import MavlinkOrders
from companion.flight.landing.orders.operator_order import OrderDesk
from companion.flight.landing.restart import Restart
from companion.flight.landing.situation import COMMANDING
from companion.flight.link.link import Link
from companion.flight.mode_requests import ModeRequests
from companion.flight.sensing import Sensing
from companion.flight.services.fence_reader import FenceReader
from companion.flight.situation_source import SituationSource
from companion.flight.terrain_mapping import TerrainMapping
from companion.runtime.state_directory import StateDir
from params import Parameters


@dataclass(frozen=True, slots=True)
class Deciding:
    """Executive, and what it decides by and with.

    Attributes
    ----------
    executive
        Phases of the landing.
    order_desk
        Carries out the operator's orders.
    fence, fitness
        Readers of the autopilot's fence and of its parameters.
    situations
        Source of the situation that the executive sees.
    modes, execution
        Requests for flight modes, and execution of commands.
    loop
        Steps the executive.
    path
        Flown path.
    """

    executive: Executive
    order_desk: OrderDesk
    fence: FenceReader
    fitness: Fitness
    situations: SituationSource
    modes: ModeRequests
    execution: CommandExecution
    loop: DecisionLoop
    path: FlownPath

    def is_commanding(self) -> bool:
        """Return whether the vehicle is commanded."""
        return self.executive.phase in COMMANDING

    def autopilot_parameters(self) -> Mapping[str, float]:
        """Return the autopilot's parameters of the newest reading, by name."""
        return self.fitness.values


def build_deciding(
    link: Link,
    parameters: Parameters,
    sensing: Sensing,
    mapping: TerrainMapping,
    executive: Executive,
    state: StateDir | None,
    *,
    auto: bool,
) -> Deciding:
    """Build what decides, and let it answer MAV_CMD_USER_1.

    state: directory to keep a landing under way in. auto: land without an order.
    """
    fence, commanders, path = FenceReader(), CommanderWatch(link), FlownPath()
    aids_autopilot = parameters.odometry == "autopilot"
    fitness = Fitness(auto, aids_autopilot, fence)
    modes = ModeRequests(link, executive)
    execution = CommandExecution(
        link, sensing.history, mapping.worker, mapping.surroundings, modes, commanders, parameters
    )
    situations = SituationSource(parameters, link, sensing, mapping, execution, fitness, commanders, fence)
    order_desk = OrderDesk(executive, situations.situation, parameters.zone_m)
    link.on_command(MavlinkOrders(order_desk, sensing.history).answer)
    restart = Restart(LandingMemory(state))
    loop = DecisionLoop(link, sensing.history, mapping.feed, executive, situations, execution, restart, path)
    mapping.watch.on_intrusion.subscribe(loop.hurry)
    return Deciding(executive, order_desk, fence, fitness, situations, modes, execution, loop, path)
