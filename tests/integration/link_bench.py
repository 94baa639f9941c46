"""Test bench for the link: virtual time, real sockets, and an autopilot with configurable misbehaviour."""

from __future__ import annotations

import asyncio
import functools
import itertools
import time
from collections.abc import Callable, Coroutine, Iterator
from contextlib import asynccontextmanager
from dataclasses import dataclass, field
from typing import Any, Protocol

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from companion.flight.link.link import Link
from companion.flight.link.wire.signing import Signing
from companion.runtime.clock import now_ns
from companion.runtime.lockstep_loop import LockstepLoop
from params import Parameters
from sitl.wire.message_signing import sign

STEP_NS = 2_000_000
LONGEST_S = 300.0
GUIDED, LAND = 4, 9


def virtually(test: Callable[[], Coroutine[Any, Any, None]], *, kernel_s: float = 0.0) -> None:
    """Run a coroutine on a loop whose time passes whenever nothing else is to do.

    kernel_s: real time left at each step. A socket delivers at once, but a thread of the kernel carries the
    bytes of a terminal: without this, time passes before they have arrived.
    """
    steps: Iterator[int] = itertools.count(STEP_NS, STEP_NS)

    def step() -> int:
        if kernel_s:
            time.sleep(kernel_s)
        return next(steps)

    loop = LockstepLoop(step)
    try:
        loop.run_until_complete(asyncio.wait_for(test(), LONGEST_S))
    finally:
        loop.run_until_complete(loop.shutdown_asyncgens())
        loop.run_until_complete(loop.shutdown_default_executor())
        loop.close()


def on_simulated_clock(test: Callable[..., Coroutine[Any, Any, None]]) -> Callable[..., None]:
    """Run a test as `virtually` does."""

    @functools.wraps(test)
    def run(*args: Any, **fixtures: Any) -> None:
        virtually(lambda: test(*args, **fixtures))

    return run


async def until(condition: Callable[[], object], seconds: float = 20.0) -> None:
    """Wait until something is so."""
    async with asyncio.timeout(seconds):
        while not condition():
            await asyncio.sleep(0.01)


@asynccontextmanager
async def running(url: str, signing: Signing | None = None, **values: Any) -> Any:
    """Give a link that runs, and close it; what its run raised is raised here."""
    link = Link(url, Parameters(**values), signing)
    task = asyncio.create_task(link.run())
    await asyncio.sleep(0)
    try:
        yield link
    finally:
        await link.close()
        await task


class Wire(Protocol):
    """What the autopilot sends over."""

    def write(self, data: bytes) -> None: ...


