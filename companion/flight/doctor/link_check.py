"""Checks of the MAVLink link: heartbeat, message rates, losses, clock synchronisation."""

from __future__ import annotations

from companion.flight.doctor.finding import Finding, judged
from companion.flight.link.autopilots.autopilot_interface import Stream
from companion.flight.link.autopilots.autopilot_registry import registered_autopilots
from companion.flight.link.link_statistics import LinkStatistics
from companion.flight.link.vehicle_class import type_name
from companion.flight.link.vehicle_state import VehicleState
from companion.flight.link.wire.key_mismatch import KeyMismatch

ROUND_TRIP_MS = 10.0
"""PX4 resets its clock filter at longer round trips."""
RESIDUAL_MS = 3.0
LOSS = 0.01
# A message that arrives at less than this share of its rate is slow.
SHARE = 0.8
# Rates are measured over two seconds, in which one message more or less is chance.
CHANCE_HZ = 0.5


def link_findings(
    url: str,
    vehicle: VehicleState,
    statistics: LinkStatistics,
    streams: tuple[Stream, ...],
    key_mismatch: KeyMismatch | None = None,
) -> list[Finding]:
    """Judge the link; `streams` are the messages that should arrive from a vehicle that hears us."""
    if vehicle.sysid is None:
        return [_silence(url, statistics) if key_mismatch is None else _signing(key_mismatch)]
    autopilot, known = vehicle.autopilot, registered_autopilots()
    found = [
        judged(
            "autopilot",
            autopilot in known,
            f"{autopilot.title}, system {vehicle.sysid}, mode {vehicle.mode}",
            " or ".join(each.title for each in known),
            f"connect a vehicle with {' or '.join(each.firmware for each in known)}",
        ),
        _class(vehicle),
    ]
    if key_mismatch is not None:
        return [*found, _signing(key_mismatch)]
    return [
        *found,
        *(_stream(stream, statistics) for stream in streams),
        _losses(statistics),
        *_clock(statistics),
    ]


def _class(vehicle: VehicleState) -> Finding:
    """Judge whether the vehicle may be commanded; a VTOL may while it hovers, as on the ground."""
    reason, name = vehicle.no_command_reason, type_name(vehicle.vehicle_type)
    return judged(
        "vehicle",
        not reason,
        f"{name}: {reason}" if reason and reason != name else name,
        "multirotor, helicopter, or a VTOL of PX4 that hovers",
        "slz maps and shows zones for it, and commands nothing; if it is a multirotor, set its type",
    )


def _signing(mismatch: KeyMismatch) -> Finding:
    return Finding("signing", "fail", mismatch.value, "one key on both sides, or none", mismatch.remedy)


def _silence(url: str, statistics: LinkStatistics) -> Finding:
    if statistics.bad_bytes or statistics.bad:
        remedy = (
            "there are bytes but no MAVLink: check the baud rate and that the port's protocol is MAVLink 2"
        )
    elif statistics.received:
        remedy = (
            "MAVLink arrives, but no autopilot's heartbeat: connect to the vehicle, not to a ground station"
        )
    elif statistics.opened:
        remedy = "nothing arrives: check cable, port and the autopilot's SERIALn_PROTOCOL (2) or MAV_n_CONFIG"
    elif url.startswith("/dev/"):
        remedy = "the port cannot be opened: see ls /dev/autopilot* /dev/ttyUSB* /dev/ttyACM*"
    else:
        remedy = "the port cannot be opened: check that the autopilot or its simulator runs and listens there"
    return Finding("autopilot", "fail", f"no heartbeat at {url}", "a heartbeat a second", remedy)


def _stream(stream: Stream, statistics: LinkStatistics) -> Finding:
    rate_hz = statistics.rates_hz.get(stream.name, 0.0)
    if stream.name in statistics.refused or (rate_hz == 0.0 and not stream.needed):
        return Finding(f"rate of {stream.name}", "skipped", "this autopilot does not send it")
    return _rate(stream, rate_hz)


def _rate(stream: Stream, rate_hz: float) -> Finding:
    needed = stream.needed and (stream.rate_hz >= 10.0 or stream.name in ("HEARTBEAT", "EXTENDED_SYS_STATE"))
    arrives_hz = stream.arrives_hz
    less = _LESS if stream.needed else "what it tells (mode, estimator, sticks, fence, target) is seen late"
    return judged(
        f"rate of {stream.name}",
        rate_hz >= min(SHARE * arrives_hz, arrives_hz - CHANCE_HZ),
        f"{rate_hz:.1f} Hz",
        f"{arrives_hz:g} Hz",
        "use a faster port (921600 baud), or send less to others on it" if needed else less,
        otherwise="fail" if needed else "warn",
    )


_LESS = "without it the reaction to a low battery, a moved home or the first fix is missing"


def _losses(statistics: LinkStatistics) -> Finding:
    whole = statistics.from_vehicle + statistics.lost
    share = statistics.lost / whole if whole else 0.0
    return judged(
        "frames lost",
        share <= LOSS,
        f"{100 * share:.2f} % of {whole}",
        f"at most {100 * LOSS:g} %",
        "check wiring and flow control, or lower the load of the link",
        otherwise="warn",
    )


def _clock(statistics: LinkStatistics) -> list[Finding]:
    if statistics.time_source != "timesync":
        return [
            Finding(
                "time synchronisation",
                "fail",
                "TIMESYNC is not answered",
                "answers",
                "use MAVLink 2 and an autopilot that answers; until then stamps rest on arrival times",
            )
        ]
    return [
        judged(
            "round trip",
            statistics.round_trip_ms <= ROUND_TRIP_MS,
            f"{statistics.round_trip_ms:.2f} ms",
            f"at most {ROUND_TRIP_MS:g} ms",
            "connect the companion to the autopilot directly, not by radio",
        ),
        judged(
            "residual of the clocks",
            statistics.residual_ms <= RESIDUAL_MS,
            f"{statistics.residual_ms:.2f} ms",
            f"at most {RESIDUAL_MS:g} ms",
            "lower the load of the link and of this computer",
        ),
    ]
