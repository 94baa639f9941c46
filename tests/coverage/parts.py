"""What is run for coverage: the suite with the compiler on, and what reaches kernels with it off."""

from __future__ import annotations

from dataclasses import dataclass

WANTED = "not bench and not browser and not realtime"


@dataclass(frozen=True, slots=True)
class Part:
    """One run of tests: its name, the paths, and whether kernels are compiled."""

    name: str
    paths: tuple[str, ...]
    compiled: bool
    limit_s: float

    def options(self) -> list[str]:
        """Return pytest's options."""
        chosen = [
            "-p",
            "tests.coverage.plugin",
            "-m",
            WANTED,
            "--timeout",
            "0",
            "--processor-limit",
            f"{self.limit_s:g}",
        ]
        # A kernel's 0/0 is NaN by design; numpy's scalars, which stand for it uncompiled, warn of it.
        return (
            [*chosen, *self.paths]
            if self.compiled
            else [*chosen, "-W", "ignore::RuntimeWarning", *self.paths]
        )


PARTS = (
    # Kernels run as Python, a thousand times slower: small inputs end within the limit, flights are cut.
    Part(
        "uncompiled",
        (
            "tests/oracle", "tests/unit/slz", "tests/unit/companion/sensors", "tests/unit/companion/fusion",
            "tests/unit/companion/dashboard/test_map_blocks.py", "tests/property",
        ),
        compiled=False,
        limit_s=3.0,
    ),
    Part("compiled", ("tests",), compiled=True, limit_s=0.0),
)  # fmt: skip
