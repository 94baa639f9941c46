"""Another map frame far from the origin of the last, with what the companion keeps of places."""

from __future__ import annotations

import logging
from typing import TYPE_CHECKING

from companion.flight.landing.situation import FLYING, Severity, Vector

if TYPE_CHECKING:
    from companion.flight.app import Companion

log = logging.getLogger(__name__)


def begin_frame_if_far(companion: Companion) -> bool:
    """Begin another map frame if the vehicle is far from the origin; tell whether one began.

    Point under watch, chosen point and flown path follow into it; a survey is asked for anew by the map that
    begins. Between hand-over and landing the frame stays: a landing ends within the reach of a survey.
    """
    history, old = companion.history, companion.history.frame
    if old is None or companion.executive.phase in FLYING or not history.is_far:
        return False
    new = history.begin_frame()

    def moved(enu_m: Vector) -> Vector:
        return new.enu_m(*old.lla(enu_m).T)

    if companion.recordings.recorder is not None:
        companion.recordings.recorder.frame_begun(new)
    companion.executive.carry(moved)
    path, companion_path = companion.path_enu_m.array(), companion.path_enu_m
    companion_path.clear()
    for place in moved(path) if len(path) else ():
        companion_path.append(place)
    if companion.page is not None:
        companion.page.board.leave_path()
    log.warning("a new map frame begins at %.7f, %.7f", new.lat_deg, new.lon_deg)
    companion.link.statustext("SLZ: far from the map's origin: mapping anew", Severity.INFO.value)
    return True
