"""Triage of flash frames (Flash paper, section 4.1)."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

import numpy as np

from slz.flash.ranging import RangeImage
from slz.kernels.instruments.waveform import GOOD, MISSING, SATURATED

FULL = 0.95
"""Share of GOOD pixels, "close to 100 %", from which a frame is whole."""
LIMIT = (0.5, 0.7)
"""Shares of GOOD pixels of a frame at the limit of detection."""
MOST_SATURATED = 0.2


class Quality(Enum):
    """Quality of a frame. Only WHOLE and PARTIAL frames are mapped."""

    WHOLE = "whole"
    PARTIAL = "partial"
    LIMIT = "at the limit of detection"
    SATURATED = "saturated"
    EMPTY = "empty"


@dataclass(frozen=True, slots=True)
class Triage:
    """Quality of a frame, with the shares of its pixels that gave a return and that were saturated."""

    quality: Quality
    returned: float
    saturated: float

    @property
    def usable(self) -> bool:
        """True if the ranges of the frame are mapped."""
        return self.quality in (Quality.WHOLE, Quality.PARTIAL)


def triage(image: RangeImage) -> Triage:
    """Classify a frame by its shares of GOOD and of saturated pixels.

    Between 70 and 95 % the frame is partial, a case that the source does not name: its returns are used, and
    the rest stays unknown. Below 50 % noise triggers too large a share of the returns.
    """
    returned = float(np.mean(image.state != MISSING))
    saturated = float(np.mean(image.state == SATURATED))
    good = float(np.mean(image.state == GOOD))
    if saturated > MOST_SATURATED:
        quality = Quality.SATURATED
    elif good < LIMIT[0]:
        quality = Quality.EMPTY
    elif good <= LIMIT[1]:
        quality = Quality.LIMIT
    else:
        quality = Quality.WHOLE if good >= FULL else Quality.PARTIAL
    return Triage(quality, returned, saturated)
