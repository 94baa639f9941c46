"""Parts of the record, by name, in the order in which they run."""

from __future__ import annotations

from collections.abc import Callable

from tests.answers.parts import bench, clouds, flights, parameters, reproduction, worlds
from tests.answers.recorder import Recorder

PARTS: dict[str, Callable[[Recorder], None]] = {
    "parameters": parameters.record,
    "map": clouds.record,
    "worlds": worlds.record,
    "bench": bench.record,
    "flights": flights.record,
    "reproduce": reproduction.record,
}
