"""``identify``: numbers of a vehicle file fitted to logs."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated

import click

from clutchest.cli.options import (
    DEFAULT_OUT,
    AsJson,
    Holdout,
    Logs,
    Out,
    Trust,
    VehicleName,
    disjoint,
)
from clutchest.cli.parameters import Argument, Option
from clutchest.cli.terminal import answer, loaded, progress
from clutchest.extras import required
from clutchest.identify import OF_EVERY_MACHINE

if TYPE_CHECKING:
    from clutchest.identify.bench_records import Stated
    from clutchest.signals import Signals
    from clutchest.vehicle import Vehicle


Bench = Annotated[
    list[str] | None,
    Option(
        metavar="NAME",
        help="The test bench that the logs are from, for experiments: one for all, or one for each "
        "LOG in their order, --holdout after them. Unless given: as simulate wrote it beside a "
        "log, else guessed from the data and said.",
    ),
]

Refit = Annotated[
    bool,
    Option(
        help="Beside each number of an experiment also the one by the likelihood of the "
        "filter's innovations over its record, up to a minute of processor time each.",
    ),
]


def identify(
    name: Annotated[
        str,
        Argument(
            metavar="PROCEDURE",
            help="A procedure that the vehicle's machine declares, as torque-curve, disc or I1; or "
            + "; ".join(f"{name}: {what}" for name, what in OF_EVERY_MACHINE.items())
            + ".",
        ),
    ],
    logs: Logs,
    vehicle: VehicleName,
    trust: Trust = False,
    holdout: Holdout = None,
    bench: Bench = None,
    refit: Refit = False,
    out: Out = DEFAULT_OUT,
    as_json: AsJson = False,
) -> None:
    """Fit numbers of a vehicle file to your own logs.

    Writes vehicle.toml (the vehicle with the numbers that the logs determine, their spreads and
    source), fit.json (each with its interval, or why it is not determined), pictures and
    report.html.

    \b
    Example:
      clutchest identify noise monday.log --vehicle truck --out tuned
      clutchest identify disc ramps.log --holdout tuesday.log \\
          --vehicle tuned/vehicle.toml
      clutchest replay wednesday.log --vehicle tuned/vehicle.toml
      clutchest identify I1 held.log --bench rotor-held --vehicle alsd_rig
    """
    with progress() as show:
        show("loading", None)
        required("matplotlib")
        from clutchest.identify import identify_vehicle as run
        from clutchest.identify.fit import print_fit
        from clutchest.reading import read_log
        from clutchest.record.fit import write_fit

        car = loaded(vehicle, trust)
        disjoint(logs, holdout or ())
        show("reading", None)
        signals, held_out = read_log(logs, car), read_log(holdout, car) if holdout else None
        benches = _benches(logs, signals, holdout or [], held_out, bench or [], car)
        fit = run(name, signals, car, show, held_out, benches, refit)
        show("writing", None)
        names = [path.name for path in write_fit(fit, out)]
    answer(fit.summary(), as_json, lambda console: print_fit(fit, car, console), out, names)


def _benches(
    logs: list[str],
    signals: Signals,
    holdout: list[str],
    held_out: Signals | None,
    names: list[str],
    car: Vehicle,
) -> tuple[Stated, Stated]:
    """Those of the drives that are fitted, and of those that are held out."""
    from clutchest.identify.bench_records import stated_sections
    from clutchest.shown import counted

    if len(names) not in (0, 1, len(logs), len(logs) + len(holdout)):
        raise click.BadParameter(
            f"{len(names)} benches for {counted(len(logs), 'log')}, expected one, or one for each",
            param_hint="--bench",
        )
    own = names if len(names) == 1 else names[: len(logs)]
    rest = names if len(names) == 1 else names[len(logs) :]
    return (
        stated_sections(signals, logs, own, car),
        stated_sections(held_out, holdout, rest, car) if held_out is not None else (),
    )
