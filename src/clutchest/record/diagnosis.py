"""A diagnosis as files and in a terminal: the verdicts, the faults, and what could be told."""

from __future__ import annotations

from pathlib import Path

from rich.console import Console
from rich.markup import escape
from rich.table import Table

from clutchest.diagnosis.result import Diagnosis, Fault, Isolability
from clutchest.record.files import finished_into, json_text

STYLES = {"failed": "bold red", "passed": "green", "not run": "dim"}


def write_diagnosis(diagnosis: Diagnosis, out: Path) -> list[Path]:
    """Write ``diagnosis.json`` and ``recording.rrd``; gives the paths written.

    Raises ClutchestError if ``out`` is no folder, OSError if the disk refuses.
    """
    from clutchest.record.rerun import write_recording

    with finished_into(out) as folder:
        (folder / "diagnosis.json").write_text(json_text(diagnosis.summary()), encoding="utf-8")
        write_recording(diagnosis.run, folder / "recording.rrd", diagnosis)
        names = sorted(path.name for path in folder.iterdir())
    return [out / name for name in names]


def print_diagnosis(diagnosis: Diagnosis, console: Console, explain: bool = False) -> None:
    """Print faults, monitors, and with ``explain`` what could be detected and told apart."""
    for fault in diagnosis.faults:
        console.print(f"[bold red]{escape(headline(fault))}[/]")
        console.print(f"  {escape(details(fault))}")
    counts = {s: sum(m.status == s for m in diagnosis.monitors) for s in STYLES}
    if not diagnosis.faults:
        console.print("[green]No fault found.[/]")
    console.print(
        f"{counts['passed']} monitors passed, {counts['failed']} failed, "
        f"{counts['not run']} could not run."
    )
    shown = [m for m in diagnosis.monitors if explain or m.status != "passed"]
    if shown:
        table = Table("monitor", "status", "why", title_justify="left")
        for monitor in sorted(shown, key=lambda m: list(STYLES).index(m.status)):
            table.add_row(
                escape(monitor.name),
                monitor.status,
                escape(monitor.why),
                style=STYLES[monitor.status],
            )
        console.print(table)
    if explain and diagnosis.isolability:
        print_isolability(diagnosis.isolability, console)


def headline(fault: Fault) -> str:
    """The fault, or the set that cannot be told apart."""
    names = fault.fault if len(fault.set) == 1 else f"one of {', '.join(fault.set)}"
    return f"{fault.first_detected_s:.1f} s: {names}: {fault.what}"


def details(fault: Fault) -> str:
    """Since when, and its code."""
    began = "there from the start" if fault.began_s <= 0.0 else f"began at {fault.began_s:.1f} s"
    over = "" if fault.ended_s is None else f", over at {fault.ended_s:.1f} s"
    return (
        f"{began}{over}; SPN {fault.spn}, FMI {fault.fmi}, status {fault.status_byte:#04x}, "
        f"confidence {fault.confidence:.4f}"
    )


def print_isolability(isolability: Isolability, console: Console) -> None:
    """Print which faults this drive could show, from which size on, and tell apart."""
    numbers = [str(i + 1) for i in range(len(isolability.faults))]
    table = Table(
        "",
        "fault",
        "shows from",
        "d′ of",
        "none",
        *numbers,
        title="what this drive can tell: distance of a fault from each other one, d′",
        title_justify="left",
        caption="4 and more: surely told apart",
        caption_justify="left",
    )
    for i, fault in enumerate(isolability.faults):
        from_size = isolability.detectable[i]
        unit = "" if isolability.units[i] == "1" else f" {isolability.units[i]}"
        row = [f"{d:.1f}" for d in isolability.d_prime[i]]
        row = [row[-1], *row[:-1]]
        row[1 + i] = "–"
        table.add_row(
            numbers[i],
            escape(fault),
            "never" if from_size is None else f"{from_size:.2g}{unit}",
            f"{isolability.sizes[i]:.2g}{unit}",
            *row,
        )
    console.print(table)
    for fault, shown in isolability.structure.items():
        console.print(escape(f"{fault} shows in: {', '.join(shown) or 'nothing'}"), style="dim")
