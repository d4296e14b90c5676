"""The outputs of a live session: its files and its recording; none without a folder."""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import ExitStack
from pathlib import Path
from typing import Any

from clutchest.can.frames import Frames
from clutchest.estimate.drive import Piece
from clutchest.estimate.replay import provenance
from clutchest.extras import installed, required
from clutchest.monitor.store import Session
from clutchest.paths import as_written
from clutchest.vehicle import Vehicle


class Outputs:
    """Files in ``out`` and a recording there, with ``serve`` also to a live viewer at ``address``;
    ``notes`` on an earlier session in this folder."""

    def __init__(
        self, out: str | Path | None, vehicle: Vehicle, serve: tuple[int, int] | None
    ) -> None:
        self._provenance = provenance(vehicle, "")
        self._session = None if out is None else Session(as_written(out), self._provenance)
        self._recording = None
        self.address = ""
        if serve is not None:
            required("rerun")
        if self._session is not None and installed("rerun"):
            from clutchest.record.live_recording import LiveRecording

            self._recording = LiveRecording(self._session.recording, vehicle, serve)
            self.address = self._recording.address

    @property
    def notes(self) -> list[str]:
        """What was done with the files of an earlier session."""
        return [] if self._session is None else self._session.notes

    def receive(self, frames: Frames) -> None:
        """Keep frames with the stamps that are used."""
        if self._session is not None:
            self._session.receive(frames)

    def keep(self, piece: Piece, drive: int, start_ns: int | None) -> None:
        """Keep new rows of a drive that begins at ``start_ns``."""
        if self._session is not None:
            self._session.keep(piece.track, drive, start_ns, piece.begins)

    def event(self, line: Mapping[str, Any], offset: float) -> None:
        """Keep an event of a drive that begins at ``offset`` s."""
        if self._session is not None:
            self._session.event(line)
        if self._recording is not None:
            self._recording.tell(line, offset)

    def record(self, piece: Piece, start_ns: int | None, offset: float) -> None:
        """Add new rows and signals to the recording; ``start_ns`` where the session begins with
        them."""
        if self._recording is None:
            return
        if start_ns is not None:
            self._recording.begin(start_ns, self._provenance)
        self._recording.add(piece.track, piece.signals, offset)

    def close(self, state: Mapping[str, Any] | None) -> list[str]:
        """Complete every file; ``state`` for the next drive.  Returns their names."""
        with ExitStack() as both:  # the files are completed though the recording should fail
            written: list[str] = []
            if self._session is not None:
                session = self._session
                both.callback(lambda: written.extend(session.close(state)))
            if self._recording is not None:
                self._recording.close()
        return written
