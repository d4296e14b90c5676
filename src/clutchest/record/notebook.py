"""The Rerun viewer in a cell of a notebook."""

from __future__ import annotations

from clutchest.checked import checked
from clutchest.diagnosis.result import Diagnosis
from clutchest.estimate.run import Run
from clutchest.extras import required


@checked
def view(
    run: Run, diagnosis: Diagnosis | None = None, *, width: int = 1200, height: int = 700
) -> None:
    """Show the recording of a ``run`` in a viewer within the cell, ``width`` and ``height`` in
    pixels; with a ``diagnosis`` of it also its monitors.

    Raises ClutchestError where the extra ``notebook`` is not installed.
    """
    required("rerun_notebook")
    import rerun as rr

    from clutchest.record.rerun import send_run

    stream = rr.RecordingStream("clutchest", send_properties=False)
    send_run(stream, run, diagnosis)
    stream.notebook_show(width=width, height=height)
    stream.flush()
