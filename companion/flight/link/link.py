"""MAVLink link of the companion: one vehicle, its state, its clock, commands in both directions."""

from __future__ import annotations

import asyncio
import logging
from collections import defaultdict
from collections.abc import Callable
from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from companion.flight.link.autopilots.autopilot_interface import Stream
from companion.flight.link.command import Command, CommandResult
from companion.flight.link.command_server import CommandServer, Handler
from companion.flight.link.commander import Commander
from companion.flight.link.inbox import Inbox
from companion.flight.link.link_statistics import LinkStatistics, RateMeter, quantile_ms
from companion.flight.link.message_rates import OldMessageWatch, StreamKeeper, wanted
from companion.flight.link.position_fix import PATIENCE_NS, PositionGate
from companion.flight.link.statustext import statustext
from companion.flight.link.transport.mavlink_url import parse_url
from companion.flight.link.transport.reconnecting import Transport
from companion.flight.link.unheard_texts import UnheardTexts
from companion.flight.link.vehicle_identity import LISTEN_NS, Candidate, VehicleIdentity
from companion.flight.link.vehicle_state import VehicleState
from companion.flight.link.wire.codec import Codec
from companion.flight.link.wire.key_mismatch import KeyMismatch
from companion.flight.link.wire.signing import Signing
from companion.runtime.clock import now_ns
from companion.runtime.event import Event, Unsubscribe
from params import Parameters

log = logging.getLogger(__name__)

TICK_S = 0.05
HEARTBEAT_S = 1.0
STREAM_PAUSE_S = 0.1
# The new mode is in the next heartbeat, at most a second later.
MODE_CONFIRM_S = 2.5
# A vehicle that hears us answers a TIMESYNC a second, and signs with times after ours from then on.
UNANSWERED_NS, MISMATCH_NS = 2_000_000_000, 2_000_000_000


