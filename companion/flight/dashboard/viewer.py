"""WebSocket session of one browser."""

from __future__ import annotations

import asyncio
import contextlib
import json
import logging

from starlette.websockets import WebSocket, WebSocketDisconnect

from companion.flight.dashboard.browser_orders import BadMessageError, Command, Facts, Simple, parse
from companion.flight.dashboard.security.access import Role
from companion.flight.dashboard.site import TICK_S, Site
from companion.flight.landing.situation import Reply

log = logging.getLogger(__name__)

SEND_S = 5.0  # a browser that accepts nothing for this long is disconnected
MOST_BAD = 10
MOST_PER_S = 20
PATH_PART = 2000
ABORT = '"abort"'


class Viewer:
    """Sends updates at the pace of the browser, skipping superseded ones, and receives its orders."""

    def __init__(self, site: Site, socket: WebSocket, role: Role) -> None:
        self._site, self._socket, self._role = site, socket, role
        self._sent = {"state": 0, "zones": 0, "health": 0, "replay": 0}
        self._text = 0
        self._path = (0, 0)
        self._serials: dict[str, int] = {}
        self._clocks: dict[str, int] = {}
        self._bad = 0
        self._budget = float(MOST_PER_S)
        self._orders: asyncio.Queue[tuple[Command, int | None]] = asyncio.Queue(MOST_PER_S)
        self._aborts: set[asyncio.Task[None]] = set()

    async def run(self) -> None:
        """Serve until the browser disconnects."""
        await self._socket.accept()
        tasks = [
            asyncio.create_task(self._send_all(), name="page to browser"),
            asyncio.create_task(self._receive_all(), name="page from browser"),
            asyncio.create_task(self._carry_out_all(), name="orders from browser"),
        ]
        try:
            done, _ = await asyncio.wait(tasks, return_when=asyncio.FIRST_COMPLETED)
            for task in done:
                task.result()
        except (WebSocketDisconnect, TimeoutError, RuntimeError, OSError):
            pass  # the browser disconnected, or was disconnected
        finally:
            for task in tasks:
                task.cancel()
            await asyncio.gather(*tasks, *self._aborts, return_exceptions=True)

    # ---- to the browser -------------------------------------------------------------------------

    async def _send_all(self) -> None:
        site = self._site
        document = {"t": "about", "role": self._role.value, "run": site.board.run, "serving": site.serving}
        await self._send(json.dumps({**document, **site.about}))
        while True:
            await self._site.give_way()
            for message in self.pending_messages():
                await self._send(message)
            self._budget = min(MOST_PER_S, self._budget + MOST_PER_S * TICK_S)
            await asyncio.sleep(TICK_S)

    async def _send(self, text: str) -> None:
        async with asyncio.timeout(SEND_S):
            await self._socket.send_text(text)

    def pending_messages(self) -> list[str]:
        """Return the messages that this browser has not been sent, most urgent first."""
        found = []
        for name in self._sent:
            number, text = getattr(self._site, name)
            if number != self._sent[name] and text:
                self._sent[name] = number
                found.append(text)
        return found + self._texts() + self._map() + self._flown()

    def _texts(self) -> list[str]:
        fresh = [text for text in tuple(self._site.board.texts) if text.number > self._text]
        if not fresh:
            return []
        self._text = fresh[-1].number
        items = [
            {"number": x.number, "at_s": x.wall_s, "severity": x.severity, "text": x.text} for x in fresh
        ]
        return [json.dumps({"t": "texts", "texts": items})]

    def _map(self) -> list[str]:
        pyramids, changes = self._site.pyramids, {}
        for name, pyramid in pyramids.by_name.items():
            if self._serials.get(name) != pyramid.serial:
                self._serials[name], self._clocks[name] = pyramid.serial, 0
            fresh = pyramid.since(self._clocks[name])
            if fresh:
                self._clocks[name] = max(at for _, _, at in fresh)
                changes[name] = fresh
        if not changes:
            return []
        return [json.dumps({"t": "map", "heads": pyramids.heads(), "changes": changes})]

    def _flown(self) -> list[str]:
        board = self._site.board
        number, at = self._path
        if number != board.path_number:
            number, at = board.path_number, 0
        part = board.path[at : at + PATH_PART]
        self._path = number, at + len(part)
        if not part:
            return []
        return [json.dumps({"t": "path", "number": number, "from": at, "points": part})]

    # ---- from the browser -----------------------------------------------------------------------

    async def _receive_all(self) -> None:
        while True:
            message = await self._socket.receive()
            if message["type"] == "websocket.disconnect":
                return
            text = message.get("text")
            await self._on_text(text if isinstance(text, str) else "")
            if self._bad >= MOST_BAD:
                log.warning("a browser sent %d bad messages and is let go", self._bad)
                await self._socket.close(1008, "too many bad messages")
                return

    async def _on_text(self, text: str) -> None:
        self._budget -= 1
        if self._budget < 0 and (ABORT not in text or len(self._aborts) >= MOST_PER_S):
            self._bad += 1
            return
        try:
            seen, order = _split(text)
            message = parse(order)
        except BadMessageError as error:
            self._bad += 1
            self._site.refused += 1
            await self._reply(None, Reply(False, f"not understood: {error}"))
            return
        # A greater tick is from another run.
        seen_tick = seen if seen is not None and seen <= self._sent["state"] else None
        if isinstance(message, Simple) and message.do == "abort" and self._role is Role.OPERATOR:
            # An abort waits for no earlier order and is exempt from their rate limit.
            task = asyncio.create_task(self._abort(message, seen_tick), name="abort from browser")
            self._aborts.add(task)
            task.add_done_callback(self._aborts.discard)
        elif isinstance(message, Facts):
            await self._send(json.dumps({"t": "facts", "id": message.id, **self._site.facts(message)}))
        elif self._role is not Role.OPERATOR:
            await self._reply(message.id, Reply(False, "this page may look only"))
        else:
            try:
                self._orders.put_nowait((message, seen_tick))
            except asyncio.QueueFull:
                await self._reply(message.id, Reply(False, "too many orders at once: try again"))

    async def _carry_out_all(self) -> None:
        """Execute orders one after the other."""
        while True:
            await self._answer(*await self._orders.get())

    async def _abort(self, message: Command, seen_tick: int | None) -> None:
        with contextlib.suppress(WebSocketDisconnect, TimeoutError, RuntimeError, OSError):  # disconnected
            await self._answer(message, seen_tick)

    async def _answer(self, message: Command, seen_tick: int | None) -> None:
        await self._reply(message.id, await self._site.answer(message, seen_tick))

    async def _reply(self, number: int | None, reply: Reply) -> None:
        document = {"t": "reply", "id": number, "ok": reply.accepted, "reason": reply.reason}
        await self._send(json.dumps(document))


def _split(text: str) -> tuple[int | None, str]:
    """Return the tick that the sender had seen, and the message, from `TICK JSON`."""
    tick, space, order = text.partition(" ")
    if not space or not (tick.isascii() and tick.isdigit() and len(tick) < 16):
        raise BadMessageError("a message is the tick last seen, a space and a JSON object")
    return int(tick), order
