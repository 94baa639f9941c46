"""Optional packages: extra of the distribution that installs each, and the line for a missing one."""

from __future__ import annotations

import importlib.util
from collections.abc import Mapping

from companion.runtime.errors import UsageError

SURVEY = ("laspy", "lazrs", "rasterio", "pyproj", "pyogrio", "dask", "distributed", "jinja2")
PACKAGES: Mapping[str, Mapping[str, str]] = {
    "survey": {
        **{name: name for name in SURVEY},
        "lzf": "python-neo-lzf",
        "PIL": "pillow",
    },
    "page": {name: name for name in ("fastapi", "starlette", "uvicorn", "websockets")},
    "record": {"foxglove": "foxglove-sdk", "mcap": "mcap", "dpkt": "dpkt"},
    "plots": {"matplotlib": "matplotlib"},
    "ros": {"rosbags": "rosbags", "zenoh": "eclipse-zenoh", "xxhash": "xxhash", "zstandard": "zstandard"},
    "ouster": {"ouster": "ouster-sdk"},
}
"""Package of every optional module that this program imports, by the extra that installs it."""


def missing(extra: str) -> str | None:
    """Return the first package of an extra that is not installed, None where all are."""
    return next((name for module, name in PACKAGES[extra].items() if not _is_installed(module)), None)


def require(extra: str, purpose: str) -> None:
    """Check that an extra is installed, before a command starts its work.

    purpose: the command or option that needs it; begins the error's line.

    Raises
    ------
    UsageError
        A package of it is missing.
    """
    if (package := missing(extra)) is not None:
        raise UsageError(explain(purpose, package, extra))


def explain(purpose: str, package: str, extra: str) -> str:
    """Return the line on a missing package: which one, its extra, and the command that installs it."""
    return f"{purpose}: {package}, of the extra {extra}, is not installed: pip install 'slz[{extra}]'"


def extra_of(error: ModuleNotFoundError) -> tuple[str, str] | None:
    """Return the package that an import misses and its extra, None for a module of no extra."""
    module = (error.name or "").partition(".")[0]
    return next(((names[module], extra) for extra, names in PACKAGES.items() if module in names), None)


def _is_installed(module: str) -> bool:
    try:
        return importlib.util.find_spec(module) is not None
    except ModuleNotFoundError:  # raised by a finder that hides it
        return False
