"""Messages as received: with a sender and a sequence number."""

from __future__ import annotations

from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as mavlink

ARMED = mavlink.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED | mavlink.MAV_MODE_FLAG_SAFETY_ARMED


def received(message: Any, system: int = 1, component: int = 1, sequence: int = 0) -> Any:
    """Return the message after a trip over the wire."""
    sender = mavlink.MAVLink(None, srcSystem=system, srcComponent=component)
    sender.seq = sequence
    return mavlink.MAVLink(None).parse_buffer(message.pack(sender))[0]


def heartbeat(
    *,
    autopilot: int = mavlink.MAV_AUTOPILOT_ARDUPILOTMEGA,
    kind: int = mavlink.MAV_TYPE_QUADROTOR,
    base_mode: int = 1,
    custom_mode: int = 0,
    system: int = 1,
    component: int = 1,
    sequence: int = 0,
) -> Any:
    """Return a heartbeat as received."""
    message = mavlink.MAVLink_heartbeat_message(kind, autopilot, base_mode, custom_mode, 4, 3)
    return received(message, system, component, sequence)


def position(boot_ms: int, *, lat: int = 470_000_000, lon: int = 80_000_000, relative_mm: int = 0) -> Any:
    """Return a global position as received."""
    return received(
        mavlink.MAVLink_global_position_int_message(
            boot_ms, lat, lon, 412_000, relative_mm, 100, -200, 50, 9000
        )
    )


def attitude(boot_ms: int, quaternion: tuple[float, float, float, float] = (1, 0, 0, 0)) -> Any:
    """Return an attitude as received."""
    return received(mavlink.MAVLink_attitude_quaternion_message(boot_ms, *quaternion, 0.1, 0.2, 0.3))


def acknowledgement(command: int, result: int, progress: int = 255, system: int = 1) -> Any:
    """Return a COMMAND_ACK to everybody as received."""
    return received(mavlink.MAVLink_command_ack_message(command, result, progress), system)
