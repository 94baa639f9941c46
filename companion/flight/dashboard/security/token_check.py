"""Token check: known tokens pass at once, others after a delay that grows with wrong ones."""

from __future__ import annotations

import asyncio
import hashlib
import secrets
import time
from collections import OrderedDict
from collections.abc import Awaitable, Callable

from companion.flight.dashboard.security.access import Access, Role
from companion.flight.dashboard.security.incidents import UNJUDGED, WRONG_TOKEN, Incidents
from companion.flight.dashboard.security.throttle import Throttle, TooManyGuessesError

MOST_KNOWN = 256


class TokenCheck:
    """Access control with a memory of addresses that outlasts a restart of the page.

    A token once accepted is known for its address: an open page, its reconnections and its orders never wait,
    whatever others at the same address try. Wrong tokens of one address delay no other address. The
    operator's token ends the delay of its address; a viewer's does not, or a viewer could guess operators'
    tokens without one.

    Parameters
    ----------
    access
        Rules of access.
    now, sleep
        Monotonic clock in seconds, and its sleep.
    """

    def __init__(
        self,
        access: Access,
        now: Callable[[], float] = time.monotonic,
        sleep: Callable[[float], Awaitable[None]] = asyncio.sleep,
    ) -> None:
        self.access = access
        self.incidents = Incidents(now)
        self._throttle, self._sleep = Throttle(now), sleep
        self._known: OrderedDict[tuple[str, bytes], None] = OrderedDict()
        self._salt = secrets.token_bytes(16)

    async def role(self, address: str, token: str | None) -> Role | None:
        """Return the role of a token, None if it is unknown.

        Raises
        ------
        TooManyGuessesError
            Too many tokens of this address wait for their check; this one is not checked.
        """
        if not self.access.needs_token or not token:
            return self.access.role(token)
        hashed = hashlib.blake2b(token.encode("utf-8", "replace"), digest_size=16, key=self._salt).digest()
        if (address, hashed) in self._known:
            self._known.move_to_end((address, hashed))
            return self.access.role(token)
        await self._wait(address, hashed)
        role = self.access.role(token)
        if role is None:
            self._throttle.count_wrong(address, hashed)
            self.incidents.count(WRONG_TOKEN, address)
        else:
            self._remember(address, hashed, role)
        return role

    async def _wait(self, address: str, token: bytes) -> None:
        delay_s = self._throttle.delay_s(address, token)
        if delay_s <= 0.0:
            return
        try:
            with self._throttle.waiting(address, token):
                await self._sleep(delay_s)
        except TooManyGuessesError:
            self.incidents.count(UNJUDGED, address)
            raise

    def _remember(self, address: str, token: bytes, role: Role) -> None:
        self._known[address, token] = None
        while len(self._known) > MOST_KNOWN:
            self._known.popitem(last=False)
        if role is Role.OPERATOR:
            self._throttle.forget(address)
