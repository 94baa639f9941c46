"""The page over real sockets: served and refused requests, and no waiting for browsers."""

import asyncio
import contextlib
import json
import re
import socket
import time
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from dataclasses import replace
from importlib.metadata import version
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from websockets.asyncio.client import ClientConnection, connect
from websockets.exceptions import ConnectionClosed, InvalidStatus

import params
from companion.flight.dashboard.background_picture import BackgroundPicture
from companion.flight.dashboard.board import Board
from companion.flight.dashboard.browser_orders import Command, Simple
from companion.flight.dashboard.page import PageEndpoint, about, carry_out_in_time, serve
from companion.flight.dashboard.security.token_check import TokenCheck
from companion.flight.dashboard.viewer import MOST_PER_S
from companion.flight.landing.situation import Reply
from tests.unit.companion.flight.dashboard.test_alarms import QUIET
from tests.unit.companion.flight.dashboard.test_background_picture import FRAME, small
from tests.unit.companion.flight.dashboard.test_map_blocks import drawn, tile
from tests.unit.companion.flight.landing.flight import Flight, zone

OPERATOR, VIEWER = "o" * 20, "v" * 20
PLACE = {"north_m": 0.0, "up_m": 20.0, "height_m": 20.0}
STATE = {**QUIET, **PLACE, "phase": "idle", "mode": "GUIDED", "battery_pct": 80.0}
# BlueOS, core/services/helper/main.py, ServiceMetadata.
FIELDS_OF_BLUEOS = ("name", "description", "icon", "company", "version", "webpage", "api")
OPTIONS_OF_BLUEOS = ("new_page", "avoid_iframes", "works_in_relative_paths")


class Clerk:
    """Notes the orders."""

    def __init__(self) -> None:
        self.orders: list[Command] = []
        self.reply = Reply(True, "noted")
        self.answering = asyncio.Event()
        self.answering.set()

    async def carry_out(self, order: Command) -> Reply:
        self.orders.append(order)
        await self.answering.wait()
        return self.reply

    def done(self) -> list[str]:
        """Return what was ordered."""
        return [order.do for order in self.orders]


class Waits:
    """A clock that goes on only when somebody sleeps; notes the sleeps."""

    def __init__(self) -> None:
        self.seconds: list[float] = []
        self.at_s = 0.0

    def now(self) -> float:
        return self.at_s

    async def sleep(self, seconds: float) -> None:
        self.seconds.append(seconds)
        self.at_s += seconds


class Served:
    """A page of a board that the test writes."""

    def __init__(
        self, tokens: Path | None, waits: Waits | None = None, background: BackgroundPicture | None = None
    ) -> None:
        self.front = PageEndpoint("127.0.0.1:0", tokens)
        self.front.background = background
        if waits is not None:
            self.front.token_check = TokenCheck(self.front.token_check.access, waits.now, waits.sleep)
        self.board = Board(params.load())
        self.board.state = dict(STATE)
        self.clerk = Clerk()
        self.server = serve(self.front, self.board, self.clerk, about(params.rows()))
        self.host = str(self.front.address)
        self.renewing: asyncio.Task[None] | None = None

    def connect(self, token: str = "", sender: str = "127.0.0.1", **headers: str) -> connect:
        """Open a browser's channel, from an address of this computer."""
        origin = headers.pop("origin", f"http://{self.host}")
        more = {"Authorization": f"Bearer {token}"} if token else {}
        return connect(
            f"ws://{self.host}/live",
            origin=origin or None,
            additional_headers=more,
            proxy=None,
            local_addr=(sender, 0),
        )  # type: ignore[arg-type]

    async def open(self, sender: str = "127.0.0.1") -> tuple[asyncio.StreamReader, asyncio.StreamWriter]:
        """Open a connection from an address of this computer."""
        address = self.front.address
        return await asyncio.open_connection(address.host, address.port, local_addr=(sender, 0))

    async def http(
        self, path: str, method: str = "GET", body: bytes = b"", sender: str = "127.0.0.1", **headers: str
    ) -> tuple[int, bytes]:
        """Ask by hand, for a client library would mend what is asked."""
        reader, writer = await self.open(sender)
        given = {"Host": self.host, "Connection": "close", "Content-Length": str(len(body)), **headers}
        head = "".join(f"{name.replace('_', '-')}: {value}\r\n" for name, value in given.items())
        writer.write(f"{method} {path} HTTP/1.1\r\n{head}\r\n".encode() + body)
        answer = await reader.read()
        writer.close()
        await writer.wait_closed()
        head_bytes, _, content = answer.partition(b"\r\n\r\n")
        self.head = head_bytes.decode().lower()
        return int(answer.split()[1]), content


