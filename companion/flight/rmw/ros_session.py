"""Session of a ROS node over Zenoh: opened and kept in the background, so that nobody waits for a router."""

from __future__ import annotations

import asyncio
import json
import logging
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from companion.flight.rmw.attachment import Attachment
from companion.flight.rmw.message_types import message_types
from companion.flight.rmw.ros_topic import NodeName, Topic, topic_key
from companion.flight.rmw.zenoh_url import NO_HASH, ZenohUrl

log = logging.getLogger(__name__)

NODE = "slz"
LOOK_S = 0.5
FIRST_PAUSE_S, LONGEST_PAUSE_S = 1.0, 60.0
HEARTBEAT_S = 0.5  # of a cached topic after its last message, as rmw_zenoh's: its losses show
OnMessage = Callable[[bytes, bytes], None]  # payload and attachment, in a thread of Zenoh's


@dataclass(slots=True)
class RosPublisher:
    """Publisher of a topic.

    sent: messages handed to Zenoh while a router or a peer was connected. lost: messages while none was.
    replaced: messages that a newer one replaced before they were made. gid: ID of the publisher in the graph.
    number: of the last message.
    """

    topic: Topic
    type_hash: str
    entity: int
    sent: int = 0
    lost: int = 0
    replaced: int = 0
    gid: bytes = b""
    number: int = 0
    zenoh: Any = None

    def has_listener(self) -> bool:
        """Return whether anyone subscribes to the topic, or may do so later and get its last message."""
        return self.zenoh is not None and (
            self.topic.qos.transient_local or bool(self.zenoh.matching_status.matching)
        )

    def put(self, payload: bytes) -> None:
        """Publish a message once the session is open; Zenoh drops it rather than wait for a slow network."""
        self.number += 1
        attachment = Attachment(self.number, time.time_ns(), self.gid)
        self.zenoh.put(payload, attachment=attachment.pack())


@dataclass(slots=True)
class RosSubscription:
    """Subscription to a topic. wrong_type: messages of another definition of its type."""

    topic: Topic
    type_hash: str
    entity: int
    on_message: OnMessage
    wrong_type: int = 0

    def add_sample(self, sample: Any) -> None:
        """Pass the message of a sample on, in a thread of Zenoh's."""
        if str(sample.key_expr).rpartition("/")[2] not in (self.type_hash, NO_HASH):
            self.wrong_type += 1
            return
        attachment = sample.attachment
        self.on_message(bytes(sample.payload), b"" if attachment is None else bytes(attachment))


