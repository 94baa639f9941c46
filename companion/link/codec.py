"""MAVLink messages to bytes and back (MAVLink 2, the dialect ardupilotmega, which includes common)."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from companion.link.framing import Framer

Message = Any  # pymavlink is untyped

# A larger step of the sequence number means that the sender began anew, not that so many frames were lost;
# unless it is nearly a whole turn: then it is an old frame come late.
LARGEST_GAP = 127
OUT_OF_ORDER = 16


class Codec:
    """Both directions of one link.

    Attributes
    ----------
    received, lost, undecodable
        Frames decoded; gaps in the senders' sequence numbers; frames that are whole but make no message.
    sent
        Messages encoded.
    """

    def __init__(self, component_id: int) -> None:
        self._mavlink = mavlink.MAVLink(None, srcSystem=1, srcComponent=component_id)
        self._framer = Framer()
        self._sequences: dict[tuple[int, int], int] = {}
        self.received = 0
        self.lost = 0
        self.undecodable = 0
        self.sent = 0

    @property
    def system_id(self) -> int:
        """System that we speak as: the vehicle's own once it is known."""
        return int(self._mavlink.srcSystem)

    @system_id.setter
    def system_id(self, system_id: int) -> None:
        self._mavlink.srcSystem = system_id

    @property
    def component_id(self) -> int:
        return int(self._mavlink.srcComponent)

    @property
    def bad(self) -> int:
        """Candidates that were no valid frame."""
        return self._framer.bad_frames + self.undecodable

    @property
    def bad_bytes(self) -> int:
        return self._framer.bad_bytes

    @property
    def unknown(self) -> int:
        return self._framer.unknown

    def decode(self, data: bytes) -> Iterator[Message]:
        """Return the messages that these bytes complete; never raises on what came over the wire."""
        for frame in self._framer.feed(data):
            try:
                message = self._mavlink.decode(frame)
            except mavlink.MAVError:
                self.undecodable += 1
                continue
            self.received += 1
            self._follow(message)
            yield message

    def encode(self, message: Message) -> bytes:
        """Return the frame of a message, numbered in sequence.

        Raises
        ------
        struct.error, TypeError
            If a field does not fit its type: a fault of the program, not of the wire.
        """
        frame = bytes(message.pack(self._mavlink))
        self._mavlink.seq = (self._mavlink.seq + 1) % 256
        self.sent += 1
        return frame

    def restart(self) -> None:
        """Forget partial frames and sequence numbers: the channel is a new one."""
        self._framer.reset()
        self._sequences.clear()

    def _follow(self, message: Message) -> None:
        sender = (message.get_srcSystem(), message.get_srcComponent())
        sequence = message.get_seq()
        last = self._sequences.get(sender)
        step = 1 if last is None else (sequence - last) % 256
        if 1 <= step <= LARGEST_GAP:
            self.lost += step - 1
            self._sequences[sender] = sequence
        elif LARGEST_GAP < step < 256 - OUT_OF_ORDER:
            self._sequences[sender] = sequence
