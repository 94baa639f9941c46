"""Repetition of texts lost on a silent link: calls before warnings, each once, with its age."""

from __future__ import annotations

import pytest

from companion.flight.link.message_rates import OldMessageWatch
from companion.flight.link.unheard_texts import KEPT, UnheardTexts

S, MS = 1_000_000_000, 1_000_000
CRITICAL, WARNING, INFO = 2, 4, 6


def heard(texts: UnheardTexts, until_ns: int, every_ns: int = 20 * MS) -> list[str]:
    """Let the vehicle be heard for two seconds up to a time; return what is sent again."""
    times = range(until_ns - 2 * S, until_ns + 1, every_ns)
    return [text for at_ns in times for text, _ in texts.on_heard(at_ns)]


@pytest.mark.parametrize("silent_ns", [500 * MS, S, 2 * S, 5 * S, 60 * S])
def test_a_warning_said_into_an_outage_of_any_length_is_said_again(silent_ns: int) -> None:
    texts = UnheardTexts()
    assert heard(texts, 4 * S) == []
    texts.record("SLZ: abort: position lost", WARNING, 4 * S + silent_ns // 2)
    ((text, severity),) = texts.on_heard(4 * S + silent_ns)
    assert severity == WARNING
    assert text.endswith(" s ago: abort: position lost")
    assert heard(texts, 6 * S + silent_ns + 20 * MS) == []


def test_a_vehicle_that_is_heard_once_a_second_only_is_not_silent_between() -> None:
    texts = UnheardTexts()
    for k in range(60):
        texts.record(f"SLZ: warning {k}", WARNING, k * S + S // 2)
        said = texts.on_heard((k + 1) * S)
    assert said == []


def test_only_warnings_of_the_silence_are_told_with_their_age() -> None:
    texts = UnheardTexts()
    texts.record("SLZ: before", WARNING, 1 * S)
    texts.record("SLZ: abort: position lost", WARNING, 5 * S)
    texts.record("SLZ: surveying", INFO, 6 * S)
    texts.on_heard(4 * S)
    assert texts.on_heard(8 * S) == [("SLZ: 3 s ago: abort: position lost", WARNING)]


def test_many_warnings_do_not_push_out_a_call_of_the_pilot() -> None:
    texts = UnheardTexts()
    texts.record("SLZ: take over", CRITICAL, 5 * S)
    for k in range(3 * KEPT):
        texts.record(f"SLZ: warning {k}", WARNING, 6 * S)
    texts.on_heard(4 * S)
    told = [text for text, _ in texts.on_heard(8 * S)]
    assert told[0] == "SLZ: 3 s ago: take over"
    assert len(told) == KEPT


def test_a_text_said_again_and_again_counts_once() -> None:
    texts = UnheardTexts()
    for k in range(3 * KEPT):
        texts.record(f"SLZ: {'map' if k % 2 else 'scans'} late: holding", WARNING, (5 + k) * S)
    texts.on_heard(4 * S)
    assert len(texts.on_heard(40 * S)) == 2


@pytest.mark.parametrize(
    ("lasts", "said"), [("", []), ("SLZ: position lost: holding", ["SLZ: 14 s ago: position lost: holding"])]
)
def test_a_state_that_ended_with_the_silence_is_not_said_and_one_that_lasts_is(
    lasts: str, said: list[str]
) -> None:
    """What happened is said at once; a state, when it is known whether it still lasts."""
    texts = UnheardTexts()
    heard(texts, 4 * S)
    texts.lasting = "SLZ: position lost: holding"
    texts.record("SLZ: position lost: holding", WARNING, 5 * S)
    texts.record("SLZ: abort: position lost", WARNING, 5 * S)
    assert texts.on_heard(17 * S) == [("SLZ: 12 s ago: abort: position lost", WARNING)]
    texts.lasting = lasts
    assert heard(texts, 19 * S + 500 * MS) == said


# When the pilot is told that the link delivers old messages.


SECOND_NS = 1_000_000_000


def told(per_s: int) -> list[int]:
    """Return the seconds at which it is told, of a minute with so many old messages a second."""
    watch = OldMessageWatch()
    return [at_s for at_s in range(60) if watch.is_news(at_s * per_s, at_s * SECOND_NS)]


def test_many_old_messages_are_told_once() -> None:
    assert told(50) == [1]
    assert told(2) == [10]


def test_few_old_messages_are_not_told() -> None:
    assert told(1) == []
    assert told(0) == []
