"""Pace of windows: longer on a computer that is too slow for short ones, and for a sensor of few returns."""

from __future__ import annotations

from params import Parameters

LEAST = 0.1  # of `window_s`
SHARE = 0.4  # of the time, for which the pipeline may compute
WEIGHT = 0.2  # of the newest window in the mean time to compute one
ALONE = 0.5  # share of returns without others near; with more, clutter is hard to tell from objects
STEP = 1.25  # from window to window, by which windows become longer or shorter for that


class WindowPace:
    """Chooses the span of the next window from the windows before.

    Attributes
    ----------
    window_s
        Span of the next window, a tenth of the parameter of this name at least: that whose mean time of
        computing is `SHARE` of it, and up to the parameter that in which most returns are not alone. With
        `adaptive=off` and in source mode the parameter itself.
    """

    def __init__(self, parameters: Parameters) -> None:
        self._adapts = parameters.adaptive == "on" and parameters.mode == "default"
        self._whole_s = parameters.window_s
        self.window_s = self._least_s = self._whole_s * (LEAST if self._adapts else 1.0)
        self._took_s, self._company_s = 0.0, self._least_s

    def follow(self, took_s: float, longest_s: float, alone: float) -> None:
        """Note a window: its time of computing, the longest span that suits the flight, the share alone."""
        self._took_s += (took_s - self._took_s) * (WEIGHT if self._took_s else 1.0)
        step = min(max(alone / ALONE, 1 / STEP), STEP)
        self._company_s = min(max(self._company_s * step, self._least_s), self._whole_s)
        if self._adapts:
            self.window_s = min(longest_s, max(self._company_s, self._took_s / SHARE))
