"""Pace of windows: longer on a computer that is too slow for short ones."""

from __future__ import annotations

from params import Parameters

SHARE = 0.4  # of the time, for which the pipeline may compute
WEIGHT = 0.2  # of the newest window in the mean time to compute one


class WindowPace:
    """Chooses the span of the next window from the time that windows take to compute.

    Attributes
    ----------
    window_s
        Span of the next window: that whose mean time of computing is `SHARE` of it, the parameter of this
        name at least. With `adaptive=off` and in source mode the parameter itself.
    """

    def __init__(self, parameters: Parameters) -> None:
        self.window_s = self._least_s = parameters.window_s
        self._adapts = parameters.adaptive == "on" and parameters.mode == "default"
        self._took_s = 0.0

    def follow(self, took_s: float, longest_s: float) -> None:
        """Note the time that a window took, and the longest span that suits the flight."""
        self._took_s += (took_s - self._took_s) * (WEIGHT if self._took_s else 1.0)
        if self._adapts:
            self.window_s = min(longest_s, max(self._least_s, self._took_s / SHARE))
