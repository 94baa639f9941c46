"""Hook of the site's build: what a page loads must lie in the site itself."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

from mkdocs.exceptions import PluginError

LOADED = re.compile(
    r"""<(?:script|img|iframe|source|audio|video|embed)\b[^>]*\ssrc\s*=\s*["']?(?:https?:)?//"""
    r"""|<link\b(?=[^>]*\srel\s*=\s*["']?(?:stylesheet|preload|preconnect|modulepreload|icon))[^>]*"""
    r"""\shref\s*=\s*["']?(?:https?:)?//"""
    r"""|@import\s*(?:url\()?["']?(?:https?:)?//"""
    r"""|url\(\s*["']?(?:https?:)?//""",
    re.IGNORECASE,
)


def loaded_from_outside(text: str) -> list[str]:
    """Return what a page or style sheet would load from another host."""
    return [found.group(0) for found in LOADED.finditer(text)]


def on_post_build(config: Any, **_: Any) -> None:
    """Fail where a page would load a font, a script, a style or a picture from another host."""
    site = Path(config["site_dir"])
    for path in sorted([*site.rglob("*.html"), *site.rglob("*.css")]):
        for found in loaded_from_outside(path.read_text("utf-8")):
            raise PluginError(f"{path.relative_to(site)} loads from another host: {found}")
