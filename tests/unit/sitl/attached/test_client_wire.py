"""The simulator as a client of an autopilot's TCP port."""

from __future__ import annotations

import socket
from pathlib import Path

import pytest

from sitl.__main__ import main
from sitl.attached.attach import RETRY_S, TcpClientWire, open_client
from sitl.wire.wire import UdpWire, WireError


class Clock:
    now_s = 0.0

    def __call__(self) -> float:
        return self.now_s


def server(port: int = 0) -> socket.socket:
    sock = socket.socket(socket.AF_INET, socket.SOCK_STREAM)
    sock.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    sock.bind(("127.0.0.1", port))
    sock.listen(1)
    sock.settimeout(5)
    return sock


def received(wire: TcpClientWire) -> bytes:
    """Poll until something arrives, as often as the loopback may need."""
    for _ in range(100_000):
        for _, data in wire.poll():
            return data
    raise AssertionError("nothing arrived")


def test_it_connects_again_when_the_other_end_comes_back() -> None:
    clock, listening = Clock(), server()
    port = listening.getsockname()[1]
    wire = TcpClientWire("127.0.0.1", port, clock)
    wire.poll()
    accepted, _ = listening.accept()
    accepted.sendall(b"abc")
    assert received(wire) == b"abc"
    first = wire.peers[0]
    accepted.close()
    listening.close()
    for _ in range(100_000):
        wire.poll()
        if not wire.peers:
            break
    assert not first.open
    clock.now_s += RETRY_S
    assert wire.poll() == []  # nobody there: it tries again later
    again = server(port)
    clock.now_s += RETRY_S
    wire.poll()
    accepted, _ = again.accept()
    wire.peers[0].write(b"hello")
    assert accepted.recv(5) == b"hello"
    assert wire.peers[0] is not first
    wire.close()
    accepted.close()
    again.close()


def test_attempts_keep_their_distance() -> None:
    clock, listening = Clock(), server()
    port = listening.getsockname()[1]
    listening.close()
    wire = TcpClientWire("127.0.0.1", port, clock)
    wire.poll()
    listening = server(port)
    clock.now_s += RETRY_S / 2
    wire.poll()
    assert wire.peers == []
    clock.now_s += RETRY_S / 2
    wire.poll()
    assert len(wire.peers) == 1
    wire.close()
    listening.close()


@pytest.mark.parametrize(
    "url", ["tcp:127.0.0.1", "tcp::5762", "tcp:127.0.0.1:70000", "http://x", "tcpin:1:2", ""]
)
def test_what_is_no_address_is_refused_in_one_line(url: str) -> None:
    with pytest.raises(WireError, match="tcp:HOST:PORT") as refusal:
        open_client(url)
    assert "\n" not in str(refusal.value)


def test_udp_is_taken_as_everywhere() -> None:
    wire = open_client("udpin:127.0.0.1:0")
    assert isinstance(wire, UdpWire)
    wire.close()


# `slz sim --autopilot`: refusals.


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["--autopilot", "nonsense"], "is no autopilot's address"),
        (["--autopilot", "tcp:127.0.0.1:5762", "--pilot", "takeoff"], "--pilot means nothing"),
        (["--autopilot", "tcp:127.0.0.1:5762", "--wind", "5"], "--wind means nothing"),
        (["--autopilot", "tcp:127.0.0.1:5762", "--wind-from", "90"], "--wind-from means nothing"),
        (["--autopilot", "tcp:127.0.0.1:5762", "--lockstep", "0"], "--lockstep means nothing"),
        (["--autopilot", "tcp:127.0.0.1:5762", "--mavlink", "udpin:0:1"], "--mavlink means nothing"),
        (["--autopilot", "tcp:127.0.0.1:5762", "--origin", "1,2"], "write LAT,LON,ALT"),
    ],
)
def test_bad_arguments_are_one_line(
    arguments: list[str], said: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(arguments) == 2
    err = capsys.readouterr().err
    assert said in err
    assert err.count("\n") == 1


def test_without_an_autopilot_it_says_so_and_has_no_truth_to_write(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    arguments = ["--autopilot", "tcp:127.0.0.1:9", "--scene", "hill", "--duration", "0"]
    assert main([*arguments, "--truth", str(tmp_path)]) == 1
    captured = capsys.readouterr()
    assert "waiting for an autopilot at tcp:127.0.0.1:9" in captured.err
    assert "nothing is written" in captured.err
    assert captured.out == ""
