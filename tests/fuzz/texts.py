"""Fuzz harnesses of texts from users and browsers: URLs, parameters, profiles, orders, requests."""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Coroutine, Sequence
from pathlib import Path

import params
from companion.desk.clouds.crs import from_option
from companion.flight.dashboard.browser_orders import BadMessageError, parse
from companion.flight.dashboard.security.access import Access, Role, read_tokens
from companion.flight.dashboard.security.address import parse_address
from companion.flight.dashboard.security.request_guard import Guard
from companion.flight.dashboard.security.token_check import TokenCheck
from companion.flight.dashboard.viewer import _split
from companion.flight.link.transport.mavlink_url import parse_url
from companion.flight.link.wire.signing_key import read_key
from companion.flight.sensors.lidar_url import open_lidar
from companion.flight.services import settings as stored
from companion.flight.services.services import _read_points
from companion.flight.services.settings import Settings
from companion.runtime.errors import UsageError
from companion.runtime.state_directory import StateDir
from params import ParameterError, Parameters
from tests.fuzz.harness import Harness, Target
from tests.fuzz.wire import one_line

Documented = (UsageError, ParameterError, BadMessageError)
PARAMETERS = Parameters()


def documented(work: Callable[[str], object]) -> Callable[[Path], Target]:
    """Try a text; only documented errors of one line may come."""

    def target(data: bytes) -> None:
        try:
            work(data.decode("utf-8", "replace"))
        except Documented as error:
            one_line(error)

    return lambda _folder: target


def in_a_file(name: str, work: Callable[[Path], object], mode: int = 0o600) -> Callable[[Path], Target]:
    """Try what a file holds."""

    def make(folder: Path) -> Target:
        path = folder / name

        def target(data: bytes) -> None:
            path.write_bytes(data)
            path.chmod(mode)
            try:
                work(path)
            except Documented as error:
                one_line(error)

        return target

    return make


def order(text: str) -> None:
    """Try a browser's message."""
    _, inner = _split(text)
    message = parse(inner)
    for value in (getattr(message, name, 0.0) for name in ("east_m", "north_m", "speed", "at_s")):
        if isinstance(value, float) and not math.isfinite(value):
            raise AssertionError("an order that is no number")


def set_parameter(text: str) -> None:
    """Try `--set NAME=VALUE`, and the same over MAVLink's and the page's way."""
    name, _, value = text.partition("=")
    if name in Parameters.model_fields:
        for given in (value, value.encode(), None, [value]):
            Settings(PARAMETERS).change(name, given)
    params.load("quadcopter", [text])


def at_once(work: Coroutine[object, None, object]) -> None:
    """Run what waits for nothing, without a loop."""
    try:
        work.send(None)
    except StopIteration:
        return
    work.close()
    raise AssertionError("it waits")


async def _no_wait(_seconds: float) -> None:
    """Return at once."""


class _Requests:
    """The page's guard before an application that says yes."""

    def __init__(self, _folder: Path) -> None:
        address = parse_address("0.0.0.0:8080")
        tokens = {"o" * 20: Role.OPERATOR, "v" * 20: Role.VIEWER}
        local = Access(parse_address("127.0.0.1:8080"), None)
        checks = TokenCheck(Access(address, tokens), sleep=_no_wait), TokenCheck(local)
        self.guards = [Guard(self._yes, check) for check in checks]

    async def _yes(self, _scope: object, _receive: object, send: Callable[[object], object]) -> None:
        await send({"type": "http.response.start", "status": 200})  # type: ignore[misc]

    def __call__(self, data: bytes) -> None:
        head, _, path = data.partition(b"\n")
        lines = [line.partition(b": ") for line in head.split(b"\r")]
        headers = [(name.lower(), value) for name, _, value in lines]
        text = path.decode("latin-1")
        kind = "websocket" if b"live" in path else "http"
        scope = {"type": kind, "method": "POST" if b"!" in path else "GET", "path": text, "headers": headers}
        for guard in self.guards:
            at_once(guard(dict(scope), self._receive, self._send))  # type: ignore[arg-type]

    async def _receive(self) -> object:
        return {"type": "http.disconnect"}

    async def _send(self, _message: object) -> None:
        return None


