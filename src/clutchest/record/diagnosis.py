"""A diagnosis as files and in a terminal: verdicts, faults, detectability and isolability."""

from __future__ import annotations

from pathlib import Path

from rich.console import Console
from rich.markup import escape
from rich.table import Table

from clutchest.diagnosis.result import Diagnosis, Isolability
from clutchest.record.diagnosis_report import details, headline
from clutchest.record.files import finished_into, json_text

STYLES = {"failed": "bold red", "passed": "green", "not run": "dim"}


def write_diagnosis(diagnosis: Diagnosis, out: Path) -> list[Path]:
    """Write ``diagnosis.json`` and ``recording.rrd``; gives the paths written.

    Raises ClutchestError if ``out`` is no folder, OSError if the disk refuses.
    """
    from clutchest.record.rerun import write_recording  # rerun, only where it is needed

    with finished_into(out) as folder:
        (folder / "diagnosis.json").write_text(json_text(diagnosis.summary()), encoding="utf-8")
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


def print_isolability(isolability: Isolability, console: Console) -> None:
    """Print which faults are detectable in this drive, from which magnitude, and isolable."""
    numbers = [str(i + 1) for i in range(len(isolability.faults))]
    table = Table(
        "",
        "fault",
        "detectable from",
        "separability (σ) of",
        "none",
        *numbers,
        title="detectability in this drive, and separability of each fault from every other (σ)",
        title_justify="left",
        caption="4 or more: isolable",
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
        console.print(escape(f"{fault} affects: {', '.join(shown) or 'nothing'}"), style="dim")
