"""Something that happens, and who wants to know."""

from __future__ import annotations

from collections.abc import Callable
from typing import Generic, ParamSpec

P = ParamSpec("P")
Unsubscribe = Callable[[], None]


class Event(Generic[P]):
    """List of callbacks, called in the order they came in.

    Call the event itself, or `subscribe`, with a callback; whoever owns the event calls `emit`.
    """

    def __init__(self) -> None:
        self._callbacks: list[Callable[P, None]] = []

    def subscribe(self, callback: Callable[P, None]) -> Unsubscribe:
        """Call `callback` from now on; the returned function ends that, and may be called twice."""
        self._callbacks.append(callback)

        def unsubscribe() -> None:
            if callback in self._callbacks:
                self._callbacks.remove(callback)

        return unsubscribe

    def __call__(self, callback: Callable[P, None]) -> Unsubscribe:
        return self.subscribe(callback)

    def emit(self, *args: P.args, **kwargs: P.kwargs) -> None:
        """Call all of them."""
        for callback in tuple(self._callbacks):
            callback(*args, **kwargs)
