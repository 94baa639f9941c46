"""ROS node of a flight: what it publishes, made and sent in a thread of its own."""

from __future__ import annotations

import asyncio
import contextlib
import logging
import threading
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import numpy as np
from numpy.typing import NDArray

from companion.flight.flight_view import FlightView
from companion.flight.geometry.pose import Pose
from companion.flight.rmw.message_types import GRID_MAP, message_types
from companion.flight.rmw.ros_session import RosPublisher, RosSession
from companion.flight.rmw.ros_topic import LATCHED, Qos, Topic
from companion.flight.ros2 import diagnostic_message, frame_messages, grid_map_message, zone_markers
from companion.runtime.clock import WallOffset, now_ns
from slz import LocalFrame, MovingObject, Pipeline, PointState, Report, TerrainMaps
from slz.grid import Box, common

log = logging.getLogger(__name__)

MAP = Topic("/slz/map", GRID_MAP, LATCHED)
ZONES = Topic("/slz/zones", "visualization_msgs/msg/MarkerArray", Qos(1))
LANDING_POINT = Topic("/slz/landing_point", "geometry_msgs/msg/PoseStamped", Qos(1))
ODOMETRY = Topic("/slz/odometry", "nav_msgs/msg/Odometry", Qos(5, reliable=False))
TF = Topic("/tf", "tf2_msgs/msg/TFMessage", Qos(100))
DIAGNOSTICS = Topic("/diagnostics", "diagnostic_msgs/msg/DiagnosticArray", Qos(10))
TOPICS = (MAP, ZONES, LANDING_POINT, ODOMETRY, TF, DIAGNOSTICS)

POSE_NS = 100_000_000
MAP_S = 1.0
DIAGNOSTICS_S = 1.0
MOST_CELLS = 400  # a side of the map around the vehicle
DISPLAY = "ROS topic"


