"""Command line: `slz demo`, `sim`, `run`, `doctor`, `map`, `bench`, `params`."""

from __future__ import annotations

import contextlib
import json
import logging
import os
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, NoReturn, cast

import typer
from rich.console import Console
from rich.logging import RichHandler
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn
from rich.table import Table

import params
from companion.runtime import kernel_compilation
from companion.runtime.errors import CompanionError, UsageError
from companion.runtime.interrupt import Interrupted, Interrupts

if TYPE_CHECKING:
    from companion.flight.dashboard.page import PageEndpoint

app = typer.Typer(
    add_completion=False,
    pretty_exceptions_enable=False,
    help="Safe landing zones from LiDAR: map the ground, choose where to land, land there.",
)
PLAIN = "%(asctime)s %(levelname)s %(name)s: %(message)s"
DEMO_PAGE = "127.0.0.1:0"  # any free port
WIDE = 1000  # columns of a table written to a pipe or file
err = Console(stderr=True)
_BadArguments = cast(type[Exception], typer.BadParameter.__base__)  # click's, of typer's version

LIDAR = "livox:, velodyne: or ouster:HOST:PORT, lightware:/dev/ttyX,BAUD, or mavlink: (docs/sensors.md)."
Key = Annotated[
    Path | None,
    typer.Option(help="File with the key of MAVLink signing: 32 bytes, 64 hex digits or a passphrase."),
]
State = Annotated[Path | None, typer.Option(help="Folder for what is set in flight ($XDG_STATE_HOME/slz).")]
Profile = Annotated[str, typer.Option(help="quadcopter, helicopter or a TOML file.")]
Settings = Annotated[list[str], typer.Option("--set", metavar="NAME=VALUE", help="Set one parameter.")]
System = Annotated[
    int | None,
    typer.Option(min=1, max=255, help="MAVLink system of the vehicle, where several are heard."),
]
Json = Annotated[bool, typer.Option("--json", help="Print one JSON object on stdout.")]
Dashboard = Annotated[
    str | None, typer.Option(metavar="HOST:PORT", help="Serve the pilot's page (docs/page.md).")
]
DashboardToken = Annotated[
    Path | None,
    typer.Option(help="File with lines 'operator TOKEN', 'viewer TOKEN': needed but on 127.0.0.1."),
]
Prior = Annotated[
    Path | None,
    typer.Option(metavar="DIR", help="Survey of slz map to begin with: where to look first."),
]
Verbose = Annotated[bool, typer.Option("--verbose", "-v", help="Log more, to stderr.")]


def main() -> None:
    """Run the command line; every expected error ends in one line and exit code 1 or 2.

    SIGINT and SIGTERM end every command with one line and exit code 130 or 143, except a flight of `slz run`.
    """
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


def _in_words(error: Exception) -> str:
    """Return typer's message on bad arguments as one line, with the command whose help explains more."""
    said = " ".join(str(getattr(error, "format_message", error.__str__)()).split()).rstrip(".")
    command = getattr(getattr(error, "ctx", None), "command_path", "slz")
    return f"{said[:1].lower()}{said[1:]} ('{command} --help' shows what there is)"


@contextlib.contextmanager
def _front(address: str | None, tokens: Path | None) -> Iterator[PageEndpoint | None]:
    """Open the port of the pilot's page, so that its errors are reported before the flight."""
    if address is None:
        if tokens is not None:
            raise UsageError("--dashboard-token goes with --dashboard HOST:PORT")
        yield None
        return
    from companion.flight.dashboard.page import PageEndpoint

    with contextlib.closing(PageEndpoint(address, tokens)) as front:
        err.print(f"the pilot's page: http://{front.address}/", highlight=False)
        yield front


def _fail(error: Exception | str, code: int) -> NoReturn:
    print(f"slz: {error}", file=sys.stderr)
    sys.exit(code)


def _out() -> Console:
    """Return the console of stdout; for a pipe or a file it is wide enough that nothing is cut off."""
    return Console() if sys.stdout.isatty() else Console(width=WIDE)


def _compile_at_first(mode: str = "default") -> None:
    """Compile missing kernels and explain why that takes a minute."""
    also = kernel_compilation.of_mode(mode)
    if not kernel_compilation.is_first(also):
        return
    err.print("first start: compiling the kernels for this computer, about a minute", highlight=False)
    columns = TextColumn("kernels"), BarColumn(), MofNCompleteColumn(), TimeElapsedColumn()
    with Progress(*columns, console=err, transient=True, disable=not err.is_terminal) as shown:
        task = shown.add_task("")
        kernel_compilation.compile_kernels(
            lambda done, total: shown.update(task, completed=done, total=total), also
        )


