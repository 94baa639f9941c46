"""Messages of a topic, handed from a session's thread to the event loop."""

from __future__ import annotations

import asyncio
import contextlib
from collections import deque
from collections.abc import Callable

from companion.flight.rmw.ros_session import RosSession
from companion.flight.rmw.ros_topic import Topic


class TopicInbox:
    """Subscription whose messages wait for the event loop, as many as the topic's quality of service keeps.

    Parameters
    ----------
    take
        Called in the event loop with arrival (ns), payload and attachment of each message, in their order.

    Attributes
    ----------
    overrun
        Number of messages that newer ones replaced while the event loop was busy.
    """

    def __init__(self, session: RosSession, topic: Topic, take: Callable[[int, bytes, bytes], None]) -> None:
        self.overrun = 0
        self._take = take
        self._loop: asyncio.AbstractEventLoop | None = None
        self._waiting: deque[tuple[int, bytes, bytes]] = deque(maxlen=topic.qos.depth)
        self._subscription = session.subscribe(topic, self._receive)

    def statistics(self) -> dict[str, int]:
        """Return the counters of messages that were not taken, by reason."""
        return {"overrun": self.overrun, "wrong_type": self._subscription.wrong_type}

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
        self.overrun += len(self._waiting) == self._waiting.maxlen
        self._waiting.append((round(loop.time() * 1e9), payload, attachment))
        with contextlib.suppress(RuntimeError):  # the loop has just ended
            loop.call_soon_threadsafe(self._take_oldest)

    def _take_oldest(self) -> None:
        if self._waiting:
            self._take(*self._waiting.popleft())