class Link:
    """MAVLink link to one vehicle.

    Parameters
    ----------
    url
        MAVLink URL, see `companion.flight.link.transport.mavlink_url.parse_url`.
    parameters
        Uses `component_id`, `pose_rate_hz` and `link_timeout_s`.
    signing
        Signs outgoing messages; incoming messages must then be signed, too.
    identity
        Selects the system that is the vehicle; None selects the only aircraft heard in the first 2.5 s.
    alone
        Whether `run` raises an error when two systems may be the vehicle; otherwise none is chosen, and
        `identity.ambiguous` is set.

    Attributes
    ----------
    inbox
        Receiver of the vehicle's messages, with its state, its clock and their events.
    identity
        Selection of the system that is the vehicle.
    connected
        Whether the autopilot's heartbeat was heard within `link_timeout_s`.
    key_mismatch
        How the keys of signing have separated us from the vehicle for two seconds, None if they agree.
    system_status
        MAV_STATE of our own heartbeat; `ready` sets it.
    on_connection
        Event (connected) when the autopilot is found, lost or found again.
    on_text
        Event (text, severity) of each text shown to the pilot.
    on_frame, on_sent, on_time_asked
        Events of the wire, for recordings: (message, now_ns) before it is processed; (frame); (now_ns) of
        each request for the autopilot's time.

    Raises
    ------
    UsageError
        If the URL is invalid.
    """

    def __init__(
        self,
        url: str,
        parameters: Parameters,
        signing: Signing | None = None,
        identity: VehicleIdentity | None = None,
        *,
        alone: bool = True,
    ) -> None:
        self._parameters = parameters
        self._transport = Transport(parse_url(url))
        self._codec = Codec(parameters.component_id, signing)
        self._server = CommandServer()
        self.identity = VehicleIdentity(listen_ns=LISTEN_NS) if identity is None else identity
        self._alone = alone
        self.inbox = Inbox(self._codec, self._server, self.identity, PositionGate(PATIENCE_NS))
        self._streams = StreamKeeper()
        self._commander = Commander(self._send_command)
        self._rates = RateMeter()
        self._subscribers: defaultdict[tuple[str, bool], Event[[Any, int]]] = defaultdict(Event)
        self._text_id = 0
        self._unheard = UnheardTexts()
        self._old_messages = OldMessageWatch()
        self._stop: asyncio.Event | None = None
        self._failure: asyncio.Future[None] | None = None
        self._ended = asyncio.Event()
        self.connected = False
        self.key_mismatch: KeyMismatch | None = None
        self._keys_agreed_ns: int | None = None
        self.system_status: int = mavlink.MAV_STATE_BOOT
        self.on_connection: Event[[bool]] = Event()
        self.on_text: Event[[str, int]] = Event()
        self.on_frame: Event[[Any, int]] = Event()
        self.on_sent: Event[[bytes]] = Event()
        self.on_time_asked: Event[[int]] = Event()
        self.inbox.on_answer.subscribe(self.send)
        self.inbox.on_reason.subscribe(self._tell_reason)
        self.inbox.on_acknowledgement.subscribe(self._commander.acknowledge)
        self.inbox.on_heartbeat.subscribe(self._heard)
        self.inbox.on_reboot.subscribe(self._streams.reset)
        self.inbox.on_stranger.subscribe(self._warn_of)

    # ---- state ----------------------------------------------------------------------------------

    @property
    def vehicle(self) -> VehicleState:
        """Newest state of the vehicle."""
        return self.inbox.vehicle

    @property
    def no_command_reason(self) -> str:
        """Reason not to command the vehicle (its class, or that it ignores us), empty if it may be."""
        ignored = self.key_mismatch if self.key_mismatch is KeyMismatch.NO_KEY else None
        return self.vehicle.no_command_reason or ("" if ignored is None else ignored.value)

    def has_lost_fix(self) -> bool:
        """Return whether the receiver had a fix and has none now."""
        return self.vehicle.health.fix_lost

    @property
    def system_id(self) -> int:
        """System ID that we send with, the vehicle's once it is known."""
        return self._codec.system_id

    @property
    def component_id(self) -> int:
        """Component ID that we send with."""
        return self._codec.component_id

    @property
    def ready(self) -> bool:
        """True if our heartbeat reports MAV_STATE_ACTIVE instead of MAV_STATE_BOOT."""
        return bool(self.system_status == mavlink.MAV_STATE_ACTIVE)

    @ready.setter
    def ready(self, ready: bool) -> None:
        self.system_status = mavlink.MAV_STATE_ACTIVE if ready else mavlink.MAV_STATE_BOOT

    def statistics(self) -> LinkStatistics:
        """Return counters, rates and the state of the clock."""
        at_ns, codec, clock = now_ns(), self._codec, self.inbox.clock
        sync, signing = clock.timesync, codec.signing
        return LinkStatistics(
            received=codec.received,
            from_vehicle=codec.from_vehicle,
            lost=codec.lost,
            bad=codec.bad,
            bad_bytes=codec.bad_bytes,
            unknown=codec.unknown,
            sent=codec.sent,
            dropped=self._transport.dropped,
            foreign=self.inbox.foreign,
            copies=codec.repeated.copies,
            old=self._old_count,
            opened=self._transport.opened,
            rates_hz=self._rates.rates_hz(at_ns),
            missing=self._streams.missing(at_ns),
            refused=self._streams.refused,
            key_mismatch="" if self.key_mismatch is None else self.key_mismatch.value,
            time_source=clock.source,
            round_trip_ms=sync.round_trip_ns * 1e-6,
            residual_ms=sync.residual_ns * 1e-6,
            worst_residual_ms=sync.worst_residual_ns * 1e-6,
            delay_p50_ms=quantile_ms(clock.delays_ns, 0.5),
            delay_p99_ms=quantile_ms(clock.delays_ns, 0.99),
            drift_ppm=sync.drift_ppm,
            time_resets=sync.resets,
            implausible_stamps=clock.implausible,
            commands_executed=self._server.executed,
            commands_repeated=self._server.repeated,
            unsigned=signing.unsigned if signing else 0,
            forged=signing.forged if signing else 0,
            replayed=signing.replayed if signing else 0,
            orders_refused=codec.refused_orders,
        )

    @property
    def _old_count(self) -> int:
        return self._codec.repeated.old_copies + self.inbox.followed.order.old

    # ---- subscriptions --------------------------------------------------------------------------

    def subscribe(
        self, type_name: str, handler: Callable[[Any, int], None], *, anyone: bool = False
    ) -> Unsubscribe:
        """Call `handler(message, now_ns)` for each message of a type from the vehicle, or from anyone."""
        return self._subscribers[type_name, anyone].subscribe(handler)

    def on_command(self, handler: Handler, number: int | None = None) -> None:
        """Set the handler that executes and answers commands addressed to this component.

        With a number it is for that command alone, otherwise for all without a handler of their own.
        """
        if number is None:
            self._server.handler = handler
        else:
            self._server.handlers[number] = handler

    # ---- sending --------------------------------------------------------------------------------

    def send(self, message: Any) -> None:
        """Send a message as this component; it is dropped and counted while no channel is open."""
        frame = self._codec.encode(message)
        self._transport.write(frame)
        self.on_sent.emit(frame)

    async def command(
        self,
        command_id: int,
        *params: float,
        frame: int | None = None,
        x: int = 0,
        y: int = 0,
        z: float = 0.0,
        timeout_s: float = 1.5,
        tries: int = 3,
        supersede: bool = False,
    ) -> CommandResult:
        """Send the vehicle a command and wait for its result.

        Parameters
        ----------
        params
            Up to seven of COMMAND_LONG; with a `frame` (COMMAND_INT) the first four, and x, y (degrees
            x 1e7, in local frames metres x 1e4) and z (m).
        supersede
            End an earlier command of this number instead of waiting for its result.
        """
        command = Command(command_id, params, frame, x, y, z)
        return await self._commander.run(command, timeout_s=timeout_s, tries=tries, supersede=supersede)

    async def set_mode(self, name: str, timeout_s: float = 1.5, tries: int = 3) -> CommandResult:
        """Request a flight mode by name and wait until the vehicle reports it."""
        command_id = mavlink.MAV_CMD_DO_SET_MODE
        numbers = self.vehicle.autopilot.mode_parameters(self.vehicle.vehicle_type, name)
        if numbers is None:
            return CommandResult(command_id, "unsupported")
        custom = float(mavlink.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED)
        result = await self.command(
            command_id, custom, *numbers, timeout_s=timeout_s, tries=tries, supersede=True
        )
        if not result.ok or await self._sees_mode(name):
            return result
        return CommandResult(command_id, "unconfirmed", result.tries)

    def statustext(self, text: str, severity: int) -> None:
        """Show a text to the pilot (MAV_SEVERITY 0 emergency to 7 debug)."""
        self._send_text(text, severity)
        if self._stop is not None:  # before `run` there is no clock and no receiver
            self._unheard.record(text, severity, now_ns())
        self.on_text.emit(text, severity)

    def note_lasting(self, text: str) -> None:
        """Note the text about the state that lasts now, "" without one: only that is said again."""
        self._unheard.lasting = text

    def _send_text(self, text: str, severity: int) -> None:
        self._text_id = self._text_id % 65535 + 1
        for message in statustext(text, severity, self._text_id):
            self.send(message)

    # ---- life cycle -----------------------------------------------------------------------------

    async def run(self) -> None:
        """Run the link until `close` or cancelled; the last heartbeat is MAV_STATE_POWEROFF.

        Raises
        ------
        UsageError
            If the address can never be opened, or two systems may be the vehicle.
        Exception
            Any exception of a subscriber.
        """
        self._stop, self._failure = asyncio.Event(), asyncio.get_running_loop().create_future()
        self._ended.clear()
        try:
            async with asyncio.TaskGroup() as group:
                tasks = [
                    group.create_task(
                        self._transport.run(self._on_bytes, self._on_up), name="link transport"
                    ),
                    group.create_task(self._beat(), name="link heartbeat"),
                    group.create_task(self._tick(), name="link clock and watch"),
                    group.create_task(self._keep_streams(), name="link streams"),
                    group.create_task(_wait_for(self._failure), name="link failure"),
                ]
                try:
                    await self._stop.wait()
                finally:  # closed, cancelled or failed: while the channel is still open
                    self._send_heartbeat(mavlink.MAV_STATE_POWEROFF)
                for task in tasks:
                    task.cancel()
        except BaseExceptionGroup as failures:
            raise failures.exceptions[0] from None
        finally:
            self.connected = False
            self._stop = None
            self._ended.set()

    async def close(self) -> None:
        """Let `run` send its last heartbeat, close the channel and return; no-op if it is not running."""
        if self._stop is None:
            return
        self._stop.set()
        await self._ended.wait()

    def _on_up(self) -> None:
        self._codec.reset()
        self._streams.reset()
        self._send_heartbeat()

    def _on_bytes(self, data: bytes) -> None:
        """Decode and process bytes from the wire; an exception here is our own fault and ends `run`."""
        try:
            at_ns = now_ns()
            for message in self._codec.decode(data, at_ns):
                self._on_message(message, at_ns)
        except Exception as error:
            if self._failure is not None and not self._failure.done():
                self._failure.set_exception(error)

    def _on_message(self, message: Any, at_ns: int) -> None:
        self.on_frame.emit(message, at_ns)
        name = message.get_type()
        from_vehicle = self.inbox.on_message(message, at_ns)
        if from_vehicle:
            self._rates.record(name, at_ns)
            self._streams.record_arrival(name, at_ns)
            for text, severity in self._unheard.on_heard(at_ns):
                self._send_text(text, severity)
        for key in ((name, True), ("*", True), (name, False)):
            if key in self._subscribers and (key[1] or from_vehicle):
                self._subscribers[key].emit(message, at_ns)

    # ---- tasks ----------------------------------------------------------------------------------

    async def _beat(self) -> None:
        while True:
            self._send_heartbeat()
            await asyncio.sleep(HEARTBEAT_S)

    async def _tick(self) -> None:
        while True:
            at_ns, timeout_ns = now_ns(), round(self._parameters.link_timeout_s * 1e9)
            self.inbox.confirm_vehicle(at_ns)
            if self._alone and self.identity.ambiguous:
                raise self.identity.error()
            if self._old_messages.is_news(self._old_count, at_ns):
                self.statustext("SLZ: link repeats old messages: dropped", mavlink.MAV_SEVERITY_WARNING)
            heard_ns = self.vehicle.last_heartbeat_ns
            if self.connected and heard_ns is not None and at_ns - heard_ns > timeout_ns:
                self._set_connected(False)
            self._watch_keys(at_ns)
            if self.connected and (stamp := self.inbox.clock.timesync.request(at_ns)) is not None:
                self.on_time_asked.emit(at_ns)
                self.send(mavlink.MAVLink_timesync_message(0, stamp))
            await asyncio.sleep(TICK_S)

    async def _keep_streams(self) -> None:
        while True:
            stream = self._streams.due(now_ns()) if self.connected else None
            if stream is not None:
                result = await self._ask(stream)
                if result.outcome != "not_connected":
                    answered = result.outcome in ("denied", "unsupported", "failed", "accepted")
                    self._streams.record_request(stream, now_ns(), accepted=result.ok, answered=answered)
                    continue
            await asyncio.sleep(STREAM_PAUSE_S)  # while the link is down, a request returns without waiting

    async def _ask(self, stream: Stream) -> CommandResult:
        return await self.command(
            mavlink.MAV_CMD_SET_MESSAGE_INTERVAL,
            float(stream.message_id),
            float(stream.interval_us),
            timeout_s=0.7,
            tries=2,
        )

    # ---- details --------------------------------------------------------------------------------

    def _send_heartbeat(self, status: int | None = None) -> None:
        kind, autopilot = mavlink.MAV_TYPE_ONBOARD_CONTROLLER, mavlink.MAV_AUTOPILOT_INVALID
        status = self.system_status if status is None else status
        self.send(mavlink.MAVLink_heartbeat_message(kind, autopilot, 0, 0, status, 3))

    def _send_command(self, command: Command, tries: int) -> bool:
        # Also try without a heartbeat: the outgoing direction may still work.
        if self.vehicle.sysid is None or not self._transport.up:
            return False
        self.send(command.message(self.vehicle.sysid, mavlink.MAV_COMP_ID_AUTOPILOT1, tries))
        return True

    def _tell_reason(self, reason: str, accepted: bool) -> None:
        self.statustext(reason, mavlink.MAV_SEVERITY_INFO if accepted else mavlink.MAV_SEVERITY_WARNING)

    def _warn_of(self, stranger: Candidate) -> None:
        ours = self.vehicle.sysid
        self.statustext(
            f"SLZ: vehicle {stranger.system} heard too, ours is {ours}", mavlink.MAV_SEVERITY_WARNING
        )

    def _watch_keys(self, at_ns: int) -> None:
        """Report keys that have not matched for a while; who is not connected hears of nothing else."""
        found = self._momentary_mismatch(at_ns)
        if found is None or self._keys_agreed_ns is None:
            self._keys_agreed_ns = at_ns
        lasts = found if at_ns - self._keys_agreed_ns >= MISMATCH_NS else None
        before, self.key_mismatch = self.key_mismatch, lasts
        if lasts is None or lasts is before:
            return
        log.warning("%s: %s", lasts.value, lasts.remedy)
        if not self.connected:
            self.statustext(f"SLZ: {lasts.value}", mavlink.MAV_SEVERITY_WARNING)

    def _momentary_mismatch(self, at_ns: int) -> KeyMismatch | None:
        if self._codec.signing is not None:
            return None if self.connected else KeyMismatch.of(self._codec.autopilot_verdict)
        answered_ns = self.inbox.clock.timesync.answered_ns
        answers = answered_ns is not None and at_ns - answered_ns < UNANSWERED_NS
        unheard = self.connected and self._codec.vehicle_signs and not answers
        return KeyMismatch.NO_KEY if unheard else None

    def _heard(self) -> None:
        if not self.connected:
            p = self._parameters
            self._streams.want(
                wanted(self.vehicle.autopilot, p.pose_rate_hz, odometry=p.odometry == "autopilot")
            )
            self._set_connected(True)

    def _set_connected(self, connected: bool) -> None:
        self.connected = connected
        log.info("autopilot connected") if connected else log.warning("autopilot lost")
        self.on_connection.emit(connected)

    async def _sees_mode(self, name: str) -> bool:
        seen = asyncio.Event()
        unsubscribe = self.inbox.on_change(lambda _, new: seen.set() if new.mode == name else None)
        try:
            async with asyncio.timeout(MODE_CONFIRM_S):
                if self.vehicle.mode != name:
                    await seen.wait()
        except TimeoutError:
            return False
        finally:
            unsubscribe()
        return True


async def _wait_for(failure: asyncio.Future[None]) -> None:
    await failure
