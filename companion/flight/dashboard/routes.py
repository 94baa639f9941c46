"""HTTP and WebSocket routes of the page."""

from __future__ import annotations

from importlib import resources
from importlib.metadata import version
from typing import Any
from urllib.parse import parse_qs

from fastapi import FastAPI, Request, Response, WebSocket
from starlette.responses import HTMLResponse, PlainTextResponse, RedirectResponse
from starlette.types import ASGIApp

from companion.flight.dashboard import api
from companion.flight.dashboard.alarms import active_alarms
from companion.flight.dashboard.security.access import COOKIE, Role
from companion.flight.dashboard.security.request_guard import MOST_BODY_BYTES, ROLE, Guard, address_of
from companion.flight.dashboard.security.throttle import TooManyGuessesError
from companion.flight.dashboard.site import Site
from companion.flight.dashboard.viewer import Viewer

MOST_VIEWERS = 16
KEPT_FOR_OPERATORS = 4  # of these
OPENAPI = "/api/openapi.json"
KINDS = {"js": "text/javascript", "css": "text/css", "html": "text/html", "svg": "image/svg+xml"}


BLUEOS_PATH = "/register_service"


def registration() -> dict[str, Any]:
    """Return what BlueOS's helper expects of a web service.

    It opens in a window of its own: the page refuses to be framed by another one, and its addresses are
    absolute, so it does not work behind BlueOS's proxy.
    """
    return {
        "name": "Safe landing zones",
        "description": "Finds and watches landing zones with a LiDAR, and lands there.",
        "icon": "mdi-helicopter",
        "company": "slz contributors",
        "version": version("slz"),
        "webpage": "",
        "api": "/api",
        "new_page": True,
        "avoid_iframes": True,
        "works_in_relative_paths": False,
    }


def read_static() -> dict[str, tuple[bytes, str]]:
    """Return every file of the page with its media type: they are small and stay in memory."""
    folder = resources.files("companion.flight.dashboard").joinpath("static")
    found = {}
    for file in folder.iterdir():
        kind = KINDS.get(file.name.rpartition(".")[2])
        if kind is not None:
            found[file.name] = file.read_bytes(), f"{kind}; charset=utf-8"
    return found


def make_app(site: Site) -> ASGIApp:
    """Return the application with all routes behind the guard."""
    app = FastAPI(
        title=api.TITLE, description=api.DESCRIPTION, docs_url=None, redoc_url=None, openapi_url=OPENAPI
    )
    files = read_static()

    def page(name: str) -> HTMLResponse:
        return HTMLResponse(files[name][0], headers={"cache-control": "no-cache"})

    @app.get("/", include_in_schema=False)
    async def index() -> Response:
        return page("index.html")

    @app.get("/login", include_in_schema=False)
    async def login() -> Response:
        return page("login.html")

    @app.post("/login", include_in_schema=False)
    async def log_in(request: Request) -> Response:
        given = parse_qs((await _body(request)).decode("ascii", "replace")).get("token", [""])[0].strip()
        try:
            role = await site.token_check.role(address_of(request.scope), given)
        except TooManyGuessesError:
            return RedirectResponse("/login?wait", 303)
        if role is None:
            return RedirectResponse("/login?refused", 303)
        answer = RedirectResponse("/", 303)
        answer.set_cookie(COOKIE, given, max_age=86_400, httponly=True, samesite="strict")
        return answer

    @app.get(BLUEOS_PATH, include_in_schema=False)
    async def register_service() -> dict[str, Any]:
        return registration()

    @app.get("/api", include_in_schema=False)
    async def docs() -> Response:
        return page("api.html")

    @app.get("/static/{name}", include_in_schema=False)
    async def static(name: str) -> Response:
        if name not in files:
            return PlainTextResponse("there is no such file", 404)
        data, kind = files[name]
        return Response(data, media_type=kind, headers={"cache-control": "no-cache"})

    @app.get("/map/{name}/{serial}/{level}/{row}/{col}", include_in_schema=False)
    async def block(name: str, serial: int, level: int, row: int, col: int) -> Response:
        data = await site.block(name, serial, level, row, col)
        if data is None:
            return Response(status_code=204)  # nothing is known there, or the map was replaced meanwhile
        headers = {"content-encoding": "gzip", "cache-control": "no-store"}
        return Response(data, media_type="application/octet-stream", headers=headers)

    @app.get("/background/{lat}/{lon}/{alt}", include_in_schema=False)
    async def background(lat: float, lon: float, alt: float) -> Any:
        return await site.from_background("place", (lat, lon, alt))

    @app.get("/background/{lat}/{lon}/{alt}/{level}/{row}/{col}", include_in_schema=False)
    async def background_tile(
        request: Request, lat: float, lon: float, alt: float, level: int, row: int, col: int
    ) -> Response:
        etag = getattr(site.background, "etag", "")
        if etag and request.headers.get("if-none-match") == etag:
            return Response(status_code=304)
        if data := await site.from_background("tile", (lat, lon, alt), level, row, col):
            return Response(data, 200, {"etag": etag, "cache-control": "private, no-cache"}, "image/webp")
        return PlainTextResponse("there is no picture there", 404)

    @app.get("/api/status", summary="State of the flight")
    async def status() -> api.Status:
        state, picture = site.board.state, site.picture
        alarms = (
            [] if state is None else active_alarms(state, None if picture is None else picture["selected"])
        )
        return api.status(state, picture, alarms, site.board.report_number)

    @app.get("/api/zones.geojson", summary="Zones as GeoJSON (WGS-84)", response_model=api.Zones)
    async def zones() -> Response:
        return Response(await site.collection(), media_type="application/geo+json")

    @app.get(
        "/api/hazards.geojson",
        summary="Wires and what moves, as GeoJSON (WGS-84)",
        response_model=api.Hazards,
    )
    async def hazards() -> Response:
        return Response(await site.hazards(), media_type="application/geo+json")

    @app.websocket("/live")
    async def live(socket: WebSocket) -> None:
        role = socket.scope[ROLE]
        kept = 0 if role is Role.OPERATOR else KEPT_FOR_OPERATORS
        if site.board.viewers >= MOST_VIEWERS - kept:
            await socket.close(1013, "too many browsers")
            return
        site.board.viewers += 1
        try:
            await Viewer(site, socket, role if isinstance(role, Role) else Role.VIEWER).run()
        finally:
            site.board.viewers -= 1

    return Guard(app, site.token_check)


async def _body(request: Request) -> bytes:
    """Return the body, truncated to `MOST_BODY_BYTES`."""
    data = b""
    async for part in request.stream():
        data += part
        if len(data) > MOST_BODY_BYTES:
            break
    return data[:MOST_BODY_BYTES]
