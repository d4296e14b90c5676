"""The files of a discovery."""

from __future__ import annotations

from pathlib import Path

from clutchest import __version__
from clutchest.discovery.result import Discovery
from clutchest.extras import installed
from clutchest.paths import readable
from clutchest.record.discovery_report import report, title
from clutchest.record.files import REPORT, finished_into, json_text
from clutchest.record.html_reports import discovery_page
from clutchest.vehicle import dump_vehicle
from clutchest.vehicle.trust import trust_written

NAME, PICTURE, FORMS = "extended.toml", "misfit.png", "form.png"


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
        misfit, forms = _draw(discovery, folder)
        (folder / "report.md").write_text(
            readable(report(discovery, misfit, forms)), encoding="utf-8"
        )
        (folder / REPORT).write_text(readable(discovery_page(discovery)), encoding="utf-8")
        if installed("rerun"):
            from clutchest.record.discovery_recording import write_discovery_recording

            write_discovery_recording(discovery, folder / "recording.rrd")
        names = sorted(path.name for path in folder.iterdir())
    if forms is None:  # that of an earlier run would not belong to the report beside it
        (out / FORMS).unlink(missing_ok=True)
    trust_written(discovery.extended, out / NAME)
    return [out / name for name in names]


def _draw(discovery: Discovery, folder: Path) -> tuple[str | None, str | None]:
    """The names of the pictures that were drawn: of the misfit, and of the causes' forms."""
    if not installed("matplotlib"):
        return None, None
    from clutchest.pictures import DOTS_PER_INCH
    from clutchest.record.form_picture import draw_forms

    discovery.plot().savefig(folder / PICTURE, dpi=DOTS_PER_INCH)
    forms = draw_forms(discovery)
    if forms is None:
        return PICTURE, None
    forms.savefig(folder / FORMS, dpi=DOTS_PER_INCH)
    return PICTURE, FORMS


def _heading(discovery: Discovery) -> str:
    which = "All other" if discovery.added else "Nothing was added: all"
    return (
        f"clutchest {__version__}, discover: {title(discovery)}.\n"
        f"{which} entries are those of {discovery.vehicle.path.name}.  "
        "Reasons: report.md, discovery.json."
    )
