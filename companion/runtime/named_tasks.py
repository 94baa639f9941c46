"""Named tasks that run together: the first one to fail, or to stop them, ends all."""

from __future__ import annotations

import asyncio
from collections.abc import Coroutine, Mapping
from typing import Any


class Stopped(Exception):  # noqa: N818 - not an error
    """Raised by a task to end all of them."""


async def run_together(parts: Mapping[str, Coroutine[Any, Any, None]]) -> BaseException | None:
    """Run tasks until one fails, or raises `Stopped`; return the failure, None after `Stopped`.

    The failure is returned bare: raised within, Python before 3.11.4 would wrap it in a group.
    """
    failed: BaseException | None = None
    try:
        async with asyncio.TaskGroup() as group:
            for name, part in parts.items():
                group.create_task(part, name=name)
    except* Stopped:
        pass
    except* Exception as errors:
        failed = _first(errors)
    return failed


def _first(errors: BaseExceptionGroup[BaseException]) -> BaseException:
    error: BaseException = errors
    while isinstance(error, BaseExceptionGroup):
        error = error.exceptions[0]
    return error
