"""Subscription of an external odometry in ROS 2."""

from __future__ import annotations

import asyncio
import contextlib
from collections import deque

from companion.flight.fusion.external_odometry.odometry_decoder import ODOMETRY
from companion.flight.fusion.external_odometry.odometry_topic import OdometryTopic
from companion.flight.fusion.external_odometry.pose_stream import PoseStream
from companion.flight.rmw.qos import Qos
from companion.flight.rmw.ros_session import RosSession
from companion.flight.rmw.ros_topic import Topic

# Best effort takes messages of reliable publishers too. A motion capture of 200 Hz sends as many in 0.1 s.
QOS = Qos(20, reliable=False)


class RosOdometry:
    """Receiver of the messages of a topic, in the background of a session.

    It keeps the last twenty messages while the event loop is busy and counts those before as `overrun`.
    """

    def __init__(self, session: RosSession, topic: OdometryTopic, stream: PoseStream) -> None:
        self.topic, self.stream = topic, stream
        self._loop: asyncio.AbstractEventLoop | None = None
        self._waiting: deque[tuple[int, bytes]] = deque(maxlen=QOS.depth)
        self._overrun = 0
        self._subscription = session.subscribe(Topic(topic.name, ODOMETRY, QOS), self._receive)

    def statistics(self) -> dict[str, int]:
        """Return counters of messages, and of those that did not reach the decoder by reason."""
        return {
            "messages": self.stream.messages,
            "lost_messages": self.stream.lost,
            "overrun": self._overrun,
            "wrong_type": self._subscription.wrong_type,
        }

    async def run(self) -> None:
        """Receive until cancelled."""
        loop = self._loop = asyncio.get_running_loop()
        try:
            await loop.create_future()
        finally:
            self._loop = None

    def _receive(self, payload: bytes, attachment: bytes) -> None:
        """Store a message, in a thread of Zenoh's."""
        loop = self._loop
        if loop is None:
            return
        self._overrun += len(self._waiting) == self._waiting.maxlen
        self._waiting.append((round(loop.time() * 1e9), attachment + payload))
        with contextlib.suppress(RuntimeError):  # the loop has just ended
            loop.call_soon_threadsafe(self._decode)

    def _decode(self) -> None:
        """Decode the oldest stored message."""
        if self._waiting:
            arrival_ns, packet = self._waiting.popleft()
            self.stream.add_packet(packet, arrival_ns)
