"""LiDAR of a ROS 2 driver: clouds from a topic."""

from __future__ import annotations

from companion.flight.rmw.attachment import unpack
from companion.flight.rmw.ros_session import RosSession
from companion.flight.rmw.ros_topic import SENSOR_DATA, Topic
from companion.flight.rmw.topic_inbox import TopicInbox
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
        self._inbox = TopicInbox(session, Topic(topic, CLOUD, SENSOR_DATA), self._decode)

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
        return self.stream.statistics() | self._inbox.statistics()

    async def run(self) -> None:
        """Receive until cancelled."""
        await self._inbox.run()

    def _decode(self, arrival_ns: int, payload: bytes, attachment: bytes) -> None:
        head = unpack(attachment)
        host = "" if head is None else head.gid.hex()
        self.stream.add_packet(attachment + payload, host, arrival_ns)
        self.stream.flush(arrival_ns)
