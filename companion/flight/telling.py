"""Fourth part of a flight: messages, texts, page, recordings, ROS node and live view."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING

from companion.flight.deciding import Deciding
from companion.flight.flight_view import FlightView
from companion.flight.link.link import Link
from companion.flight.link.wire.signing import Signing
from companion.flight.outputs.announcers.lidar_announcer import LidarAnnouncer
from companion.flight.outputs.announcers.odometry_announcer import OdometryAnnouncer
from companion.flight.outputs.announcers.report_announcer import ReportAnnouncer
from companion.flight.outputs.landing_status import landing_status
from companion.flight.outputs.schedule import MessageSchedule
from companion.flight.recorder.recordings import Recordings
from companion.flight.rmw.ros_session import RosSession
from companion.flight.sensing import Sensing
from companion.flight.services.order_parameters import OrderParameters
from companion.flight.services.services import Services
from companion.flight.services.settings import Settings
from companion.flight.terrain_mapping import TerrainMapping
from companion.runtime.clock import WallOffset
from companion.runtime.state_directory import StateDir
from params import Parameters

if TYPE_CHECKING:
    from companion.flight.dashboard.page import Page, PageEndpoint
    from companion.flight.foxglove.live_view import LiveView
    from companion.flight.ros2.ros_node import RosNode


@dataclass(frozen=True, slots=True)
class Displays:
    """Displays of a flight: address of the pilot's page, and port of the live view; None for none."""

    page: PageEndpoint | None = None
    foxglove_port: int | None = None


@dataclass(frozen=True, slots=True)
class Telling:
    """Everything that is sent, shown and recorded.

    Attributes
    ----------
    view
        The flight's parts, as displays read them.
    streams, services
        Messages at fixed rates; answers to stations.
    recordings
        Recordings of the flight.
    lidar_announcer, odometry_announcer
        Texts about faults of the LiDAR and changes of an external odometry.
    page, live, ros_node
        Displays, None for those that are off.
    """

    view: FlightView
    streams: MessageSchedule
    services: Services
    recordings: Recordings
    lidar_announcer: LidarAnnouncer
    odometry_announcer: OdometryAnnouncer
    page: Page | None
    live: LiveView | None
    ros_node: RosNode | None

    def close(self) -> None:
        """Stop the displays and close the recording."""
        for display in (self.page, self.live, self.ros_node):
            if display is not None:
                display.close()
        self.recordings.close()


def build_telling(
    link: Link,
    settings: Settings,
    parameters: Parameters,
    sensing: Sensing,
    mapping: TerrainMapping,
    deciding: Deciding,
    displays: Displays,
    *,
    signing: Signing | None,
    state: StateDir | None,
    wall_offset_ns: WallOffset,
    sends_ranges: bool,
) -> Telling:
    """Build what sends, shows and records.

    Parameters
    ----------
    signing, state
        Signing of the link; state directory for its timestamp, our rally points and recordings.
    wall_offset_ns
        Offset of UTC from the companion's clock.
    sends_ranges
        Whether ranges and obstacles are sent to the autopilot.

    Raises
    ------
    UsageError
        The port of the live view is in use.
    """
    executive, external, latest = deciding.executive, sensing.external, mapping.latest
    status = partial(landing_status, link, sensing.history, mapping.worker, latest, executive)
    streams = MessageSchedule(
        link, sensing.history, mapping.surroundings, parameters, status, deciding.execution, sensing.odometry,
        ranges=sends_ranges,
    )  # fmt: skip
    services = Services(
        link, settings, signing, state, latest, (OrderParameters(deciding.order_desk),), deciding.fence
    )
    recordings = Recordings(
        link, sensing.lidar.stream, mapping.worker, settings, wall_offset_ns, state, sensing.assembler,
        external,
    )  # fmt: skip
    view = FlightView(parameters, settings, link, sensing, mapping, deciding, streams, recordings)
    live = None if displays.foxglove_port is None else _live_view(view, displays.foxglove_port)
    page = None if displays.page is None else _page(view, displays.page)
    ros_node = None if sensing.ros is None else _ros_node(view, sensing.ros)
    for display in (recordings, live, ros_node):
        if display is not None:
            mapping.worker.on_report.subscribe(display.use_report)
            mapping.feed.on_pose.subscribe(display.pose)
            mapping.feed.on_moving.subscribe(display.moving)
    if page is not None:
        mapping.worker.on_report.subscribe(page.use_report)
        deciding.loop.on_new_frame.subscribe(page.clear_path)
    if ros_node is not None:
        mapping.feed.on_new_map.subscribe(ros_node.clear)
    deciding.loop.on_new_frame.subscribe(recordings.frame_begun)
    announcer = ReportAnnouncer(link, executive, parameters)
    mapping.worker.on_report.subscribe(announcer.use_report)
    mapping.worker.on_invalid.subscribe(announcer.on_invalid)
    lidar_announcer = LidarAnnouncer(sensing.lidar.diagnosis, link.statustext)
    odometry_announcer = OdometryAnnouncer(None if external is None else external.odometry, link.statustext)
    return Telling(
        view, streams, services, recordings, lidar_announcer, odometry_announcer, page, live, ros_node
    )


# ---- displays, whose libraries are imported only where they are used -------------------------


def _page(view: FlightView, endpoint: PageEndpoint) -> Page:
    from companion.flight.dashboard.page import Page

    return Page(view, endpoint)


def _live_view(view: FlightView, port: int) -> LiveView:
    from companion.flight.foxglove.live_view import LiveView

    return LiveView(view, port)


def _ros_node(view: FlightView, session: RosSession) -> RosNode:
    from companion.flight.ros2.ros_node import RosNode

    return RosNode(view, session)
