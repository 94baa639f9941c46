"""Pacing of a free-running simulation to real time or a multiple of it."""

from __future__ import annotations

import select
import socket
import struct
import time
from collections.abc import Callable

from sitl.wire.wire import WireError

LONGEST_SLEEP_S = 0.1
SLOW = "too slow for real time: the simulated clocks fall behind; stop other programs or lower --point-rate"
SKIPPED = "too slow for real time: LiDAR scans are left out; stop other programs or lower --point-rate"
SKIPPED_NS = 1_000_000_000
SLIP_S = 2.0  # simulated lag behind the pace beyond which the lost time is not caught up


class LockstepServer:
    """Server for one client on the loopback interface."""

    def __init__(self, port: int = 0) -> None:
        self._server = socket.socket(socket.AF_INET, socket.SOCK_STREAM)
        self._server.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            self._server.bind(("127.0.0.1", port))
        except OSError as error:
            self._server.close()
            raise WireError(f"lockstep port {port}: {error.strerror}") from None
        self._server.listen(1)
        self.port = int(self._server.getsockname()[1])

    def serve(self, step: Callable[[], int], ended: Callable[[], bool]) -> None:
        """Step on request until the client disconnects or `ended` is true."""
        client = self._wait(ended)
        if client is None:
            return
        with client:
            client.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            while not ended():
                if not select.select([client], [], [], 0.2)[0]:
                    continue
                try:
                    asked = client.recv(1)
                    if not asked:
                        return
                    client.sendall(struct.pack("<q", step()))
                except OSError:
                    return

    def _wait(self, ended: Callable[[], bool]) -> socket.socket | None:
        while not ended():
            if select.select([self._server], [], [], 0.2)[0]:
                return self._server.accept()[0]
        return None

    def close(self) -> None:
        self._server.close()


class Pace:
    """Ratio of simulated to real time.

    A delayed simulation catches up, so that the clocks of its autopilot and sensors keep to real time, as
    those of a vehicle do.

    Parameters
    ----------
    pace
        Times real time; 0 is as fast as possible.
    say
        Called with lines for the user.
    ended
        Returns whether the simulation is over: a pause in slow motion must not delay its end.
    """

    def __init__(
        self,
        pace: float,
        say: Callable[[str], None] = lambda line: None,
        ended: Callable[[], bool] = lambda: False,
    ) -> None:
        self._pace = pace
        self._say = say
        self._ended = ended
        self._start_s: float | None = None
        self._slipped = False
        self._skipped = False

    def note_skipped(self, skipped_ns: int) -> None:
        """Say once that scans are left out, when those of a second are."""
        if skipped_ns > SKIPPED_NS and not self._skipped:
            self._skipped = True
            self._say(SKIPPED)

    def late_s(self, now_ns: int) -> float:
        """Return the lag of a simulated time behind its pace (simulated s); negative if it is ahead."""
        if self._pace == 0 or self._start_s is None:
            return 0.0
        return (time.monotonic() - self._start_s) * self._pace - now_ns * 1e-9

    def keep(self, now_ns: int) -> int:
        """Sleep while a simulated time, just reached, is ahead of its pace; return it."""
        if self._pace == 0:
            return now_ns
        if self._start_s is None:
            self._start_s = time.monotonic() - now_ns * 1e-9 / self._pace
        while (late_s := self.late_s(now_ns)) < -1e-3 * self._pace and not self._ended():
            time.sleep(min(-late_s / self._pace, LONGEST_SLEEP_S))
        if late_s > SLIP_S:
            self._start_s += late_s / self._pace
            if not self._slipped:
                self._slipped = True
                self._say(SLOW)
        return now_ns
