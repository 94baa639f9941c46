"""Connection limit: closes idle or untrusted connections to make room for a new one."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable
from typing import Any

from companion.flight.dashboard.security.request_guard import ROLE

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
