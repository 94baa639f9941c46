"""Parts of a running flight, as page, live view, ROS node and summary read them."""

from __future__ import annotations

from dataclasses import dataclass

from companion.flight.deciding import Deciding
from companion.flight.link.link import Link
from companion.flight.outputs.schedule import MessageSchedule
from companion.flight.recorder.recordings import Recordings
from companion.flight.sensing import Sensing
from companion.flight.services.settings import Settings
from companion.flight.terrain_mapping import TerrainMapping
from params import Parameters


@dataclass(frozen=True, slots=True)
class FlightView:
    """Parts of a flight.

    Attributes
    ----------
    parameters
        Parameters in force; they follow changes.
    streams
        Messages that are sent at fixed rates.
    """

    parameters: Parameters
    settings: Settings
    link: Link
    sensing: Sensing
    mapping: TerrainMapping
    deciding: Deciding
    streams: MessageSchedule
    recordings: Recordings
