"""UDP socket as a channel: its peers, and its end."""

from __future__ import annotations

import asyncio
import errno
import os
from types import SimpleNamespace
from typing import Any

import pytest

from companion.flight.link.transport.mavlink_url import Url, parse_url
from companion.flight.link.transport.udp import MAX_BACKLOG_BYTES, MAX_PEERS, PEER_MEMORY_S, DatagramChannel
from companion.runtime.errors import UsageError


class Transport:
    def __init__(self) -> None:
        self.sent: list[tuple[bytes, Any]] = []
        self.backlog, self.closing, self.aborted = 0, False, False

    def sendto(self, data: bytes, peer: Any = None) -> None:
        self.sent.append((data, peer))

    def get_write_buffer_size(self) -> int:
        return self.backlog

    def is_closing(self) -> bool:
        return self.closing

    def close(self) -> None:
        self.closing = True

    def abort(self) -> None:
        self.aborted = self.closing = True


def opened(*, bound: bool) -> tuple[DatagramChannel, Any, SimpleNamespace, list[bytes]]:
    """Return a channel, its transport, its clock and what came."""
    came: list[bytes] = []
    transport, clock, loop = Transport(), SimpleNamespace(now=0.0), asyncio.get_running_loop()
    with pytest.MonkeyPatch.context() as patch:
        timed = SimpleNamespace(time=lambda: clock.now, create_future=loop.create_future)
        patch.setattr(asyncio, "get_running_loop", lambda: timed)
        channel = DatagramChannel(came.append, bound=bound)
    channel.connection_made(transport)  # type: ignore[arg-type]
    return channel, transport, clock, came


async def test_a_bound_socket_answers_all_who_spoke_lately_and_the_last_one_for_ever() -> None:
    channel, transport, clock, came = opened(bound=True)
    assert not channel.write(b"to nobody")
    channel.datagram_received(b"a", "first")
    clock.now = PEER_MEMORY_S - 1
    channel.datagram_received(b"b", "second")
    assert channel.write(b"x")
    assert transport.sent == [(b"x", "first"), (b"x", "second")]
    clock.now = PEER_MEMORY_S + 2
    channel.datagram_received(b"c", "second")
    transport.sent.clear()
    assert channel.write(b"y")
    assert transport.sent == [(b"y", "second")]
    clock.now += 1000 * PEER_MEMORY_S
    transport.sent.clear()
    assert channel.write(b"z")
    assert transport.sent == [(b"z", "second")]
    assert came == [b"a", b"b", b"c"]


async def test_of_too_many_who_speak_those_silent_for_longest_are_forgotten() -> None:
    channel, transport, _, _ = opened(bound=True)
    for number in range(MAX_PEERS):
        channel.datagram_received(b"", number)
    channel.datagram_received(b"", 0)
    channel.datagram_received(b"", MAX_PEERS)
    channel.write(b"x")
    assert [peer for _, peer in transport.sent] == [*range(2, MAX_PEERS), 0, MAX_PEERS]


async def test_a_socket_to_one_address_sends_there_whoever_spoke() -> None:
    channel, transport, _, _ = opened(bound=False)
    assert channel.write(b"x")
    assert transport.sent == [(b"x", None)]


@pytest.mark.parametrize("bound", [True, False])
async def test_what_cannot_be_sent_is_told(bound: bool) -> None:
    channel, transport, _, _ = opened(bound=bound)
    channel.datagram_received(b"", "peer")
    transport.backlog = MAX_BACKLOG_BYTES + 1
    assert not channel.write(b"x")
    transport.backlog = 0
    channel.close()
    assert not channel.write(b"x")
    assert transport.sent == []


async def test_nobody_listening_yet_is_counted_and_any_other_fault_ends_the_socket() -> None:
    channel, transport, _, _ = opened(bound=False)
    channel.error_received(ConnectionRefusedError())
    assert (channel.refused, channel.lost.done(), transport.aborted) == (1, False, False)
    channel.error_received(OSError("Network is unreachable"))
    assert await channel.lost == "Network is unreachable"
    assert transport.aborted
    channel.connection_lost(None)
    assert await channel.lost == "Network is unreachable"


