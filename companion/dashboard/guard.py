"""Stands before every route: refuses what does not come from this page, or without a token."""

from __future__ import annotations

import logging
from http.cookies import CookieError, SimpleCookie

from starlette.datastructures import Headers
from starlette.responses import PlainTextResponse, RedirectResponse, Response
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from companion.dashboard.access import COOKIE, Access

log = logging.getLogger(__name__)

ROLE = "slz_role"
OPEN = frozenset({"/login", "/static/login.js", "/static/style.css"})  # what needs no token
MOST_BODY_BYTES = 1024
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
    """ASGI layer that lets a request through with its role in the scope."""

    def __init__(self, app: ASGIApp, access: Access) -> None:
        self._app, self._access = app, access

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        headers = Headers(scope=scope)
        channel = scope["type"] == "websocket"
        acts = channel or scope["method"] not in SAFE_METHODS
        why = self._access.refuses(headers, acts=acts)
        role = self._access.role(token_of(headers))
        if why:
            await self._refuse(scope, receive, send, PlainTextResponse(why, 403))
        elif role is None and scope["path"] not in OPEN:
            page = scope["path"] == "/"
            answer = RedirectResponse("/login", 303) if page else PlainTextResponse("a token is needed", 401)
            await self._refuse(scope, receive, send, answer)
        elif not _is_short(headers.get("content-length") or "0"):
            await self._refuse(scope, receive, send, PlainTextResponse("too long", 413))
        else:
            scope[ROLE] = role
            await self._app(scope, receive, send if channel else _with_headers(send))

    @staticmethod
    async def _refuse(scope: Scope, receive: Receive, send: Send, answer: Response) -> None:
        if scope["type"] == "websocket":
            await send({"type": "websocket.close", "code": 1008})  # before accepting: HTTP 403
        else:
            await answer(scope, receive, _with_headers(send))


def token_of(headers: Headers) -> str | None:
    """Return the token that a request brings, in its cookie or as `Authorization: Bearer`."""
    scheme, _, token = headers.get("authorization", "").partition(" ")
    if scheme.lower() == "bearer":
        return token
    try:
        found = SimpleCookie(headers.get("cookie", "")).get(COOKIE)
    except CookieError:
        return None
    return None if found is None else found.value


def _is_short(length: str) -> bool:
    """Tell whether a body's length is a number, and small."""
    return length.isascii() and length.isdigit() and int(length[:9]) <= MOST_BODY_BYTES


def _with_headers(send: Send) -> Send:
    async def sender(message: Message) -> None:
        if message["type"] == "http.response.start":
            added = [(name.encode(), value.encode()) for name, value in HEADERS.items()]
            message = {**message, "headers": [*message.get("headers", []), *added]}
        await send(message)

    return sender
