"""The files of an identification."""

from __future__ import annotations

from pathlib import Path

from clutchest.identify.fit import Fit
from clutchest.paths import readable
from clutchest.record.files import REPORT, finished_into, json_text
from clutchest.record.html_reports import fit_page
from clutchest.vehicle.trust import trust_written

NAME = "vehicle.toml"


def write_fit(fit: Fit, out: Path) -> list[Path]:
    """Write ``vehicle.toml``, ``fit.json``, pictures and ``report.html``; gives the paths written.

    Raises ClutchestError if ``out`` is no folder, OSError if the disk refuses.
    """
    with finished_into(out) as folder:
        (folder / "fit.json").write_text(json_text(fit.summary()), encoding="utf-8")
        fit.write_vehicle(folder / NAME, out / NAME)
        fit.draw(folder)
        page = fit_page(fit, fit.before or fit.vehicle)
        (folder / REPORT).write_text(readable(page), encoding="utf-8")
        names = sorted(path.name for path in folder.iterdir())
    trust_written(fit.vehicle, out / NAME)
    return [out / name for name in names]