@pytest.mark.parametrize("bound", [True, False])
@pytest.mark.parametrize("number", [errno.ENOBUFS, errno.ENOMEM, errno.EPERM])
async def test_a_datagram_that_the_system_does_not_take_is_dropped_and_the_socket_goes_on(
    number: int, bound: bool
) -> None:
    channel, transport, _, _ = opened(bound=bound)
    channel.datagram_received(b"", "peer")
    taken = transport.sendto
    transport.sendto = lambda *_: channel.error_received(OSError(number, os.strerror(number)))
    assert not channel.write(b"x")
    transport.sendto = taken
    assert channel.write(b"y")
    assert [data for data, _ in transport.sent] == [b"y"]
    assert (channel.unsent, channel.lost.done(), transport.aborted) == (1, False, False)


async def test_the_fault_of_one_peer_leaves_a_bound_socket_open() -> None:
    channel, transport, _, _ = opened(bound=True)
    channel.error_received(OSError("Network is unreachable"))
    assert (channel.refused, channel.lost.done(), transport.aborted) == (1, False, False)


@pytest.mark.parametrize(("error", "told"), [(None, "closed"), (OSError("gone"), "gone")])
async def test_the_end_of_the_socket_is_told(error: OSError | None, told: str) -> None:
    channel, _, _, _ = opened(bound=True)
    channel.connection_lost(error)
    assert await channel.lost == told


async def test_a_channel_that_was_never_open_can_be_closed() -> None:
    channel = DatagramChannel(lambda _: None, bound=False)
    assert not channel.write(b"x")
    channel.close()
    assert await asyncio.wait_for(channel.lost, 1) == "closed"


async def test_a_socket_that_fails_before_it_is_open_is_lost_for_the_first_reason() -> None:
    channel = DatagramChannel(lambda _: None, bound=False)
    channel.error_received(OSError("Network is unreachable"))
    channel.error_received(OSError("Network is down"))
    assert await channel.lost == "Network is unreachable"


# URLs in pymavlink's notation; faults in one line.


@pytest.mark.parametrize(
    ("text", "url"),
    [
        ("udpin:0.0.0.0:14550", Url("udpin", "0.0.0.0", 14550)),
        ("udp:127.0.0.1:14551", Url("udpin", "127.0.0.1", 14551)),
        ("udpin::14550", Url("udpin", "0.0.0.0", 14550)),
        ("udpout:drone.local:14550", Url("udpout", "drone.local", 14550)),
        ("tcp:127.0.0.1:5760", Url("tcp", "127.0.0.1", 5760)),
        ("tcpin:[::1]:5760", Url("tcpin", "::1", 5760)),
        ("/dev/ttyAMA0,921600", Url("serial", device="/dev/ttyAMA0", baud=921600)),
        ("serial:/dev/ttyS1:57600", Url("serial", device="/dev/ttyS1", baud=57600)),
        (" /dev/serial/by-id/usb-x ", Url("serial", device="/dev/serial/by-id/usb-x", baud=115200)),
    ],
)
def test_every_form_is_read_and_written_back(text: str, url: Url) -> None:
    assert parse_url(text) == url
    assert parse_url(str(url)) == url


@pytest.mark.parametrize(
    ("text", "fault"),
    [
        ("", "it is empty"),
        ("http://127.0.0.1:80", "'http' is no known kind of link"),
        ("udpin:14550", "udpin needs a host and a port"),
        ("tcp::5760", "the host is missing"),
        ("tcp:127.0.0.1:99999", "port '99999' is not a number from 1 to 65535"),
        ("udpin:0.0.0.0:0", "port '0'"),
        ("tcp:127.0.0.1:0000099999", "port '0000099999'"),
        ("udpin:0.0.0.0:٣", "port '٣'"),
        ("tcp:127.0.0.1:", "port ''"),
        ("/dev/ttyAMA0,fast", "baud rate 'fast'"),
        ("serial:ttyS1:57600", "serial:/dev/NAME:BAUD"),
        ("tcp:::1:5760", "tcp needs a host and a port"),
    ],
)
def test_a_fault_is_one_line_with_the_text_the_fault_and_an_example(text: str, fault: str) -> None:
    with pytest.raises(UsageError) as caught:
        parse_url(text)
    line = str(caught.value)
    assert repr(text) in line
    assert fault in line
    assert "tcp:127.0.0.1:5760" in line
    assert "\n" not in line
