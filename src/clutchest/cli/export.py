"""``export``: the model for other tools."""

from __future__ import annotations

from typing import Annotated

import click

from clutchest.cli.options import DEFAULT_OUT, AsJson, Out, Trust, VehicleName
from clutchest.cli.parameters import Option
from clutchest.cli.terminal import print_json, progress


def export(
    vehicle: VehicleName,
    c: Annotated[bool, Option(help="C code of the step and its derivative, for an ECU.")] = False,
    fmu: Annotated[
        bool,
        Option(
            help="A functional mock-up unit, FMI 3.0 for model exchange, compiled with the "
            "system's compiler.",
        ),
    ] = False,
    trust: Trust = False,
    out: Out = DEFAULT_OUT,
    as_json: AsJson = False,
) -> None:
    """Export a vehicle's model, effects included, for other tools.

    \b
    Example:
      clutchest export --vehicle result/extended.toml --c --out ecu
      clutchest export --vehicle truck --fmu --out model
    """
    if not (c or fmu):
        raise click.BadParameter("expected --c, --fmu or both", param_hint="--c")
    with progress() as show:
        show("exporting", None)
        from clutchest.export.c_code import write_c
        from clutchest.export.fmu import write_fmu
        from clutchest.record.files import finished_into
        from clutchest.vehicle import load_vehicle

        car = load_vehicle(vehicle, trust=trust)
        with finished_into(out) as folder:
            names = [*(write_c(car, folder) if c else ()), *(write_fmu(car, folder) if fmu else ())]
    if as_json:
        print_json({"out": str(out), "files": names})
    else:
        print(f"Written to {out}: {', '.join(names)}")
