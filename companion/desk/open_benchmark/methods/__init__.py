"""Methods of the benchmark, one file each; the order is that of their publication."""

from __future__ import annotations

import runpy
from pathlib import Path
from typing import Any

from companion.desk.open_benchmark.landing_task import LandingMethod
from companion.desk.open_benchmark.methods.alhat_deterministic import METHOD as ALHAT_DETERMINISTIC
from companion.desk.open_benchmark.methods.alhat_probabilistic import METHOD as ALHAT_PROBABILISTIC
from companion.desk.open_benchmark.methods.every_return import METHOD as EVERY_RETURN
from companion.desk.open_benchmark.methods.gradient_threshold import METHOD as GRADIENT_THRESHOLD
from companion.desk.open_benchmark.methods.plane_threshold import METHOD as PLANE_THRESHOLD
from companion.desk.open_benchmark.methods.px4_avoidance import METHOD as PX4_AVOIDANCE
from companion.desk.open_benchmark.methods.slz_paper import METHOD as SLZ_PAPER
from companion.desk.open_benchmark.methods.slz_pipeline import METHOD as SLZ_PIPELINE
from companion.desk.open_benchmark.methods.traversability import METHOD as TRAVERSABILITY
from companion.runtime.errors import UsageError

METHODS: tuple[LandingMethod, ...] = (
    GRADIENT_THRESHOLD,
    PLANE_THRESHOLD,
    ALHAT_DETERMINISTIC,
    ALHAT_PROBABILISTIC,
    TRAVERSABILITY,
    PX4_AVOIDANCE,
    SLZ_PAPER,
    SLZ_PIPELINE,
)
REFERENCE: LandingMethod = EVERY_RETURN
OURS = SLZ_PIPELINE.name


def method_of_file(path: Path) -> LandingMethod:
    """Run a Python file and return its `METHOD`.

    Raises
    ------
    UsageError
        There is no such file, it fails, or it has no usable `METHOD`.
    """
    if not path.is_file():
        raise UsageError(f"--method-file {path}: there is no such file")
    try:
        found: Any = runpy.run_path(str(path)).get("METHOD")
    except (Exception, SystemExit) as error:
        line = " ".join(f"{type(error).__name__}: {error}".split())[:160]
        raise UsageError(f"--method-file {path}: it fails ({line})") from None
    named = isinstance(getattr(found, "name", None), str) and isinstance(getattr(found, "source", None), str)
    if not (named and callable(getattr(found, "judge", None))):
        raise UsageError(f"--method-file {path}: it needs METHOD with name, source and judge(returns, task)")
    method: LandingMethod = found
    return method
