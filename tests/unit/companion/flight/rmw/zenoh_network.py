"""A Zenoh router and clients on this computer, and the messages that reach them."""

from __future__ import annotations

import asyncio
import json
import socket
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any, ClassVar

import zenoh

from tests.ports import free_port


def configured(**values: Any) -> zenoh.Config:
    """Return a configuration without multicast; `__` stands for a slash."""
    made = zenoh.Config()
    for name, value in {"scouting__multicast__enabled": False, **values}.items():
        made.insert_json5(name.replace("__", "/"), json.dumps(value))
    return made


@contextmanager
def router(port: int | None = None) -> Iterator[str]:
    """Run a router; yield its endpoint."""
    endpoint = f"tcp/127.0.0.1:{port or free_port(socket.SOCK_STREAM)}"
    with zenoh.open(configured(mode="router", listen__endpoints=[endpoint])):
        try:
            yield endpoint
        finally:
            while Client.open:
                Client.open[-1].close()


class Client:
    """A client of a router that keeps what it receives.

    samples: of the keys listened to, in their order. open: clients to close, a router's with it.
    """

    open: ClassVar[list[Client]] = []

    def __init__(self, endpoint: str) -> None:
        self.session: Any = zenoh.open(configured(mode="client", connect__endpoints=[endpoint]))
        self.samples: asyncio.Queue[Any] = asyncio.Queue()
        self._loop = asyncio.get_running_loop()
        self._kept: list[Any] = []
        self.open.append(self)

    def listen(self, key: str) -> None:
        """Subscribe to a key expression."""
        self._kept.append(self.session.declare_subscriber(key, self._add))

    def listen_late(self, key: str) -> None:
        """Subscribe as a transient-local subscription of rmw_zenoh does, which asks for what was before."""
        history = zenoh.ext.HistoryConfig(detect_late_publishers=True, max_samples=1)
        self._kept.append(
            zenoh.ext.declare_advanced_subscriber(self.session, key, self._add, history=history)
        )

    def tokens(self, key: str) -> set[str]:
        """Return the liveliness tokens now."""
        return {str(reply.ok.key_expr) for reply in self.session.liveliness().get(key)}

    async def next(self) -> Any:
        """Return the next sample."""
        return await asyncio.wait_for(self.samples.get(), 20)

    async def next_of(self, topic: str) -> Any:
        """Return the next sample of a topic; those of others are dropped."""
        while f"{topic}/" not in str((sample := await self.next()).key_expr):
            pass
        return sample

    async def by_topic(self, count: int) -> dict[str, Any]:
        """Return the first sample of so many keys, by the name of its topic."""
        found: dict[str, Any] = {}
        while len(found) < count:
            sample = await self.next()
            _, *name, _, _ = str(sample.key_expr).split("/")
            found.setdefault("/" + "/".join(name), sample)
        return found

    def close(self) -> None:
        """Leave the network."""
        self.open.remove(self)
        self.session.close()

    def _add(self, sample: Any) -> None:
        self._loop.call_soon_threadsafe(self.samples.put_nowait, sample)


async def until(condition: Any) -> None:
    """Wait for a condition that another thread brings about."""
    async with asyncio.timeout(20):
        while not condition():
            await asyncio.sleep(0.002)