def _log(verbose: bool) -> None:
    _compile_at_first()
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


@app.command()
def demo(
    context: typer.Context,
    scene: Annotated[
        str, typer.Option(help="stadium, plain, hill, streets, mountains, dense or dust_out.")
    ] = "stadium",
    sensor: Annotated[str, typer.Option(help="lidar, flash, radar or lidar+radar.")] = "lidar",
    seed: Annotated[int, typer.Option(min=0, help="Seed of scene, wind and noise.")] = 1,
    speedup: Annotated[
        float, typer.Option(help="Simulated seconds per second; 0 is as fast as possible.")
    ] = 0.0,
    headless: Annotated[bool, typer.Option("--headless", help="No live display.")] = False,
    out: Annotated[Path, typer.Option(help="Folder for maps and figures.")] = Path("out/demo"),
    intruder: Annotated[
        str, typer.Option(help="car@15: a car drives onto the landing point below 15 m.")
    ] = "none",
    point_rate: Annotated[float, typer.Option(help="LiDAR points per second.")] = 200_000.0,
    limit_s: Annotated[float, typer.Option(help="Give up after so many simulated seconds.")] = 900.0,
    dashboard: Dashboard = None,
    dashboard_token: DashboardToken = None,
    profile: Profile = "quadcopter",
    setting: Settings = [],  # noqa: B006 - typer reads the default
    prior: Prior = None,
    as_json: Json = False,
    verbose: Verbose = False,
) -> None:
    """Fly the simulator: take off, survey, choose a zone and land in it."""
    _log(verbose)
    from companion.desk.demo import demonstration

    chosen = demonstration.sensor_named(sensor)
    parameters = params.load(profile, [*chosen.settings_for(scene), *setting])
    _compile_at_first(parameters.mode)
    plan = demonstration.Plan(scene, seed, speedup, out, intruder, point_rate, limit_s, chosen, prior)
    demonstration.check(plan)
    with _front(dashboard or (None if headless else DEMO_PAGE), dashboard_token) as front:
        summary = demonstration.fly(plan, parameters, err, context.obj, live=not headless, front=front)
    if as_json:
        print(json.dumps(summary))
    else:
        _out().print(demonstration.table(summary))
    if not (summary["landed"] and summary["touchdown_safe"]):
        sys.exit(1)


@app.command(
    add_help_option=False, context_settings={"allow_extra_args": True, "ignore_unknown_options": True}
)
def sim(context: typer.Context) -> None:
    """Run the simulated vehicle alone: `slz sim --help` shows its options."""
    os.execv(sys.executable, [sys.executable, "-m", "sitl", *context.args])


@app.command()
def run(
    mavlink: Annotated[str, typer.Option(help="udpin:HOST:PORT, tcp:HOST:PORT or /dev/ttyX,BAUD.")],
    lidar: Annotated[str, typer.Option(help=LIDAR)],
    land: Annotated[
        str, typer.Option(help="ask: wait for the operator. auto: land without further word.")
    ] = "ask",
    profile: Profile = "quadcopter",
    setting: Settings = [],  # noqa: B006
    mavlink_key: Key = None,
    state_dir: State = None,
    radar: Annotated[
        str | None, typer.Option(help="A radar beside the LiDAR: radar:HOST:PORT (docs/instruments.md).")
    ] = None,
    record: Annotated[Path | None, typer.Option(help="Record the flight: FILE.mcap.")] = None,
    out: Annotated[Path | None, typer.Option(help="Folder for maps at the end.")] = None,
    dashboard: Dashboard = None,
    dashboard_token: DashboardToken = None,
    foxglove: Annotated[
        int | None,
        typer.Option(min=0, max=65535, metavar="PORT", help="Serve Foxglove's live view on 127.0.0.1:PORT."),
    ] = None,
    prior: Prior = None,
    system: System = None,
    as_json: Json = False,
    verbose: Verbose = False,
) -> None:
    """Run on the vehicle: read the autopilot and the LiDAR, map, choose and land."""
    _log(verbose)
    from companion.flight.services import settings
    from companion.runtime.state_directory import StateDir, default_state_dir

    if land not in ("ask", "auto"):
        raise UsageError(f"--land {land!r}: use ask or auto")
    state = StateDir(state_dir or default_state_dir())
    parameters = settings.load(profile, setting, state)
    _compile_at_first(parameters.mode)
    from companion.cli import run

    with _front(dashboard, dashboard_token) as front:
        summary = run.run(
            mavlink,
            lidar,
            land == "auto",
            parameters,
            out,
            state,
            key_file=mavlink_key,
            record=record,
            radar_url=radar,
            front=front,
            foxglove_port=foxglove,
            prior=prior,
            system=system,
        )
    if as_json:
        print(json.dumps(summary))


