"""LiDAR URLs."""

from __future__ import annotations

from companion.errors import UsageError

FORM = "livox:HOST:PORT"
LATER = ("velodyne", "ouster")


def parse(url: str) -> tuple[str, int]:
    """Return host (may be empty) and port of a LiDAR URL.

    Raises
    ------
    UsageError
        The scheme is unknown or not supported yet, or host and port are wrong.
    """
    scheme, colon, address = url.partition(":")
    if scheme in LATER and colon:
        raise UsageError(f"--lidar {url}: {scheme} is not supported yet; use {FORM}")
    if scheme != "livox" or not colon:
        raise UsageError(f"--lidar {url}: is not a LiDAR address (files are not supported yet); use {FORM}")
    host, colon, port = address.rpartition(":")
    if not colon or not (port.isascii() and port.isdigit()) or not 0 < int(port) < 65536:
        raise UsageError(f"--lidar {url}: needs a port from 1 to 65535; use {FORM}")
    if host.startswith("[") and host.endswith("]"):
        host = host[1:-1]
    elif ":" in host or "/" in host or " " in host:
        raise UsageError(f"--lidar {url}: {host!r} is no host; use {FORM}")
    return host, int(port)
