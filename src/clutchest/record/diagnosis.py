"""A diagnosis as files and in a terminal: verdicts, faults, detectability and isolability."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path

from rich import box
from rich.console import Console
from rich.markup import escape
from rich.table import Table

from clutchest.diagnosis.codes import WEAR
from clutchest.diagnosis.result import Diagnosis, Isolability, MonitorStatus
from clutchest.extras import installed
from clutchest.paths import readable
from clutchest.record.arrow import without_pandas
from clutchest.record.diagnosis_report import (
    SEPARABILITY,
    affected,
    details,
    headline,
    separability,
)
from clutchest.record.files import REPORT, finished_into, json_text
from clutchest.record.html_reports import diagnosis_page
from clutchest.record.terminal import print_warnings
from clutchest.shown import with_unit

NAMED = 2  # monitors of one kind and reason in the terminal; more are counted
STYLES = {"failed": "bold red", "passed": "green", "not run": "dim"}


def write_diagnosis(diagnosis: Diagnosis, out: Path) -> list[Path]:
    """Write ``diagnosis.json``, ``report.html`` and ``recording.rrd``; gives the paths written.

    Raises ClutchestError if ``out`` is no folder, OSError if the disk refuses.
    """
    with without_pandas(), finished_into(out) as folder:
        (folder / "diagnosis.json").write_text(json_text(diagnosis.summary()), encoding="utf-8")
        (folder / REPORT).write_text(readable(diagnosis_page(diagnosis)), encoding="utf-8")
        if installed("rerun"):
            from clutchest.record.rerun import write_recording

            write_recording(diagnosis.run, folder / "recording.rrd", diagnosis)
        names = sorted(path.name for path in folder.iterdir())
    return [out / name for name in names]


def print_diagnosis(diagnosis: Diagnosis, console: Console, explain: bool = False) -> None:
    """Print faults, monitors, and with ``explain`` what is detectable and isolable."""
    for fault in diagnosis.faults:
        console.print(f"[bold red]{escape(headline(fault))}[/]")
        console.print(f"  {escape(details(fault))}")
    counts = {s: sum(m.status == s for m in diagnosis.monitors) for s in STYLES}
    if not diagnosis.faults:
        console.print("[green]No fault detected.[/]")
    console.print(
        f"{counts['passed']} monitors passed, {counts['failed']} failed, "
        f"{counts['not run']} could not run."
    )
    shown = [m for m in diagnosis.monitors if explain or m.status != "passed"]
    if shown:
        table = Table("monitor", "status", "why", title_justify="left")
        for name, status, why in _together(shown):
            table.add_row(escape(name), status, escape(why), style=STYLES[status])
        console.print(table)
    if explain and diagnosis.isolability:
        print_isolability(diagnosis.isolability, console)
    print_warnings(diagnosis.warnings, "diagnosis.json", console)


def _together(monitors: Sequence[MonitorStatus]) -> Iterator[tuple[str, str, str]]:
    """Names, status and reason, the worst first; those that could not run for one and the same
    reason in one row, many of one kind counted, as ``frozen (5)``."""
    alike: dict[tuple[str, str, str], list[str]] = {}
    for monitor in sorted(monitors, key=lambda m: list(STYLES).index(m.status)):
        own = "" if monitor.status == "not run" else monitor.name
        alike.setdefault((monitor.status, monitor.why, own), []).append(monitor.name)
    for (status, why, _), names in alike.items():
        kinds: dict[str, list[str]] = {}
        for name in names:
            kinds.setdefault(name.partition(":")[0], []).append(name)
        words = (
            f"{kind} ({len(of)})" if len(of) > NAMED else ", ".join(of)
            for kind, of in kinds.items()
        )
        yield ", ".join(words), status, why


def print_isolability(isolability: Isolability, console: Console) -> None:
    """Print which faults are detectable in this drive, from which size, and isolable."""
    console.print(_detectability(isolability), "")
    console.print(_separability(isolability))


def _detectability(isolability: Isolability) -> Table:
    """Per fault the smallest size detectable in this drive, and the sensors that it affects."""
    table = _compact("", "fault", "detectable from", "affects", title="what this drive can detect")
    for i, fault in enumerate(isolability.faults):
        size = isolability.detectable[i]
        never = "its limit" if fault == WEAR else "never"
        table.add_row(
            str(i + 1),
            escape(fault),
            never if size is None else with_unit(f"{size:.2g}", isolability.units[i]),
            escape(affected(isolability, fault)),
        )
    return table


def _separability(isolability: Isolability) -> Table:
    """The separability of every fault from no fault and from every other one."""
    head, rows = separability(isolability)
    table = _compact(*head, title=SEPARABILITY)
    for column in table.columns[2:]:
        column.justify, column.no_wrap = "right", True
    for row in rows:
        table.add_row(*map(escape, row))
    return table


def _compact(*head: str, title: str) -> Table:
    """A table without vertical lines, which leaves room for many columns."""
    return Table(
        *head,
        title=title,
        title_justify="left",
        box=box.SIMPLE_HEAD,
        show_edge=False,
        padding=(0, 1, 0, 0),
        pad_edge=False,
    )
