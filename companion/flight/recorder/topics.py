"""Topics of a recording for display; those of the replay are in `journal`."""

from __future__ import annotations

POINTS, ZONES, MOVING, GEOJSON, TRANSFORM, FIX, LOG, PARAMETERS = (
    "/points",
    "/zones",
    "/moving",
    "/zones/geojson",
    "/tf",
    "/position",
    "/log",
    "/parameters",
)
MOST_POINTS = 20_000  # of a message on POINTS
