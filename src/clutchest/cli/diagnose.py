"""``diagnose``: fault tests."""

from __future__ import annotations

from typing import Annotated

from clutchest.cli.estimating import estimated
from clutchest.cli.groups import grouped
from clutchest.cli.options import DEFAULT_OUT, WHOLE, AsJson, Out, SourceOptions, WindowOptions
from clutchest.cli.parameters import Option
from clutchest.cli.terminal import answer, progress


@grouped
def diagnose(
    source: SourceOptions,
    explain: Annotated[
        bool,
        Option(
            help="Also which faults this drive can detect and isolate.",
        ),
    ] = False,
    out: Out = DEFAULT_OUT,
    window: WindowOptions = WHOLE,
    as_json: AsJson = False,
) -> None:
    """Test drives for faults of messages, signals and the clutch.

    Every monitor raises false alarms at the rate that the vehicle file states ([monitors]
    false_alarms_per_1000h).  One that could not detect its fault in these logs says why: not run.
    Writes report.html (start there), diagnosis.json and recording.rrd, in which each fault has a
    freeze frame.

    \b
    Example:
      clutchest diagnose monday.log --vehicle truck --explain --out faults
    """
    with progress() as show:
        show("loading", None)
        from clutchest.diagnosis.diagnose import diagnose as test
        from clutchest.record.diagnosis import print_diagnosis, write_diagnosis

        run = estimated(source, window, show, traffic=True)
        diagnosis = test(run, progress=show)
        show("writing", None)
        names = [path.name for path in write_diagnosis(diagnosis, out)]
    answer(
        diagnosis.summary(),
        as_json,
        lambda console: print_diagnosis(diagnosis, console, explain),
        out,
        names,
    )
