"""``report.html`` of a replay, a diagnosis, a discovery and a fit."""

from __future__ import annotations

from collections.abc import Mapping
from itertools import pairwise
from math import ceil
from typing import TYPE_CHECKING

from clutchest.extras import installed
from clutchest.record.html import bitmap, page, vector

if TYPE_CHECKING:
    from clutchest.diagnosis.result import Diagnosis
    from clutchest.discovery.result import Discovery
    from clutchest.estimate.run import Run
    from clutchest.identify.fit import Fit
    from clutchest.pictures import Picture
    from clutchest.vehicle import Vehicle

PANELS = 6  # of estimates in a picture, at most: as many as are legible on a printed page
DRAWN = 4  # drives whose estimates are drawn


def run_page(run: Run) -> str:
    """The tables of the report, with the estimates of the first drives over time."""
    from clutchest.record.report import markdown

    drives = min(len(run.tracks), DRAWN) if installed("matplotlib") else 0
    drawn = [drive for drive in range(drives) if len(run.tracks[drive].time)]
    names, several = run.estimated, len(run.tracks) > 1
    sheets = ceil(len(names) / PANELS)
    cuts = [len(names) * k // sheets for k in range(sheets + 1)]
    pages = [names[a:b] for a, b in pairwise(cuts)]
    pictures: dict[str, str] = {}
    parts = ["## Estimates over time, ± 2σ; grey where an estimate is not valid"] if drawn else []
    for drive in drawn:
        parts += [f"### Drive {drive}"] if several else []
        for k, shown in enumerate(pages):
            pictures[f"drive{drive}-{k}"] = bitmap(run.plot(*shown, drive=drive)._repr_png_())
            parts.append(f"![Estimates of drive {drive} over time](drive{drive}-{k})")
    if drawn and len(run.tracks) > len(drawn):
        parts.append(f"Drawn are {len(drawn)} of {len(run.tracks)} drives.")
    return page(f"{run.vehicle.name}: estimates", markdown(run, "", parts), pictures)


def diagnosis_page(diagnosis: Diagnosis) -> str:
    """Faults, then the monitors over time, and what could have been detected."""
    from clutchest.record.diagnosis_report import diagnosis_markdown

    run, pictures = diagnosis.run, {}
    if installed("matplotlib"):
        drives = [d for d in range(min(len(run.tracks), DRAWN)) if len(run.tracks[d].time)]
        pictures = {f"drive{d}": vector(diagnosis.plot(d)) for d in drives}
    words = diagnosis_markdown(diagnosis, list(pictures))
    return page(f"{run.vehicle.name}: diagnosis", words, pictures)


def discovery_page(discovery: Discovery, drawn: Mapping[str, Picture]) -> str:
    """The same as ``report.md``, with the curve of an error that has no name; with the pictures
    that are ``drawn``, by name."""
    from clutchest.record.discovery_report import report

    names = [name if name in drawn else None for name in ("misfit", "forms", "curve")]
    pictures = {name: vector(picture) for name, picture in drawn.items()}
    return page(f"{discovery.vehicle.name}: discovery", report(discovery, *names), pictures)


def fit_page(fit: Fit, before: Vehicle) -> str:
    """The numbers with their intervals beside those of the vehicle ``before``, and data against
    fit."""
    from clutchest.record.fit_report import fit_markdown

    drawn = {picture.name: picture.png for picture in fit.plot()} if installed("matplotlib") else {}
    pictures = {name: bitmap(png) for name, png in drawn.items()}
    title = f"{fit.vehicle.name}: {fit.procedure}"
    return page(title, fit_markdown(fit, before, list(pictures)), pictures)
