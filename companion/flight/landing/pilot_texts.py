"""Texts to the pilot in one step of the executive."""

from __future__ import annotations

from textwrap import shorten

from companion.flight.landing.situation import Severity, Situation


class PilotTexts:
    """Texts of this step, and the text about a wait that lasts."""

    def __init__(self) -> None:
        self._texts: list[tuple[Severity, str]] = []
        self._lasting = ""

    def say(self, severity: Severity, text: str) -> None:
        """Send the pilot a text with this step's commands."""
        self._texts.append((severity, f"SLZ: {text}"))

    def note_lasting(self, text: str) -> None:
        """Note the input or event that the landing waits for in this step, as the pilot reads it."""
        self._lasting = f"SLZ: {text}"

    def ask_for_hand_over(self, event: str, s: Situation, auto: bool) -> None:
        """Ask for a hand-over after an event; setting a guided mode that is on already is none."""
        if s.guided and auto:
            text = f"{event}: leave {s.mode}, set it again"
        else:
            text = f"{event}, {s.mode}: order again" if s.guided else f"{event}, {s.mode}: hand over again"
        self.say(Severity.WARNING, text)

    def collect_lasting(self) -> str:
        """Return the text about a wait since the last collection, "" for none."""
        text, self._lasting = self._lasting, ""
        return text

    def collect_texts(self) -> tuple[tuple[Severity, str], ...]:
        """Return the texts since the last collection."""
        texts, self._texts = tuple(self._texts), []
        return texts


def bracketed(cause: str, most: int) -> str:
    """Return the cause's first words in brackets, short enough for one STATUSTEXT; "" without a cause."""
    words = shorten(cause.partition(":")[0], most, placeholder="") or cause[:most]
    return f" ({words})" if cause else ""
