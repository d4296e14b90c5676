"""Logs converted to another format: frames, signals, or frames decoded to signals."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from clutchest.can import files
from clutchest.can.frames import Frames
from clutchest.errors import ClutchestError
from clutchest.models import shipped_machines
from clutchest.reading.log import read_log
from clutchest.reading.table_formats import is_table, only_decoded, tables_in_words
from clutchest.reading.tables import joined, read_table, write_signals
from clutchest.reading.window import EVERYTHING, TimeWindow
from clutchest.shipped import locate_each
from clutchest.signals import Signals
from clutchest.vehicle import Vehicle


@dataclass(frozen=True, slots=True)
class Conversion:
    """What was read: ``content`` is frames, or the signals of one drive."""

    content: Frames | Signals

    @classmethod
    def of(
        cls,
        logs: Sequence[str],
        out: Path,
        vehicle: Vehicle | None,
        window: TimeWindow = EVERYTHING,
    ) -> Conversion:
        """The part of ``logs`` in ``window``, as frames or signals, whichever ``out`` can hold.

        With a ``vehicle`` CAN logs are decoded; decoded tables need none.  Raises ClutchestError
        where the suffix of ``out`` cannot hold what the logs contain.
        """
        paths = locate_each(logs, "logs")
        tables = [is_table(path) for path in paths]
        if vehicle is not None:
            return cls(read_log(paths, vehicle, window))
        if all(tables):
            columns = {k: unit for m in shipped_machines() for k, unit in m.units.items()}
            signals = window.of_signals(joined([read_table(path, columns) for path in paths]))
            if signals is None:
                raise ClutchestError(f"{' '.join(logs)}: no data in the time window")
            return cls(signals)
        if any(tables):
            raise ClutchestError(
                f"{paths[tables.index(True)]}: holds decoded signals, the others hold frames; "
                "name a vehicle to decode those"
            )
        if only_decoded(out):
            raise ClutchestError(f"{out}: holds decoded signals; name a vehicle to decode the logs")
        parts = [files.read_frames(path, tables_in_words()) for path in paths]
        if len(parts) > 1 and not all(part.absolute for part in parts):
            which = next(log for log, part in zip(logs, parts, strict=True) if not part.absolute)
            raise ClutchestError(
                f"{which}: its clock only counts from its own start, so it cannot be put in order "
                "with the others; convert it alone"
            )
        frames = Frames.concatenate(parts).sorted() if len(parts) > 1 or window else parts[0]
        frames = window.of_frames(frames, tuple(logs))
        if not len(frames):
            raise ClutchestError(f"{' '.join(logs)}: no data in the time window")
        return cls(frames)

    def write(self, path: Path) -> tuple[str, ...]:
        """Write to ``path``; returns what its format cannot hold, in words."""
        if isinstance(self.content, Frames):
            return files.write_frames(self.content, path)
        write_signals(self.content, path)
        return ()

    @property
    def decoded(self) -> bool:
        """Whether ``content`` is signals."""
        return isinstance(self.content, Signals)

    @property
    def count(self) -> int:
        """Number of frames, or of samples."""
        if isinstance(self.content, Frames):
            return len(self.content)
        return sum(len(signal) for signal in self.content.values())

    @property
    def notes(self) -> tuple[str, ...]:
        """What the logs leave open, in words."""
        return self.content.notes if isinstance(self.content, Frames) else self.content.warnings

    @property
    def rejected(self) -> dict[str, int]:
        """Frames that were rejected: reason → number."""
        if isinstance(self.content, Frames):
            return dict(self.content.rejected)
        return dict(self.content.counts.rejected)
