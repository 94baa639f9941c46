"""One connection: how long a request may take, and how many connections there may be."""

from __future__ import annotations

import asyncio

from uvicorn.protocols.http.h11_impl import H11Protocol

LOOK_S = 5.0  # a connection on which nothing is asked for is let go at the second look
MOST_LOOKS = 6  # so many looks may find the same request unanswered
MOST_CONNECTIONS = 256  # the landing needs files and sockets of the same process, too
MOST_OF_ONE_HOST = 128


class Connection(H11Protocol):
    """Ends what asks too slowly or too much, for the server by itself waits for ever.

    Whoever sends a head or a body byte by byte, or takes an answer so, would hold a connection without
    a token.
    """

    _looking: asyncio.TimerHandle | None = None
    _looks = 0
    _looked_at: tuple[object, bool] = (None, False)

    def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override]
        """Take a connection, or refuse one too many."""
        super().connection_made(transport)
        host = _host(self)
        of_host = sum(_host(other) == host for other in self.connections)
        if len(self.connections) > MOST_CONNECTIONS or of_host > MOST_OF_ONE_HOST:
            transport.abort()
            return
        self._looking = self.loop.call_later(LOOK_S, self._look)

    def connection_lost(self, exc: Exception | None) -> None:
        """Look no more."""
        if self._looking is not None:
            self._looking.cancel()
        super().connection_lost(exc)

    def _look(self) -> None:
        if self.transport.is_closing() or self.transport.get_protocol() is not self:
            return  # it ended, or is a browser's channel now
        idle = self.cycle is None or self.cycle.response_complete
        same = self._looked_at[0] is self.cycle and self._looked_at[1] is idle
        self._looks, self._looked_at = self._looks + 1 if same else 1, (self.cycle, idle)
        if self._looks >= (2 if idle else MOST_LOOKS):
            self.transport.abort()
            return
        self._looking = self.loop.call_later(LOOK_S, self._look)


def _host(connection: object) -> str | None:
    client = getattr(connection, "client", None)
    return client[0] if client else None
