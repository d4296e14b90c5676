"""The command line: each verb reads, calls the library, and says in a few lines what came out.

Whatever is heavy is imported by the verb that needs it, so that ``--help`` answers at once.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated, Any

import typer

from clutchest import __version__
from clutchest.errors import ClutchestError

Progress = Callable[[str, float | None], None]

app = typer.Typer(
    add_completion=False,
    no_args_is_help=True,
    rich_markup_mode=None,
    pretty_exceptions_enable=False,
    help="Clutch temperatures, wear and friction from production CAN signals.",
)

Logs = Annotated[
    list[str],
    typer.Argument(
        metavar="LOG",
        show_default=False,
        help="CAN logs (.log .asc .blf .trc .csv .mf4, also .gz), decoded .csv or .parquet, or the "
        "name of a shipped log: demo.",
    ),
]
VehicleName = Annotated[
    str,
    typer.Option(
        "--vehicle",
        metavar="V",
        show_default=False,
        help="A vehicle file, or a shipped vehicle: truck, gt350, j1939_t270.",
    ),
]
Out = Annotated[Path, typer.Option("--out", metavar="DIR", help="Folder for the results.")]
AsJson = Annotated[
    bool,
    typer.Option(
        "--json", help="Print the machine-readable result on stdout, and nothing else there."
    ),
]
DEFAULT_OUT = Path("clutchest-out")


def main() -> None:
    """Run the command line.  Bad input ends in one line on stderr and exit code 1."""
    try:
        app()
    except ClutchestError as problem:
        _fail(str(problem))
    except MemoryError as problem:
        _fail(f"not enough memory: {problem or 'the log or the duration is too long'}")
    except OSError as problem:
        where = f"{problem.filename}: " if problem.filename else ""
        _fail(f"{where}{problem.strerror or problem}")


def _fail(problem: str) -> None:
    print(f"clutchest: {' '.join(problem.split())}", file=sys.stderr)
    sys.exit(1)


def _version(wanted: bool) -> None:
    if wanted:
        print(f"clutchest {__version__}")
        raise typer.Exit


@app.callback()
def _common(
    version: Annotated[
        bool, typer.Option("--version", callback=_version, is_eager=True, help="Print the version.")
    ] = False,
) -> None:
    pass


@contextmanager
def _progress() -> Iterator[Progress]:
    """Shows ``(text, share done or None)`` as a bar on stderr; in a pipe it stays quiet."""
    if not sys.stderr.isatty():
        yield lambda text, share: None
        return
    from rich.console import Console
    from rich.progress import BarColumn, SpinnerColumn, TextColumn, TimeElapsedColumn
    from rich.progress import Progress as Bar

    columns = (SpinnerColumn(), TextColumn("{task.description}"), BarColumn(), TimeElapsedColumn())
    with Bar(*columns, console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task("starting", total=None)

        def show(text: str, share: float | None) -> None:
            total = None if share is None else 1.0
            bar.update(task, description=text, total=total, completed=share or 0.0)

        yield show


def _print_json(value: Any) -> None:
    from clutchest.record.files import json_text

    sys.stdout.write(json_text(value))


def _note(text: str) -> None:
    print(text, file=sys.stderr)


@app.command()
def replay(
    logs: Logs,
    vehicle: VehicleName,
    out: Out = DEFAULT_OUT,
    state: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE",
            show_default=False,
            help="state.json of the drive before: its estimates carry over.",
        ),
    ] = None,
    rate: Annotated[
        float,
        typer.Option(metavar="HZ", min=0.01, max=1000.0, help="Rows per second of the estimates."),
    ] = 10.0,
    smooth: Annotated[
        bool,
        typer.Option("--smooth", help="Also the estimates that each whole drive supports."),
    ] = False,
    innovations: Annotated[
        bool, typer.Option("--innovations", help="Also write innovations.parquet: every misfit.")
    ] = False,
    as_json: AsJson = False,
) -> None:
    """Estimate temperatures, wear and friction over recorded drives.

    Writes estimates.parquet, summary.json, recording.rrd (open it with `rerun`) and state.json.
    Logs whose clocks join are pieces of one drive, others drives of their own.

    \b
    Example:
      clutchest replay monday.log tuesday.log --vehicle truck --out results
      clutchest replay wednesday.log --vehicle truck --state results/state.json
    """
    with _progress() as progress:
        progress("loading", None)
        from clutchest.estimate.replay import replay as estimate
        from clutchest.reading import read_log
        from clutchest.record.files import read_state, write_run
        from clutchest.vehicle import load_vehicle

        car = load_vehicle(vehicle)
        before = None if state is None else read_state(state)
        progress("reading", None)
        signals = read_log(logs, car)
        run = estimate(signals, car, rate=rate, state=before, smooth=smooth, progress=progress)
        progress("writing", None)
        written = write_run(run, out, innovations=innovations)
    if as_json:
        _print_json(run.summary)
        return
    from rich.console import Console

    from clutchest.record.terminal import print_run

    print_run(run, Console())
    print(f"Written to {out}: {', '.join(path.name for path in written)}")
    print(f"To look at it: rerun {out / 'recording.rrd'}")


@app.command()
def inspect(
    logs: Logs,
    dbc: Annotated[
        list[Path] | None,
        typer.Option(
            "--dbc",
            metavar="FILE",
            show_default=False,
            help="Names the messages; repeat for several.  Without it the shipped ones do.",
        ),
    ] = None,
    out: Out = DEFAULT_OUT,
    as_json: AsJson = False,
) -> None:
    """Say what is in a log, and draft a vehicle file for it.

    Lists ids, rates and gaps, and the signals that look like those the estimator needs.  Writes
    inspect.json and vehicle.toml; the heading of the latter names what is still missing.

    \b
    Example:
      clutchest inspect drive.log --dbc vehicle.dbc --out first-look
    """
    with _progress() as progress:
        progress("reading", None)
        from clutchest.reading.inspection import inspect_logs
        from clutchest.record.files import finished_into, json_text

        found = inspect_logs(logs, dbc or ())
        with finished_into(out) as folder:
            text = json_text(found.as_dict())
            (folder / "inspect.json").write_text(text, encoding="utf-8")
            draft = found.vehicle_toml(out / "vehicle.toml")
            (folder / "vehicle.toml").write_text(draft, encoding="utf-8")
    if as_json:
        sys.stdout.write(text)
        return
    from rich.console import Console

    from clutchest.record.terminal import print_inspection

    print_inspection(found, Console())
    print(f"Written to {out}: inspect.json, vehicle.toml")


@app.command()
def convert(
    logs: Annotated[
        list[str],
        typer.Argument(metavar="IN", show_default=False, help="Logs of any known format."),
    ],
    out: Annotated[
        Path,
        typer.Option(
            "-o",
            "--output",
            metavar="OUT",
            show_default=False,
            help="The log to write; its suffix says the format.",
        ),
    ],
    vehicle: Annotated[
        str | None,
        typer.Option(
            metavar="V",
            show_default=False,
            help="Decode CAN logs by this vehicle; OUT is then .csv or .parquet.",
        ),
    ] = None,
    as_json: AsJson = False,
) -> None:
    """Write logs in another format.

    CAN logs become CAN logs, several of them one, in order of time; decoded tables become tables.
    With a vehicle CAN logs become decoded tables.

    \b
    Example:
      clutchest convert drive.mf4 -o drive.log.gz
      clutchest convert drive.mf4 --vehicle truck -o drive.parquet
    """
    with _progress() as progress:
        progress("reading", None)
        from clutchest.reading.conversion import Conversion
        from clutchest.record.files import finished_into
        from clutchest.vehicle import load_vehicle

        read = Conversion.of(logs, out, None if vehicle is None else load_vehicle(vehicle))
        progress("writing", None)
        with finished_into(out.parent) as folder:
            losses = read.write(folder / out.name)
    what = "samples" if read.decoded else "frames"
    if as_json:
        _print_json(
            {
                "written": str(out),
                what: read.count,
                "frames_rejected": read.rejected,
                "lost": list(losses),
            }
        )
        return
    print(f"Written: {out}, {read.count} {what}")
    for reason, count in read.rejected.items():
        _note(f"not read: {count} × {reason}")
    for loss in losses:
        _note(f"not kept: {loss}")


@app.command()
def simulate(
    vehicle: VehicleName,
    scenario: Annotated[
        str,
        typer.Option(
            metavar="NAME",
            show_default=False,
            help="city, launches, ramps, heating, slip-steps, cooldown, pulses or closed.",
        ),
    ],
    seed: Annotated[
        int, typer.Option(metavar="N", min=0, show_default=False, help="Same seed, same drive.")
    ],
    out: Annotated[
        Path,
        typer.Option(
            "-o",
            "--output",
            metavar="LOG",
            show_default=False,
            help="The log to write, format by suffix; .csv and .parquet hold decoded signals.",
        ),
    ],
    nominal: Annotated[
        bool,
        typer.Option(
            "--nominal", help="Parameters as in the vehicle file, not drawn from their spreads."
        ),
    ] = False,
    duration: Annotated[
        float | None,
        typer.Option(
            metavar="S", min=0.1, show_default=False, help="Seconds, instead of the scenario's own."
        ),
    ] = None,
    effect: Annotated[
        list[str] | None,
        typer.Option(
            metavar="NAME:P=V,P2=V2",
            show_default=False,
            help="Something that is wrong with the truth; repeat for several.",
        ),
    ] = None,
    disturb: Annotated[
        list[str] | None,
        typer.Option(
            metavar="KEY=VALUE",
            show_default=False,
            help="What wanders during the drive: torque_bias_walk Nm/√s from a start of "
            "torque_bias_std Nm, friction_walk 1/√s from friction_std; repeat for several.",
        ),
    ] = None,
    truck_seed: Annotated[
        int | None,
        typer.Option(
            metavar="N",
            min=0,
            show_default=False,
            help="Draws the truck's parameters, while --seed draws the drive: another drive of "
            "the same truck. The same as --seed unless said.",
        ),
    ] = None,
    as_json: AsJson = False,
) -> None:
    """Make a log of a drive whose truth is known.

    The truth is written beside it, to LOG.truth.parquet.

    \b
    Example:
      clutchest simulate --vehicle truck --scenario city --seed 1 -o city.log
      clutchest simulate --vehicle truck --scenario launches --seed 2 \\
          --effect wear:amount=0.5,rate=0.02 --disturb friction_walk=5e-4 -o worn.mf4
    """
    effects: dict[str, dict[str, float]] = {}
    for text in effect or ():
        name, colon, values = text.partition(":")
        if not colon:
            raise typer.BadParameter(
                f"'{text}' is not NAME:P=V,P2=V2, for example wear:amount=0.5",
                param_hint="--effect",
            )
        _numbers(values.split(","), effects.setdefault(name.strip(), {}), "--effect")
    disturbances: dict[str, float] = {}
    _numbers(disturb or (), disturbances, "--disturb")
    with _progress() as progress:
        progress("simulating", None)
        from clutchest.record.files import finished_into
        from clutchest.simulated import write_simulation
        from clutchest.vehicle import load_vehicle

        with finished_into(out.parent) as folder:
            truth = write_simulation(
                folder / out.name,
                load_vehicle(vehicle),
                scenario,
                seed,
                effects,
                nominal=nominal,
                duration=duration,
                truck_seed=truck_seed,
                disturbances=disturbances,
            )
    truth = out.parent / truth.name
    if as_json:
        _print_json(
            {
                "log": str(out),
                "truth": str(truth),
                "scenario": scenario,
                "seed": seed,
                "truck_seed": seed if truck_seed is None else truck_seed,
                "effects": effects,
                "disturbances": disturbances,
            }
        )
        return
    print(f"Written: {out} and {truth.name}")


def _numbers(given: Iterable[str], into: dict[str, float], option: str) -> None:
    """``KEY=VALUE`` texts into ``into``; a key may come once."""
    for text in given:
        key, _, value = (part.strip() for part in text.partition("="))
        if key in into:
            raise typer.BadParameter(f"'{key}' is given twice", param_hint=option)
        try:
            into[key] = float(value)
        except ValueError:
            raise typer.BadParameter(
                f"'{text}' is not KEY=VALUE with a number", param_hint=option
            ) from None


@app.command()
def identify(
    name: Annotated[
        str,
        typer.Argument(
            metavar="PROCEDURE",
            show_default=False,
            help="noise: noise, its AR(1) coefficient and the delay of every signal.",
        ),
    ],
    logs: Logs,
    vehicle: VehicleName,
    out: Out = DEFAULT_OUT,
    as_json: AsJson = False,
) -> None:
    """Fit numbers of a vehicle file to your own logs.

    Writes vehicle.toml (the vehicle with the numbers that the logs determine), fit.json (each
    with its interval, or why it cannot be told) and pictures.

    \b
    Example:
      clutchest identify noise monday.log --vehicle truck --out tuned
      clutchest replay tuesday.log --vehicle tuned/vehicle.toml
    """
    with _progress() as progress:
        progress("loading", None)
        from clutchest.identify import procedure
        from clutchest.reading import read_log
        from clutchest.record.files import finished_into, json_text
        from clutchest.vehicle import load_vehicle

        run = procedure(name)
        car = load_vehicle(vehicle)
        progress("reading", None)
        fit = run(read_log(logs, car), car, progress)
        progress("writing", None)
        with finished_into(out) as folder:
            text = json_text(fit.as_dict())
            (folder / "fit.json").write_text(text, encoding="utf-8")
            found = fit.vehicle_toml(out / "vehicle.toml")
            (folder / "vehicle.toml").write_text(found, encoding="utf-8")
            fit.draw(folder)
            names = sorted(path.name for path in folder.iterdir())
    if as_json:
        sys.stdout.write(text)
        return
    from rich.console import Console

    from clutchest.identify.fit import print_fit

    print_fit(fit, car, Console())
    print(f"Written to {out}: {', '.join(names)}")
