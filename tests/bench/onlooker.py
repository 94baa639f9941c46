"""Headless page clients that listen and fetch the map as the page's scripts do.

`python -m tests.bench.onlooker HOST:PORT COUNT LEVEL` runs until its parent closes stdin, and prints the
number of received bytes and blocks.
"""

from __future__ import annotations

import asyncio
import contextlib
import json
import sys
import time
from http.client import HTTPConnection

from websockets.asyncio.client import connect

LEAST_AGE_S = 2.0
AT_ONCE = 3


class Onlooker:
    """One browser, with the whole map in view at one level."""

    def __init__(self, host: str, level: int) -> None:
        self._host, self._level = host, level
        self._due: dict[tuple[str, int, int, int], float] = {}
        self.blocks = self.bytes = 0

    async def run(self) -> None:
        """Look until cancelled."""
        async with asyncio.TaskGroup() as group:
            group.create_task(self._listen())
            for _ in range(AT_ONCE):
                group.create_task(self._fetch())

    async def _listen(self) -> None:
        url, origin = f"ws://{self._host}/live", f"http://{self._host}"
        async with connect(url, origin=origin, max_size=None, proxy=None) as page:  # type: ignore[arg-type]
            async for text in page:
                self.bytes += len(text)
                message = json.loads(text)
                for name, changes in message.get("changes", {}).items() if message["t"] == "map" else ():
                    serial = message["heads"][name]["serial"]
                    for row, col, _ in changes:
                        self._due.setdefault((name, serial, row >> self._level, col >> self._level), 0.0)

    async def _fetch(self) -> None:
        fetched: dict[tuple[str, int, int, int], float] = {}
        host, _, port = self._host.rpartition(":")
        connection = HTTPConnection(host, int(port), timeout=30)
        while True:
            ready = [key for key in self._due if time.monotonic() - fetched.get(key, -9) > LEAST_AGE_S]
            if not ready:
                await asyncio.sleep(0.05)
                continue
            key = ready[0]
            self._due.pop(key)
            fetched[key] = time.monotonic()
            self.bytes += await asyncio.to_thread(self._get, connection, key)
            self.blocks += 1

    def _get(self, connection: HTTPConnection, key: tuple[str, int, int, int]) -> int:
        name, serial, row, col = key
        connection.request("GET", f"/map/{name}/{serial}/{self._level}/{row}/{col}")
        return len(connection.getresponse().read())


async def main(host: str, count: int, level: int) -> None:
    """Look until stdin ends."""
    lookers = [Onlooker(host, level) for _ in range(count)]
    tasks = [asyncio.create_task(looker.run()) for looker in lookers]
    print("ready", flush=True)
    await asyncio.to_thread(sys.stdin.read)
    for task in tasks:
        task.cancel()
    await asyncio.gather(*tasks, return_exceptions=True)
    with contextlib.suppress(BrokenPipeError):  # nobody may want to know
        told = {"blocks": sum(x.blocks for x in lookers), "bytes": sum(x.bytes for x in lookers)}
        print(json.dumps(told), flush=True)


if __name__ == "__main__":
    asyncio.run(main(sys.argv[1], int(sys.argv[2]), int(sys.argv[3])))