class RosSession:
    """One node with publishers and subscriptions, declared before `run` and real once it has opened.

    The configuration is that of rmw_zenoh: a peer that connects to a router, on this computer or another, and
    accepts peers of this computer. If there is no router, Zenoh looks for one in the background.

    Attributes
    ----------
    publishers
        All publishers.
    """

    def __init__(self, url: ZenohUrl) -> None:
        self.url = url
        self.publishers: list[RosPublisher] = []
        self._subscriptions: list[RosSubscription] = []
        self._zenoh: Any = None
        self._closed = False
        self._kept: list[Any] = []  # tokens and subscriptions last as long as their objects

    def advertise(self, topic: Topic) -> RosPublisher:
        """Return a publisher of a topic; call it before `run`."""
        made = RosPublisher(topic, self._hash(topic), self._next_entity())
        self.publishers.append(made)
        return made

    def subscribe(self, topic: Topic, on_message: OnMessage) -> RosSubscription:
        """Return a subscription to a topic; call it before `run`."""
        made = RosSubscription(topic, self._hash(topic), self._next_entity(), on_message)
        self._subscriptions.append(made)
        return made

    @property
    def is_open(self) -> bool:
        """True if messages can be handed to Zenoh."""
        return self._zenoh is not None

    def is_connected(self) -> bool:
        """Return whether a router or a peer is connected now."""
        zenoh = self._zenoh
        return zenoh is not None and bool(list(zenoh.info.routers_zid()) or list(zenoh.info.peers_zid()))

    async def run(self) -> None:
        """Open the session and report whether a router answers, until cancelled."""
        await self._open()
        connected = None
        while True:
            now_connected = self.is_connected()
            if connected is None and not now_connected:
                log.warning("ROS 2: no Zenoh router answers at %s; looking for it", self.url.endpoint)
            elif now_connected and not connected:
                log.info("ROS 2: connected to Zenoh at %s", self.url.endpoint)
            elif connected and not now_connected:
                log.warning("ROS 2: the Zenoh router at %s is gone; looking for it", self.url.endpoint)
            connected = now_connected
            await asyncio.sleep(LOOK_S)

    def close(self) -> None:
        """Leave the ROS graph."""
        self._closed = True
        zenoh, self._zenoh = self._zenoh, None
        if zenoh is not None:
            zenoh.close()

    def statistics(self) -> dict[str, int | bool]:
        """Return whether a router or peer is connected, and counters of messages."""
        return {
            "connected": self.is_connected(),
            "sent": sum(one.sent for one in self.publishers),
            "lost": sum(one.lost for one in self.publishers),
            "replaced": sum(one.replaced for one in self.publishers),
        }

    # ---- parts ----------------------------------------------------------------------------------

    async def _open(self) -> None:
        pause_s = FIRST_PAUSE_S
        while True:
            try:
                return await asyncio.to_thread(self._open_now)
            except Exception as error:  # Zenoh's, which name no class
                said = " ".join(str(error).split())[:160]
                log.warning("ROS 2: Zenoh cannot be opened, again in %.0f s: %s", pause_s, said)
            await asyncio.sleep(pause_s)
            pause_s = min(2 * pause_s, LONGEST_PAUSE_S)

    def _open_now(self) -> None:
        """Open the session and declare everything, in a thread."""
        import zenoh

        session: Any = zenoh.open(_configuration(self.url))
        try:
            self._declare(session)
        except BaseException:
            session.close()
            raise
        self._zenoh = session
        if self._closed:  # meanwhile
            self.close()

    def _declare(self, session: Any) -> None:
        import xxhash
        import zenoh
        from zenoh import CongestionControl, Reliability

        ext: Any = zenoh.ext  # its types ask for both kinds of heartbeat
        self._kept.clear()
        node = NodeName(self.url.domain, str(session.zid()), NODE)
        self._kept.append(session.liveliness().declare_token(node.token()))
        for one in self.publishers:
            token = node.endpoint_token(one.topic, one.type_hash, one.entity, "MP")
            one.gid = xxhash.xxh3_128_intdigest(token.encode()).to_bytes(16, "little")
            key, qos = topic_key(self.url.domain, one.topic, one.type_hash), one.topic.qos
            how: dict[str, Any] = {
                "congestion_control": CongestionControl.DROP,
                "reliability": Reliability.RELIABLE if qos.reliable else Reliability.BEST_EFFORT,
            }
            if qos.transient_local:
                one.zenoh = ext.declare_advanced_publisher(
                    session,
                    key,
                    cache=ext.CacheConfig(qos.depth),
                    publisher_detection=True,
                    sample_miss_detection=ext.MissDetectionConfig(sporadic_heartbeat=HEARTBEAT_S),
                    **how,
                )
            else:
                one.zenoh = session.declare_publisher(key, **how)
            self._kept.append(session.liveliness().declare_token(token))
        for wanted in self._subscriptions:
            # Any hash: a publisher of ROS 2 Humble names none.
            key = topic_key(self.url.domain, wanted.topic, "*")
            self._kept.append(session.declare_subscriber(key, wanted.add_sample))
            token = node.endpoint_token(wanted.topic, wanted.type_hash, wanted.entity, "MS")
            self._kept.append(session.liveliness().declare_token(token))

    def _hash(self, topic: Topic) -> str:
        return message_types().hash(topic.type) if self.url.has_hashes else NO_HASH

    def _next_entity(self) -> int:
        return 1 + len(self.publishers) + len(self._subscriptions)


def _configuration(url: ZenohUrl) -> Any:
    """Return the session's configuration, as rmw_zenoh's default but for the router."""
    import zenoh

    configuration: Any = zenoh.Config()
    for name, value in (
        ("mode", "peer"),
        ("connect/endpoints", [url.endpoint]),
        ("connect/timeout_ms", -1),
        ("connect/exit_on_failure", False),
        ("listen/endpoints", ["tcp/localhost:0"]),
        ("scouting/multicast/enabled", False),
        ("scouting/gossip/enabled", True),
        ("timestamping/enabled", True),
    ):
        configuration.insert_json5(name, json.dumps(value))
    return configuration
