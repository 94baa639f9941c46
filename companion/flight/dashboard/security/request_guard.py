"""ASGI guard before every route: refuses requests from other sites or without a token."""

from __future__ import annotations

import logging
from http.cookies import CookieError, SimpleCookie

from starlette.datastructures import Headers
from starlette.responses import PlainTextResponse, RedirectResponse, Response
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from companion.flight.dashboard.security.access import COOKIE, Role
from companion.flight.dashboard.security.throttle import LONGEST_S, TooManyGuessesError
from companion.flight.dashboard.security.token_check import TokenCheck

log = logging.getLogger(__name__)

ROLE = "slz_role"
# Paths without a token; the last one tells name and version.
OPEN = frozenset({"/login", "/static/login.js", "/static/style.css", "/register_service"})
MOST_BODY_BYTES = 1024
WAIT = "too many wrong tokens came from this address: wait some seconds and try again"
SAFE_METHODS = frozenset({"GET", "HEAD"})
HEADERS = {
    "content-security-policy": "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self'"
    " data:; connect-src 'self'; base-uri 'none'; form-action 'self'; frame-ancestors 'none'",
    "x-content-type-options": "nosniff",
    "referrer-policy": "no-referrer",
    "cross-origin-resource-policy": "same-origin",
    "cross-origin-opener-policy": "same-origin",
}


class Guard:
    """ASGI middleware that passes a request with its role in the scope."""

    def __init__(self, app: ASGIApp, token_check: TokenCheck) -> None:
        self._app, self._token_check = app, token_check

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        headers = Headers(scope=scope)
        channel = scope["type"] == "websocket"
        acts = channel or scope["method"] not in SAFE_METHODS
        why = self._token_check.access.refuses(headers, acts=acts)
        found = PlainTextResponse(why, 403) if why else await self._judge(scope, headers)
        if isinstance(found, Response):
            await self._refuse(scope, receive, send, found)
        else:
            scope[ROLE] = found
            await self._app(scope, receive, send if channel else _with_headers(send))

    async def _judge(self, scope: Scope, headers: Headers) -> Role | Response | None:
        """Return the role of a request, or the response that refuses it."""
        is_open, role = scope["path"] in OPEN, None
        if not is_open:
            try:
                role = await self._token_check.role(address_of(scope), token_of(headers))
            except TooManyGuessesError:
                return PlainTextResponse(WAIT, 429, {"retry-after": f"{LONGEST_S:.0f}"})
        if role is None and not is_open:
            page = scope["path"] == "/"
            return RedirectResponse("/login", 303) if page else PlainTextResponse("a token is needed", 401)
        if not _is_short(headers.get("content-length") or "0"):
            return PlainTextResponse("too long", 413)
        return role

    @staticmethod
    async def _refuse(scope: Scope, receive: Receive, send: Send, answer: Response) -> None:
        if scope["type"] == "websocket":
            await send({"type": "websocket.close", "code": 1008})  # before accepting: HTTP 403
        else:
            await answer(scope, receive, _with_headers(send))


def address_of(scope: Scope) -> str:
    """Return the address of a request's sender, empty if it is unknown."""
    client = scope.get("client")
    return str(client[0]) if client else ""


def token_of(headers: Headers) -> str | None:
    """Return the token in a request's cookie or `Authorization: Bearer` header."""
    scheme, _, token = headers.get("authorization", "").partition(" ")
    if scheme.lower() == "bearer":
        return token
    try:
        found = SimpleCookie(headers.get("cookie", "")).get(COOKIE)
    except CookieError:
        return None
    return None if found is None else found.value


def _is_short(length: str) -> bool:
    """Return whether a body's length is a small number."""
    return length.isascii() and length.isdigit() and int(length[:9]) <= MOST_BODY_BYTES


def _with_headers(send: Send) -> Send:
    async def sender(message: Message) -> None:
        if message["type"] == "http.response.start":
            added = [(name.encode(), value.encode()) for name, value in HEADERS.items()]
            message = {**message, "headers": [*message.get("headers", []), *added]}
        await send(message)

    return sender
