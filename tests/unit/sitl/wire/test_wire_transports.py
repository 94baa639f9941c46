"""Sockets and terminals: bytes carried, frames kept whole, loss of peers survived."""

from __future__ import annotations

import os
import socket
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from sitl.wire.wire import Router, TcpWire, Wire, WireError, open_wire
from tests.unit.sitl.wire.test_wire import text


@contextmanager
def opened(url: str) -> Iterator[Wire]:
    wire = open_wire(url)
    try:
        yield wire
    finally:
        wire.close()


@contextmanager
def far_end(kind: socket.SocketKind) -> Iterator[socket.socket]:
    with socket.socket(socket.AF_INET, kind) as made:
        made.settimeout(5)
        made.bind(("127.0.0.1", 0))
        yield made


def address(wire: Wire) -> tuple[str, int]:
    _, host, port = wire.name.split(":")
    return host, int(port)


def data_of(wire: Wire) -> bytes:
    return b"".join(data for _, data in wire.poll())


def test_udpout_speaks_first_and_hears_the_answer() -> None:
    with far_end(socket.SOCK_DGRAM) as far, opened(f"udpout:127.0.0.1:{far.getsockname()[1]}") as wire:
        wire.peers[0].write(b"hello")
        data, sender = far.recvfrom(100)
        far.sendto(b"answer", sender)
        assert (data, data_of(wire)) == (b"hello", b"answer")


def test_udpout_keeps_its_address_whoever_else_speaks_to_it() -> None:
    with (
        far_end(socket.SOCK_DGRAM) as far,
        far_end(socket.SOCK_DGRAM) as stranger,
        opened(f"udpout:127.0.0.1:{far.getsockname()[1]}") as wire,
    ):
        wire.peers[0].write(b"first")
        _, sender = far.recvfrom(100)
        stranger.sendto(b"me too", sender)
        wire.poll()
        wire.peers[0].write(b"second")
        assert far.recv(100) == b"second"


def test_udpin_is_silent_until_spoken_to_and_answers_whoever_spoke_last() -> None:
    with (
        opened("udpin:127.0.0.1:0") as wire,
        far_end(socket.SOCK_DGRAM) as a,
        far_end(socket.SOCK_DGRAM) as b,
    ):
        wire.peers[0].write(b"nobody is there")
        for far in (a, b):
            far.sendto(b"here", address(wire))
            assert data_of(wire) == b"here"
            wire.peers[0].write(b"answer")
            assert far.recv(100) == b"answer"


def test_tcpin_serves_several_clients_and_forgets_those_that_go() -> None:
    with opened("tcpin:127.0.0.1:0") as wire:
        first = socket.create_connection(address(wire), timeout=5)
        second = socket.create_connection(address(wire), timeout=5)
        with first, second:
            wire.poll()
            assert len(wire.peers) == 2
            for peer in wire.peers:
                peer.write(b"to all")
            assert first.recv(100) == second.recv(100) == b"to all"
            first.close()
            wire.poll()
            assert len(wire.peers) == 1
            second.sendall(b"still here")
            assert data_of(wire) == b"still here"


def test_a_client_that_vanishes_between_two_writes_does_no_harm() -> None:
    with opened("tcpin:127.0.0.1:0") as wire:
        client = socket.create_connection(address(wire), timeout=5)
        wire.poll()
        peer = wire.peers[0]
        client.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, b"\x01\0\0\0\0\0\0\0")  # reset, not good-bye
        client.close()
        for _ in range(3):
            peer.write(b"anybody?")
        wire.poll()
        assert wire.peers == []
        peer.write(b"too late")


def test_a_client_that_does_not_read_gets_whole_frames_or_none() -> None:
    with (
        opened("tcpin:127.0.0.1:0") as wire,
        socket.create_connection(address(wire), timeout=5) as client,
    ):
        wire.poll()
        codec: Any = mavlink.MAVLink(None, srcSystem=1, srcComponent=1)
        frame = bytes(text("x" * 50).pack(codec))
        for _ in range(200_000):
            wire.peers[0].write(frame)
        client.settimeout(0.0)
        took = bytearray()
        while True:
            try:
                took += client.recv(1 << 20)
            except BlockingIOError:
                wire.poll()
                wire.peers[0].write(frame)
                break
        client.settimeout(5)
        while not took.endswith(frame):
            took += client.recv(1 << 20)
        assert len(took) % len(frame) == 0
        assert took == frame * (len(took) // len(frame))


def test_a_terminal_carries_every_byte_both_ways_without_an_echo() -> None:
    ours, theirs = os.openpty()
    try:
        every = bytes(range(256))
        with opened(os.ttyname(theirs)) as wire:
            os.write(ours, every)
            assert data_of(wire) == every
            wire.peers[0].write(every)
            assert os.read(ours, 1000) == every
    finally:
        os.close(ours)
        os.close(theirs)


def test_a_terminal_whose_other_end_closes_does_no_harm() -> None:
    ours, theirs = os.openpty()
    with opened(os.ttyname(theirs)) as wire:
        os.close(theirs)
        os.close(ours)
        wire.peers[0].write(b"anybody?")
        assert wire.poll() == []


def test_a_file_is_not_overwritten_with_telemetry(tmp_path: Path) -> None:
    file = tmp_path / "notes"
    file.write_text("mine")
    with pytest.raises(WireError, match="not a serial device"):
        open_wire(str(file))
    assert file.read_text() == "mine"


@pytest.mark.parametrize("url", [
    "", "5760", "tcpin:5760", "udp:127.0.0.1:1", "tcpin:127.0.0.1:", "tcpin:127.0.0.1:x",
    "tcpin:127.0.0.1:-1", "tcpin:127.0.0.1:65536", "udpin:127.0.0.1:²", "udpout::14550",
    "/dev/no-such-terminal",
])  # fmt: skip
def test_a_bad_address_is_one_line_that_names_it(url: str) -> None:
    with pytest.raises(WireError) as caught:
        open_wire(url)
    message = str(caught.value)
    assert (url or "''") in message
    assert "\n" not in message


@pytest.mark.parametrize("kind", ["tcpin", "udpin"])
def test_a_port_in_use_is_named(kind: str) -> None:
    with opened(f"{kind}:127.0.0.1:0") as wire:
        port = address(wire)[1]
        with pytest.raises(WireError, match=rf"{kind}:127\.0\.0\.1:{port}: the port is in use"):
            open_wire(f"{kind}:127.0.0.1:{port}")


def test_a_lost_client_does_not_keep_the_number_of_its_link_for_ever() -> None:
    wire = open_wire("tcpin:127.0.0.1:0")
    assert isinstance(wire, TcpWire)
    router = Router([wire], np.random.default_rng(1), lambda m, link: None)
    try:
        numbers = set()
        for _ in range(5):
            with socket.create_connection(address(wire), timeout=5):
                router.read(0)
                numbers.add(router.number(wire.peers[0]))
            router.read(0)
        assert numbers == {0}
    finally:
        router.close()
