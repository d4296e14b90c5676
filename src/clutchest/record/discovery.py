"""The files of a discovery."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from clutchest import __version__
from clutchest.discovery.result import Discovery
from clutchest.extras import installed
from clutchest.paths import readable
from clutchest.record.discovery_report import report, title
from clutchest.record.files import REPORT, finished_into, json_text
from clutchest.record.html_reports import discovery_page
from clutchest.vehicle import dump_vehicle
from clutchest.vehicle.trust import trust_written

if TYPE_CHECKING:
    from clutchest.pictures import Picture

NAME = "extended.toml"
FILES = {"misfit": "misfit.png", "forms": "form.png"}  # of pictures beside report.md


def write_discovery(discovery: Discovery, out: Path) -> list[Path]:
    """Write ``discovery.json``, ``extended.toml``, ``report.md`` with its pictures, the same as
    ``report.html``, and ``recording.rrd``.  Python files of the user's own are copied beside
    ``extended.toml``, which is trusted: they have run already.

    All are finished beside their place first.  Gives the paths written.  Raises ClutchestError if
    ``out`` is no folder, OSError if the disk refuses.
    """
    with finished_into(out) as folder:
        (folder / "discovery.json").write_text(json_text(discovery.summary()), encoding="utf-8")
        dump_vehicle(discovery.extended, folder / NAME, _heading(discovery), out / NAME)
        pictures = pictures_of(discovery)
        files = {name: file for name, file in FILES.items() if name in pictures}
        for name, file in files.items():
            (folder / file).write_bytes(pictures[name]._repr_png_())
        text = report(discovery, files.get("misfit"), files.get("forms"))
        (folder / "report.md").write_text(readable(text), encoding="utf-8")
        html = discovery_page(discovery, pictures)
        (folder / REPORT).write_text(readable(html), encoding="utf-8")
        if installed("rerun"):
            from clutchest.record.discovery_recording import write_discovery_recording

            write_discovery_recording(discovery, folder / "recording.rrd")
        names = sorted(path.name for path in folder.iterdir())
    for file in FILES.values():  # one of an earlier run would not belong to the report beside it
        if file not in names:
            (out / file).unlink(missing_ok=True)
    trust_written(discovery.extended, out / NAME)
    return [out / name for name in names]


def pictures_of(discovery: Discovery) -> dict[str, Picture]:
    """Those that there are, by name: the ``misfit``, the ``forms`` of the causes, and the ``curve``
    of an error that has no name."""
    if not installed("matplotlib"):
        return {}
    from clutchest.record.error_curve_picture import draw_error_curve
    from clutchest.record.form_picture import draw_forms

    drawn = {
        "misfit": discovery.plot(),
        "forms": draw_forms(discovery),
        "curve": draw_error_curve(discovery),
    }
    return {name: picture for name, picture in drawn.items() if picture is not None}


def _heading(discovery: Discovery) -> str:
    which = "All other" if discovery.added else "Nothing was added: all"
    return (
        f"clutchest {__version__}, discover: {title(discovery)}.\n"
        f"{which} entries are those of {discovery.vehicle.path.name}.  "
        "Reasons: report.md, discovery.json."
    )