@app.command()
def replay(
    context: typer.Context,
    file: Annotated[
        Path, typer.Argument(help="Recording of slz run --record, ROS 2 bag, or FLIGHT.tlog with --points.")
    ],
    out: Annotated[Path | None, typer.Option(help="Folder for the maps at the end.")] = None,
    points: Annotated[
        str | None,
        typer.Option(
            help="Topic of the points of a bag; beside a .tlog FILE.pcap, CLOUD.laz or a folder of PCD."
        ),
    ] = None,
    pose: Annotated[
        list[str], typer.Option(help="Topic of the poses of a bag; or twice: NavSatFix and Imu.")
    ] = [],  # noqa: B006
    lidar: Annotated[
        str | None, typer.Option(help="livox, velodyne or ouster?meta=FILE; told by the packets else.")
    ] = None,
    origin: Annotated[
        str | None, typer.Option(help="LAT,LON,ALT where the local frame of a bag's poses begins.")
    ] = None,
    vertical_unit: Annotated[
        str | None,
        typer.Option(metavar="m|ft|us-ft", help="Unit of the heights of CLOUD.laz, whatever it says."),
    ] = None,
    profile: Annotated[str, typer.Option(help="Profile for files of other programs.")] = "quadcopter",
    speed: Annotated[float, typer.Option(min=0, help="Seconds of flight a second; 0: all it can.")] = 0.0,
    start: Annotated[float, typer.Option("--from", min=0, help="Map from so many seconds on.")] = 0.0,
    until: Annotated[float, typer.Option(min=0, help="End after so many seconds.")] = 1e9,
    system: System = None,
    dashboard: Dashboard = None,
    dashboard_token: DashboardToken = None,
    setting: Settings = [],  # noqa: B006
    as_json: Json = False,
    verbose: Verbose = False,
) -> None:
    """Run a recorded flight again; exit 1 if its zones are not those of the flight."""
    _log(verbose)
    from companion.desk.replay import replay_run
    from companion.desk.replay.recording_type import Beside

    beside = Beside(points, tuple(pose), lidar, origin, profile, system, vertical_unit)
    with _front(dashboard, dashboard_token) as front:
        if front is not None:
            from companion.desk.replay.replay_page import show

            interrupts: Interrupts = context.obj
            show(file, setting, front, beside, speed, interrupts.handled_by)
            return

    with _progress(as_json) as step:
        summary = replay_run.run(
            file, setting, out, speed, (start, until), lambda _at, text: step(text, 0.0), beside
        )
    for line in (*summary["warnings"], *([f"no zone: {why}"] if (why := summary["why_no_zones"]) else [])):
        print(f"slz: {file}: {line}", file=sys.stderr)
    if as_json:
        print(json.dumps(summary))
    else:
        title = f"{summary['windows']} windows"
        if "source" not in summary:
            title += f", {summary['identical']} as in flight"
        _out().print(_zone_table(summary["zones"], title))
        if summary["cut"]:
            print(f"slz: {file}: it is not whole: {summary['cut']}", file=sys.stderr)
        if summary["lost_messages"]:
            print(f"slz: {file}: {summary['lost_messages']} messages were lost in flight", file=sys.stderr)
    if summary["different"] and not setting and start == 0:
        sys.exit(1)


@app.command()
def calibrate(
    file: Annotated[Path, typer.Argument(help="Recording of slz run --record.")],
    setting: Settings = [],  # noqa: B006
    as_json: Json = False,
    verbose: Verbose = False,
) -> None:
    """Find the LiDAR's boresight and time offset from a recorded flight over ground seen several times."""
    _log(verbose)
    from companion.desk.calibrate import calibration

    summary = calibration.run(file, setting)
    if as_json:
        print(json.dumps(summary))
    else:
        _out().print(_calibration_table(summary))


