"""Address of a Zenoh router and a ROS domain, as on the command line."""

from __future__ import annotations

import os
import re
from dataclasses import dataclass

from companion.runtime.errors import UsageError

EXAMPLE = "zenoh, or zenoh:tcp/HOST:7447?domain=0"
ROUTER = "tcp/localhost:7447"
NO_HASH = "TypeHashNotSupported"
_ENDPOINT = re.compile(r"(tcp|udp|tls|quic)/(\[[0-9a-fA-F:.]+\]|[\w.-]+):(\d{1,5})")
MOST_DOMAIN = 232  # of DDS; Zenoh has no limit


@dataclass(frozen=True, slots=True)
class ZenohUrl:
    """Router and domain. has_hashes: not so in ROS 2 Humble, whose keys name no type hash."""

    endpoint: str = ROUTER
    domain: int = 0
    has_hashes: bool = True


def parse_zenoh_url(text: str) -> ZenohUrl:
    """Return what `zenoh[:ENDPOINT][?domain=N][&distro=humble]` says.

    The domain is by default that of the environment (ROS_DOMAIN_ID), or 0.

    Raises
    ------
    UsageError
        It is malformed.
    """
    address, _, query = text.partition("?")
    kind, colon, endpoint = address.partition(":")
    if kind != "zenoh" or (colon and not _is_endpoint(endpoint)):
        raise UsageError(f"--ros2 {text!r} is not understood: write {EXAMPLE}")
    values = {"domain": os.environ.get("ROS_DOMAIN_ID") or "0", "distro": ""}
    for part in query.split("&") if query else ():
        name, _, value = part.partition("=")
        if name not in values:
            raise UsageError(f"--ros2 {text!r}: {part!r} is not understood: write {EXAMPLE}")
        values[name] = value
    domain, distro = values["domain"], values["distro"]
    if not (domain.isascii() and domain.isdigit() and int(domain) <= MOST_DOMAIN):
        raise UsageError(f"--ros2 {text!r}: the domain is a number from 0 to {MOST_DOMAIN}, not {domain!r}")
    if distro not in ("", "humble"):
        raise UsageError(f"--ros2 {text!r}: distro= is humble or nothing; later ones need none")
    return ZenohUrl(endpoint or ROUTER, int(domain), distro != "humble")


def _is_endpoint(text: str) -> bool:
    found = _ENDPOINT.fullmatch(text)
    return found is not None and 0 < int(found[3]) < 65536
