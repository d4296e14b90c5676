"""``discover``: what the simulation gets wrong."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

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
from clutchest.cli.parameters import Option
from clutchest.cli.terminal import answer, meanwhile, progress
from clutchest.progress import Progress

LONG = 1200.0  # s of logs: discovery of longer ones needs the memory that writing takes
WRITERS = "scipy.optimize", "clutchest.record.form_picture", "clutchest.record.discovery_recording"

EffectsFiles = Annotated[
    list[Path] | None,
    Option(
        metavar="FILE.py",
        help="Your own hypotheses, effect classes, tested beside the library's; repeat for "
        "several.",
    ),
]


def discover(
    logs: Logs,
    vehicle: VehicleName,
    trust: Trust = False,
    holdout: Holdout = None,
    effects: EffectsFiles = None,
    out: Out = DEFAULT_OUT,
    as_json: AsJson = False,
) -> None:
    """Detect errors of the model and name their causes.

    Writes report.html (start there) and report.md, discovery.json, extended.toml (the vehicle with
    the identified causes in its model, if there are any) and recording.rrd.  Says so where no error
    is detectable, where the log does not separate causes, and where no known cause explains the
    error.

    \b
    Example:
      clutchest discover monday.log --vehicle truck --holdout tuesday.log
      clutchest replay wednesday.log --vehicle result/extended.toml
    """
    with progress() as show:
        show("loading", None)
        from rich.console import Console

        from clutchest.discovery.user_effects import user_effects
        from clutchest.reading import read_log
        from clutchest.vehicle import load_vehicle

        car = load_vehicle(vehicle, trust=trust)
        user_effects(effects or (), car)  # a slip of the pen shows now, not when the logs are read
        disjoint(logs, holdout or ())
        show("reading", None)
        meanwhile("clutchest.discovery.discover")
        signals = read_log(logs, car)
        held_out = read_log(holdout, car).drives if holdout else None
        from clutchest.discovery.discover import discover as search
        from clutchest.record.discovery_terminal import print_discovery, print_identifiable

        long = sum(drive.end for drive in signals.drives) > LONG
        discovery = search(
            signals,
            car,
            holdout=held_out,
            effects_files=tuple(effects or ()),
            progress=show if long else _and_load_writers(show),
            on_identifiability=None if as_json else lambda i: print_identifiable(i, Console()),
        )
        show("writing", None)
        from clutchest.record.discovery import write_discovery

        names = [path.name for path in write_discovery(discovery, out)]
    answer(
        discovery.summary(),
        as_json,
        lambda console: print_discovery(discovery, console),
        out,
        names,
    )


def _and_load_writers(show: Progress) -> Progress:
    """``show``, and what writes is loaded when there is something to show: earlier, two threads of
    Python would take turns."""
    writers = [*WRITERS]

    def shown(text: str, share: float | None) -> None:
        show(text, share)
        if writers:
            meanwhile(*writers)
            writers.clear()

    return shown
