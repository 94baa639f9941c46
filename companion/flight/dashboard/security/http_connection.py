"""HTTP connection with time limits and a connection limit."""

from __future__ import annotations

import asyncio
from collections import Counter
from collections.abc import Iterable
from typing import Any

from uvicorn.protocols.http.h11_impl import H11Protocol

from companion.flight.dashboard.security.incidents import CROWDED_OUT, Incidents
from companion.flight.dashboard.security.request_guard import ROLE

LOOK_S = 5.0  # an idle connection is closed at the second look
MOST_LOOKS = 6  # looks at the same unanswered request before the connection is closed


MOST_CONNECTIONS = 256  # the landing needs files and sockets of the same process
MOST_OF_ONE_HOST = 128


def make_room(newcomer: Any, connections: Iterable[Any]) -> str | None:
    """Return the address whose connection was closed for a newcomer; None if there is room.

    A connection without an answer in progress for a known token is closed: of the newcomer's address if that
    has too many, else of the address that has most; preferably one that never sent a valid token, and the
    oldest of these. So strangers who hold connections replace each other and not the pilot, whose open page
    is never closed. If all others are in use, the newcomer is closed.

    newcomer, connections: protocols of a server, with `client`, `transport` and, after the first request,
    `scope`.
    """
    held = [one for one in connections if not one.transport.is_closing()]
    counts = Counter(host_of(one) for one in held)
    own = host_of(newcomer)
    if counts[own] > MOST_OF_ONE_HOST:
        pool = [one for one in held if host_of(one) == own]
    elif len(held) > MOST_CONNECTIONS:
        pool = held
    else:
        return None
    free = [one for one in pool if one is not newcomer and not _in_use(one)]
    ended = min(free, key=lambda one: (_has_role(one), -counts[host_of(one)], _made_s(one)), default=newcomer)
    ended.transport.abort()
    return host_of(ended)


def host_of(connection: Any) -> str:
    """Return the address of the other end, empty if it is unknown."""
    client = connection.client
    return client[0] if client else ""


def _has_role(connection: Any) -> bool:
    scope = getattr(connection, "scope", None)
    return scope is not None and scope.get(ROLE) is not None


def _in_use(connection: Any) -> bool:
    """Return whether a known token's request is being answered; a WebSocket always is."""
    return _has_role(connection) and not getattr(connection, "is_idle", False)


def _made_s(connection: Any) -> float:
    return float(getattr(connection, "made_s", 0.0))


class Connection(H11Protocol):
    """Closes slow and surplus connections, because the server itself waits for ever.

    Otherwise a client that sends a request or reads an answer byte by byte holds a connection without a
    token.

    Attributes
    ----------
    made_s
        Time of connection, on the loop's clock.
    """

    made_s = 0.0
    _looking: asyncio.TimerHandle | None = None
    _looks = 0
    _looked_at: tuple[object, bool] = (None, False)

    def __init__(self, *args: Any, incidents: Incidents, **more: Any) -> None:
        super().__init__(*args, **more)
        self._incidents = incidents

    @property
    def is_idle(self) -> bool:
        """True if no request is being answered."""
        return self.cycle is None or self.cycle.response_complete

    def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override]
        """Accept a connection; if there are too many, close another one or this one."""
        super().connection_made(transport)
        self.made_s = self.loop.time()
        ended = make_room(self, self.connections)
        if ended is not None:
            self._incidents.count(CROWDED_OUT, ended)
        if not transport.is_closing():
            self._looking = self.loop.call_later(LOOK_S, self._look)

    def connection_lost(self, exc: Exception | None) -> None:
        """Cancel the timer."""
        if self._looking is not None:
            self._looking.cancel()
        super().connection_lost(exc)

    def _look(self) -> None:
        if self.transport.get_protocol() is not self:
            return  # it is a WebSocket now
        state = self.cycle, self.is_idle
        same = self._looked_at[0] is state[0] and self._looked_at[1] is state[1]
        self._looks, self._looked_at = self._looks + 1 if same else 1, state
        if self._looks >= (2 if self.is_idle else MOST_LOOKS):
            self.transport.abort()  # even if it is closing: the client may never read the last answer
            return
        self._looking = self.loop.call_later(LOOK_S, self._look)
