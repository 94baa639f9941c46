"""MAVLink URLs in pymavlink's syntax."""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import Literal, NoReturn, cast

from companion.runtime.errors import UsageError

Kind = Literal["udpin", "udpout", "tcp", "tcpin", "serial"]

DEFAULT_BAUD = 115_200
_EXAMPLES = "udpin:0.0.0.0:14550, udpout:192.168.1.10:14550, tcp:127.0.0.1:5760 or /dev/ttyAMA0,921600"
_NETWORK = re.compile(
    r"(?P<kind>udpin|udpout|udp|tcpin|tcp):(?P<host>\[[^\]\s]+\]|[^:\[\]\s]*):(?P<port>[^:]*)"
)
_SERIAL = re.compile(r"(?:serial:)?(?P<device>/dev/[^,:\s]+)(?:[,:](?P<baud>[^,:]*))?")


@dataclass(frozen=True, slots=True)
class Url:
    """Address of the autopilot: a network address, or a serial device with its baud rate."""

    kind: Kind
    host: str = ""
    port: int = 0
    device: str = ""
    baud: int = 0

    def __str__(self) -> str:
        if self.kind == "serial":
            return f"{self.device},{self.baud}"
        host = f"[{self.host}]" if ":" in self.host else self.host
        return f"{self.kind}:{host}:{self.port}"


def parse_url(text: str) -> Url:
    """Return the address in a MAVLink URL.

    Parameters
    ----------
    text
        `udpin:HOST:PORT` (also `udp:`), `udpout:HOST:PORT`, `tcp:HOST:PORT`, `tcpin:HOST:PORT`,
        `/dev/NAME,BAUD` or `serial:/dev/NAME:BAUD`; BAUD defaults to 115200. IPv6 hosts go in brackets.

    Raises
    ------
    UsageError
        If the text is none of these; the one line names the fault and an example.
    """
    stripped = text.strip()
    if match := _SERIAL.fullmatch(stripped):
        return Url("serial", device=match["device"], baud=_baud(text, match["baud"]))
    match = _NETWORK.fullmatch(stripped)
    if match is None:
        _refuse(text, _fault(stripped))
    kind = cast(Kind, "udpin" if match["kind"] == "udp" else match["kind"])
    host = match["host"].strip("[]")
    if not host:
        if kind in ("udpout", "tcp"):
            _refuse(text, "the host is missing")
        host = "0.0.0.0"
    return Url(kind, host=host, port=_port(text, match["port"]))


def _port(text: str, port: str) -> int:
    if not (port.isascii() and port.isdigit() and len(port) <= 5 and 1 <= int(port) <= 65535):
        _refuse(text, f"port {port!r} is not a number from 1 to 65535")
    return int(port)


def _baud(text: str, baud: str | None) -> int:
    if baud is None:
        return DEFAULT_BAUD
    if not (baud.isascii() and baud.isdigit() and len(baud) <= 8 and 1200 <= int(baud) <= 12_500_000):
        _refuse(text, f"baud rate {baud!r} is not a number from 1200 to 12500000")
    return int(baud)


def _fault(text: str) -> str:
    if not text:
        return "it is empty"
    scheme = text.split(":", 1)[0]
    if scheme == "serial":
        return "a serial device is written serial:/dev/NAME:BAUD"
    if scheme in ("udp", "udpin", "udpout", "tcp", "tcpin"):
        return f"{scheme} needs a host and a port"
    return f"{scheme!r} is no known kind of link"


def _refuse(text: str, fault: str) -> NoReturn:
    raise UsageError(f"MAVLink URL {text!r}: {fault}; write for example {_EXAMPLES}")
