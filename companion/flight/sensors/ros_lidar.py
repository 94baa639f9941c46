"""LiDAR of a ROS 2 driver: clouds from a topic."""

from __future__ import annotations

import asyncio
import contextlib
from collections import deque

from companion.flight.rmw.attachment import unpack
from companion.flight.rmw.qos import SENSOR_DATA
from companion.flight.rmw.ros_session import RosSession
from companion.flight.rmw.ros_topic import Topic
from companion.flight.sensors.decoders.ros_cloud_decoder import CLOUD
from companion.flight.sensors.diagnosis.lidar_diagnosis import LidarDiagnosis
from companion.flight.sensors.packet_stream import PacketStream


class RosLidar:
    """Receiver of the clouds of a topic, in the background of a session.

    It keeps the last five clouds while the event loop is busy, as its quality of service says, and counts
    those before as `overrun`.

    Attributes
    ----------
    stream
        Decoder of the clouds.
    on_imu
        Never emits.
    """

    def __init__(self, session: RosSession, topic: str, stream: PacketStream) -> None:
        self.stream = stream
        self.on_imu = stream.on_imu
        self._loop: asyncio.AbstractEventLoop | None = None
        self._waiting: deque[tuple[int, str, bytes]] = deque(maxlen=SENSOR_DATA.depth)
        self._overrun = 0
        self._subscription = session.subscribe(Topic(topic, CLOUD, SENSOR_DATA), self._receive)

    @property
    def last_arrival_ns(self) -> int | None:
        """Arrival of the newest valid cloud, None before any."""
        return self.stream.last_arrival_ns

    @property
    def diagnosis(self) -> LidarDiagnosis | None:
        """None: this sensor's stream is not diagnosed."""
        return None

    def statistics(self) -> dict[str, int | float | None]:
        """Return counters of clouds and returns, and of dropped data by reason."""
        more = {"overrun": self._overrun, "wrong_type": self._subscription.wrong_type}
        return self.stream.statistics() | more

    async def run(self) -> None:
        """Receive until cancelled."""
        loop = self._loop = asyncio.get_running_loop()
        try:
            await loop.create_future()
        finally:
            self._loop = None

    def _receive(self, payload: bytes, attachment: bytes) -> None:
        """Store a cloud, in a thread of Zenoh's."""
        loop = self._loop
        if loop is None:
            return
        head = unpack(attachment)
        host = "" if head is None else head.gid.hex()
        self._overrun += len(self._waiting) == self._waiting.maxlen
        self._waiting.append((round(loop.time() * 1e9), host, attachment + payload))
        with contextlib.suppress(RuntimeError):  # the loop has just ended
            loop.call_soon_threadsafe(self._decode)

    def _decode(self) -> None:
        """Decode the oldest stored cloud."""
        if not self._waiting:
            return
        arrival_ns, host, packet = self._waiting.popleft()
        self.stream.add_packet(packet, host, arrival_ns)
        self.stream.flush(arrival_ns)
