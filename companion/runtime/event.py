"""Observer pattern: callbacks subscribed to an event."""

from __future__ import annotations

from collections.abc import Callable
from typing import Generic, ParamSpec

P = ParamSpec("P")
Unsubscribe = Callable[[], None]


class Event(Generic[P]):
    """List of callbacks, called in the order of subscription.

    Call the event itself, or `subscribe`, with a callback; the owner of the event calls `emit`.
    """

    def __init__(self) -> None:
        self._callbacks: list[Callable[P, None]] = []

    def subscribe(self, callback: Callable[P, None]) -> Unsubscribe:
        """Add a callback; return a function that removes it, which may be called twice."""
        self._callbacks.append(callback)

        def unsubscribe() -> None:
            if callback in self._callbacks:
                self._callbacks.remove(callback)

        return unsubscribe

    def __call__(self, callback: Callable[P, None]) -> Unsubscribe:
        return self.subscribe(callback)

    def emit(self, *args: P.args, **kwargs: P.kwargs) -> None:
        """Call all callbacks with the arguments."""
        for callback in tuple(self._callbacks):
            callback(*args, **kwargs)
