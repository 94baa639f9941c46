"""One connection: how long a request may take, and whether there is room for it."""

from __future__ import annotations

import asyncio
from typing import Any

from uvicorn.protocols.http.h11_impl import H11Protocol

from companion.flight.dashboard.security.connection_limit import make_room
from companion.flight.dashboard.security.incidents import CROWDED_OUT, Incidents

LOOK_S = 5.0  # a connection on which nothing is asked for is let go at the second look
MOST_LOOKS = 6  # so many looks may find the same request unanswered


class Connection(H11Protocol):
    """Ends what asks too slowly or too much, for the server by itself waits for ever.

    Whoever sends a head or a body byte by byte, or takes an answer so, would hold a connection without
    a token.

    Attributes
    ----------
    made_s
        When it was made, on the loop's clock.
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
        """Take a connection; where there are too many, end another one or this."""
        super().connection_made(transport)
        self.made_s = self.loop.time()
        ended = make_room(self, self.connections)
        if ended is not None:
            self._incidents.count(CROWDED_OUT, ended)
        if not transport.is_closing():
            self._looking = self.loop.call_later(LOOK_S, self._look)

    def connection_lost(self, exc: Exception | None) -> None:
        """Look no more."""
        if self._looking is not None:
            self._looking.cancel()
        super().connection_lost(exc)

    def _look(self) -> None:
        if self.transport.get_protocol() is not self:
            return  # it is a browser's channel now
        state = self.cycle, self.is_idle
        same = self._looked_at[0] is state[0] and self._looked_at[1] is state[1]
        self._looks, self._looked_at = self._looks + 1 if same else 1, state
        if self._looks >= (2 if self.is_idle else MOST_LOOKS):
            self.transport.abort()  # even if it is closing: the other end may take the last answer never
            return
        self._looking = self.loop.call_later(LOOK_S, self._look)
