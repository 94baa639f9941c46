"""Command `python -m sitl --autopilot URL`: the LiDAR alone, on the vehicle of a running autopilot."""

from __future__ import annotations

import argparse
import json
import socket
import sys
import time
from collections.abc import Callable
from pathlib import Path

from sitl import scenes
from sitl.attached.attached_lidar import AttachedLidar
from sitl.attached.pose_source import Place
from sitl.sensors.lidar_port import Address
from sitl.signals import Signals
from sitl.truth import touchdown, truth
from sitl.wire.wire import Outlet, Peer, Wire, WireError, is_port, open_wire

RETRY_S = 0.5
CONNECT_S = 0.3
IDLE_S = 0.002
# Options of the whole vehicle; the followed autopilot has its own.
FOREIGN = (
    *("airframe", "autopilot_kind"),
    *("mavlink", "mavlink_key", "lockstep", "speedup", "pilot", "takeoff_alt", "intruder"),
    *("fault", "drift", "param", "imu_to", "wind", "wind_from", "gust"),
)
FLAT_ENOUGH = 0.98


class TcpClientWire(Wire):
    """TCP client that reconnects after a disconnection.

    Parameters
    ----------
    host, port
        Address at which the autopilot listens.
    clock
        Seconds, for the pause between attempts.
    """

    def __init__(self, host: str, port: int, clock: Callable[[], float] = time.monotonic) -> None:
        super().__init__()
        try:
            self._address = socket.gethostbyname(host), port
        except OSError as error:
            raise WireError(f"tcp:{host}:{port}: {error.strerror or error}") from None
        self.name = f"tcp:{host}:{port}"
        self._clock = clock
        self._next_s = clock()
        self._socket: socket.socket | None = None

    def poll(self) -> list[tuple[Peer, bytes]]:
        if self._socket is None:
            self._connect()
        if self._socket is None:
            return []
        try:
            data = self._socket.recv(1 << 18)
        except BlockingIOError:
            return []
        except OSError:
            data = b""
        if data:
            return [(self.peers[0], data)]
        self.close()
        return []

    def _connect(self) -> None:
        if self._clock() < self._next_s:
            return
        self._next_s = self._clock() + RETRY_S
        try:
            self._socket = socket.create_connection(self._address, CONNECT_S)
        except OSError:
            return  # no server there yet
        self._socket.setblocking(False)
        self._socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self.peers.append(Peer(Outlet(self._socket.send)))

    def close(self) -> None:
        if self._socket is not None:
            self._socket.close()
            self._socket = None
        for peer in self.peers:
            peer.open = False
        self.peers.clear()


def open_client(url: str) -> Wire:
    """Open a wire to an autopilot: tcp:HOST:PORT, udpin:HOST:PORT, udpout:HOST:PORT or a device path.

    Raises
    ------
    WireError
        The URL is malformed, its host unknown or its port in use.
    """
    kind, _, address = url.partition(":")
    host, _, port = address.rpartition(":")
    if kind == "tcp" and host and is_port(port):
        return TcpClientWire(host, int(port))
    if not url.startswith(("/", "udpin:", "udpout:")):
        raise WireError(
            f"{url!r} is no autopilot's address: write tcp:HOST:PORT, udpin:HOST:PORT, udpout:HOST:PORT "
            "or a device"
        )
    return open_wire(url)


def refuse_foreign(options: argparse.Namespace, defaults: Callable[[str], object]) -> None:
    """Raise ValueError if an option is given that is meaningless with --autopilot."""
    for name in FOREIGN:
        if getattr(options, name) != defaults(name):
            raise ValueError(
                f"--{name.replace('_', '-')} means nothing with --autopilot, which has a vehicle"
            )


def build(options: argparse.Namespace, origin: Place | None, lidar_to: Address | None) -> AttachedLidar:
    """Open the wire and build the scene; raise WireError or ValueError with one line for the user."""
    wire = open_client(options.autopilot)
    try:
        attached = AttachedLidar(
            scenes.build(options.scene, options.seed),
            wire,
            seed=options.seed,
            lidar="mid360" if options.lidar == "none" else options.lidar,
            lidar_to=lidar_to,
            point_rate_hz=round(options.point_rate),
            lidar_dual=options.dual,
            origin_lla=origin,
            say=_say,
        )
    except ValueError:
        wire.close()
        raise
    attached.log.gear, attached.log.tip_limit_deg = touchdown.chosen_gear(options), options.tip_limit
    return attached


def follow(attached: AttachedLidar, options: argparse.Namespace, signals: Signals) -> int:
    """Run until a signal arrives or the duration is over; return the exit code."""
    _say(f"waiting for an autopilot at {attached.wire.name}")
    begun_s = time.monotonic()
    announced = False
    try:
        with signals.awaited():
            while not signals.came:
                now_s = time.monotonic()
                if options.duration is not None and now_s - begun_s >= options.duration:
                    break
                if not attached.advance(now_s):
                    time.sleep(IDLE_S)
                if attached.ready and not announced:
                    announced = True
                    _announce(attached, options)
    finally:
        attached.close()
    return _write(attached, options)


def _announce(attached: AttachedLidar, options: argparse.Namespace) -> None:
    flat = attached.flat_share()
    if flat < FLAT_ENOUGH:
        _say(
            f"{100 * (1 - flat):.0f} % of the scene is not level with home; the autopilot's ground is, so "
            "that a landing there ends above or below what the LiDAR shows"
        )
    line = {
        "ready": True,
        "autopilot": attached.source.kind,
        "pose": attached.source.source,
        "mavlink": [attached.wire.name],
        "lidar": None if attached.lidar is None else attached.lidar.name,
        "origin": attached.origin_lla,
        "level_share": round(flat, 3),
    }
    print(json.dumps(line), flush=True)


def _write(attached: AttachedLidar, options: argparse.Namespace) -> int:
    if options.truth is None:
        return 0
    folder: Path = options.truth
    if attached.origin_lla is None:
        _say(f"--truth {folder}: nothing is written, for no autopilot said where it is")
        return 1
    _say(f"writing {folder}; a signal ends it without")
    try:
        attached.log.write(folder, attached.origin_lla)
        truth.write(
            folder,
            attached.scene,
            attached.origin_lla,
            footprint_m=options.footprint,
            slope_limit_deg=options.slope_limit,
            relief_limit_m=options.relief_limit,
        )
    except OSError as error:
        _say(f"--truth {folder}: {error.strerror or error}")
        return 1
    return 0


def _say(line: str) -> None:
    print(f"slz sim: {line}", file=sys.stderr, flush=True)
