"""External odometry with the stream of its messages, opened by topic."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Self

from companion.flight.fusion.external_odometry.external_odometry import ExternalOdometry
from companion.flight.fusion.external_odometry.odometry_clock import OdometryClock, Offset
from companion.flight.fusion.external_odometry.odometry_decoder import ODOMETRY
from companion.flight.fusion.external_odometry.odometry_topic import EXAMPLE, OdometryTopic
from companion.flight.fusion.external_odometry.pose_stream import PoseStream
from companion.flight.rmw.ros_session import RosSession
from companion.flight.rmw.ros_topic import Qos, Topic
from companion.flight.rmw.topic_inbox import TopicInbox
from companion.runtime.errors import UsageError
from params import Parameters

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


@dataclass(frozen=True, slots=True)
class OdometryInput:
    """An external odometry, and the stream of its messages."""

    topic: OdometryTopic
    odometry: ExternalOdometry
    stream: PoseStream

    @classmethod
    def open(
        cls,
        topic: OdometryTopic,
        odometry: ExternalOdometry,
        cloud_offset_ns: Offset,
        wall_offset_ns: Callable[[], int],
    ) -> Self:
        """Return the stream of a topic's messages to an odometry; offsets as of `OdometryClock`."""
        clock = OdometryClock(cloud_offset_ns, wall_offset_ns)
        return cls(topic, odometry, PoseStream(clock, odometry.add_pose, odometry.on_drop))

    def subscribe(self, session: RosSession | None, parameters: Parameters) -> RosOdometry:
        """Return the subscription of a node that is not yet running.

        Raises
        ------
        UsageError
            There is no node, or the parameters use no odometry.
        """
        option = f"--ros2-odometry {str(self.topic)!r}"
        if session is None:
            raise UsageError(f"{option} needs --ros2: write {EXAMPLE}")
        if parameters.odometry == "off":
            raise UsageError(f"{option} is used nowhere, as odometry is off: add --set odometry=map")
        return RosOdometry(session, self.topic, self.stream)
