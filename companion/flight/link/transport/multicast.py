"""Multicast groups: joined on every interface, since a vehicle's networks have no common default route."""

from __future__ import annotations

import contextlib
import errno
import ipaddress
import socket
import struct


def is_multicast(host: str) -> bool:
    """Return whether a host is the address of a multicast group."""
    try:
        return ipaddress.ip_address(host.partition("%")[0]).is_multicast
    except ValueError:
        return False


def join_group(sock: socket.socket, host: str) -> None:
    """Let a bound socket receive what is sent to its host, if that is a multicast group.

    Raises
    ------
    OSError
        No interface takes multicasts.
    """
    if not is_multicast(host):
        return
    group = ipaddress.ip_address(host.partition("%")[0])
    joined = 0
    for index, _ in socket.if_nameindex():
        with contextlib.suppress(OSError):
            if group.version == 6:
                request = group.packed + struct.pack("@I", index)
                sock.setsockopt(socket.IPPROTO_IPV6, socket.IPV6_JOIN_GROUP, request)
            else:
                request = group.packed + bytes(4) + struct.pack("@i", index)
                sock.setsockopt(socket.IPPROTO_IP, socket.IP_ADD_MEMBERSHIP, request)
            joined += 1
    if not joined:
        raise OSError(errno.ENODEV, "no network interface takes multicasts")
