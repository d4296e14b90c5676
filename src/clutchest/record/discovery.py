"""The files of a discovery."""

from __future__ import annotations

from pathlib import Path

from clutchest import __version__
from clutchest.discovery.result import Discovery
from clutchest.record.discovery_recording import write_discovery_recording
from clutchest.record.discovery_report import report, title
from clutchest.record.files import finished_into, json_text
from clutchest.record.form_picture import PICTURE as FORMS
from clutchest.record.form_picture import draw_forms
from clutchest.record.misfit_pictures import PICTURE, draw_misfit
from clutchest.vehicle import dump_vehicle
from clutchest.vehicle.trust import trust_written

NAME = "extended.toml"


def write_discovery(discovery: Discovery, out: Path) -> list[Path]:
    """Write ``discovery.json``, ``extended.toml``, ``report.md`` with its pictures and
    ``recording.rrd``.  Python files of the user's own are copied beside ``extended.toml``, which
    is trusted: they have run already.

    All are finished beside their place first.  Gives the paths written.  Raises ClutchestError if
    ``out`` is no folder, OSError if the disk refuses.
    """
    with finished_into(out) as folder:
        (folder / "discovery.json").write_text(json_text(discovery.summary()), encoding="utf-8")
        dump_vehicle(discovery.extended, folder / NAME, _heading(discovery), out / NAME)
        draw_misfit(discovery, folder / PICTURE)
        forms = FORMS if draw_forms(discovery, folder / FORMS) else None
        text = report(discovery, PICTURE, forms)
        (folder / "report.md").write_text(text, encoding="utf-8")
        write_discovery_recording(discovery, folder / "recording.rrd")
        names = sorted(path.name for path in folder.iterdir())
    if forms is None:  # that of an earlier run would not belong to the report beside it
        (out / FORMS).unlink(missing_ok=True)
    trust_written(discovery.extended, out / NAME)
    return [out / name for name in names]


def _heading(discovery: Discovery) -> str:
    return (
        f"clutchest {__version__}, discover: {title(discovery)}.\n"
        f"All other entries are those of {discovery.vehicle.path.name}.  "
        "Reasons: report.md, discovery.json."
    )