def requests() -> Sequence[bytes]:
    host = b"host: 127.0.0.1:8080\r"
    return [
        host + b"origin: http://127.0.0.1:8080\rcontent-length: 12\ncookie/live",
        host + b"authorization: Bearer " + b"o" * 20 + b"\rorigin: https://[::1]:8080\n/login!",
        host
        + b"cookie: slz-token="
        + b"v" * 20
        + b"; a=b\rsec-fetch-site: cross-site\rsec-fetch-mode: navigate\n/",
    ]


def orders() -> Sequence[bytes]:
    given = (
        {"do": "select_zone", "zone": 3},
        {"do": "confirm", "east_m": 1.5, "north_m": -2.0},
        {"do": "abort"},
        {"do": "set", "name": "cell_m", "value": 0.2},
        {"do": "record", "on": True},
        {"do": "replay", "speed": 2.0, "at_s": None},
        {"do": "facts", "east_m": 0.0, "north_m": 0.0},
    )
    plain = [json.dumps({"id": 1, **one}).encode() for one in given]
    return plain + [json.dumps({"id": 1, "seen": 7, **one}).encode() for one in given]


HARNESSES = (
    Harness(
        "mavlink-url",
        lambda: [
            b"udpin:0.0.0.0:14550",
            b"tcp:[::1]:5760",
            b"/dev/ttyAMA0,921600",
            b"serial:/dev/ttyUSB0:57600",
            b"udpout:10.0.0.1:1",
        ],
        documented(parse_url),
        words=(b"udp:", b"[", b"]", b":", b"/dev/", b","),
    ),
    Harness(
        "lidar-url",
        lambda: [
            b"livox:0.0.0.0:56301?sensor=192.168.1.100",
            b"velodyne:",
            b"ouster:h:1?meta=x",
            b"lightware:/dev/ttyUSB0,921600",
            b"radar:0.0.0.0:7611",
        ],
        documented(lambda text: open_lidar(text, PARAMETERS, print)),
        words=(b"?", b"sensor=", b"meta=", b"[::]", b":"),
        cost=3,
    ),
    Harness(
        "page-address",
        lambda: [b"127.0.0.1:8080", b"[::1]:0", b"localhost:80"],
        documented(lambda text: parse_address(text).is_loopback),
        words=(b"[", b"]", b":", b"%"),
    ),
    Harness(
        "order", orders, documented(order), words=(b'"', b"null", b"1e999", b"NaN", b"{", b"[", b"\\ud800")
    ),
    Harness("request", requests, _Requests, words=(b"[", b"]", b"//", b"@", b";", b"=", b'"', b"\r", b": ")),
    Harness(
        "setting",
        lambda: (
            [f"{row.name}={row.default}".encode() for row in params.rows()]
            + [f"{row.mavlink}=1".encode() for row in params.rows()]
        ),
        documented(set_parameter),
        cost=20,
    ),
    Harness(
        "profile",
        lambda: (
            [path.read_bytes() for path in sorted(Path(params.__file__).parent.glob("profiles/*"))]
            + [b'profile = "helicopter"\ncell_m = 0.5\n']
        ),
        in_a_file("own.toml", lambda path: params.load(str(path))),
        words=(b"=", b"[[", b"]", b'"""', b"inf"),
        cost=20,
    ),
    Harness(
        "stored-parameters",
        lambda: [b'final_height_m = 20.0\nfusing = "max"\n'],
        in_a_file("parameters.toml", lambda path: stored.load("quadcopter", [], StateDir(path.parent))),
        words=(b"=", b"[a]", b"true"),
        cost=20,
    ),
    Harness(
        "state",
        lambda: [b"470000000 85000000 500\n-1 -2 -3\n"],
        in_a_file("rally", lambda path: _read_points(StateDir(path.parent))),
        words=(b" ", b"\n", b"-"),
        cost=3,
    ),
    Harness(
        "key", lambda: [bytes(range(32)), b"0f" * 32 + b"\r\n", b"a passphrase\n"], in_a_file("key", read_key)
    ),
    Harness(
        "tokens",
        lambda: [b"operator " + b"o" * 20 + b"\n# x\nviewer " + b"v" * 20],
        in_a_file("tokens", read_tokens),
        words=(b"operator ", b"viewer ", b"\n", b"#"),
    ),
    Harness(
        "crs",
        lambda: [b"EPSG:2992", b"EPSG:32610+5703", b"+proj=utm +zone=33", b'PROJCRS["x"]'],
        documented(from_option),
        words=(b"EPSG:", b"+proj=", b"+", b'["', b"ESRI:"),
        cost=2000,
    ),
)
