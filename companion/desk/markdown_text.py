"""Text in Markdown, as it was written: no markup, no markdown, and one line."""

from __future__ import annotations

import html
import re

_MARKS = re.compile(r"[\\`*\[\]|~]|(?<!\w)_|_(?!\w)")
_LINE_START = re.compile(r"^(?:[#+=-]|(\d{1,9})(?=[.)]))")


def escaped(text: str) -> str:
    """Return a text that Markdown shows as it is, also in a cell of a table or a list."""
    line = html.escape(" ".join(text.split()), quote=False)
    line = _MARKS.sub(lambda found: "\\" + found[0], line)
    return _LINE_START.sub(lambda found: f"{found[1]}\\" if found[1] else "\\" + found[0], line)
