"""MAVProxy as a program, controlled through its command line."""

from __future__ import annotations

import asyncio
import contextlib
import os
from asyncio.subprocess import PIPE, STDOUT, Process
from collections.abc import AsyncIterator
from pathlib import Path

LIMIT_S = 90.0
UNBUFFERED = {**os.environ, "PYTHONUNBUFFERED": "1"}  # what it prints must not wait for its next prompt


class Station:
    """A running MAVProxy: what it is told, and what it has printed."""

    def __init__(self, process: Process) -> None:
        self._process = process
        self.printed = ""

    @classmethod
    @contextlib.asynccontextmanager
    async def at(cls, program: Path, port: int, folder: Path, *first: str) -> AsyncIterator[Station]:
        """Start it as a client of a TCP port; `first` are commands before it connects."""
        command = [str(program), f"--master=tcp:127.0.0.1:{port}", "--source-system=254"]
        command += ["--default-modules=param,rally,signing", f"--state-basedir={folder}"]
        command += [f"--cmd={'; '.join(first)}"] if first else []
        process = await asyncio.create_subprocess_exec(
            *command, stdin=PIPE, stdout=PIPE, stderr=STDOUT, cwd=folder, env=UNBUFFERED
        )
        station = cls(process)
        reader = asyncio.create_task(station.read())
        try:
            yield station
        finally:
            if process.returncode is None:
                process.kill()
            await process.wait()
            await reader

    async def read(self) -> None:
        assert self._process.stdout is not None
        while data := await self._process.stdout.read(4096):
            self.printed += data.decode("utf-8", "replace")

    async def says(self, line: str) -> None:
        """Type a command."""
        assert self._process.stdin is not None
        self._process.stdin.write(f"{line}\n".encode())
        await self._process.stdin.drain()

    async def hears(self, text: str) -> None:
        """Wait until it has printed something; what came before is then forgotten."""
        try:
            async with asyncio.timeout(LIMIT_S):
                while text not in self.printed:
                    await asyncio.sleep(0.05)
        except TimeoutError:
            raise AssertionError(f"no {text!r} in {self.printed[-2000:]}") from None
        self.printed = self.printed.partition(text)[2]
