"""The application on the vehicle: link, sensors, fusion, map, landing and outputs, composed."""

from __future__ import annotations

import asyncio
import gc
import logging
import math
from collections.abc import Coroutine
from pathlib import Path
from typing import TYPE_CHECKING, Any

from companion.flight.command_execution import CommandExecution
from companion.flight.commander_watch import CommanderWatch
from companion.flight.decision_loop import DecisionLoop
from companion.flight.doctor.autopilot_fitness import Fitness
from companion.flight.flight_summary import flight_summary
from companion.flight.flown_path import FlownPath
from companion.flight.fusion.assembler import ScanAssembler
from companion.flight.fusion.external_odometry.odometry_input import OdometryInput
from companion.flight.fusion.external_odometry.odometry_topic import OdometryTopic
from companion.flight.fusion.odometry.opening import open_odometry
from companion.flight.fusion.odometry.place_source import PlaceSource
from companion.flight.fusion.pose_history import PoseHistory
from companion.flight.fusion.second_sensor import open_beside
from companion.flight.fusion.wind_estimate import WindEstimate
from companion.flight.landing.executive import Executive
from companion.flight.landing.landing_memory import LandingMemory
from companion.flight.landing.mavlink_orders import MavlinkOrders
from companion.flight.landing.operator_order import OrderDesk
from companion.flight.landing.restart import Restart
from companion.flight.landing.situation import COMMANDING, Severity, Situation
from companion.flight.link.link import Link
from companion.flight.link.navigation_source import NavigationSource
from companion.flight.link.wire.signing import Signing
from companion.flight.mapping.pipeline_worker import PipelineWorker
from companion.flight.mapping.point_watch import PointWatch
from companion.flight.mapping.recent_obstacles import RecentObstacles
from companion.flight.mapping.vehicle_surroundings import Surroundings
from companion.flight.mode_requests import ModeRequests
from companion.flight.outputs.announcers.lidar_announcer import LidarAnnouncer
from companion.flight.outputs.announcers.odometry_announcer import OdometryAnnouncer
from companion.flight.outputs.schedule import MessageSchedule
from companion.flight.recorder.recordings import Recordings
from companion.flight.report_feed import ReportFeed
from companion.flight.rmw.ros_session import RosSession
from companion.flight.rmw.zenoh_url import ZenohUrl
from companion.flight.scan_feed import ScanFeed
from companion.flight.sensors.lidar_url import Lidar, open_lidar
from companion.flight.sensors.ros_lidar import RosLidar
from companion.flight.services.fence_reader import FenceReader
from companion.flight.services.order_parameters import OrderParameters
from companion.flight.services.services import Services
from companion.flight.services.settings import Settings
from companion.flight.services.vehicle_memory import identity_from, remember_vehicle
from companion.flight.situation_source import SituationSource
from companion.flight.status_source import landing_status
from companion.runtime.allocator import keep_memory
from companion.runtime.clock import WallOffset, now_ns
from companion.runtime.event import Event
from companion.runtime.named_tasks import Stopped, run_together
from companion.runtime.ring_buffer import RingBuffer
from companion.runtime.state_directory import StateDir
from params import Parameters
from slz import Report, SpeckDetector, TerrainMaps

if TYPE_CHECKING:
    from companion.flight.dashboard.page import Page, PageEndpoint
    from companion.flight.foxglove.live_view import LiveView
    from companion.flight.mapping.survey_prior import SurveyPrior
    from companion.flight.ros2.ros_node import RosNode

log = logging.getLogger(__name__)


