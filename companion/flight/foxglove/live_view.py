"""Foxglove WebSocket server of the visual topics, for Foxglove and Lichtblick at `ws://HOST:PORT`."""

from __future__ import annotations

import logging
import time
from collections import deque
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import foxglove

from companion.flight.flight_view import FlightView
from companion.flight.geometry.pose import Pose
from companion.flight.mapping.window_event import WindowEvent
from companion.flight.recorder import foxglove_scene, topics
from companion.runtime.clock import now_ns
from companion.runtime.errors import UsageError
from slz import LocalFrame, MovingObject, Report, Window

log = logging.getLogger(__name__)

HOST = "127.0.0.1"
MOST_WAITING = 64
POSE_NS, ZONES_NS = 100_000_000, 500_000_000
SHOWN = frozenset(
    {
        topics.POINTS,
        topics.ZONES,
        topics.MOVING,
        topics.GEOJSON,
        topics.TRANSFORM,
        topics.FIX,
        topics.LOG,
        topics.PARAMETERS,
    }
)


class LiveView:
    """Server of the visual topics; it accepts no orders and only connections from this computer.

    Messages are built and sent in a separate thread; when it falls behind, the oldest are dropped.

    Parameters
    ----------
    port
        Port to listen on, 0 for any free one.

    Raises
    ------
    UsageError
        The port is in use.
    """

    def __init__(self, flight: FlightView, port: int) -> None:
        self._clock_offset_ns = time.time_ns() - now_ns()
        self._wind = flight.sensing.wind
        self._last_pose_ns = self._last_moving_ns = self._last_zones_ns = 0
        self._waiting: deque[Callable[[], None]] = deque(maxlen=MOST_WAITING)
        self._thread = ThreadPoolExecutor(1, thread_name_prefix="slz-foxglove")
        self.dropped = 0
        self._context = context = foxglove.Context()  # its channels close with it
        try:
            self._server = foxglove.start_server(
                name="slz",
                host=HOST,
                port=port,
                context=context,
                channel_filter=lambda channel: channel.topic in SHOWN,
            )
        except Exception as error:
            raise UsageError(f"--foxglove {port}: {error}") from None
        self._channels = {t: c for t, c in foxglove_scene.channels(context).items() if t in SHOWN}
        flight.mapping.worker.on_window.subscribe(self.window)
        flight.link.on_text.subscribe(self.text)

    @property
    def port(self) -> int:
        """Port that the server listens on."""
        return int(self._server.port)

    def window(self, _event: WindowEvent, window: Window) -> None:
        """Publish the points of a window."""
        wall_ns = self._wall_ns()
        self._put(topics.POINTS, lambda: foxglove_scene.cloud(window, wall_ns), wall_ns)

    def use_report(self, report: Report) -> None:
        """Publish a report, at most twice a second."""
        at_ns = now_ns()
        if self._last_zones_ns and at_ns - self._last_zones_ns < ZONES_NS:
            return
        self._last_zones_ns = at_ns
        wall_ns, wind = self._wall_ns(), self._wind.at(now_ns())
        self._put(topics.ZONES, lambda: foxglove_scene.scene(report, wall_ns, wind), wall_ns)
        self._put(topics.GEOJSON, lambda: foxglove_scene.geojson(report), wall_ns)

    def pose(self, pose: Pose, frame: LocalFrame) -> None:
        """Publish the vehicle's pose, at most ten times a second."""
        if now_ns() - self._last_pose_ns < POSE_NS:
            return
        self._last_pose_ns, wall_ns = now_ns(), self._wall_ns()
        self._put(topics.TRANSFORM, lambda: foxglove_scene.transform(pose, wall_ns), wall_ns)
        self._put(topics.FIX, lambda: foxglove_scene.fix(pose, frame, wall_ns), wall_ns)

    def moving(self, objects: tuple[MovingObject, ...]) -> None:
        """Publish what moves around the vehicle, at most ten times a second."""
        at_ns, wall_ns = now_ns(), self._wall_ns()
        if objects and at_ns - self._last_moving_ns >= POSE_NS:
            self._last_moving_ns = at_ns
            self._put(topics.MOVING, lambda: foxglove_scene.moving(objects, at_ns, wall_ns), wall_ns)

    def text(self, text: str, severity: int) -> None:
        """Publish a text for the pilot."""
        level = logging.INFO if severity > 4 else logging.WARNING if severity > 2 else logging.CRITICAL
        record = logging.LogRecord("slz", level, "", 0, text, None, None)
        wall_ns = self._wall_ns()
        self._put(topics.LOG, lambda: foxglove_scene.line(record, wall_ns), wall_ns)

    def close(self) -> None:
        """Stop the server."""
        self._thread.shutdown(wait=False, cancel_futures=True)
        self._server.stop()

    # ---- parts ----------------------------------------------------------------------------------

    def _put(self, topic: str, make: Callable[[], Any], wall_ns: int) -> None:
        channel = self._channels[topic]
        if not channel.has_sinks():
            return
        self.dropped += len(self._waiting) == MOST_WAITING
        self._waiting.append(lambda: channel.log(make(), log_time=wall_ns))
        self._thread.submit(self._send)

    def _send(self) -> None:
        try:
            self._waiting.popleft()()
        except IndexError:
            pass  # the oldest message was dropped
        except Exception:
            log.exception("a message for Foxglove cannot be made")

    def _wall_ns(self) -> int:
        return now_ns() + self._clock_offset_ns
