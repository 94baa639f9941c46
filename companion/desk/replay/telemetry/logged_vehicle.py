"""Vehicle selection in a telemetry log, which may hold several vehicles."""

from __future__ import annotations

import sys
from pathlib import Path

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from companion.desk.replay.telemetry.telemetry_log import TelemetryLog
from companion.flight.link.vehicle_identity import NAME_IT, VehicleIdentity, several
from companion.flight.link.vehicle_state import is_autopilot
from companion.runtime.errors import UsageError


def vehicle_of(path: Path, log: TelemetryLog, named: int | None) -> int | None:
    """Return the system ID of a log's only aircraft, or the named one; None if there is none.

    Raises
    ------
    UsageError
        The log holds two aircraft and none was named, no aircraft at all, or not the named system.
    """
    identity = VehicleIdentity(named, listen_ns=sys.maxsize)
    for logged in log.only(mavlink.MAVLINK_MSG_ID_HEARTBEAT):
        if is_autopilot(logged.message):
            identity.on_heartbeat(logged.message, logged.at_ns)
    heard = identity.candidates | identity.passed_over
    if named is not None and named not in heard:
        others = ", ".join(map(str, heard.values())) or "none"
        raise UsageError(f"{path}: it holds no autopilot of system {named}; of others: {others}")
    if identity.ambiguous:
        raise UsageError(f"{path}: {several(identity.candidates.values())}")
    if identity.system is None and heard:
        names = " and ".join(map(str, heard.values()))
        raise UsageError(f"{path}: it holds no aircraft, only {names}: {NAME_IT}")
    return identity.system


def tells_fix(log: TelemetryLog, system: int | None) -> bool:
    """Return whether the vehicle's autopilot reports the quality of its position in a log."""
    said = log.only(
        mavlink.MAVLINK_MSG_ID_GPS_RAW_INT,
        mavlink.MAVLINK_MSG_ID_GPS2_RAW,
        mavlink.MAVLINK_MSG_ID_EKF_STATUS_REPORT,
        mavlink.MAVLINK_MSG_ID_ESTIMATOR_STATUS,
    )
    ours = (system, mavlink.MAV_COMP_ID_AUTOPILOT1)
    return any((m.message.get_srcSystem(), m.message.get_srcComponent()) == ours for m in said)
