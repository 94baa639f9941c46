"""TCP transport: a client of the autopilot (`tcp:`) or a server for it (`tcpin:`)."""

from __future__ import annotations

import asyncio

from companion.flight.link.transport.channel import Channel, OnBytes, StreamChannel
from companion.flight.link.transport.mavlink_url import Url
from companion.flight.link.wire.framing import Framer

CONNECT_TIMEOUT_S = 5.0


async def open_tcp(url: Url, on_bytes: OnBytes) -> Channel:
    """Connect to the host; raise OSError on failure."""
    channel = StreamChannel(on_bytes)
    async with asyncio.timeout(CONNECT_TIMEOUT_S):
        await asyncio.get_running_loop().create_connection(lambda: channel, url.host, url.port)
    return channel


async def listen_tcp(url: Url, on_bytes: OnBytes) -> Channel:
    """Listen at the address; raise OSError on failure."""
    channel = ServerChannel(on_bytes)
    await channel.listen(url.host, url.port)
    return channel


class ServerChannel:
    """All connected clients as one channel, which is up once it listens.

    Received data is passed on in whole MAVLink frames, because TCP splits streams anywhere.
    """

    def __init__(self, on_bytes: OnBytes) -> None:
        self.lost: asyncio.Future[str] = asyncio.get_running_loop().create_future()
        self._on_bytes = on_bytes
        self._server: asyncio.Server | None = None
        self._clients: set[StreamChannel] = set()

    async def listen(self, host: str, port: int) -> None:
        """Start listening."""
        self._server = await asyncio.get_running_loop().create_server(self._accept, host, port)

    def _accept(self) -> StreamChannel:
        framer = Framer()
        client = StreamChannel(lambda data: self._on_bytes(framer.complete_bytes(data)))
        self._clients.add(client)
        client.lost.add_done_callback(lambda _: self._clients.discard(client))
        return client

    def write(self, data: bytes) -> bool:
        taken = [client.write(data) for client in self._clients]
        return bool(taken) and all(taken)

    def close(self) -> None:
        if self._server is not None:
            self._server.close()
        for client in list(self._clients):
            client.close()
        if not self.lost.done():
            self.lost.set_result("closed")
