"""Methods of the benchmark, in the order of their publication."""

from __future__ import annotations

import runpy
from pathlib import Path
from typing import Any

from companion.desk.open_benchmark.landing_task import LandingMethod
from companion.desk.open_benchmark.methods.alhat import AlhatDeterministic, AlhatProbabilistic
from companion.desk.open_benchmark.methods.px4_avoidance import Px4Avoidance
from companion.desk.open_benchmark.methods.slz_methods import SlzPaper, SlzPipeline
from companion.desk.open_benchmark.methods.threshold import EveryReturn, GradientThreshold, PlaneThreshold
from companion.desk.open_benchmark.methods.traversability import Traversability
from companion.runtime.errors import UsageError

METHODS: tuple[LandingMethod, ...] = (
    GradientThreshold(),
    PlaneThreshold(),
    AlhatDeterministic(),
    AlhatProbabilistic(),
    Traversability(),
    Px4Avoidance(),
    SlzPaper(),
    SlzPipeline(),
)
REFERENCE: LandingMethod = EveryReturn()
OURS = METHODS[-1].name


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
