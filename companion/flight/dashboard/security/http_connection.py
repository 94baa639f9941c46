"""HTTP connection with time limits and a connection limit."""

from __future__ import annotations

import asyncio
from typing import Any

from uvicorn.protocols.http.h11_impl import H11Protocol

from companion.flight.dashboard.security.connection_limit import make_room
from companion.flight.dashboard.security.incidents import CROWDED_OUT, Incidents

LOOK_S = 5.0  # an idle connection is closed at the second look
MOST_LOOKS = 6  # looks at the same unanswered request before the connection is closed


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
        """Whether no request is being answered."""
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