@dataclass
class Autopilot:
    """An ArduCopter as far as the link can tell; `mute`, `deaf_to` and `reboot` are its vices."""

    wire: Wire
    system: int = 1
    delay_s: float = 0.0
    mode: int = 5
    armed: bool = False
    mute: bool = False
    deaf_to: dict[int, int] = field(default_factory=dict)  # command -> times it goes unheard
    obeys_modes: bool = True
    received: list[Any] = field(default_factory=list)
    intervals_s: dict[int, float] = field(default_factory=dict)
    booted_ns: int = 0
    key: bytes | None = None  # signs, and ignores what is not signed by it,
    hears_unsigned: bool = False  # unless this

    def __post_init__(self) -> None:
        self.booted_ns = now_ns() - 60_000_000_000
        self._parser = mavlink.MAVLink(None)
        self._parser.robust_parsing = True
        self._sender = mavlink.MAVLink(None, srcSystem=self.system, srcComponent=1)
        if self.key is not None:
            sign(self._sender, self.key, 0)
        if self.key is not None and not self.hears_unsigned:
            sign(self._parser, self.key, 0)

    def stop_signing(self) -> None:
        """Remove the key, as SETUP_SIGNING does."""
        self._parser.signing = mavlink.MAVLinkSigning()
        self._sender.signing = mavlink.MAVLinkSigning()

    # ---- what it does ---------------------------------------------------------------------------

    async def fly(self) -> None:
        """Send heartbeats and whatever was asked for, until cancelled."""
        next_heartbeat = 0.0
        due: dict[int, float] = {}
        loop = asyncio.get_running_loop()
        while True:
            now = loop.time()
            if now >= next_heartbeat:
                self.send(self._heartbeat())
                next_heartbeat = now + 1.0
            for message_id, interval_s in self.intervals_s.items():
                if now >= due.setdefault(message_id, now) and (message := self._stream(message_id)):
                    due[message_id] += interval_s
                    self.send(message)
            await asyncio.sleep(0.005)

    def reboot(self) -> None:
        """Begin anew: its clock, its streams."""
        self.booted_ns = now_ns() - 1_000_000_000
        self.intervals_s.clear()

    @property
    def boot_ms(self) -> int:
        return (now_ns() - self.booted_ns) // 1_000_000

    def send(self, message: Any, system: int | None = None, component: int = 1) -> None:
        """Send as itself, or as another system or component."""
        self._sender.srcSystem, self._sender.srcComponent = system or self.system, component
        data = bytes(message.pack(self._sender))
        self._sender.seq = (self._sender.seq + 1) % 256
        if self.mute:
            return
        if self.delay_s:
            asyncio.get_running_loop().call_later(self.delay_s, self.wire.write, data)
        else:
            self.wire.write(data)

    def _heartbeat(self) -> Any:
        flags = 1 | (128 if self.armed else 0)
        return mavlink.MAVLink_heartbeat_message(2, 3, flags, self.mode, 4, 3)

    # ---- what it hears --------------------------------------------------------------------------

    def hear(self, data: bytes) -> None:
        for message in self._parser.parse_buffer(data) or []:
            self.received.append(message)
            if message.get_type() == "TIMESYNC" and message.tc1 == 0:
                self.send(mavlink.MAVLink_timesync_message(now_ns() - self.booted_ns, message.ts1))
            elif message.get_type() == "COMMAND_LONG" and message.target_system == self.system:
                self._command(message)

    def _command(self, m: Any) -> None:
        if self.deaf_to.get(m.command, 0) > 0:
            self.deaf_to[m.command] -= 1
            return
        if m.command == mavlink.MAV_CMD_SET_MESSAGE_INTERVAL:
            self.intervals_s[int(m.param1)] = m.param2 * 1e-6
        elif m.command == mavlink.MAV_CMD_DO_SET_MODE and self.obeys_modes:
            self.mode = int(m.param2)
        self.send(mavlink.MAVLink_command_ack_message(m.command, 0))

    def _stream(self, message_id: int) -> Any:
        """Return a message of a stream, None if it is none of ours."""
        return _STREAMS[message_id](self.boot_ms) if message_id in _STREAMS else None

    def heard(self, name: str) -> list[Any]:
        """Return all messages of a type so far."""
        return [m for m in self.received if m.get_type() == name]


def _attitude(boot_ms: int) -> Any:
    return mavlink.MAVLink_attitude_quaternion_message(boot_ms, 1, 0, 0, 0, 0.1, 0.2, 0.3)


def _position(boot_ms: int) -> Any:
    return mavlink.MAVLink_global_position_int_message(
        boot_ms, 470_000_000, 80_000_000, 412_000, 12_000, 100, 200, -50, 9000
    )


_STREAMS: dict[int, Callable[[int], Any]] = {
    mavlink.MAVLINK_MSG_ID_ATTITUDE_QUATERNION: _attitude,
    mavlink.MAVLINK_MSG_ID_GLOBAL_POSITION_INT: _position,
    mavlink.MAVLINK_MSG_ID_EXTENDED_SYS_STATE: lambda _: mavlink.MAVLink_extended_sys_state_message(0, 2),
}


class UdpWire(asyncio.DatagramProtocol):
    """The autopilot's end of a datagram link."""

    def __init__(self) -> None:
        self.hear: Callable[[bytes], None] = lambda data: None
        self.transport: Any = None

    def connection_made(self, transport: Any) -> None:
        self.transport = transport

    def datagram_received(self, data: bytes, addr: Any) -> None:
        self.hear(data)

    def error_received(self, exc: Exception) -> None:
        """Nobody listens at the other end just now."""

    def write(self, data: bytes) -> None:
        self.transport.sendto(data)


@asynccontextmanager
async def autopilot_over_udp(port: int, kind: type[Autopilot] = Autopilot, **vices: Any) -> Any:
    """Give an autopilot that speaks to a UDP port of this machine."""
    loop = asyncio.get_running_loop()
    transport, wire = await loop.create_datagram_endpoint(UdpWire, remote_addr=("127.0.0.1", port))
    autopilot = kind(wire, **vices)
    wire.hear = autopilot.hear
    task = asyncio.create_task(autopilot.fly())
    try:
        yield autopilot
    finally:
        task.cancel()
        transport.close()
        await asyncio.sleep(0)
