"""Serial port, or a USB autopilot that appears as one.

pyserial opens and configures the port. Reading and writing are implemented here, because its write spins for
ever, and the whole program with it, when the kernel's buffer is exactly full (pyserial 3.5, which
pyserial-asyncio-fast calls in the event loop).
"""

from __future__ import annotations

import asyncio
import os
import termios

import serial

from companion.flight.link.transport.channel import MAX_BACKLOG_BYTES, Channel, OnBytes
from companion.flight.link.transport.mavlink_url import Url

READ_BYTES = 4096


async def open_serial(url: Url, on_bytes: OnBytes) -> Channel:
    """Open the device exclusively; raise OSError on failure."""
    if not os.path.exists(url.device):  # noqa: ASYNC240 - a look at /dev never waits
        raise FileNotFoundError(2, "no such device", url.device)
    try:
        port = serial.Serial(url.device, baudrate=url.baud, exclusive=True, timeout=0)
    except serial.SerialException as error:
        cause = error.__context__
        if isinstance(cause, termios.error):  # pyserial hides the errno in the text
            raise OSError(*cause.args) from None
        raise
    except termios.error as error:  # no OSError: the device disappeared during its configuration
        raise OSError(*error.args) from None
    except ValueError as error:  # a baud rate that the port does not support
        raise OSError(22, str(error)) from None
    return SerialChannel(port, on_bytes)


class SerialChannel:
    """Open serial port as a channel."""

    def __init__(self, port: serial.Serial, on_bytes: OnBytes) -> None:
        self._loop = asyncio.get_running_loop()
        self.lost: asyncio.Future[str] = self._loop.create_future()
        self._port = port
        self._descriptor: int = port.fileno()
        self._on_bytes = on_bytes
        self._backlog = bytearray()
        self._loop.add_reader(self._descriptor, self._read)

    def write(self, data: bytes) -> bool:
        if self.lost.done() or len(self._backlog) > MAX_BACKLOG_BYTES:
            return False
        waiting = bool(self._backlog)
        self._backlog += data
        if not waiting:
            self._flush()
        return True

    def _flush(self) -> None:
        try:
            sent = os.write(self._descriptor, self._backlog)
        except BlockingIOError:
            sent = 0
        except OSError as error:
            self._end(error.strerror or str(error))
            return
        del self._backlog[:sent]
        if self._backlog:
            self._loop.add_writer(self._descriptor, self._flush)
        else:
            self._loop.remove_writer(self._descriptor)

    def _read(self) -> None:
        try:
            data = os.read(self._descriptor, READ_BYTES)
        except BlockingIOError:
            return
        except OSError as error:
            self._end(error.strerror or str(error))
            return
        if data:
            self._on_bytes(data)
        else:  # readable without data: the device has gone
            self._end("unplugged")

    def close(self) -> None:
        self._end("closed")

    def _end(self, reason: str) -> None:
        if self.lost.done():
            return
        self._loop.remove_reader(self._descriptor)
        self._loop.remove_writer(self._descriptor)
        try:
            if self._backlog:  # the line is stalled; the kernel would wait half a minute for it to drain
                self._port.reset_output_buffer()
            self._port.close()
        except (OSError, termios.error) as error:  # the device has gone already
            reason = f"{reason} ({error})"
        self.lost.set_result(reason)
