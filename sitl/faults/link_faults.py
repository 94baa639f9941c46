"""Link faults: the effects of a bad plug, a full radio or a busy network on datagrams."""

from __future__ import annotations

import heapq
from collections.abc import Callable
from functools import partial
from typing import TYPE_CHECKING, Protocol

import numpy as np

from sitl.faults.fault import Fault
from sitl.wire.wire import Peer, Wire

if TYPE_CHECKING:
    from sitl.simulation import Simulation

Write = Callable[[bytes], None]
Arriving = list[tuple[float, bytes]]
LOST_SHARE = 0.3
BURST_S = 0.6
DELAY_S = 0.5
DUPLICATED, COPY_S, OLD_COPY_S = 0.3, 0.3, 5.0
SHUFFLE_S = 0.25
CORRUPTED, MOST_BITS = 0.2, 8


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


class LinkFault(Fault):
    """Fault treatment of all `FaultyWire`s of a simulation.

    Raises
    ------
    ValueError
        On `start`, if none of the wires is a `FaultyWire`.
    """

    def __init__(self, treatment: Treatment) -> None:
        self._treatment = treatment

    def start(self, simulation: Simulation) -> None:
        for wire in _faulty_wires(simulation):
            wire.treatment = self._treatment

    def stop(self, simulation: Simulation) -> None:
        for wire in _faulty_wires(simulation):
            wire.treatment = None


def _faulty_wires(simulation: Simulation) -> list[FaultyWire]:
    wires = [wire for wire in simulation.router.wires if isinstance(wire, FaultyWire)]
    if not wires:
        raise ValueError("link fault: no wire of this simulation is a FaultyWire; open it as one")
    return wires


class Loss:
    """Complete loss."""

    def __call__(self, data: bytes, rng: np.random.Generator, now_ns: int) -> Arriving:
        return []


class Bursts:
    """Loss in bursts of 0.6 s on average, 30 % of the time (Gilbert's model)."""

    def __init__(self) -> None:
        self._lost = False
        self._until_ns = 0

    def __call__(self, data: bytes, rng: np.random.Generator, now_ns: int) -> Arriving:
        self._until_ns = self._until_ns or now_ns
        while self._until_ns <= now_ns:
            self._lost = not self._lost
            mean_s = BURST_S if self._lost else BURST_S * (1 / LOST_SHARE - 1)
            self._until_ns += 1 + round(rng.exponential(mean_s) * 1e9)
        return [] if self._lost else [(0.0, data)]


class Delay:
    """Delay of every datagram by half a second."""

    def __call__(self, data: bytes, rng: np.random.Generator, now_ns: int) -> Arriving:
        return [(DELAY_S, data)]


class Duplicates:
    """Duplication of 30 % of the datagrams; the copy arrives up to 0.3 s later, the autopilot's up to 5 s.

    A router with two ways to the autopilot stores what a radio cannot send at once.
    """

    def __call__(self, data: bytes, rng: np.random.Generator, now_ns: int) -> Arriving:
        if rng.random() >= DUPLICATED:
            return [(0.0, data)]
        return [(0.0, data), (float(rng.uniform(0.0, OLD_COPY_S if _is_autopilots(data) else COPY_S)), data)]


def _is_autopilots(data: bytes) -> bool:
    """Return whether a MAVLink 2 frame is of component 1."""
    return len(data) > 6 and data[0] == 0xFD and data[6] == 1


class Reordering:
    """Delay of every datagram by a random time of up to 0.25 s, which reorders them."""

    def __call__(self, data: bytes, rng: np.random.Generator, now_ns: int) -> Arriving:
        return [(float(rng.uniform(0.0, SHUFFLE_S)), data)]


class Corruption:
    """Corruption of 20 % of the datagrams: one to eight flipped bits, and half of them also truncated."""

    def __call__(self, data: bytes, rng: np.random.Generator, now_ns: int) -> Arriving:
        if rng.random() >= CORRUPTED:
            return [(0.0, data)]
        spoilt = bytearray(data)
        for place in rng.integers(8 * len(spoilt), size=rng.integers(1, MOST_BITS + 1)):
            spoilt[int(place) // 8] ^= 1 << int(place) % 8
        length = len(spoilt) if rng.random() < 0.5 else int(rng.integers(1, len(spoilt) + 1))
        return [(0.0, bytes(spoilt[:length]))]
