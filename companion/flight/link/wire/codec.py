"""MAVLink 2 encoder and decoder (dialect ardupilotmega, which includes common)."""

from __future__ import annotations

import logging
from collections import Counter
from collections.abc import Iterator
from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from companion.flight.link.wire.framing import Framer, is_signed, message_id, sender
from companion.flight.link.wire.repeated_frames import RepeatedFrames
from companion.flight.link.wire.signing import Signing, Verdict

log = logging.getLogger(__name__)

Message = Any  # pymavlink is untyped

# A larger step of the sequence number means that the sender restarted, not that this many frames were lost. A
# step of nearly a whole cycle is an old frame that arrived late.
LARGEST_GAP = 127
OUT_OF_ORDER = 16
# Messages that command an action or a change.
ORDERS = frozenset(
    {"COMMAND_LONG", "COMMAND_INT", "COMMAND_CANCEL", "PARAM_SET", "PARAM_EXT_SET", "SETUP_SIGNING"}
)


class Codec:
    """Encoder and decoder of one link.

    Parameters
    ----------
    component_id
        Component ID that we send with.
    signing
        Signs outgoing frames and verifies incoming ones; without it every frame is accepted, signed or not.

    Attributes
    ----------
    received, undecodable
        Number of frames decoded; number of whole frames that give no message.
    sent
        Number of messages encoded.
    repeated
        Recogniser of frames delivered more than once, with its counts.
    refused_orders
        Commands and parameter changes among the frames that `signing` refused.
    autopilot_verdict
        Verdict of `signing` on the newest frame of an autopilot, None before one.
    """

    def __init__(self, component_id: int, signing: Signing | None = None) -> None:
        self._mavlink = mavlink.MAVLink(None, srcSystem=1, srcComponent=component_id)
        self._reader = mavlink.MAVLink(None)  # without a key: signatures are verified before it decodes
        self.signing = signing
        if signing is not None:
            self._mavlink.signing.secret_key = signing.secret
            self._mavlink.signing.sign_outgoing = True
        self.refused_orders = 0
        self.autopilot_verdict: Verdict | None = None
        self._signers: set[int] = set()  # systems whose autopilot signed its newest frame
        self._warned: set[Verdict] = set()
        self._framer = Framer()
        self._sequences: dict[tuple[int, int], int] = {}
        self._heard: Counter[int] = Counter()  # frames of each system's autopilot
        self._lost: Counter[int] = Counter()
        self.repeated = RepeatedFrames()
        self.received = 0
        self.undecodable = 0
        self.sent = 0

    @property
    def system_id(self) -> int:
        """System ID that we send with: the vehicle's own once it is known."""
        return int(self._mavlink.srcSystem)

    @system_id.setter
    def system_id(self, system_id: int) -> None:
        self._mavlink.srcSystem = system_id

    @property
    def component_id(self) -> int:
        return int(self._mavlink.srcComponent)

    @property
    def vehicle_signs(self) -> bool:
        """True if the newest frame of the vehicle's autopilot was signed."""
        return self.system_id in self._signers

    @property
    def from_vehicle(self) -> int:
        """Number of decoded frames of the vehicle's autopilot."""
        return self._heard[self.system_id]

    @property
    def lost(self) -> int:
        """Gaps in the sequence numbers of the vehicle's autopilot; it forwards others' only in part."""
        return self._lost[self.system_id]

    @property
    def bad(self) -> int:
        """Number of candidates that were no valid frame."""
        return self._framer.bad_frames + self.undecodable

    @property
    def bad_bytes(self) -> int:
        return self._framer.bad_bytes

    @property
    def unknown(self) -> int:
        return self._framer.unknown

    def decode(self, data: bytes, at_ns: int | None = None) -> Iterator[Message]:
        """Return the messages that these bytes complete; never raises on received data.

        `at_ns`: time of arrival; without it, a frame that comes again is returned again.
        """
        for frame in self._framer.feed(data):
            self._note_signer(frame)
            if self.signing is not None and not self._believed(frame, self.signing):
                continue
            try:
                message = self._reader.decode(frame)
            except mavlink.MAVError:
                self.undecodable += 1
                continue
            self.received += 1
            if at_ns is not None and self.repeated.is_copy(message, at_ns):
                continue
            self._follow(message)
            yield message

    def encode(self, message: Message) -> bytes:
        """Return the frame of a message with the next sequence number.

        Raises
        ------
        struct.error, TypeError
            If a field does not fit its type: a fault of the program, not of the link.
        """
        if self.signing is not None:
            self._mavlink.signing.timestamp = self.signing.next_tick()
        frame = bytes(message.pack(self._mavlink))
        self._mavlink.seq = (self._mavlink.seq + 1) % 256
        self.sent += 1
        return frame

    def reset(self) -> None:
        """Discard partial frames and sequence numbers, because the channel is a new one."""
        self._framer.reset()
        self._sequences.clear()

    def _note_signer(self, frame: bytearray) -> None:
        system, component = sender(frame)
        if component == mavlink.MAV_COMP_ID_AUTOPILOT1:
            (self._signers.add if is_signed(frame) else self._signers.discard)(system)

    def _believed(self, frame: bytearray, signing: Signing) -> bool:
        verdict = signing.verify(frame)
        if sender(frame)[1] == mavlink.MAV_COMP_ID_AUTOPILOT1:
            self.autopilot_verdict = verdict
        if verdict in ("good", "allowed"):
            return True
        name = mavlink.mavlink_map[message_id(frame)].msgname
        self.refused_orders += name in ORDERS
        if verdict not in self._warned:
            self._warned.add(verdict)
            log.warning("%s frames are refused: a key is set (the first was %s)", verdict, name)
        return False

    def _follow(self, message: Message) -> None:
        sender = (message.get_srcSystem(), message.get_srcComponent())
        sequence = message.get_seq()
        last = self._sequences.get(sender)
        step = 1 if last is None else (sequence - last) % 256
        if sender[1] == mavlink.MAV_COMP_ID_AUTOPILOT1:
            self._heard[sender[0]] += 1
            self._lost[sender[0]] += step - 1 if 1 <= step <= LARGEST_GAP else 0
        if 1 <= step <= LARGEST_GAP or LARGEST_GAP < step < 256 - OUT_OF_ORDER:
            self._sequences[sender] = sequence
