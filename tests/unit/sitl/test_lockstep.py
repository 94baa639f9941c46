"""Lockstep clock service: one byte, one step, one answer."""

from __future__ import annotations

import socket
import struct
import threading
from collections.abc import Iterator

import pytest

from sitl.pace import LockstepServer
from sitl.wire.wire import WireError

LIMIT_S = 10.0


class Clock:
    """A server in a thread, stepping a counter."""

    def __init__(self) -> None:
        self.server = LockstepServer()
        self.steps = 0
        self.stop = False
        self._thread = threading.Thread(target=self.server.serve, args=(self._step, lambda: self.stop))
        self._thread.start()

    def _step(self) -> int:
        self.steps += 1
        return self.steps * 2_500_000 + (1 << 40)

    def connect(self) -> socket.socket:
        return socket.create_connection(("127.0.0.1", self.server.port), timeout=LIMIT_S)

    def ended(self) -> bool:
        self._thread.join(LIMIT_S)
        return not self._thread.is_alive()

    def close(self) -> None:
        self.stop = True
        assert self.ended()
        self.server.close()


@pytest.fixture
def clock() -> Iterator[Clock]:
    made = Clock()
    yield made
    made.close()


def answer(client: socket.socket) -> int:
    data = b""
    while len(data) < 8:
        part = client.recv(8 - len(data))
        assert part, "hung up"
        data += part
    return int(struct.unpack("<q", data)[0])


def test_each_byte_is_one_step_and_the_answer_is_the_time_after_it(clock: Clock) -> None:
    with clock.connect() as client:
        for number in range(1, 51):
            client.sendall(b"\x01")
            assert answer(client) == number * 2_500_000 + (1 << 40)
            assert clock.steps == number


def test_time_stands_still_until_it_is_asked_to_pass(clock: Clock) -> None:
    with clock.connect() as client:
        client.settimeout(0.0)
        with pytest.raises(BlockingIOError):
            client.recv(1)
        assert clock.steps == 0


def test_requests_sent_together_are_each_answered(clock: Clock) -> None:
    with clock.connect() as client:
        client.sendall(b"\x01" * 5)
        assert [answer(client) for _ in range(5)][-1] == 5 * 2_500_000 + (1 << 40)


@pytest.mark.parametrize("steps", [0, 3])
def test_the_client_hanging_up_ends_the_service(clock: Clock, steps: int) -> None:
    with clock.connect() as client:
        for _ in range(steps):
            client.sendall(b"\x01")
            answer(client)
    assert clock.ended()
    assert clock.steps == steps


def test_the_end_is_noticed_while_nobody_has_come(clock: Clock) -> None:
    clock.stop = True
    assert clock.ended()


def test_the_end_is_noticed_while_the_client_is_busy(clock: Clock) -> None:
    with clock.connect() as client:
        client.sendall(b"\x01")
        answer(client)
        clock.stop = True
        assert clock.ended()


def test_a_client_that_resets_the_connection_ends_the_service(clock: Clock) -> None:
    client = clock.connect()
    client.sendall(b"\x01")
    answer(client)
    client.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
    client.close()
    assert clock.ended()


def test_a_port_in_use_is_named(clock: Clock) -> None:
    with pytest.raises(WireError, match=f"lockstep port {clock.server.port}: "):
        LockstepServer(clock.server.port)
