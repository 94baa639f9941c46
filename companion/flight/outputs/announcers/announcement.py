"""Announcing of what changes to the pilot and the log, in steps of time."""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Callable, Sequence

from companion.flight.landing.situation import Severity
from companion.runtime.clock import now_ns

log = logging.getLogger(__name__)

STEP_S = 0.25

Say = Callable[[str, int], None]
Update = Callable[[int], Sequence[tuple[Severity, str]]]


async def announce(update: Update, say: Say) -> None:
    """Say and log each severity and text that `update` returns for the present time (ns), until cancelled."""
    while True:
        for severity, text in update(now_ns()):
            log.warning(text)
            say(text, severity.value)
        await asyncio.sleep(STEP_S)