async def renew(board: Board) -> None:
    """Leave a new state on a board again and again, as a companion does that is well."""
    while True:
        board.state = dict(board.state or {})
        await asyncio.sleep(0.02)


@asynccontextmanager
async def served(
    tokens: Path | None = None, waits: Waits | None = None, background: BackgroundPicture | None = None
) -> AsyncIterator[Served]:
    made = Served(tokens, waits, background)
    made.renewing = asyncio.create_task(renew(made.board))
    try:
        yield made
    finally:
        made.renewing.cancel()
        await asyncio.to_thread(made.server.stop)
        made.front.close()
    assert not made.server.alive
    assert made.server.failure is None


@pytest.fixture
def tokens(tmp_path: Path) -> Path:
    file = tmp_path / "tokens"
    file.write_text(f"operator {OPERATOR}\nviewer {VIEWER}\n")
    file.chmod(0o600)
    return file


async def heard(page: ClientConnection, kind: str) -> dict[str, Any]:
    """Return the first message of a kind."""
    async with asyncio.timeout(10):
        while True:
            message: dict[str, Any] = json.loads(await page.recv())
            if message["t"] == kind:
                return message


async def ended(page: ClientConnection) -> int | None:
    """Wait until the page's channel is closed; return the code."""
    async with asyncio.timeout(10):
        with contextlib.suppress(ConnectionClosed):
            while True:
                await page.recv()
    return page.close_code


async def all_heard(page: ClientConnection, kinds: set[str]) -> dict[str, dict[str, Any]]:
    """Return the first message of each kind."""
    found: dict[str, dict[str, Any]] = {}
    async with asyncio.timeout(10):
        while kinds - set(found):
            message = json.loads(await page.recv())
            found.setdefault(message["t"], message)
    return found


async def newest_tick(page: ClientConnection) -> int:
    """Return the newest state's of all that comes within a second."""
    newest = 0
    with contextlib.suppress(TimeoutError):
        async with asyncio.timeout(1.0):
            while True:
                newest = max(newest, json.loads(await page.recv()).get("tick", 0))
    return newest


async def ask(page: ClientConnection, text: str) -> dict[str, Any]:
    await page.send(text)
    return await heard(page, "reply")


async def test_a_browser_is_told_everything_and_its_orders_are_carried_out() -> None:
    async with served() as s, s.connect() as page:
        told = await heard(page, "about")
        assert told["role"] == "operator"
        assert {row["name"] for row in told["rows"]} == {row.name for row in params.rows()}
        state = await heard(page, "state")
        assert state["mode"] == "GUIDED"
        report = Flight([zone(1, 5.0, 5.0)]).situation().report
        assert report is not None
        s.board.set_report(report, 12.0)
        s.board.map_changes.append(("near", drawn(tile())))
        s.board.add_text("SLZ: surveying", 6)
        s.board.add_position((1.0, 2.0, 3.0))
        told = await all_heard(page, {"zones", "map", "texts", "path"})
        assert told["zones"]["near"][0]["id"] == 1
        assert told["map"]["changes"] == {"near": [[0, 0, 1]]}
        assert told["texts"]["texts"][0]["text"] == "SLZ: surveying"
        assert told["path"]["points"] == [[1.0, 2.0, 3.0]]
        assert (await s.http("/map/near/1/0/0/0"))[0] == 200
        assert "content-encoding: gzip" in s.head
        assert (await s.http("/map/near/2/0/0/0"))[0] == 204
        assert await ask(page, f'{state["tick"]} {{"id": 7, "do": "abort"}}') == {
            "t": "reply", "id": 7, "ok": True, "reason": "noted",
        }  # fmt: skip
        assert [order.do for order in s.clerk.orders] == ["abort"]


