"""Parts of the coverage run: the suite with the compiler on, and the tests of kernels with it off."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

WANTED = "not bench and not browser and not realtime"
PROGRAMS = {
    "demo": ("demo", "--headless", "--out", "{out}/programs/demo"),
    "flash": ("reproduce", "--only", "flash", "--out", "{out}/programs/flash"),
    "radar": ("reproduce", "--only", "radar", "--out", "{out}/programs/radar"),
}
"""What no test runs from end to end, for it takes minutes: arguments of `slz`."""


@dataclass(frozen=True, slots=True)
class Part:
    """One run of tests: its name, the paths, and whether kernels are compiled."""

    name: str
    paths: tuple[str, ...]
    compiled: bool
    limit_s: float
    wanted: str = WANTED

    def options(self) -> list[str]:
        """Return pytest's options."""
        chosen = ["-p", "tests.coverage.plugin", "-m", self.wanted, "--timeout", "0"]
        chosen += ["--processor-limit", f"{self.limit_s:g}"]
        # A kernel's 0/0 is NaN by design; numpy's scalars, which stand for it uncompiled, warn of it.
        quiet = [] if self.compiled else ["-W", "ignore::RuntimeWarning"]
        return [*chosen, *quiet, *self.paths]


def costs_file(data: Path) -> Path:
    """Return where a run's costs lie; a name that begins with the data's would be taken for more of it."""
    return data.with_name(f"costs-{data.name}.json")


PARTS = (
    # Kernels run as Python, a thousand times slower: small inputs end within the limit, flights are cut.
    Part(
        "uncompiled",
        (
            "tests/oracle", "tests/unit/slz", "tests/unit/companion/flight/sensors",
            "tests/unit/companion/flight/fusion", "tests/unit/companion/flight/outputs",
            "tests/unit/companion/desk/survey", "tests/unit/companion/desk/clouds",
            "tests/unit/companion/flight/dashboard/test_map_blocks.py",
            "tests/unit/companion/flight/mapping/test_clearance.py",
            "tests/property",
        ),
        compiled=False,
        limit_s=3.0,
    ),
    Part("compiled", ("tests",), compiled=True, limit_s=0.0),
    Part("realtime", ("tests/e2e", "tests/integration"), compiled=True, limit_s=0.0, wanted="realtime"),
)  # fmt: skip
