"""When the pilot is told that the link delivers old messages."""

from __future__ import annotations

from companion.flight.link.message_rates import OldMessageWatch

S = 1_000_000_000


def told(per_s: int) -> list[int]:
    """Return the seconds at which it is told, of a minute with so many old messages a second."""
    watch = OldMessageWatch()
    return [at_s for at_s in range(60) if watch.is_news(at_s * per_s, at_s * S)]


def test_many_old_messages_are_told_once() -> None:
    assert told(50) == [1]
    assert told(2) == [10]


def test_few_old_messages_are_not_told() -> None:
    assert told(1) == []
    assert told(0) == []
