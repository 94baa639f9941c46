"""Switch to a new map frame when the vehicle is far from the origin of the current one."""

from __future__ import annotations

import logging

from companion.flight.flight_view import FlightView
from companion.flight.landing.situation import COMMANDING, Severity, Vector

log = logging.getLogger(__name__)


def begin_frame_if_far(flight: FlightView) -> bool:
    """Begin a new map frame if the vehicle is far from the origin; return whether one began.

    Selected point, chosen point and flown path are converted to the new frame; the new map requests the
    survey prior again. Between hand-over and landing the frame is kept: a landing stays within a survey's
    reach.
    """
    history, old = flight.history, flight.history.frame
    if old is None or flight.executive.phase in COMMANDING or not history.is_far:
        return False
    new = history.begin_frame()

    def moved(enu_m: Vector) -> Vector:
        return new.enu_m(*old.lla(enu_m).T)

    if flight.recordings.recorder is not None:
        flight.recordings.recorder.frame_begun(new)
    flight.executive.change_frame(moved)
    path = flight.path_enu_m.array()
    flight.path_enu_m.clear()
    for place in moved(path) if len(path) else ():
        flight.path_enu_m.append(place)
    log.warning("a new map frame begins at %.7f, %.7f", new.lat_deg, new.lon_deg)
    flight.link.statustext("SLZ: far from the map's origin: mapping anew", Severity.INFO.value)
    return True
