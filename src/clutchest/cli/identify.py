"""``identify``: numbers of a vehicle file fitted to logs."""

from __future__ import annotations

from typing import Annotated

import typer

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
from clutchest.cli.terminal import answer, progress
from clutchest.identify import OF_EVERY_MACHINE


def identify(
    name: Annotated[
        str,
        typer.Argument(
            metavar="PROCEDURE",
            show_default=False,
            help="A procedure that the vehicle's machine declares, as torque-curve or disc; or "
            + "; ".join(f"{name}: {what}" for name, what in OF_EVERY_MACHINE.items())
            + ".",
        ),
    ],
    logs: Logs,
    vehicle: VehicleName,
    trust: Trust = False,
    holdout: Holdout = None,
    out: Out = DEFAULT_OUT,
    as_json: AsJson = False,
) -> None:
    """Fit numbers of a vehicle file to your own logs.

    Writes vehicle.toml (the vehicle with the numbers that the logs determine, their spreads and
    source), fit.json (each with its interval, or why it is not determined) and pictures.

    \b
    Example:
      clutchest identify noise monday.log --vehicle truck --out tuned
      clutchest identify disc ramps.log --holdout tuesday.log --vehicle tuned/vehicle.toml
      clutchest replay wednesday.log --vehicle tuned/vehicle.toml
    """
    with progress() as show:
        show("loading", None)
        from clutchest.identify import identify as run
        from clutchest.identify.fit import print_fit
        from clutchest.reading import read_log
        from clutchest.record.files import finished_into, json_text
        from clutchest.vehicle import load_vehicle
        from clutchest.vehicle.trust import trust_written

        car = load_vehicle(vehicle, trust=trust)
        disjoint(logs, holdout or ())
        show("reading", None)
        held_out = read_log(holdout, car) if holdout else None
        fit = run(name, read_log(logs, car), car, show, held_out)
        show("writing", None)
        with finished_into(out) as folder:
            (folder / "fit.json").write_text(json_text(fit.as_dict()), encoding="utf-8")
            fit.write_vehicle(folder / "vehicle.toml", out / "vehicle.toml")
            fit.draw(folder)
            names = sorted(path.name for path in folder.iterdir())
        trust_written(fit.vehicle, out / "vehicle.toml")
    answer(fit.as_dict(), as_json, lambda console: print_fit(fit, car, console), out, names)