class Companion:
    """The whole application.

    Parameters
    ----------
    mavlink_url, lidar_url
        As on the command line.
    auto
        Land without being asked.
    signing
        Signs the MAVLink link.
    state
        Where to remember what is set in flight; None forgets it.
    record
        File to record the flight in; it holds the data of the first sensor only.
    radar_url
        A radar beside the LiDAR; its points go into the same map.
    front
        Where to serve the pilot's page; None for nowhere.
    foxglove_port
        Port of this computer for Foxglove's live view; None for none.
    prior
        Folder of a survey to begin with (docs/survey.md).
    system
        The vehicle's MAVLink system; None: the only aircraft heard.
    ros2
        Zenoh router and domain of the ROS node; None for none.
    ros2_odometry
        Topic of an external odometry; None for none.

    Raises
    ------
    UsageError
        A URL is wrong or its port is in use, or the recording cannot be made.
    """

    def __init__(
        self,
        mavlink_url: str,
        lidar_url: str,
        parameters: Parameters,
        *,
        auto: bool,
        signing: Signing | None = None,
        state: StateDir | None = None,
        record: Path | None = None,
        radar_url: str | None = None,
        front: PageEndpoint | None = None,
        foxglove_port: int | None = None,
        prior: Path | None = None,
        system: int | None = None,
        ros2: ZenohUrl | None = None,
        ros2_odometry: OdometryTopic | None = None,
    ) -> None:
        self.settings = Settings(parameters, state)
        self.parameters = parameters = self.settings.live
        self.link = Link(mavlink_url, parameters, signing, identity_from(state, system))
        if state is not None:
            remember_vehicle(self.link, state)
        self.history = PoseHistory(parameters)
        self.link.inbox.on_reboot.subscribe(self.history.clear)
        self.wind = WindEstimate(parameters.drag_per_s)
        self.wind.follow(self.link)
        self.executive = Executive(parameters, auto)
        self._aids_autopilot = parameters.odometry == "autopilot"
        self.fence = FenceReader()
        self.fitness = Fitness(auto, lambda: self._aids_autopilot, self.fence)
        self._build_map(None if prior is None else _surveyed(prior, parameters))
        self._open_sensors(lidar_url, radar_url, ros2, ros2_odometry, state)
        ranges = lidar_url.partition(":")[0] != "mavlink"  # else they would come back as what was sent
        self._build_landing(signing, state, ranges=ranges)
        self.maps: TerrainMaps | None = None
        self.summary: dict[str, Any] = {}
        self.on_ready: Event[[]] = Event()
        self._stop = asyncio.Event()
        self._record_into, self._foxglove_port = record, foxglove_port
        self.live: LiveView | None = None
        self.page = None if front is None else _page(self, front)
        self.ros_node = None if self.ros is None else _ros_node(self, self.ros)

    def _build_map(self, surveyed: SurveyPrior | None) -> None:
        """Build the pipeline, and what is known beside its reports."""
        parameters = self.parameters
        self.specks = SpeckDetector()
        self.obstacles = RecentObstacles(self.specks)
        self.surroundings = Surroundings(self.obstacles, parameters)
        self.watch = PointWatch(math.radians(parameters.angle_noise_deg))
        self._reports = ReportFeed(
            self.link, self.executive, lambda: (
                self.situations, self.recordings.recorder, self.live, self.ros_node,
                self.surroundings, self.page,
            ),
        )  # fmt: skip
        self.worker = PipelineWorker(self.settings.running, self._reports.on_report, surveyed)
        self.settings.on_change.subscribe(lambda *_: self.worker.use(self.settings.running))
        self.worker.on_invalid.subscribe(self._reports.on_invalid)
        self.feed = ScanFeed(
            self.link, self.history, self.worker, self.executive, self.obstacles, self.watch,
            lambda: self.assembler.scans, lambda: (self.recordings.recorder, self.live, self.ros_node),
        )  # fmt: skip

    def _open_sensors(
        self,
        lidar_url: str,
        radar_url: str | None,
        ros2: ZenohUrl | None,
        ros2_odometry: OdometryTopic | None,
        state: StateDir | None,
    ) -> None:
        """Open LiDAR, radar and odometry, and the recordings of what they send."""
        parameters = self.parameters
        wall_offset_ns = WallOffset()
        self.ros = None if ros2 is None else RosSession(ros2)
        told = None if ros2_odometry is None else self._open_external(ros2_odometry, wall_offset_ns)
        self.ros_odometry = None if told is None else told.subscribe(self.ros, parameters)
        own = open_odometry(parameters, self.history, self._fix_lost) if told is None else None
        self.odometry: PlaceSource | None = own if told is None else told.odometry
        self._external = None if told is None else told.odometry
        self.assembler = ScanAssembler(
            parameters, self.history, self.feed.add_lidar_scan, self.specks, self.odometry
        )
        self.lidar: Lidar = open_lidar(
            lidar_url, parameters, self.assembler.add, self.link, wall_offset_ns, self.ros
        )
        if self.lidar.diagnosis is not None:
            self.lidar.diagnosis.repeated = lambda: self.assembler.repeated
            self.lidar.diagnosis.mount_error_deg = lambda: self.assembler.boresight.error_deg
        if own is not None:
            self.lidar.on_imu(own.gyro.add_samples)
            self.link.inbox.on_attitude.subscribe(own.gyro.add_attitude)
        self.radar: Lidar | None = None
        if radar_url is not None:
            self.radar = open_beside(radar_url, parameters, self.history, self.feed.add_radar_scan)
        self.recordings = Recordings(
            self.link, self.lidar.stream, self.worker, self.settings, wall_offset_ns, state,
            lambda: self.assembler.scans, told,
        )  # fmt: skip

    def _build_landing(self, signing: Signing | None, state: StateDir | None, *, ranges: bool) -> None:
        """Build what decides and commands, and the services and messages of the link."""
        parameters = self.parameters
        commanders = CommanderWatch(self.link)
        self.situations = SituationSource(
            parameters, self.link, self.history, self.worker, self.lidar, self.radar, self.fitness, self.wind,
            self.watch, commanders, self.odometry, self.fence,
        )  # fmt: skip
        self.feed.on_scan.subscribe(self.situations.on_scan)
        self.feed.on_new_map.subscribe(self.situations.on_new_map)
        self.streams = MessageSchedule(
            self.link, self.history, self.surroundings, parameters,
            lambda: landing_status(self, self.situations.report_now()), ranges=ranges,
            odometry=lambda: None if self.odometry is None else self.odometry.estimate,
        )  # fmt: skip
        self.feed.on_new_map.subscribe(self.surroundings.forget)
        self.modes = ModeRequests(self.link, self.executive)
        self._execution = CommandExecution(
            self.link, self.history, self.worker, self.streams, self.surroundings, self.modes, commanders,
            parameters,
        )  # fmt: skip
        self.order_desk = OrderDesk(self.executive, self.situation, parameters.zone_m)
        self.link.on_command(MavlinkOrders(self.order_desk, lambda: self.history.frame).answer)
        orders = (OrderParameters(self.order_desk),)
        self.services = Services(
            self.link, self.settings, signing, state, self.situations.fresh_report, orders, self.fence
        )
        self._path = FlownPath()
        self.decisions = DecisionLoop(
            self, self.feed, self.situations, self._execution, Restart(LandingMemory(state)), self._path,
            lambda: None if self.page is None else self.page.board.clear_path(),
        )  # fmt: skip
        self.watch.on_intrusion.subscribe(self.decisions.hurry)

    @property
    def report(self) -> Report | None:
        """The newest report of the present map, None before the first."""
        return self.situations.newest

    @property
    def path_enu_m(self) -> RingBuffer:
        """Flown path, (n, 3) of the map frame."""
        return self._path.enu_m

    @property
    def zones_seen(self) -> set[int]:
        """IDs of all zones reported so far."""
        return self._reports.zones_seen

    def situation(self) -> Situation:
        """Return what is known now, as the executive sees it."""
        return self.situations.situation()

    # ---- life -----------------------------------------------------------------------------------

    async def run(self) -> None:
        """Run until `stop`; any essential part that fails ends it with that part's error."""
        if self._record_into is not None:
            self.recordings.start_flight_recording(self._record_into)
        if self._foxglove_port is not None:
            self.live = _live_view(self, self._foxglove_port)
        self.link.inbox.on_certain.subscribe(self.history.limit_to_certain)
        self.link.inbox.on_attitude.subscribe(self.history.add_attitude)
        self.link.inbox.on_position.subscribe(self.history.add_position)
        parts: dict[str, Coroutine[Any, Any, None]] = {
            "link": self.link.run(),
            "lidar": self.lidar.run(),
            "services": self.services.run(),
            "fitness": self.fitness.run(self.link, lambda: self.executive.phase in COMMANDING),
            "ready": self._get_ready(),
            "stopper": self._wait_for_stop(),
        }
        if self._aids_autopilot:
            place_by = "LiDAR" if self.odometry is None else self.odometry.name
            parts["source"] = NavigationSource(place_by).run(
                self.link, self._tells_place, lambda: self.fitness.values
            )
        if self.ros_odometry is not None:
            parts["odometry"] = self.ros_odometry.run()
        if self.radar is not None:
            parts["radar"] = self.radar.run()
        if self.page is not None:
            parts["page"] = self.page.run()
        if self.ros_node is not None:
            self.feed.on_new_map.subscribe(self.ros_node.clear)
            parts["ros2"] = self.ros_node.run()
        try:
            failed = await run_together(parts)
        finally:
            gc.unfreeze()
            if self.page is not None:
                self.page.close()
            self.maps = self.worker.close()
            if self.live is not None:
                self.live.close()
            if self.ros_node is not None:
                self.ros_node.close()
            self.recordings.close()
            self.summary = flight_summary(self)
        if failed is not None:
            raise failed from None

    def _fix_lost(self) -> bool:
        return self.link.vehicle.health.fix_lost

    def _tells_place(self) -> bool:
        return self.odometry is not None and self.odometry.tells_place(now_ns())

    def _open_external(self, topic: OdometryTopic, wall_offset_ns: WallOffset) -> OdometryInput:
        def cloud_offset_ns(stamp_ns: int) -> int | None:
            return self.lidar.stream.offset_ns(stamp_ns) if isinstance(self.lidar, RosLidar) else None

        return OdometryInput.open(
            topic, self.parameters, self.history, gps_lost=self._fix_lost,
            cloud_offset_ns=cloud_offset_ns, wall_offset_ns=wall_offset_ns,
        )  # fmt: skip

    def stop(self) -> None:
        """End `run`, after telling whoever listens."""
        self._stop.set()

    async def _get_ready(self) -> None:
        """Warm up, then start deciding: nothing compiles in flight, and nothing commands before."""
        self.link.ready = False
        keep_memory()
        await self.worker.warm_up()
        gc.collect()
        gc.freeze()  # a full collection would stop the streams for a tenth of a second, for what stays anyway
        self.link.ready = True
        self.on_ready.emit()
        log.info("ready" if self.link.connected else "ready: waits for the autopilot")
        async with asyncio.TaskGroup() as group:
            group.create_task(self.worker.run(), name="pipeline")
            group.create_task(self.decisions.run(self._stop), name="executive")
            group.create_task(self.streams.run(), name="streams")
            group.create_task(
                LidarAnnouncer(self.lidar.diagnosis, self.link.statustext).run(), name="lidar announcer"
            )
            group.create_task(
                OdometryAnnouncer(self._external, self.link.statustext).run(), name="odometry announcer"
            )

    async def _wait_for_stop(self) -> None:
        await self._stop.wait()
        await self.leave()
        raise Stopped

    async def leave(self) -> None:
        """Tell whoever listens that the companion stops, stop the vehicle, and close the link."""
        flying = self.executive.phase in COMMANDING
        text = "SLZ: companion stops, take over" if flying else "SLZ: companion stops"
        log.info(text)
        self.link.statustext(text, Severity.CRITICAL.value if flying else Severity.NOTICE.value)
        self.modes.cancel()
        if flying and self.link.vehicle.guided:
            self._execution.stop_vehicle()
        await asyncio.sleep(0.2)
        await self.link.close()


def _surveyed(folder: Path, parameters: Parameters) -> SurveyPrior:
    from companion.flight.mapping.survey_prior import SurveyPrior  # the libraries of maps, as for the page

    return SurveyPrior(folder, parameters)


def _page(companion: Companion, front: PageEndpoint) -> Page:
    from companion.flight.dashboard.page import Page  # the server's libraries only where they are used

    return Page(companion, front)


def _live_view(companion: Companion, port: int) -> LiveView:
    from companion.flight.foxglove.live_view import LiveView

    return LiveView(companion, port)


def _ros_node(companion: Companion, session: RosSession) -> RosNode:
    from companion.flight.ros2.ros_node import RosNode

    return RosNode(companion, session)
