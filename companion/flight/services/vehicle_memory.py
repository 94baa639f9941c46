"""Persistent MAVLink system ID of the vehicle."""

from __future__ import annotations

import logging

from companion.flight.link.link import Link
from companion.flight.link.vehicle_identity import LISTEN_NS, VehicleIdentity
from companion.runtime.state_directory import StateDir

log = logging.getLogger(__name__)

FILE = "vehicle"
SYSTEMS = range(1, 256)


def identity_from(state: StateDir | None, named: int | None) -> VehicleIdentity:
    """Return the initial identity: the named system, or that of the previous run."""
    text = "" if state is None else (state.read(FILE, damaged=True) or "").strip()
    known = text.isascii() and text.isdigit() and len(text) <= 3 and int(text) in SYSTEMS
    if state is not None and text and not known:
        log.warning("%s: %r is no MAVLink system", state.folder / FILE, text[:20])
    return VehicleIdentity(named, LISTEN_NS, int(text) if known else None)


def remember_vehicle(link: Link, state: StateDir) -> None:
    """Write the vehicle's system to the state directory each time it changes."""
    written = link.identity.remembered

    def write(connected: bool) -> None:
        nonlocal written
        system = link.vehicle.sysid
        if connected and system is not None and system != written:
            written = system
            if fault := state.write_behind(FILE, f"{system}\n"):
                log.warning("the vehicle is not remembered: %s", fault)

    link.on_connection.subscribe(write)
