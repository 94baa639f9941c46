"""Service discovery of BlueOS: the document at /register_service, by which its menu shows the page."""

from __future__ import annotations

from importlib.metadata import version
from typing import Any

PATH = "/register_service"


def registration() -> dict[str, Any]:
    """Return what BlueOS's helper expects of a web service.

    It opens in a window of its own: the page refuses to be framed by another one, and its addresses are
    absolute, so it does not work behind BlueOS's proxy.
    """
    return {
        "name": "Safe landing zones",
        "description": "Finds and watches landing zones with a LiDAR, and lands there.",
        "icon": "mdi-helicopter",
        "company": "slz contributors",
        "version": version("slz"),
        "webpage": "",
        "api": "/api",
        "new_page": True,
        "avoid_iframes": True,
        "works_in_relative_paths": False,
    }
