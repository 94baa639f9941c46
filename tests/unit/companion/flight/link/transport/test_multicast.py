"""Multicast groups of sockets."""

from __future__ import annotations

import errno
import socket

import pytest

from companion.flight.link.transport.multicast import is_multicast, join_group


@pytest.mark.parametrize(
    ("host", "expected"),
    [
        ("239.1.1.5", True),
        ("224.0.0.1", True),
        ("ff02::1", True),
        ("ff02::1%lo", True),
        ("127.0.0.1", False),
        ("255.255.255.255", False),
        ("::1", False),
        ("lidar.local", False),
        ("", False),
    ],
)
def test_groups_are_recognised(host: str, expected: bool) -> None:
    assert is_multicast(host) is expected


@pytest.mark.parametrize(
    ("family", "group", "interface"),
    [
        (
            socket.AF_INET,
            "239.1.1.5",
            (socket.IPPROTO_IP, socket.IP_MULTICAST_IF, socket.inet_aton("127.0.0.1")),
        ),
        (
            socket.AF_INET6,
            "ff15::1:5",
            (socket.IPPROTO_IPV6, socket.IPV6_MULTICAST_IF, socket.if_nametoindex("lo")),
        ),
    ],
)
def test_a_joined_group_is_heard(
    family: socket.AddressFamily, group: str, interface: tuple[int, int, bytes | int]
) -> None:
    with (
        socket.socket(family, socket.SOCK_DGRAM) as receiver,
        socket.socket(family, socket.SOCK_DGRAM) as sender,
    ):
        receiver.settimeout(5.0)
        try:
            receiver.bind((group, 0))
            sender.setsockopt(*interface)
            sender.sendto(b"", (group, 9))
        except OSError:
            pytest.skip("no such addresses here")
        join_group(receiver, group)
        sender.sendto(b"one", (group, receiver.getsockname()[1]))
        assert receiver.recv(10) == b"one"


def test_without_an_interface_the_reason_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(socket, "if_nameindex", list)
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as receiver:
        join_group(receiver, "127.0.0.1")
        with pytest.raises(OSError, match="no network interface takes multicasts") as error:
            join_group(receiver, "239.1.1.5")
    assert error.value.errno == errno.ENODEV
