"""Server for commands addressed to the companion: answers each one and executes none twice."""

from __future__ import annotations

from collections import OrderedDict, deque
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as mavlink

# Frames whose x and y are degrees x 1e7; in all others they are metres x 1e4.
_GLOBAL_FRAMES = frozenset(
    {
        mavlink.MAV_FRAME_GLOBAL,
        mavlink.MAV_FRAME_GLOBAL_RELATIVE_ALT,
        mavlink.MAV_FRAME_GLOBAL_INT,
        mavlink.MAV_FRAME_GLOBAL_RELATIVE_ALT_INT,
        mavlink.MAV_FRAME_GLOBAL_TERRAIN_ALT,
        mavlink.MAV_FRAME_GLOBAL_TERRAIN_ALT_INT,
    }
)
# Within this time, an equal command is a retransmission, unless the first was refused or is no longer in
# effect. A raised confirmation counter extends the time and lifts the condition.
REPEAT_NS = 1_500_000_000
COUNTED_REPEAT_NS = 10_000_000_000
MAX_SENDERS = 16
MAX_COMMANDS = 8


@dataclass(frozen=True, slots=True)
class OperatorCommand:
    """Command to this component.

    Attributes
    ----------
    params
        Parameters 1 to 4 (NaN where the sender left one open).
    x, y, z
        Parameters 5 to 7: degrees and metres in global frames and in COMMAND_LONG (there in single precision,
        accurate to a metre), metres in local frames.
    frame
        MAV_FRAME of x, y, z; None in COMMAND_LONG.
    """

    command: int
    params: tuple[float, float, float, float]
    x: float
    y: float
    z: float
    frame: int | None
    sender_system: int
    sender_component: int


@dataclass(frozen=True, slots=True)
class CommandReply:
    """Answer to a command: a MAV_RESULT, and a reason for the pilot's screen (empty: none).

    Attributes
    ----------
    always
        Execute the command each time it arrives; never treat it as a retransmission.
    is_in_effect
        Returns whether the command is still in effect; if not, an equal command is a new one.
    """

    result: int
    reason: str = ""
    always: bool = False
    is_in_effect: Callable[[], bool] = lambda: True

    @classmethod
    def accepted(cls, reason: str = "") -> CommandReply:
        """Return the answer to a command that is carried out."""
        return cls(mavlink.MAV_RESULT_ACCEPTED, reason)

    @classmethod
    def denied(cls, reason: str) -> CommandReply:
        """Return the answer to a command that is refused."""
        return cls(mavlink.MAV_RESULT_DENIED, reason)

    @classmethod
    def temporarily_rejected(cls, reason: str) -> CommandReply:
        """Return the answer to a command that may succeed at another time."""
        return cls(mavlink.MAV_RESULT_TEMPORARILY_REJECTED, reason)

    @classmethod
    def unsupported(cls) -> CommandReply:
        """Return the answer to a command that is not implemented here."""
        return cls(mavlink.MAV_RESULT_UNSUPPORTED)


Handler = Callable[[OperatorCommand], CommandReply]


@dataclass(frozen=True, slots=True)
class Answer:
    """Acknowledgement to send, the reply, and whether the command was executed just now."""

    ack: Any
    reply: CommandReply
    executed: bool


@dataclass(slots=True)
class _Done:
    command: OperatorCommand
    sequence: int
    confirmation: int
    heard_ns: int
    reply: CommandReply


class CommandServer:
    """Server for COMMAND_LONG and COMMAND_INT.

    Only the newest command of a sender can be repeated: after a different one, an equal command is a new one
    (land, abort, land). For the few commands before it, only a frame that the network delivered twice is
    recognised.

    Attributes
    ----------
    handler
        Executes a command and answers it; None: every command is unsupported.
    handlers
        Handlers of single commands by their number, instead of `handler`.
    executed, repeated
        Number of commands given to the handler; number of retransmissions answered from memory.
    """

    def __init__(self) -> None:
        self.handler: Handler | None = None
        self.handlers: dict[int, Handler] = {}
        self.executed = 0
        self.repeated = 0
        self._done: OrderedDict[tuple[int, int], deque[_Done]] = OrderedDict()

    def handle_command(self, message: Any, system: int, component: int, now_ns: int) -> Answer | None:
        """Return the answer to a command, None if it is not addressed to this component."""
        if (message.target_system, message.target_component) != (system, component):
            return None
        command = _command(message)
        confirmation = getattr(message, "confirmation", 0)
        sender = (command.sender_system, command.sender_component)
        done = self._done.setdefault(sender, deque(maxlen=MAX_COMMANDS))
        earlier = _repeated(reversed(done), command, confirmation, message.get_seq(), now_ns)
        if earlier is not None:
            self.repeated += 1
            earlier.confirmation = confirmation
            return Answer(_ack(command, earlier.reply), earlier.reply, executed=False)
        handler = self.handlers.get(command.command, self.handler)
        reply = CommandReply.unsupported() if handler is None else handler(command)
        self.executed += 1
        done.append(_Done(command, message.get_seq(), confirmation, now_ns, reply))
        self._done.move_to_end(sender)
        if len(self._done) > MAX_SENDERS:
            self._done.popitem(last=False)
        return Answer(_ack(command, reply), reply, executed=True)


def _repeated(
    done: Iterable[_Done], command: OperatorCommand, confirmation: int, sequence: int, now_ns: int
) -> _Done | None:
    """Return the sender's earlier command that this one repeats, searching the newest first."""
    for number, old in enumerate(done):
        # repr, because an open parameter is NaN, which equals nothing
        if repr(old.command) == repr(command) and _repeats(
            old, number == 0, confirmation, sequence, now_ns - old.heard_ns
        ):
            return old
    return None


def _repeats(old: _Done, newest: bool, confirmation: int, sequence: int, age_ns: int) -> bool:
    """Return whether an equal command, `age_ns` later, is a repetition of an old one."""
    if sequence == old.sequence:  # the same frame, delivered twice
        return age_ns <= (COUNTED_REPEAT_NS if newest else REPEAT_NS)
    if not newest or old.reply.always:
        return False
    if confirmation > old.confirmation:
        return age_ns <= COUNTED_REPEAT_NS
    accepted = old.reply.result == mavlink.MAV_RESULT_ACCEPTED
    return accepted and old.reply.is_in_effect() and age_ns <= REPEAT_NS


def _command(m: Any) -> OperatorCommand:
    params = (m.param1, m.param2, m.param3, m.param4)
    sender = (m.get_srcSystem(), m.get_srcComponent())
    if m.get_type() == "COMMAND_LONG":
        return OperatorCommand(m.command, params, m.param5, m.param6, m.param7, None, *sender)
    scale = 1e-7 if m.frame in _GLOBAL_FRAMES else 1e-4
    return OperatorCommand(m.command, params, m.x * scale, m.y * scale, m.z, m.frame, *sender)


def _ack(command: OperatorCommand, reply: CommandReply) -> Any:
    return mavlink.MAVLink_command_ack_message(
        command.command, reply.result, 255, 0, command.sender_system, command.sender_component
    )
