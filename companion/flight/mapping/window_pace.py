"""Pace of windows: longer on a computer that is too slow for short ones."""

from __future__ import annotations

from params import Parameters

SHARE = 0.4  # of the time, for which the pipeline may compute
SHORTEST = 1.0  # of `window_s`
WEIGHT = 0.2  # of the newest window in the mean time to compute one


class WindowPace:
    """Chooses the span of the next window from the time that windows take to compute.

    Attributes
    ----------
    window_s
        Span of the next window: that whose mean time of computing is `SHARE` of it, `SHORTEST` of the
        parameter `window_s` at least. With `adaptive=off` and in source mode the parameter itself.
    """

    def __init__(self, parameters: Parameters) -> None:
        self._fixed_s = parameters.window_s
        self._adapts = parameters.adaptive == "on" and parameters.mode == "default"
        self.window_s = SHORTEST * self._fixed_s if self._adapts else self._fixed_s
        self._took_s = 0.0

    def follow(self, took_s: float, longest_s: float) -> None:
        """Note the time that a window took, and the longest span that suits the flight."""
        self._took_s += (took_s - self._took_s) * (WEIGHT if self._took_s else 1.0)
        if self._adapts:
            self.window_s = min(longest_s, max(SHORTEST * self._fixed_s, self._took_s / SHARE))
