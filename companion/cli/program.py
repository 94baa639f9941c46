"""Command line: the commands of `slz`, and how they end."""

from __future__ import annotations

import io
import platform
import sys
from importlib import metadata
from typing import Annotated, NoReturn, cast

import typer

import params
from companion.cli.bench import bench
from companion.cli.calibrate import calibrate
from companion.cli.demo import demo
from companion.cli.doctor import doctor
from companion.cli.evidence import evidence
from companion.cli.map import map_
from companion.cli.nearest import nearest
from companion.cli.params_table import params_
from companion.cli.replay import replay
from companion.cli.reproduce import reproduce
from companion.cli.run import run
from companion.cli.safe_map_benchmark import benchmark
from companion.cli.simulator import sim
from companion.runtime import extras
from companion.runtime.errors import CompanionError, UsageError
from companion.runtime.interrupt import Interrupted, Interrupts

app = typer.Typer(pretty_exceptions_enable=False)
_BadArguments = cast(type[Exception], typer.BadParameter.__base__)  # click's, of typer's version


def _versions() -> str:
    """Return the versions of slz, Python, Numba and NumPy, and the platform, in one line."""
    python = platform.python_version()
    libraries = ", ".join(f"{name} {metadata.version(name)}" for name in ("numba", "numpy"))
    return f"slz {metadata.version('slz')}, Python {python}, {libraries}, {platform.platform()}"


def _show_versions(asked: bool) -> None:
    """Print the versions and end, when the option is given."""
    if asked:
        print(_versions())
        raise typer.Exit


@app.callback()
def slz(
    version: Annotated[
        bool,
        typer.Option("--version", is_eager=True, callback=_show_versions, help="Print the versions and end."),
    ] = False,
) -> None:
    """Safe landing zones from LiDAR: map the ground, choose where to land, land there."""


app.command()(demo)
app.command(
    add_help_option=False, context_settings={"allow_extra_args": True, "ignore_unknown_options": True}
)(sim)
app.command()(run)
app.command()(replay)
app.command()(calibrate)
app.command()(doctor)
app.command("map")(map_)
app.command(context_settings={"ignore_unknown_options": True})(nearest)  # because longitudes may be negative
app.command()(reproduce)
app.command()(evidence)
app.command()(bench)
app.command()(benchmark)
app.command("params")(params_)


def main() -> None:
    """Run the command line; every expected error ends in one line and exit code 1 or 2.

    SIGINT and SIGTERM end every command with one line and exit code 130 or 143, except a flight of `slz run`.
    A character that the terminal's encoding lacks is shown as a question mark.
    """
    if isinstance(sys.stdout, io.TextIOWrapper):
        sys.stdout.reconfigure(errors="replace")  # stderr escapes such characters already
    interrupts = Interrupts()
    with interrupts.installed():
        try:
            asked = sys.argv[1:]
            code = app(asked or ["--help"], prog_name="slz", standalone_mode=False, obj=interrupts)
            sys.exit(code or 0 if asked else 2)
        except Interrupted as signal:
            interrupts.report()
            sys.exit(signal.exit_code)
        except _BadArguments as error:
            _fail(_in_words(error), 2)
        except (UsageError, params.ParameterError) as error:
            _fail(error, 2)
        except CompanionError as error:
            _fail(error, 1)
        except ModuleNotFoundError as error:
            if (found := extras.extra_of(error)) is None:
                raise
            _fail(extras.explain(" ".join(["slz", *asked[:1]]), *found), 2)
        except RuntimeError as error:
            if "no locator available" not in str(error):  # Numba's: folders are read-only
                raise
            _fail("no folder takes the compiled kernels: set NUMBA_CACHE_DIR to one that can be written", 2)


def _in_words(error: Exception) -> str:
    """Return typer's message on bad arguments as one line, with the command whose help explains more."""
    said = " ".join(str(getattr(error, "format_message", error.__str__)()).split()).rstrip(".")
    command = getattr(getattr(error, "ctx", None), "command_path", "slz")
    return f"{said[:1].lower()}{said[1:]} ('{command} --help' shows what there is)"


def _fail(error: Exception | str, code: int) -> NoReturn:
    print(f"slz: {error}", file=sys.stderr)
    sys.exit(code)