async def test_the_background_is_served_in_the_map_frame_and_kept_by_browsers(
    tokens: Path, tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    picture = BackgroundPicture(small(tmp_path / "a.tif", [200, 100, 50]))
    async with served(tokens, background=picture) as s:
        report = Flight([]).situation().report
        assert report is not None
        bearer = {"Authorization": f"Bearer {VIEWER}"}
        frame, other = (f"/background/{lat}/{FRAME.lon_deg}/4500" for lat in (FRAME.lat_deg, 47.0))
        tile = f"{frame}/3/0/0"
        assert (await s.http(frame, **bearer))[1] == b"null"  # no map yet
        s.board.set_report(replace(report, frame=FRAME), 12.0)
        place = json.loads((await s.http(frame, **bearer))[1])
        assert (place["name"], place["finest"]) == ("a.tif", 3)
        assert place["box_m"] == pytest.approx([-1, -1, 66, 66], abs=3)
        assert (await s.http(other, **bearer))[1] == b"null"
        status, data = await s.http(tile, **bearer)
        assert (status, data[8:12]) == (200, b"WEBP")
        assert "img-src 'self' data:;" in s.head
        etag = re.search(r"^etag: (.*)$", s.head, re.MULTILINE)
        assert etag
        again = await s.http(tile, **bearer, If_None_Match=etag[1].strip())
        assert again == (304, b"")
        for path in (tile, frame):
            assert (await s.http(path))[0] == 401  # without a token
        for bad in (f"{other}/0/0/0", f"{frame}/9999/0/0", "/background/nan/nan/nan/0/0/0"):
            assert (await s.http(bad, **bearer))[0] == 404
        assert (await s.http(f"{frame}/0/0/..%2f..%2fetc", **bearer))[0] in (404, 422)
    async with served() as s:
        assert (await s.http(frame))[1] == b"null"
        assert (await s.http(tile))[0] == 404


async def test_an_order_on_the_sight_of_old_data_is_refused_but_for_an_abort(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """A phone that slept sends what was tapped half a minute ago."""
    monkeypatch.setattr("companion.flight.dashboard.site.STALE_S", 0.2)
    async with served() as s, s.connect() as page:
        seen = (await heard(page, "state"))["tick"]
        while (await heard(page, "state"))["tick"] <= seen + 3:
            pass
        late = await ask(page, f'{seen} {{"id": 1, "do": "land_best"}}')
        assert (late["ok"], "old data" in late["reason"]) == (False, True)
        assert (await ask(page, f'{seen} {{"id": 2, "do": "abort"}}'))["ok"]
        assert [order.do for order in s.clerk.orders] == ["abort"]


async def test_an_order_on_the_sight_of_a_state_that_this_channel_was_never_sent_is_refused() -> None:
    """A phone that slept while the page was started anew holds a higher number than the new one's."""
    async with served() as s, s.connect() as page:
        await heard(page, "state")
        for tick in (0, 10**6, 10**15 - 1):
            answer = await ask(page, f'{tick} {{"id": 1, "do": "land_best"}}')
            assert (answer["ok"], "old data" in answer["reason"]) == (False, True)
        assert (await ask(page, f'{10**6} {{"id": 2, "do": "abort"}}'))["ok"]
        assert [order.do for order in s.clerk.orders] == ["abort"]


async def test_a_companion_that_hangs_is_shown_as_silent_and_takes_no_order(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """The page's own thread lives on, but what it shows grows old."""
    monkeypatch.setattr("companion.flight.dashboard.site.STALE_S", 0.3)
    async with served() as s, s.connect() as page:
        seen = (await heard(page, "state"))["tick"]
        assert s.renewing is not None
        s.renewing.cancel()
        seen = max(seen, await newest_tick(page))
        answer = await ask(page, f'{seen} {{"id": 1, "do": "confirm", "east_m": 0, "north_m": 0}}')
        assert (answer["ok"], "old data" in answer["reason"]) == (False, True)
        assert s.clerk.orders == []


async def test_what_was_told_to_have_failed_is_not_done_later_but_for_an_abort() -> None:
    """The landing's loop wakes after the page has given its answer up."""
    clerk, late_s = Clerk(), time.monotonic() - 0.001
    refused = await carry_out_in_time(clerk, Simple(id=1, do="land_best"), late_s)
    assert not refused.accepted
    assert clerk.orders == []
    assert (await carry_out_in_time(clerk, Simple(id=2, do="abort"), late_s)).accepted
    assert (await carry_out_in_time(clerk, Simple(id=3, do="land_best"), late_s + 60)).accepted


async def test_a_page_is_told_when_it_is_served_by_another_run() -> None:
    """Then it forgets numbers of messages and maps, which begin anew."""
    told = []
    for _ in range(2):
        async with served() as s, s.connect() as page, s.connect() as other:
            told += [await heard(page, "about"), await heard(other, "about")]
    assert told[0]["run"] == told[1]["run"] != told[2]["run"] == told[3]["run"]
    assert told[0]["serving"] == told[1]["serving"] != told[2]["serving"] == told[3]["serving"]


@pytest.mark.parametrize("token", ["", "x" * 20, OPERATOR + "o"])
async def test_without_the_token_nothing_is_served(tokens: Path, token: str) -> None:
    async with served(tokens) as s:
        with pytest.raises(InvalidStatus):
            await s.connect(token)
        bearer = {"Authorization": f"Bearer {token}"}
        assert (await s.http("/api/status", **bearer))[0] == 401
        assert (await s.http("/static/main.js", **bearer))[0] == 401
        assert (await s.http("/map/near/1/0/0/0", **bearer))[0] == 401
        assert (await s.http("/", **bearer))[0] == 303
        assert (await s.http("/login"))[0] == 200


async def test_blueos_finds_the_page_without_a_token(tokens: Path) -> None:
    async with served(tokens) as s:
        status, document = await s.http("/register_service", Accept="application/json")
        assert status == 200
        assert "content-type: application/json" in s.head
        found = json.loads(document)
        assert set(FIELDS_OF_BLUEOS) <= set(found) <= set(FIELDS_OF_BLUEOS) | set(OPTIONS_OF_BLUEOS)
        assert {name: type(found[name]) for name in FIELDS_OF_BLUEOS} == dict.fromkeys(FIELDS_OF_BLUEOS, str)
        assert found["version"] == version("slz")
        assert found["avoid_iframes"]  # the page refuses frames
        assert not found["works_in_relative_paths"]
        assert (await s.http("/register_service", "POST"))[0] == 403  # of no origin


async def test_a_token_is_kept_as_a_cookie_that_no_script_reads(tokens: Path) -> None:
    async with served(tokens) as s:
        form = {"Origin": f"http://{s.host}", "Content_Type": "application/x-www-form-urlencoded"}
        assert (await s.http("/login", "POST", f"token={'x' * 20}".encode(), **form))[0] == 303
        assert "set-cookie" not in s.head
        assert (await s.http("/login", "POST", f"token={OPERATOR}".encode(), **form))[0] == 303
        assert "httponly" in s.head
        assert "samesite=strict" in s.head
        assert (await s.http("/", Cookie=f"slz-token={OPERATOR}"))[0] == 200


async def test_a_viewer_sees_all_and_orders_nothing(tokens: Path) -> None:
    async with served(tokens) as s, s.connect(VIEWER) as page:
        tick = (await heard(page, "state"))["tick"]
        for do in ('"abort"', '"land_now"', '"set", "name": "survey_s", "value": 3', '"record", "on": true'):
            assert (await ask(page, f'{tick} {{"id": 1, "do": {do}}}'))["reason"] == "this page may look only"
        await page.send(f'{tick} {{"id": 2, "do": "facts", "east_m": 0, "north_m": 0}}')
        assert (await heard(page, "facts"))["state"] == "unknown"
        assert s.clerk.orders == []


@pytest.mark.parametrize("origin", ["http://evil.example", "", "null", "http://[", "http://[::1"])
async def test_a_page_of_another_site_gets_no_channel(origin: str) -> None:
    async with served() as s:
        with pytest.raises(InvalidStatus):
            await s.connect(origin=origin)


async def test_other_sites_and_other_names_are_refused_over_http() -> None:
    async with served() as s:
        assert (await s.http("/api/status", Host="evil.example"))[0] == 403
        assert (await s.http("/login", "POST", b"token=x", Origin="http://evil.example"))[0] == 403
        assert (await s.http("/api/status", Sec_Fetch_Site="cross-site"))[0] == 403
        assert (await s.http("/login", "POST", b"x" * 2000, Origin=f"http://{s.host}"))[0] == 413
        assert (await s.http("/static/..%2f..%2fpage.py"))[0] == 404
        assert (await s.http("/api/status"))[0] == 200
        assert "frame-ancestors 'none'" in s.head


async def test_malformed_messages_are_refused_and_too_many_end_the_channel() -> None:
    async with served() as s, s.connect() as page:
        assert (await ask(page, "abort"))["ok"] is False
        assert (await ask(page, '1 {"id": 1, "do": "fly"}'))["reason"].startswith("not understood")
        for _ in range(10):
            await page.send("{}")
        assert await ended(page) == 1008
        assert s.clerk.orders == []
        async with s.connect() as other:
            await heard(other, "state")


@pytest.mark.parametrize("message", ["x" * 10_000, b"\x00" * 10_000])
async def test_an_oversized_message_ends_its_channel_only(message: str | bytes) -> None:
    async with served() as s, s.connect() as other, s.connect() as page:
        await page.send(message)
        assert await ended(page) in (1003, 1007, 1009)
        await heard(other, "state")


async def test_a_flood_of_orders_is_cut_off(monkeypatch: pytest.MonkeyPatch) -> None:
    """Nothing is answered, and the allowance of so many a second is not renewed, however slow the machine."""
    monkeypatch.setattr("companion.flight.dashboard.viewer.TICK_S", 1000.0)
    monkeypatch.setattr("companion.flight.dashboard.site.ANSWER_S", 1000.0)
    async with served() as s, s.connect() as page:
        s.clerk.answering.clear()
        try:
            with contextlib.suppress(ConnectionClosed):
                for _ in range(500):
                    await page.send('0 {"id": 1, "do": "abort"}')
                    await asyncio.sleep(0)
            assert await ended(page) == 1008
        finally:
            s.clerk.answering.set()
        assert 0 < len(s.clerk.orders) <= MOST_PER_S


async def test_a_browser_that_stalls_holds_up_nobody(monkeypatch: pytest.MonkeyPatch) -> None:
    """It reads nothing while much is said: it is let go, and the others go on."""
    monkeypatch.setattr("companion.flight.dashboard.viewer.SEND_S", 0.3)
    async with served() as s, s.connect() as other:
        stalled = socket.create_connection((s.front.address.host, s.front.address.port))
        stalled.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 2048)
        key = "dGhlIHNhbXBsZSBub25jZQ=="
        stalled.sendall(
            f"GET /live HTTP/1.1\r\nHost: {s.host}\r\nOrigin: http://{s.host}\r\nUpgrade: websocket\r\n"
            f"Connection: Upgrade\r\nSec-WebSocket-Version: 13\r\nSec-WebSocket-Key: {key}\r\n\r\n".encode()
        )
        s.board.state = {**STATE, "long": "x" * 1_000_000}
        async with asyncio.timeout(20):
            while s.board.viewers < 2:
                await heard(other, "state")
            while s.board.viewers == 2:
                await heard(other, "state")
        stalled.close()


async def test_five_browsers_are_served_and_a_crowd_is_turned_away() -> None:
    async with served() as s:
        pages = [await s.connect() for _ in range(16)]
        for page in pages[:5]:
            await heard(page, "state")
        with pytest.raises(InvalidStatus):
            await s.connect()
        for page in pages:
            await page.close()


async def test_viewers_leave_room_for_an_operator(tokens: Path) -> None:
    async with served(tokens) as s:
        pages = [await s.connect(VIEWER) for _ in range(12)]
        with pytest.raises(InvalidStatus):
            await s.connect(VIEWER)
        pages.append(await s.connect(OPERATOR))
        assert (await heard(pages[-1], "about"))["role"] == "operator"
        for page in pages:
            await page.close()


async def until_closed(reader: asyncio.StreamReader) -> bytes:
    async with asyncio.timeout(10):
        try:
            return await reader.read()
        except ConnectionError:
            return b""


async def closed(*writers: asyncio.StreamWriter) -> None:
    for one in writers:
        one.close()
        with contextlib.suppress(ConnectionError):
            await one.wait_closed()


@pytest.mark.parametrize(
    "begun",
    [b"", b"GET / HT", b"GET / HTTP/1.1\r\nHost: x\r\nA: ", b"POST /login HTTP/1.1\r\n%s\r\ntoken="],
)
async def test_whoever_asks_too_slowly_is_let_go(monkeypatch: pytest.MonkeyPatch, begun: bytes) -> None:
    """It needs no token for that, and without end would keep a connection from the pilot."""
    monkeypatch.setattr("companion.flight.dashboard.security.http_connection.LOOK_S", 0.05)
    async with served() as s:
        reader, writer = await asyncio.open_connection(s.front.address.host, s.front.address.port)
        mine = f"Host: {s.host}\r\nOrigin: http://{s.host}\r\nContent-Length: 500\r\n".encode()
        writer.write(begun % mine if b"%s" in begun else begun)
        assert await until_closed(reader) == b""
        await closed(writer)


async def test_the_api_says_what_its_description_promises() -> None:
    async with served() as s:
        report = Flight([zone(1, 5.0, 5.0)]).situation().report
        assert report is not None
        s.board.set_report(report, 12.0)
        async with asyncio.timeout(10):
            while json.loads((await s.http("/api/status"))[1])["zones"] != 1:
                pass
        found = json.loads((await s.http("/api/zones.geojson"))[1])
        assert [feature["properties"]["map"] for feature in found["features"]] == ["near"]
        assert "application/geo+json" in s.head
        assert found["past"] == {}
        s.board.state = {**(s.board.state or {}), "moving": None, "past": {"map": 61.5}}
        for name in ("zones", "hazards"):
            assert json.loads((await s.http(f"/api/{name}.geojson"))[1])["past"] == {"map": 61.5}
        spec = json.loads((await s.http("/api/openapi.json"))[1])
        assert set(spec["paths"]) == {"/api/status", "/api/zones.geojson", "/api/hazards.geojson"}
        assert spec["paths"]["/api/zones.geojson"]["get"]["responses"]["200"]["content"]
        status = json.loads((await s.http("/api/status"))[1])
        assert set(status) == set(spec["components"]["schemas"]["Status"]["properties"])


async def test_every_file_of_the_page_comes_from_this_computer() -> None:
    """There is no internet in the field."""
    async with served() as s:
        for name in ("/", "/static/main.js", "/static/style.css", "/static/pilot.js", "/api"):
            code, data = await s.http(name)
            assert code == 200
            outside = data.replace(b"http://www.w3.org/2000/svg", b"")
            assert b"http://" not in outside
            assert b"https://" not in outside


async def test_only_files_of_the_page_are_served(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """What an editor left beside them is not."""
    (tmp_path / "static").mkdir()
    for name in ("main.js", "main.js~", "notes.txt", "secret"):
        (tmp_path / "static" / name).write_text("text")
    package = SimpleNamespace(files=lambda _name: tmp_path)
    monkeypatch.setattr("companion.flight.dashboard.routes.resources", package)
    async with served() as s:
        codes = [(await s.http(f"/static/{f.name}"))[0] for f in sorted((tmp_path / "static").iterdir())]
    assert codes == [200, 404, 404, 404]


async def test_of_a_body_that_does_not_say_how_long_it_is_the_beginning_counts_only(tokens: Path) -> None:
    """A stranger could fill the memory with it."""
    async with served(tokens) as s:
        pieces: dict[str, Any] = {
            "Transfer-Encoding": "chunked",
            "Content-Length": "0",
            "Origin": f"http://{s.host}",
        }
        for spare, kept in ((0, True), (2000, False)):
            form = b"x" * spare + f"&token={OPERATOR}".encode()
            body = b"%x\r\n%s\r\n0\r\n\r\n" % (len(form), form)
            assert (await s.http("/login", "POST", body, **pieces))[0] == 303
            assert ("set-cookie" in s.head) == kept


async def test_a_server_that_ended_may_be_stopped_again() -> None:
    async with served() as s:
        await asyncio.to_thread(s.server.stop)
        assert not s.server.alive
        await asyncio.to_thread(s.server.stop)
