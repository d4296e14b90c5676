"""The report of a fleet: who differs, every vehicle with its properties, and what was not used."""

from __future__ import annotations

from clutchest.extras import installed
from clutchest.fleet.fleet import Fleet
from clutchest.record.html import page, vector
from clutchest.record.report import table
from clutchest.shown import counted


def fleet_page(fleet: Fleet) -> str:
    """One page of HTML."""
    shown = fleet.shown()
    parts = [f"# {fleet.vehicle.name}: {shown.line}", _drives(fleet)]
    parts.append("\n".join(f"- **{words}**" for words in fleet.differences()))
    parts.append(table(shown.header, shown.rows))
    parts.append("± 1σ; ! marks what the other vehicles do not lead one to expect.")
    pictures = {}
    if installed("matplotlib") and fleet.compared:
        pictures["properties"] = vector(fleet.plot())
        parts.append("![Properties of every vehicle, and what the fleet expects](properties)")
        parts.append(
            "Points: estimates ± 2σ, red where a vehicle differs.  Grey: where the other vehicles "
            "lead one to expect it, ± 2σ."
        )
    if fleet.rejected:
        rows = [(log, why) for log, why in fleet.rejected.items()]
        parts += ["## Logs that are not used", table(("log", "why"), rows)]
    if fleet.contradicting:
        parts += [
            "## Logs whose signals contradict the model",
            "None of their estimates counts.",
            table(("log", "how that shows"), fleet.contradicting.items()),
        ]
    if fleet.notes:
        parts += [
            "## Logs whose clock is not relied on",
            table(("log", "why"), fleet.notes.items()),
        ]
    return page(f"{fleet.vehicle.name}: fleet", "\n\n".join(parts), pictures)


def _drives(fleet: Fleet) -> str:
    """How many drives there are, how long, and when, by the clocks that are relied on."""
    drives = [drive for one in fleet.vehicles for drive in one.drives]
    hours = sum(drive["duration_s"] for drive in drives) / 3600.0
    sure = [drive for drive in drives if drive["log"] not in fleet.notes]
    days = sorted(drive["day"] for drive in sure if drive["begin"])
    when = f", {days[0]} to {days[-1]}" if days else ""
    if fleet.notes:
        when += f" (without {counted(len(fleet.notes), 'log')} whose clock is not relied on)"
    return f"{counted(len(drives), 'drive')}, {hours:.1f} h{when}"
