"""Returns from hardly beyond the window: ground and vehicle, which are not dirt."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from companion.flight.sensors.diagnosis.return_picture import SECTORS
from companion.flight.sensors.diagnosis.stream_look import StreamLook

CLOSE_SHARE = 0.05  # of the returns of some sectors: so many more than ever are ground that came near
NEAR_SHARE, LEAST_FAR = 0.1, 6  # of returns by which a sector is the ground's no more
FROM_START = 0.05  # share of window returns that were always there
SETTLE = 0.1  # weight of the newest look

Sectors = NDArray[np.intp]
Floats = NDArray[np.float64]


class CloseReturns:
    """Least shares of close and of near returns, by sector, since the beginning.

    At a landing the ground comes within the reach of the window's own returns, but passes through the band
    beyond it first. Dirt does not. Parts of the vehicle are there always. Sectors in which the ground came
    are the ground's until their returns are far again, as on the ground there may be none but near ones.
    """

    def __init__(self) -> None:
        self._close: Floats | None = None
        self._near: Floats = np.zeros(SECTORS)
        self._least_close: Floats = np.zeros(SECTORS)
        self._least_near: Floats = np.zeros(SECTORS)
        self._ground: NDArray[np.bool_] = np.zeros(SECTORS, np.bool_)

    def add(self, look: StreamLook) -> None:
        """Use the shares of a look."""
        seen = np.maximum(look.seen, 1)
        close, near = look.close / seen, look.near / seen
        self._ground &= (look.seen - look.near - look.close < LEAST_FAR) | (near > NEAR_SHARE)
        if self._close is None:
            self._close = self._least_close = close
            self._near = self._least_near = near
            return
        self._close = self._close + SETTLE * (close - self._close)
        self._near = self._near + SETTLE * (near - self._near)
        self._least_close = np.minimum(self._least_close, self._close)
        self._least_near = np.minimum(self._least_near, self._near)

    def is_ground(self, look: StreamLook, sectors: Sectors) -> bool:
        """Return whether ground may be as near as the window, in some sectors.

        Where returns were as near from the beginning, any close ones beside them may be the ground's;
        otherwise those that came.
        """
        seen = np.maximum(look.seen[sectors], 1)
        always = (self._least_near[sectors] * seen).sum() / seen.sum() > FROM_START
        before = 0.0 if always else float((self._least_close[sectors] * seen).sum() / seen.sum())
        if look.close[sectors].sum() / seen.sum() - before > CLOSE_SHARE:
            self._ground[sectors] = True
        return bool(self._ground[sectors].any())