@app.command()
def doctor(
    mavlink: Annotated[str, typer.Option(help="udpin:HOST:PORT, tcp:HOST:PORT or /dev/ttyX,BAUD.")],
    lidar: Annotated[str, typer.Option(help=LIDAR)],
    seconds: Annotated[float, typer.Option(min=3.0, max=600.0, help="How long to listen.")] = 10.0,
    system: System = None,
    mavlink_key: Key = None,
    state_dir: State = None,
    profile: Profile = "quadcopter",
    setting: Settings = [],  # noqa: B006
    as_json: Json = False,
    verbose: Verbose = False,
) -> None:
    """Check link, clock, autopilot parameters, LiDAR and this computer; exit 1 if what is needed is wrong."""
    _log(verbose)
    from companion.flight.doctor import consultation

    parameters = params.load(profile, setting)
    signing = None
    if mavlink_key is not None:
        from companion.flight.services.services import start_signing
        from companion.runtime.state_directory import StateDir, default_state_dir

        signing = start_signing(mavlink_key, StateDir(state_dir or default_state_dir()))
    findings = consultation.examine(mavlink, lidar, parameters, seconds, signing, system)
    summary = consultation.document(findings)
    if as_json:
        print(json.dumps(summary))
    else:
        _out().print(consultation.table(findings))
    if not summary["ok"]:
        sys.exit(1)


@app.command("map")
def map_(
    files: Annotated[list[Path], typer.Argument(help="LAS, LAZ, COPC, PCD, PLY or text: x y z.")],
    out: Annotated[Path, typer.Option(help="Folder for the results.")],
    cell_m: Annotated[float | None, typer.Option(help="Side of a cell, m (0.5).")] = None,
    min_square_m: Annotated[float | None, typer.Option(help="Side of the safe square, m (3).")] = None,
    max_slope_deg: Annotated[float | None, typer.Option(help="Steepest safe slope, degrees (10).")] = None,
    crs: Annotated[str | None, typer.Option(help="CRS of files that name none, such as EPSG:2992.")] = None,
    vertical_unit: Annotated[
        str | None,
        typer.Option(metavar="m|ft|us-ft", help="Unit of the heights, where files do not say or contradict."),
    ] = None,
    classified: Annotated[
        bool, typer.Option("--classified", help="Write the points too, class 64 safe, 65 unsafe, 66 unknown.")
    ] = False,
    tile_m: Annotated[
        float | None, typer.Option(help="Side of a tile, m (1024 cells); it changes no result.")
    ] = None,
    workers: Annotated[
        int | None, typer.Option(help="Worker processes on this machine; none: all in this one.")
    ] = None,
    scheduler: Annotated[
        str | None, typer.Option(metavar="tcp://HOST:PORT", help="Use the workers of a Dask scheduler.")
    ] = None,
    profile: Profile = "quadcopter",
    setting: Settings = [],  # noqa: B006
    as_json: Json = False,
    verbose: Verbose = False,
) -> None:
    """Find the landing zones in stored clouds."""
    _log(verbose)
    from companion.desk import survey

    given = {"cell_m": cell_m, "min_square_m": min_square_m, "safe_slope_deg": max_slope_deg}
    if profile == "quadcopter" and cell_m is None:
        given["cell_m"] = 0.5
    own = [f"{name}={value}" for name, value in given.items() if value is not None]
    parameters = params.load(profile, [*own, *setting])
    _compile_at_first(parameters.mode)
    with survey.engine(scheduler, workers) as engine, _progress(as_json) as step:
        plan = survey.Plan(crs, classified, tile_m, engine, vertical_unit)
        summary = survey.run(files, out, parameters, step, plan)
    if as_json:
        print(json.dumps(summary))
    else:
        _out().print(_zone_table(summary["zones"], f"{len(summary['zones'])} zones, maps in {out}"))
        if summary["no_zone"]:
            _out().print(f"no zone: {summary['no_zone']}")
    for skipped in summary["skipped"]:
        print(f"slz: left out: {skipped['reason']}", file=sys.stderr)
    if summary["skipped"]:
        sys.exit(2)


@app.command(context_settings={"ignore_unknown_options": True})  # because longitudes may be negative
def nearest(
    lat: Annotated[float, typer.Argument(help="Latitude, degrees north.")],
    lon: Annotated[float, typer.Argument(help="Longitude, degrees east.")],
    folder: Annotated[Path, typer.Option("--survey", help="Folder that slz map wrote.")] = Path(),
    radius_m: Annotated[
        float | None, typer.Option(help="Only zones that hold it or whose landing points lie this near, m.")
    ] = None,
    most: Annotated[int, typer.Option(help="So many at most.")] = 10,
    as_json: Json = False,
) -> None:
    """Find the surveyed landing zones nearest to a position."""
    from companion.desk.survey import nearest_zones as question

    answer = question.nearest(folder, lat, lon, radius_m, most)
    if as_json:
        print(json.dumps(answer))
        return
    table = Table(
        "zone", "distance m", "bearing °", "area m²", "certainty", "slope °", "latitude", "longitude"
    )
    for zone in answer["zones"]:
        table.add_row(
            str(zone["id"]),
            f"{zone['distance_m']:.0f}",
            f"{zone['bearing_deg']:.0f}",
            f"{zone['area_m2']:.0f}",
            f"{zone['certainty']:.2f}",
            "" if zone["slope_deg"] is None else f"{zone['slope_deg']:.1f}",
            f"{zone['lat']:.7f}",
            f"{zone['lon']:.7f}",
        )
    _out().print(table if answer["zones"] else f"no zone: {answer['no_zone']}")


