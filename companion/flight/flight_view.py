"""Protocol of a running flight for displays, recorder and summary."""

from __future__ import annotations

from typing import Protocol

from companion.flight.doctor.autopilot_fitness import Fitness
from companion.flight.fusion.assembler import ScanAssembler
from companion.flight.fusion.external_odometry.ros_odometry import RosOdometry
from companion.flight.fusion.odometry.place_source import PlaceSource
from companion.flight.fusion.pose_history import PoseHistory
from companion.flight.fusion.wind_estimate import WindEstimate
from companion.flight.landing.executive import Executive
from companion.flight.landing.operator_order import OrderDesk
from companion.flight.landing.situation import Situation
from companion.flight.link.link import Link
from companion.flight.mapping.pipeline_worker import PipelineWorker
from companion.flight.outputs.schedule import MessageSchedule
from companion.flight.recorder.recordings import Recordings
from companion.flight.rmw.ros_session import RosSession
from companion.flight.sensors.lidar_url import Lidar
from companion.flight.services.settings import Settings
from companion.runtime.ring_buffer import RingBuffer
from params import Parameters
from slz import Report


class FlightView(Protocol):
    """Components of a flight.

    Attributes
    ----------
    radar
        Second sensor, None without one.
    ros
        Session of the ROS node, None without one.
    ros_odometry
        Subscription of an external odometry, None without one.
    odometry
        Source of the place beside the autopilot, None while it is off.
    """

    parameters: Parameters
    settings: Settings
    link: Link
    lidar: Lidar
    radar: Lidar | None
    assembler: ScanAssembler
    history: PoseHistory
    wind: WindEstimate
    worker: PipelineWorker
    executive: Executive
    order_desk: OrderDesk
    fitness: Fitness
    streams: MessageSchedule
    recordings: Recordings
    ros: RosSession | None
    ros_odometry: RosOdometry | None
    odometry: PlaceSource | None

    @property
    def report(self) -> Report | None:
        """The newest report of the present map, None before the first."""

    @property
    def path_enu_m(self) -> RingBuffer:
        """Flown path, (n, 3) of the map frame."""

    @property
    def zones_seen(self) -> set[int]:
        """IDs of all zones reported so far."""

    def situation(self) -> Situation:
        """Return the current inputs of the executive."""
