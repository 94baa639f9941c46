"""Message rates requested from the autopilot, and requests due again."""

from __future__ import annotations

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from companion.flight.link.autopilots.autopilot_interface import Autopilot, Stream

# A stream silent for longer than this, or than three of its periods, is requested again, at growing
# intervals, because an autopilot without a battery monitor never sends its status.
AWAY_NS = 2_000_000_000
# A stream at less than half its rate over this span is requested again: another program may have slowed it.
SPAN_NS = 4_000_000_000
LONGEST_PAUSE_NS = 30_000_000_000
# As often as our setpoints: what another sender asks in between is flown until the next of ours. ArduPilot
# sends it in its guided mode alone.
_TARGET = Stream(
    "POSITION_TARGET_LOCAL_NED", mavlink.MAVLINK_MSG_ID_POSITION_TARGET_LOCAL_NED, 20.0, needed=False
)
_HEARTBEAT = Stream("HEARTBEAT", mavlink.MAVLINK_MSG_ID_HEARTBEAT, 1.0)  # the rate without a request
MANY, WITHIN_NS = 20, 10_000_000_000


def wanted(autopilot: Autopilot, pose_rate_hz: float, odometry: bool = False) -> tuple[Stream, ...]:
    """Return the streams to request from an autopilot, the most needed first.

    odometry: whether the LiDAR odometry is sent to it, relative to its local origin.
    """
    streams = [
        Stream("ATTITUDE_QUATERNION", mavlink.MAVLINK_MSG_ID_ATTITUDE_QUATERNION, pose_rate_hz),
        Stream("GLOBAL_POSITION_INT", mavlink.MAVLINK_MSG_ID_GLOBAL_POSITION_INT, pose_rate_hz),
        Stream("EXTENDED_SYS_STATE", mavlink.MAVLINK_MSG_ID_EXTENDED_SYS_STATE, 5.0),
        autopilot.mode_stream,
        Stream("HOME_POSITION", mavlink.MAVLINK_MSG_ID_HOME_POSITION, 1.0),
        Stream("GPS_RAW_INT", mavlink.MAVLINK_MSG_ID_GPS_RAW_INT, 2.0),  # without a fix, no map begins
        Stream("GPS2_RAW", mavlink.MAVLINK_MSG_ID_GPS2_RAW, 2.0, needed=False),  # of a second receiver
        Stream("SYS_STATUS", mavlink.MAVLINK_MSG_ID_SYS_STATUS, 1.0),
        Stream("BATTERY_STATUS", mavlink.MAVLINK_MSG_ID_BATTERY_STATUS, 1.0),
    ]
    if autopilot.needs_local_position or odometry:
        # For the odometry alone it is not needed: ArduPilot sends none before its estimator has an origin.
        needed, number = autopilot.needs_local_position, mavlink.MAVLINK_MSG_ID_LOCAL_POSITION_NED
        streams.insert(3, Stream("LOCAL_POSITION_NED", number, 10.0, needed=needed))
    return (*streams, _TARGET, *autopilot.own_streams)


def expected(autopilot: Autopilot, pose_rate_hz: float, odometry: bool = False) -> tuple[Stream, ...]:
    """Return the streams that should arrive: the requested ones, and the heartbeat even if it is not."""
    asked = wanted(autopilot, pose_rate_hz, odometry)
    return asked if autopilot.mode_stream.name == _HEARTBEAT.name else (*asked, _HEARTBEAT)


class StreamKeeper:
    """Record of the last request and the last arrival of each stream.

    Attributes
    ----------
    requests
        Number of requests, including repetitions.
    """

    def __init__(self) -> None:
        self._streams: dict[str, Stream] = {}
        self._heard_ns: dict[str, int] = {}
        self._asked_ns: dict[str, int] = {}
        self._pause_ns: dict[str, int] = {}
        self._spans: dict[str, tuple[int, int]] = {}  # start, messages since
        self._slow: set[str] = set()
        self._refused: set[str] = set()
        self.requests = 0

    def want(self, streams: tuple[Stream, ...]) -> None:
        """Replace the wanted streams; all become due."""
        self._streams = {stream.name: stream for stream in streams}
        self.reset()

    def reset(self) -> None:
        """Make all streams due again, after a reboot of the autopilot or a reconnection."""
        for memory in (
            self._heard_ns,
            self._asked_ns,
            self._pause_ns,
            self._spans,
            self._slow,
            self._refused,
        ):
            memory.clear()

    def record_arrival(self, name: str, now_ns: int) -> None:
        """Record the arrival of a message."""
        stream = self._streams.get(name)
        if stream is None or name not in self._asked_ns:
            return
        self._heard_ns[name] = now_ns
        begun_ns, count = self._spans.setdefault(name, (now_ns, 0))
        if now_ns - begun_ns < SPAN_NS:
            self._spans[name] = (begun_ns, count + 1)
            return
        self._spans[name] = (now_ns, 0)
        if count / (now_ns - begun_ns) < 0.5e-9 * stream.arrives_hz:
            self._slow.add(name)
        else:
            self._slow.discard(name)
            self._pause_ns.pop(name, None)

    def due(self, now_ns: int) -> Stream | None:
        """Return the first stream to request now, None if all arrive."""
        return next((s for s in self._streams.values() if self._is_due(s, now_ns)), None)

    def record_request(self, stream: Stream, now_ns: int, *, accepted: bool, answered: bool = True) -> None:
        """Record a request, whether it was answered at all, and whether the autopilot accepted it."""
        self.requests += 1
        name = stream.name
        if not stream.needed and answered and not accepted:
            self._refused.add(name)
        pause = min(2 * self._pause_ns.get(name, AWAY_NS // 2), LONGEST_PAUSE_NS)
        self._pause_ns[name] = pause if accepted else max(pause, 2 * AWAY_NS)
        self._asked_ns[name] = now_ns
        self._spans.pop(name, None)
        self._slow.discard(name)

    def missing(self, now_ns: int) -> tuple[str, ...]:
        """Return the names of needed streams that were requested and are absent or slow."""
        asked = (s for s in self._streams.values() if s.needed and s.name in self._asked_ns)
        return tuple(s.name for s in asked if s.name not in self._heard_ns or self._lacks(s, now_ns))

    @property
    def refused(self) -> tuple[str, ...]:
        """Names of streams that the autopilot does not have; they are not requested again."""
        return tuple(sorted(self._refused))

    def _is_due(self, stream: Stream, now_ns: int) -> bool:
        if stream.name in self._refused:
            return False
        asked = self._asked_ns.get(stream.name)
        if asked is None:
            return True
        return self._lacks(stream, now_ns) and now_ns - asked > self._pause_ns.get(stream.name, AWAY_NS)

    def _lacks(self, stream: Stream, now_ns: int) -> bool:
        patience = max(AWAY_NS, 3 * round(1e9 / stream.arrives_hz))
        heard = self._heard_ns.get(stream.name, self._asked_ns[stream.name])
        return stream.name in self._slow or now_ns - heard > patience


class OldMessageWatch:
    """Decision when to warn the pilot of old messages on the link: once, when they are many."""

    def __init__(self) -> None:
        self._begun_ns: int | None = None
        self._count = 0
        self._told = False

    def is_news(self, count: int, now_ns: int) -> bool:
        """Return whether to warn now; `count`: old messages since the start, all unused."""
        if self._begun_ns is None or now_ns - self._begun_ns > WITHIN_NS:
            self._begun_ns, self._count = now_ns, count
        if self._told or count - self._count < MANY:
            return False
        self._told = True
        return True
