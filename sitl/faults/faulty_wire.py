"""Wire with a fault treatment of its datagrams in both directions."""

from __future__ import annotations

import heapq
from collections.abc import Callable
from functools import partial
from typing import Protocol

import numpy as np

from sitl.wire.wire import Peer, Wire

Write = Callable[[bytes], None]


class Treatment(Protocol):
    """Fault treatment of a datagram."""

    def __call__(self, data: bytes, rng: np.random.Generator, now_ns: int) -> list[tuple[float, bytes]]:
        """Return the resulting datagrams with their delays in seconds; an empty list if it is lost."""


class FaultyWire(Wire):
    """Wrapper of another wire that treats all datagrams while a treatment is set.

    Parameters
    ----------
    inner
        The wrapped wire. Its peers become this one's.
    rng
        Source of all randomness.
    now_ns
        Returns the simulated time.

    Attributes
    ----------
    treatment
        Applied to each datagram; None passes everything unchanged.
    """

    def __init__(self, inner: Wire, rng: np.random.Generator, now_ns: Callable[[], int]) -> None:
        super().__init__()
        self.name = inner.name
        self.peers = inner.peers
        self.treatment: Treatment | None = None
        self._inner = inner
        self._rng = rng
        self._now_ns = now_ns
        self._order = 0
        self._inbound: list[tuple[int, int, Peer, bytes]] = []
        self._outbound: list[tuple[int, int, Write, bytes]] = []
        for peer in self.peers:
            peer.write = partial(self._write, peer.write)

    def poll(self) -> list[tuple[Peer, bytes]]:
        """Return what arrives now, and send the delayed outgoing datagrams that are due."""
        now = self._now_ns()
        for peer, data in self._inner.poll():
            for due_ns, order, rest in self._treated(data):
                heapq.heappush(self._inbound, (due_ns, order, peer, rest))
        while self._outbound and self._outbound[0][0] <= now:
            _, _, write, data = heapq.heappop(self._outbound)
            write(data)
        got = []
        while self._inbound and self._inbound[0][0] <= now:
            _, _, peer, data = heapq.heappop(self._inbound)
            got.append((peer, data))
        return got

    def close(self) -> None:
        self._inner.close()

    def _write(self, write: Write, data: bytes) -> None:
        for due_ns, order, rest in self._treated(data):
            if due_ns <= self._now_ns():
                write(rest)
            else:
                heapq.heappush(self._outbound, (due_ns, order, write, rest))

    def _treated(self, data: bytes) -> list[tuple[int, int, bytes]]:
        now = self._now_ns()
        arriving = [(0.0, data)] if self.treatment is None else self.treatment(data, self._rng, now)
        out = []
        for delay_s, rest in arriving:
            self._order += 1
            out.append((now + round(delay_s * 1e9), self._order, rest))
        return out
