"""Network address of the page: HOST:PORT."""

from __future__ import annotations

import errno
import ipaddress
import socket
from dataclasses import dataclass

from companion.runtime.errors import UsageError


@dataclass(frozen=True, slots=True)
class Address:
    """Host and port; port 0 means any free one."""

    host: str
    port: int

    @property
    def is_loopback(self) -> bool:
        """True if only programs on this computer can reach the address."""
        if self.host == "localhost":
            return True
        try:
            return ipaddress.ip_address(self.host).is_loopback
        except ValueError:
            return False

    def __str__(self) -> str:
        return f"[{self.host}]:{self.port}" if ":" in self.host else f"{self.host}:{self.port}"


def parse_address(text: str) -> Address:
    """Return the address in a text; raise `UsageError` if it is invalid."""
    host, colon, port = text.rpartition(":")
    host = host.removeprefix("[").removesuffix("]")
    if not (colon and host and port.isascii() and port.isdigit() and len(port) <= 5 and int(port) < 65536):
        raise UsageError(f"--dashboard {text!r}: write HOST:PORT, such as 127.0.0.1:8080")
    return Address(host, int(port))


def listen(address: Address) -> socket.socket:
    """Return a socket that listens at an address.

    Raises
    ------
    UsageError
        The port is in use, or the address is not one of this computer.
    """
    family = socket.AF_INET6 if ":" in address.host else socket.AF_INET
    sock = socket.socket(family, socket.SOCK_STREAM)
    try:
        sock.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        sock.bind((address.host, address.port))
        sock.listen(64)
    except OSError as error:
        sock.close()
        why = error.strerror or str(error)
        if error.errno == errno.EADDRINUSE:
            why = "the port is in use; stop the other program or choose another port"
        raise UsageError(f"--dashboard {address}: {why}") from None
    sock.setblocking(False)
    return sock


def bound(sock: socket.socket) -> Address:
    """Return the address of a listening socket."""
    host, port = sock.getsockname()[:2]
    return Address(str(host), int(port))
