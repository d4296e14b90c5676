"""``replay``: estimates over recorded drives."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum
from typing import Annotated

from clutchest.cli.estimating import estimated
from clutchest.cli.groups import grouped
from clutchest.cli.options import (
    DEFAULT_OUT,
    WHOLE,
    AsJson,
    Out,
    Rate,
    SourceOptions,
    TableFormat,
    WindowOptions,
)
from clutchest.cli.parameters import Option
from clutchest.cli.terminal import answer, progress


class Engine(StrEnum):
    """As ``clutchest.estimate.engines`` has them."""

    kernel = "kernel"
    filterpy = "filterpy"


@dataclass(frozen=True, slots=True)
class ExtraFiles:
    """What is written beside the usual files."""

    innovations: Annotated[bool, Option(help="Also write innovations.parquet.")] = False
    report: Annotated[bool, Option(help="Also write report.html, a page to mail or print.")] = False
    formats: Annotated[
        list[TableFormat] | None,
        Option(
            names=("--format",),
            metavar="csv|xlsx|mf4|mcap",
            help="Also write the estimates as estimates.csv, …; repeat for several.",
        ),
    ] = None


USUAL = ExtraFiles()


@grouped
def replay(
    source: SourceOptions,
    out: Out = DEFAULT_OUT,
    rate: Rate = 10.0,
    smooth: Annotated[
        bool,
        Option(help="Also smoothed estimates, by each drive as a whole."),
    ] = False,
    engine: Annotated[
        Engine,
        Option(
            help="Which filter: the compiled one, or filterpy's (the same, slowly).",
        ),
    ] = Engine.kernel,
    extra: ExtraFiles = USUAL,
    window: WindowOptions = WHOLE,
    as_json: AsJson = False,
) -> None:
    """Estimate temperatures, wear and friction over drives.

    Writes estimates.parquet, summary.json, recording.rrd (open it with `rerun`) and state.json.
    Logs whose clocks join are pieces of one drive, others drives of their own.

    \b
    Example:
      clutchest replay monday.log tuesday.log --vehicle truck --out results
      clutchest replay wednesday.log --vehicle truck --state results/state.json
      clutchest replay monday.log --vehicle truck --from 60 --to 300 --format mf4
    """
    with progress() as show:
        show("loading", None)
        run = estimated(source, window, show, rate=rate, smooth=smooth, engine=engine)
        show("writing", None)
        from clutchest.record.files import write_run
        from clutchest.record.terminal import print_run

        written = write_run(run, out, extra.innovations, extra.formats or (), extra.report)
    names = [path.name for path in written]
    answer(run.summary, as_json, lambda console: print_run(run, console), out, names)