@app.command()
def reproduce(
    out: Annotated[Path, typer.Option(help="Folder for the page, pictures and flown surveys.")],
    only: Annotated[str, typer.Option(help="Only scenes whose name holds this; flash or radar.")] = "",
    as_json: Json = False,
    verbose: Verbose = False,
) -> None:
    """Run the sources' scenes and write one page with their figures and ours."""
    _log(verbose)
    from companion.desk import reproduce as reproduction

    with _progress(as_json) as step:
        summary = reproduction.run(out, step, only)
    if as_json:
        print(json.dumps(summary))
    else:
        _out().print(f"see {summary['files'][1]}")


@app.command()
def bench(
    points: Annotated[Path, typer.Option(help="File of little-endian float64 t (s), x, y, z (m).")],
    cell_m: Annotated[float, typer.Option(help="Side of a cell, m.")],
    zone_m: Annotated[float, typer.Option(help="Side of the map, m.")],
    min_square_m: Annotated[float, typer.Option(help="Side of the safe square, m.")],
    min_boundary: Annotated[int, typer.Option(help="Boundary points that a zone must have.")],
    mode: Annotated[str, typer.Option(help="source: the paper's rules. default: ours.")] = "default",
    windows: Annotated[int | None, typer.Option(min=1, help="Only so many windows.")] = None,
    as_json: Json = False,
) -> None:
    """Time the pipeline on windows of 1 s of a file of points."""
    _compile_at_first(mode)
    from companion.desk import benchmark

    case = benchmark.Case(points, cell_m, zone_m, min_square_m, min_boundary, mode, windows)
    summary = benchmark.run(case)
    if as_json:
        print(json.dumps(summary))
        return
    shown = Table("", "ms", title=f"{summary['windows']} windows, {summary['points_per_s']:,} points/s")
    for name, ms in {**summary["ms"], **summary["stage_ms"]}.items():
        shown.add_row(name, f"{ms:.3f}")
    _out().print(shown)


@app.command("params")
def params_(
    profile: Profile = "quadcopter",
    setting: Settings = [],  # noqa: B006
    as_json: Json = False,
) -> None:
    """List every parameter with its value, range and meaning."""
    values = params.load(profile, setting).model_dump()
    if as_json:
        table = {
            row.name: {
                "value": values[row.name],
                "mavlink": row.mavlink,
                "unit": row.unit,
                "allowed": params.allowed(row),
                "default": row.default,
                "source": row.source,
                "description": row.sentence,
                "live": row.live,
            }
            for row in params.rows()
        }
        print(json.dumps(table))
        return
    shown = Table("name", "MAVLink", "value", "allowed", "source", "meaning")
    for row in params.rows():
        shown.add_row(
            row.name, row.mavlink, str(values[row.name]), params.allowed(row), row.source, row.sentence
        )
    _out().print(shown)


class _progress:  # noqa: N801 - a context manager used as a function
    """Progress bar on a terminal, removed at the end; none with --json."""

    def __init__(self, quiet: bool) -> None:
        from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

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


def _calibration_table(found: dict[str, Any]) -> Table:
    title = f"returns agree to {found['after_m'] * 100:.1f} cm, before {found['before_m'] * 100:.1f} cm"
    table = Table("", "correction", "standard error", title=title)
    for name, value in found["correction"].items():
        error = found["standard_error"][name]
        table.add_row(name, *(("not shown", "") if value is None else (f"{value:+.3f}", f"{error:.3f}")))
    for name, value in found["parameters"].items():
        table.add_row(f"--set {name}={value:g}", "", "")
    return table


def _zone_table(zones: list[dict[str, Any]], title: str) -> Table:
    table = Table("zone", "area m²", "certainty", "slope °", "square m", "latitude", "longitude", title=title)
    for zone in zones[:20]:
        table.add_row(
            str(zone["id"]),
            f"{zone['area_m2']:.0f}",
            f"{zone['certainty']:.2f}",
            f"{zone['slope_deg']:.1f}",
            f"{zone['square_side_m']:.1f}",
            f"{zone['lat']:.7f}",
            f"{zone['lon']:.7f}",
        )
    return table
