"""Console of the command line: logging, progress, tables, and the notice of the first start."""

from __future__ import annotations

import contextlib
import logging
import sys
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rich.console import Console
from rich.logging import RichHandler
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn
from rich.table import Table

from companion.runtime import kernel_compilation
from companion.runtime.errors import UsageError

if TYPE_CHECKING:
    from companion.flight.dashboard.page import PageEndpoint

PLAIN = "%(asctime)s %(levelname)s %(name)s: %(message)s"
WIDE = 1000  # columns of a table written to a pipe or file
NO_COLUMNS: Mapping[str, Callable[[dict[str, Any]], str]] = {}
err = Console(stderr=True)


def stdout_console() -> Console:
    """Return the console of stdout; for a pipe or a file it is wide enough that nothing is cut off."""
    return Console() if sys.stdout.isatty() else Console(width=WIDE)


def compile_at_first(needs: kernel_compilation.Needs) -> None:
    """Compile missing kernels and explain why that takes a minute."""
    if not kernel_compilation.is_first(needs):
        return
    err.print("first start: compiling the kernels for this computer, a minute or two, once", highlight=False)
    columns = TextColumn("kernels"), BarColumn(), MofNCompleteColumn(), TimeElapsedColumn()
    with Progress(*columns, console=err, transient=True, disable=not err.is_terminal) as shown:
        task = shown.add_task("")
        kernel_compilation.compile_kernels(
            lambda done, total: shown.update(task, completed=done, total=total), needs
        )


def set_up_logging(verbose: bool, needs: kernel_compilation.Needs | None = None) -> None:
    """Compile missing kernels, by default those of flights; log to stderr, in colour on a terminal."""
    compile_at_first(kernel_compilation.of_flight() if needs is None else needs)
    level = logging.DEBUG if verbose else logging.INFO
    if err.is_terminal:
        rich = RichHandler(console=err, show_path=False, rich_tracebacks=False)
        logging.basicConfig(level=level, format="%(name)s: %(message)s", handlers=[rich])
    else:
        logging.basicConfig(level=level, format=PLAIN, stream=sys.stderr)
    logging.getLogger("asyncio").setLevel(logging.WARNING)
    logging.getLogger("laspy").setLevel(logging.CRITICAL)  # our one line reports a bad file
    for noisy in ("numba", "matplotlib", "rasterio", "PIL", "pyogrio", "distributed"):
        logging.getLogger(noisy).setLevel(logging.WARNING)


@contextlib.contextmanager
def page_endpoint(
    address: str | None, tokens: Path | None, background: Any = None
) -> Iterator[PageEndpoint | None]:
    """Open the port of the pilot's page, so that its errors are reported before the flight."""
    if address is None:
        for option, given in (("--dashboard-token", tokens), ("--background", background)):
            if given is not None:
                raise UsageError(f"{option} goes with --dashboard HOST:PORT")
        yield None
        return
    from companion.flight.dashboard.page import PageEndpoint

    with contextlib.closing(PageEndpoint(address, tokens)) as front:
        front.background = background
        err.print(f"the pilot's page: http://{front.address}/", highlight=False)
        yield front


class progress:  # noqa: N801 - a context manager used as a function
    """Progress bar on a terminal, removed at the end; none with --json."""

    def __init__(self, quiet: bool) -> None:
        self._bar = Progress(
            TextColumn("{task.description:<28}"),
            BarColumn(),
            TimeElapsedColumn(),
            console=err,
            transient=True,
            disable=quiet or not err.is_terminal,
        )
        self._task = self._bar.add_task("starting", total=1.0)

    def __enter__(self) -> Callable[[str, float], None]:
        self._bar.start()
        return self._step

    def _step(self, what: str, done: float) -> None:
        self._bar.update(self._task, description=what, completed=done)

    def __exit__(self, *_: object) -> None:
        self._bar.stop()


def zone_table(
    zones: list[dict[str, Any]], title: str, more: Mapping[str, Callable[[dict[str, Any]], str]] = NO_COLUMNS
) -> Table:
    """Return a table of the first 20 zones of a summary; more: further columns by heading."""
    table = Table(
        "zone", "area m²", "certainty", "slope °", "square m", "surface", "latitude", "longitude", *more
    )
    table.title = title
    for zone in zones[:20]:
        table.add_row(
            str(zone["id"]),
            f"{zone['area_m2']:.0f}",
            f"{zone['certainty']:.2f}",
            f"{zone['slope_deg']:.1f}",
            f"{zone['square_side_m']:.1f}",
            _surface(zone),
            f"{zone['lat']:.7f}",
            f"{zone['lon']:.7f}",
            *(text(zone) for text in more.values()),
        )
    return table


def _surface(zone: dict[str, Any]) -> str:
    """Return the surface below a zone's landing point, a roof with its height."""
    word, raised_m = zone.get("surface") or "unknown", zone.get("raised_m")
    return f"{word}, {raised_m:.0f} m up" if raised_m else str(word)
