"""A fit in words: every number with its interval, or why it is not determined."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from clutchest.identify.fit import Fit, FitRow, fit_rows, in_words
from clutchest.paths import names_of
from clutchest.record.report import heading, table
from clutchest.shown import with_unit
from clutchest.vehicle import Vehicle

HEAD = ("what", "before", "fitted", "95 % interval", "remark, or why it is not determined")
HOW_TO_READ = (
    "Numbers are value ± one standard deviation. Those that are fitted stand in `vehicle.toml` "
    "beside this page; all others are as they were before."
)


def fit_markdown(fit: Fit, before: Vehicle, pictures: Sequence[str] = ()) -> str:
    """One page of Markdown; ``before``: the vehicle that it started from, ``pictures`` are file
    names."""
    units = [fitted.unit for fitted in fit.parameters.values()]
    rows = [
        (_named(row), row.before, row.now, _interval(row, unit), row.remark)
        for row, unit in zip(fit_rows(fit, before), units, strict=True)
    ]
    head = HEAD if any(row[-1] for row in rows) else HEAD[:-1]
    count = sum(fitted.determined for fitted in fit.parameters.values())
    logs = names_of(fit.sources)
    parts = [
        f"# {fit.vehicle.name}: identify {fit.procedure}",
        heading(before, logs, fit.begun),
        f"{count} of {len(rows)} numbers determined. {HOW_TO_READ}",
        table(head, [row[: len(head)] for row in rows]),
    ]
    if fit.validation is not None:
        parts += ["## On logs that were not used", in_words(fit.validation)]
    if pictures:
        parts.append("## Data and fit")
        parts += [f"![{Path(name).stem.replace('_', ' ')}]({name})" for name in pictures]
    parts += list(fit.notes)
    if fit.warnings:
        parts += ["## Warnings", "\n".join(f"- {text}" for text in fit.warnings)]
    return "\n\n".join(parts) + "\n"


def _interval(row: FitRow, unit: str) -> str:
    """The 95 % interval with its unit; a dash where there is none."""
    return with_unit(row.interval, unit) if row.interval else "–"


def _named(row: FitRow) -> str:
    """A number by what it is, and as the vehicle file has it."""
    key = f"`{row.name}.{row.leaf}`" if row.leaf else f"`{row.name}`"
    return f"{row.what}: {key}" if row.what else key
