"""Web server of the page, in a thread with an event loop of its own."""

from __future__ import annotations

import asyncio
import functools
import logging
import socket
import threading
from collections.abc import Callable

import uvicorn

from companion.flight.dashboard.browser_orders import MOST_BYTES
from companion.flight.dashboard.routes import make_app
from companion.flight.dashboard.security.http_connection import Connection
from companion.flight.dashboard.site import Site

log = logging.getLogger(__name__)

STOP_S = 3.0


class Server:
    """One run of the web server; a new instance is needed to serve again.

    Parameters
    ----------
    make_site
        Called in the thread.
    sock
        Listening socket, which stays open for the next run.
    """

    def __init__(self, make_site: Callable[[], Site], sock: socket.socket) -> None:
        self._make_site, self._socket = make_site, sock
        self._uvicorn: uvicorn.Server | None = None
        self._stopping = False
        self.failure: BaseException | None = None
        self._thread = threading.Thread(target=self._run, name="slz-page", daemon=True)

    def start(self) -> None:
        """Start the thread."""
        self._thread.start()

    @property
    def alive(self) -> bool:
        """True if the thread runs."""
        return self._thread.is_alive()

    def ask_to_stop(self) -> None:
        """Request the end of the thread without waiting for it."""
        self._stopping = True
        if self._uvicorn is not None:
            self._uvicorn.should_exit = self._uvicorn.force_exit = True

    def stop(self) -> None:
        """Stop the thread; wait at most `STOP_S` for it."""
        self.ask_to_stop()
        if self._thread.is_alive():
            self._thread.join(STOP_S)

    def _run(self) -> None:
        try:
            asyncio.run(self._serve())
        except BaseException as error:
            self.failure = error

    async def _serve(self) -> None:
        site = self._make_site()
        config = uvicorn.Config(
            make_app(site),
            lifespan="off",
            log_config=None,
            log_level=logging.ERROR,  # bad requests of strangers are not worth a line
            access_log=False,
            ws="websockets-sansio",
            ws_max_size=MOST_BYTES + 32,
            ws_per_message_deflate=False,
            h11_max_incomplete_event_size=16_384,
            backlog=64,
            timeout_keep_alive=10,
            timeout_graceful_shutdown=1,
            server_header=False,
            proxy_headers=False,  # any program on this computer could forge the address in them
            http=functools.partial(Connection, incidents=site.token_check.incidents),  # type: ignore[arg-type]
        )
        server = self._uvicorn = uvicorn.Server(config)
        server.should_exit = self._stopping
        keeping = asyncio.create_task(site.run(), name="page site")
        serving = asyncio.create_task(server.serve(sockets=[self._socket.dup()]), name="page server")
        try:
            done, _ = await asyncio.wait({keeping, serving}, return_when=asyncio.FIRST_COMPLETED)
            for task in done:
                task.result()
        finally:
            server.should_exit = True
            keeping.cancel()
            await asyncio.gather(keeping, serving, return_exceptions=True)
            site.close()
