"""Text of artefacts in Markdown: shown as it is, in one line."""

from __future__ import annotations

import pytest

from companion.desk.page_template import markdown_escape


@pytest.mark.parametrize(
    ("text", "shown"),
    [
        ("<img src=x onerror=alert(1)> & co", "&lt;img src=x onerror=alert(1)&gt; &amp; co"),
        ("a\nb\r\n| c \u2028d\x85e", "a b \\| c d e"),
        ("[a](b) ![c](d)", "\\[a\\](b) !\\[c\\](d)"),
        ("`a` *b* _c_ ~~d~~ \\|", "\\`a\\` \\*b\\* \\_c\\_ \\~\\~d\\~\\~ \\\\\\|"),
        ("tests/a_b.py::test_c", "tests/a_b.py::test_c"),
        ("# a", "\\# a"),
        ("\n- a", "\\- a"),
        ("--- a", "\\--- a"),
        ("12. a", "12\\. a"),
        ("12.5 m", "12\\.5 m"),
        ("12 m - 3", "12 m - 3"),
        ("", ""),
    ],
)
def test_marks_of_markdown_and_html_are_text(text: str, shown: str) -> None:
    assert markdown_escape(text) == shown
