"""First part of a flight: from the drivers of the sensors to placed scans."""

from __future__ import annotations

from dataclasses import dataclass

from companion.flight.fusion.assembler import ScanAssembler
from companion.flight.fusion.external_odometry.external_odometry import ExternalOdometry
from companion.flight.fusion.external_odometry.odometry_input import OdometryInput, RosOdometry
from companion.flight.fusion.external_odometry.odometry_topic import OdometryTopic
from companion.flight.fusion.odometry.place_source import PlaceSource, open_odometry
from companion.flight.fusion.pose_history import PoseHistory
from companion.flight.fusion.second_sensor import open_beside
from companion.flight.fusion.wind_estimate import WindEstimate
from companion.flight.link.link import Link
from companion.flight.rmw.ros_session import RosSession
from companion.flight.rmw.zenoh_url import ZenohUrl
from companion.flight.sensors.lidar_url import Lidar, open_lidar
from companion.flight.sensors.ros_lidar import RosLidar
from companion.runtime.clock import WallOffset, now_ns
from companion.runtime.event import Event
from params import Parameters
from slz import Scan, SpeckDetector


@dataclass(frozen=True, slots=True)
class Sources:
    """Sources of a flight's measurements.

    lidar, radar: URLs as on the command line. ros2: Zenoh router and domain of the ROS node. odometry: topic
    of an external odometry. None for none.
    """

    lidar: str
    radar: str | None = None
    ros2: ZenohUrl | None = None
    odometry: OdometryTopic | None = None

    @property
    def come_by_mavlink(self) -> bool:
        """True if the returns are ranges of the autopilot's own sensors."""
        return self.lidar.partition(":")[0] == "mavlink"


@dataclass(frozen=True, slots=True)
class Sensing:
    """Drivers, poses and what places scans by both.

    Attributes
    ----------
    history, wind
        Poses and wind by the autopilot's messages.
    specks
        Judge of single returns in the scans of the LiDAR.
    odometry
        Source of the place beside the autopilot, None while it is off.
    external
        Input of that odometry if it is another program's.
    assembler
        Places the returns of the LiDAR.
    radar
        Second sensor.
    ros
        Session of the ROS node, not yet running; ros_odometry is the subscription of the external odometry.
    on_lidar_scan, on_radar_scan
        Events of a scan (map frame), in order.
    """

    history: PoseHistory
    wind: WindEstimate
    specks: SpeckDetector
    odometry: PlaceSource | None
    external: OdometryInput | None
    assembler: ScanAssembler
    lidar: Lidar
    radar: Lidar | None
    ros: RosSession | None
    ros_odometry: RosOdometry | None
    on_lidar_scan: Event[[Scan]]
    on_radar_scan: Event[[Scan]]

    def tells_place(self) -> bool:
        """Return whether an odometry determines position and tilt now."""
        return self.odometry is not None and self.odometry.tells_place(now_ns())


def open_sensing(link: Link, parameters: Parameters, sources: Sources, wall_offset_ns: WallOffset) -> Sensing:
    """Open sensors and odometry, and let poses and wind follow the link.

    wall_offset_ns: offset of UTC from the companion's clock.

    Raises
    ------
    UsageError
        A URL is wrong or its port is in use, or the odometry is used nowhere.
    """
    history, wind, specks = PoseHistory(parameters), WindEstimate(parameters.drag_per_s), SpeckDetector()
    link.inbox.on_reboot.subscribe(history.clear)
    wind.follow(link)
    ros = None if sources.ros2 is None else RosSession(sources.ros2)
    own, other = None, None
    if sources.odometry is None:
        own = open_odometry(parameters, history, link.has_lost_fix)
    else:
        other = ExternalOdometry(history, sources.odometry.child_frame(parameters), link.has_lost_fix)
    odometry: PlaceSource | None = own if other is None else other
    on_lidar_scan, on_radar_scan = Event[[Scan]](), Event[[Scan]]()
    assembler = ScanAssembler(parameters, history, on_lidar_scan.emit, specks, odometry)
    lidar = open_lidar(sources.lidar, parameters, assembler.add, link, wall_offset_ns, ros)
    if lidar.diagnosis is not None:
        lidar.diagnosis.placed = assembler
    if own is not None:
        lidar.on_imu(own.gyro.add_samples)
        link.inbox.on_attitude.subscribe(own.gyro.add_attitude)
    external, ros_odometry = None, None
    if sources.odometry is not None and other is not None:
        cloud_offset_ns = lidar.stream.offset_ns if isinstance(lidar, RosLidar) else _no_cloud_offset
        external = OdometryInput.open(sources.odometry, other, cloud_offset_ns, wall_offset_ns)
        ros_odometry = external.subscribe(ros, parameters)
    radar = None
    if sources.radar is not None:
        radar = open_beside(sources.radar, parameters, history, on_radar_scan.emit)
    link.inbox.on_certain.subscribe(history.limit_to_certain)
    link.inbox.on_attitude.subscribe(history.add_attitude)
    link.inbox.on_position.subscribe(history.add_position)
    return Sensing(
        history, wind, specks, odometry, external, assembler, lidar, radar, ros, ros_odometry,
        on_lidar_scan, on_radar_scan,
    )  # fmt: skip


def _no_cloud_offset(_stamp_ns: int) -> None:
    """Return no offset: no cloud carries the stamps of the odometry's program."""