class RosNode:
    """Publishes a flight; it accepts no orders.

    Of each topic one message waits for the thread; a newer one replaces it and is counted. While nobody is
    connected, messages are counted as lost and not made.

    Parameters
    ----------
    session
        Not yet running; the LiDAR may share it.
    """

    def __init__(self, flight: FlightView, session: RosSession) -> None:
        self._flight, self.session = flight, session
        self._publishers = {topic: session.advertise(topic) for topic in TOPICS}
        self._wall = WallOffset()
        self._lock = threading.Lock()
        self._waiting: dict[Topic, Callable[[], Any]] = {}
        self._thread = ThreadPoolExecutor(1, thread_name_prefix="slz-ros2")
        self._last_pose_ns = 0
        self._last_map_s = -MAP_S
        self._centre: tuple[NDArray[np.float64], int] | None = None
        flight.mapping.worker.display_hooks[DISPLAY] = self._copy_map
        flight.mapping.worker.on_invalid.subscribe(lambda _: self.clear())

    async def run(self) -> None:
        """Open the session and publish diagnostics until cancelled; a failure does not affect the landing."""
        session = asyncio.create_task(self.session.run(), name="ros2 session")
        try:
            while True:
                try:
                    self._publish_diagnostics()
                    if session.done():
                        session.result()
                except Exception:
                    log.exception("ROS 2 failed; nothing is published any more")
                    await asyncio.get_running_loop().create_future()
                await asyncio.sleep(DIAGNOSTICS_S)
        finally:
            session.cancel()

    def use_report(self, report: Report) -> None:
        """Publish the zones, and the selected point while it is safe."""
        at_ns = self._wall_ns()
        pose = self._flight.sensing.history.latest(now_ns())
        self._centre = None if pose is None else (pose.position_enu_m, at_ns)
        self._put(ZONES, lambda: zone_markers.markers(report, at_ns))
        selected = report.selected
        if selected is not None and selected.state is PointState.SAFE and not self._is_intruded():
            where = np.array([*selected.enu_m[:2], selected.height_m])
            self._put(LANDING_POINT, lambda: frame_messages.landing_point(where, at_ns))

    def pose(self, pose: Pose, frame: LocalFrame) -> None:
        """Publish the vehicle's pose, at most ten times a second."""
        del frame
        at_ns = now_ns()
        if at_ns - self._last_pose_ns < POSE_NS:
            return
        self._last_pose_ns = at_ns
        of_ns = pose.stamp_ns + self._wall()
        self._put(ODOMETRY, lambda: frame_messages.odometry(pose, of_ns))
        self._put(TF, lambda: frame_messages.transforms(pose, of_ns))

    def moving(self, objects: tuple[MovingObject, ...]) -> None:
        """Publish nothing of what moves."""

    def clear(self) -> None:
        """Withdraw map and zones: they are no longer valid."""
        at_ns = self._wall_ns()
        with self._lock:
            self._centre = None
        self._put(MAP, lambda: grid_map_message.nothing_known(at_ns))
        self._put(ZONES, lambda: zone_markers.no_markers(at_ns))

    def close(self) -> None:
        """Leave the ROS graph; what waits is dropped."""
        self._flight.mapping.worker.display_hooks.pop(DISPLAY, None)
        self._thread.shutdown(wait=False, cancel_futures=True)
        self.session.close()

    # ---- parts ----------------------------------------------------------------------------------

    def _publish_diagnostics(self) -> None:
        at_ns = self._wall_ns()
        parts = diagnostic_message.statuses(self._flight, self.session.statistics())
        self._put(DIAGNOSTICS, lambda: diagnostic_message.diagnostics(parts, at_ns))

    def _is_intruded(self) -> bool:
        """Return whether something has come onto the selected point since its window."""
        selected = self._flight.deciding.situations.situation().selected
        return selected is not None and selected.state is not PointState.SAFE

    def _copy_map(self, pipeline: Pipeline) -> None:
        """Copy the map around the vehicle, in the pipeline's thread, once a second."""
        centre, now_s = self._centre, time.monotonic()
        if centre is None or now_s - self._last_map_s < MAP_S or not self.session.is_connected():
            return
        self._last_map_s = now_s
        where, at_ns = centre
        maps = _around(pipeline, where, bounded=self._flight.parameters.mode == "source")
        with self._lock:
            if maps is None or self._centre is not centre:
                return  # it was withdrawn meanwhile
            self._store(MAP, lambda: grid_map_message.grid_map(maps, at_ns))
        self._submit()

    def _put(self, topic: Topic, make: Callable[[], Any]) -> None:
        """Leave a message to the thread; never blocks."""
        with self._lock:
            self._store(topic, make)
        self._submit()

    def _submit(self) -> None:
        with contextlib.suppress(RuntimeError):  # closed
            self._thread.submit(self._send_next)

    def _store(self, topic: Topic, make: Callable[[], Any]) -> None:
        """Store a message in place of one that waits; hold the lock."""
        self._publishers[topic].replaced += self._waiting.pop(topic, None) is not None
        self._waiting[topic] = make

    def _send_next(self) -> None:
        with self._lock:
            if not self._waiting:
                return  # its message was replaced
            topic = next(iter(self._waiting))
            make = self._waiting.pop(topic)
        try:
            self._send(self._publishers[topic], make)
        except Exception:
            if self.session.is_open:
                log.exception("a message on %s cannot be published", topic.name)

    def _send(self, publisher: RosPublisher, make: Callable[[], Any]) -> None:
        connected = self.session.is_connected()
        publisher.lost += not connected
        if not publisher.has_listener() or not (connected or publisher.topic.qos.transient_local):
            return
        publisher.put(message_types().serialise(make()))
        publisher.sent += connected

    def _wall_ns(self) -> int:
        return now_ns() + self._wall()


def _around(pipeline: Pipeline, enu_m: NDArray[np.float64], *, bounded: bool) -> TerrainMaps | None:
    """Return the map to land by around a place, None before any; a bounded one ends with its grid."""
    one = pipeline.maps(Box(0, 1, 0, 1))
    if one is None:
        return None
    row, col = one.grid.index(float(enu_m[0]), float(enu_m[1]))
    half = MOST_CELLS // 2
    box = Box(row - half, row + half, col - half, col + half)
    box = common(box, one.grid.everything) if bounded else box
    return None if box.empty else pipeline.maps(box)
