"""Subscription of an external odometry in ROS 2."""

from __future__ import annotations

from companion.flight.fusion.external_odometry.odometry_decoder import ODOMETRY
from companion.flight.fusion.external_odometry.odometry_topic import OdometryTopic
from companion.flight.fusion.external_odometry.pose_stream import PoseStream
from companion.flight.rmw.qos import Qos
from companion.flight.rmw.ros_session import RosSession
from companion.flight.rmw.ros_topic import Topic
from companion.flight.rmw.topic_inbox import TopicInbox

# Best effort takes messages of reliable publishers too. A motion capture of 200 Hz sends as many in 0.1 s.
QOS = Qos(20, reliable=False)


class RosOdometry:
    """Receiver of the messages of a topic, in the background of a session.

    It keeps the last twenty messages while the event loop is busy and counts those before as `overrun`.
    """

    def __init__(self, session: RosSession, topic: OdometryTopic, stream: PoseStream) -> None:
        self.topic, self.stream = topic, stream
        self._inbox = TopicInbox(session, Topic(topic.name, ODOMETRY, QOS), self._decode)

    def statistics(self) -> dict[str, int]:
        """Return counters of messages, and of those that did not reach the decoder by reason."""
        counted = {"messages": self.stream.messages, "lost_messages": self.stream.lost}
        return counted | self._inbox.statistics()

    async def run(self) -> None:
        """Receive until cancelled."""
        await self._inbox.run()

    def _decode(self, arrival_ns: int, payload: bytes, attachment: bytes) -> None:
        self.stream.add_packet(attachment + payload, arrival_ns)
