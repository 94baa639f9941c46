"""Pages from Jinja templates that lie beside their code; HTML templates escape all values."""

from __future__ import annotations

import html
import re
from functools import cache
from pathlib import Path
from typing import Any

from jinja2 import Environment, FileSystemLoader, StrictUndefined

_MARKS = re.compile(r"[\\`*\[\]|~]|(?<!\w)_|_(?!\w)")
_LINE_START = re.compile(r"^(?:[#+=-]|(\d{1,9})(?=[.)]))")


def render(template: str, **values: Any) -> str:
    """Return a page; `template` is a path below `companion/desk`, such as "evidence/case.html.j2"."""
    return _environment().get_template(template).render(values)


def markdown_escape(text: str) -> str:
    """Return one line that Markdown shows literally, also in a cell of a table or a list.

    Templates of Markdown call it as the filter `markdown`.
    """
    line = html.escape(" ".join(text.split()), quote=False)
    line = _MARKS.sub(lambda found: "\\" + found[0], line)
    return _LINE_START.sub(lambda found: f"{found[1]}\\" if found[1] else "\\" + found[0], line)


@cache
def _environment() -> Environment:
    environment = Environment(
        loader=FileSystemLoader(Path(__file__).parent),
        autoescape=lambda name: name is not None and name.endswith(".html.j2"),
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
    )
    environment.filters["markdown"] = markdown_escape
    return environment
