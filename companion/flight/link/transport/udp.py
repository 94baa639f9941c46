"""UDP transport: a fixed peer (`udpout:`), or a bound port that replies to its recent peers (`udpin:`)."""

from __future__ import annotations

import asyncio
import errno
from typing import Any

from companion.flight.link.transport.channel import MAX_BACKLOG_BYTES, Channel, OnBytes
from companion.flight.link.transport.mavlink_url import Url
from companion.flight.link.transport.multicast import join_group

# A bound port replies to all recent peers, because an autopilot or router that restarts uses a new port.
PEER_MEMORY_S = 10.0
MAX_PEERS = 4
# The kernel's buffer or its firewall's table is full for this datagram; the next one may pass.
NOT_TAKEN = (errno.ENOBUFS, errno.ENOMEM, errno.EPERM)


async def open_udpout(url: Url, on_bytes: OnBytes) -> Channel:
    """Open a socket connected to the address; raise OSError on failure."""
    channel = DatagramChannel(on_bytes, bound=False)
    loop = asyncio.get_running_loop()
    await loop.create_datagram_endpoint(lambda: channel, remote_addr=(url.host, url.port))
    return channel


async def open_udpin(url: Url, on_bytes: OnBytes) -> Channel:
    """Bind the address, and join it if it is a multicast group; raise OSError on failure."""
    channel = DatagramChannel(on_bytes, bound=True)
    loop = asyncio.get_running_loop()
    transport, _ = await loop.create_datagram_endpoint(lambda: channel, local_addr=(url.host, url.port))
    try:
        join_group(transport.get_extra_info("socket"), url.host)
    except OSError:
        transport.close()
        raise
    return channel


class DatagramChannel(asyncio.DatagramProtocol):
    """Datagram socket as a channel; an asyncio protocol."""

    def __init__(self, on_bytes: OnBytes, *, bound: bool) -> None:
        self._loop = asyncio.get_running_loop()
        self.lost: asyncio.Future[str] = self._loop.create_future()
        self.refused = 0
        self.unsent = 0
        self._on_bytes = on_bytes
        self._bound = bound
        self._peers: dict[Any, float] = {}
        self._transport: Any = None

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        self._transport = transport

    def datagram_received(self, data: bytes, addr: Any) -> None:
        if self._bound:
            self._peers.pop(addr, None)
            self._peers[addr] = self._loop.time()
            if len(self._peers) > MAX_PEERS:
                del self._peers[next(iter(self._peers))]
        self._on_bytes(data)

    def error_received(self, exc: Exception) -> None:
        if isinstance(exc, OSError) and exc.errno in NOT_TAKEN:
            self.unsent += 1
            return
        # "Refused" only means that nobody listens there yet. Any other error means that the socket or its
        # network is gone, but a bound socket survives the fault of one peer.
        if isinstance(exc, ConnectionRefusedError) or self._bound:
            self.refused += 1
        else:
            self._give_up(exc)

    def connection_lost(self, exc: Exception | None) -> None:
        if not self.lost.done():
            self.lost.set_result(str(exc) if exc else "closed")

    def write(self, data: bytes) -> bool:
        transport = self._transport
        if transport is None or transport.is_closing():
            return False
        if transport.get_write_buffer_size() > MAX_BACKLOG_BYTES:
            return False
        unsent = self.unsent
        peers = self._recent_peers() if self._bound else [None]
        for peer in peers:
            transport.sendto(data, peer)
        return bool(peers) and self.unsent == unsent

    def _recent_peers(self) -> list[Any]:
        """Remove peers silent for long, but never the last one, and return the rest."""
        newest = max(self._peers.values(), default=0.0)
        for peer in [peer for peer, heard in self._peers.items() if newest - heard > PEER_MEMORY_S]:
            del self._peers[peer]
        return list(self._peers)

    def close(self) -> None:
        if self._transport is None:
            self.connection_lost(None)
        else:
            self._transport.close()

    def _give_up(self, exc: Exception) -> None:
        if not self.lost.done():
            self.lost.set_result(str(exc))
        if self._transport is not None:
            self._transport.abort()
