"""Repetition of texts lost on a silent link: calls before warnings, each once, with its age."""

from __future__ import annotations

from companion.flight.link.unheard_texts import KEPT, UnheardTexts

S = 1_000_000_000
CRITICAL, WARNING, INFO = 2, 4, 6


def test_only_warnings_of_the_silence_are_told_with_their_age() -> None:
    texts = UnheardTexts()
    texts.record("SLZ: before", WARNING, 1 * S)
    texts.record("SLZ: abort: position lost", WARNING, 5 * S)
    texts.record("SLZ: surveying", INFO, 6 * S)
    assert texts.to_resend(4 * S, 8 * S) == [("SLZ: 3 s ago: abort: position lost", WARNING)]


def test_many_warnings_do_not_push_out_a_call_of_the_pilot() -> None:
    texts = UnheardTexts()
    texts.record("SLZ: take over", CRITICAL, 5 * S)
    for k in range(3 * KEPT):
        texts.record(f"SLZ: warning {k}", WARNING, 6 * S)
    told = [text for text, _ in texts.to_resend(4 * S, 8 * S)]
    assert told[0] == "SLZ: 3 s ago: take over"
    assert len(told) == KEPT


def test_a_text_said_again_and_again_counts_once() -> None:
    texts = UnheardTexts()
    for k in range(3 * KEPT):
        texts.record(f"SLZ: {'map' if k % 2 else 'scans'} late: holding", WARNING, (5 + k) * S)
    assert len(texts.to_resend(4 * S, 40 * S)) == 2
