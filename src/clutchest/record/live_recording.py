"""The recording of a drive that is going on: a file, and beside it a server for a viewer."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
import rerun as rr

from clutchest.errors import ClutchestError
from clutchest.estimate.run import Track
from clutchest.paths import named_in_utf8
from clutchest.quantity import Quantity
from clutchest.record.blueprint import BOUND, COLOURS, INVALID, MODE_COLOURS, live_blueprint
from clutchest.record.drained_file import DrainedFile, open_files
from clutchest.record.quantities import OUTPUTS
from clutchest.record.series import TIMELINE, index, outline
from clutchest.record.tracking import figures_in_words
from clutchest.record.viewer import HERE, Viewer, refuse_taken
from clutchest.signals import Signal
from clutchest.vehicle import Vehicle

FLUSH_S = 30.0  # that a disk may take for what was held back
MEMORY = "256MB"  # that the server keeps for viewers that come late
_EVERY = 2.0  # s of the drive that are written in one go: a file of single rows is all overhead
_PER_S = 20  # rows of a line: the lowest and highest of a tenth of a second, as fine as estimates
_LEVELS = {"warning": "WARN", "gap": "WARN", "fault": "ERROR"}


class LiveRecording:
    """Writes tracks, signals and events to ``path`` as they come.

    With ``serve`` they also go to a server on this machine only, whose ``address`` a browser can
    open.  A file that is cut off can be read up to there; ``rerun rrd optimize`` gives it its end.
    Raises ClutchestError where a port is taken, or the file cannot be written any more.
    """

    def __init__(self, path: Path, vehicle: Vehicle, serve: tuple[int, int] | None = None) -> None:
        known = vehicle.machine
        self._states = {s.name: Quantity(s.name, s.unit, s.what) for s in known.states}
        self._states |= OUTPUTS
        self._signals = {name: Quantity(name, unit) for name, unit in known.units.items()}
        self._sensors = {s.name: Quantity(s.name, s.unit) for s in known.sensors}
        self._held: dict[str, list[tuple[np.ndarray, ...]]] = defaultdict(list)
        self._since: float | None = None
        self._mode: str | None = None
        self._viewer: Viewer | None = None
        self._styled: set[str] = set()
        self._failed = False  # what Rerun is asked for then may never be answered
        self._path, self.address = path, ""
        # where a write fails, Rerun may wait for ever
        self._file = DrainedFile(path, names) if (names := open_files()) else None
        self._stream = rr.RecordingStream("clutchest", send_properties=False)
        sinks: list[Any] = []
        every = _EVERY
        if serve is not None:
            every = 0.5
            refuse_taken(serve)
            sinks.append(rr.GrpcServerSink(HERE, serve[0], server_memory_limit=MEMORY))
        self._every = every
        with self._file.entrance() if self._file else named_in_utf8(path) as file:
            self._stream.set_sinks(rr.FileSink(file, write_footer=False), *sinks)  # opened at once
        self._stream.send_recording_name(f"{vehicle.name}, live")
        self._stream.send_blueprint(live_blueprint(known, TIMELINE))
        self._lane("mode", MODE_COLOURS)
        if serve is not None:
            self._viewer = Viewer(sinks[0].uri, serve[1])
            self.address = self._viewer.address

    def begin(self, start_ns: int, provenance: Mapping[str, str]) -> None:
        """What is known when a drive begins."""
        self._stream.send_recording_start_time_nanos(start_ns)
        self._stream.send_property("provenance", rr.AnyValues(True, **provenance))

    def add(self, track: Track, signals: Mapping[str, Signal], offset: float) -> None:
        """A piece of a drive that begins at ``offset`` s on the timeline."""
        time = track.time + offset
        for name, quantity in self._states.items():
            estimate = {**track.states, **track.outputs}.get(name)
            if estimate is None or not np.isfinite(estimate.value).any():
                continue
            value, std = quantity.read(estimate.value), quantity.read_spread(estimate.std)
            self._held[f"state/{name}"].append((time, value, std**2, estimate.valid))
        for name, signal in signals.items():
            valid = signal.only_valid()
            if name in self._signals and len(valid):
                value = self._signals[name].read(valid.value)
                self._held[f"can/{name}"].append((valid.time + offset, value))
        for name in track.innovations.names:
            at, innovation, std = track.innovations.of(name)
            if len(at):
                quantity = self._sensors[name]
                spread = 3 * quantity.read_spread(std)
                both = np.column_stack([quantity.read_spread(innovation), spread, -spread])
                self._held[f"residual/{name}"].append((at + offset, both))
        for k in np.flatnonzero(np.diff(track.mode, prepend=255)):
            mode = track.mode_names[track.mode[k]]
            if mode != self._mode:
                self._mode = mode
                self._held["mode"].append((time[k : k + 1], np.array([mode])))
        if len(time):
            self._since = float(time[0]) if self._since is None else self._since
            if time[-1] - self._since >= self._every:
                self.write()

    def tell(self, event: Mapping[str, Any], offset: float) -> None:
        """An event into the log."""
        self._stream.set_time(TIMELINE, duration=event["time"] + offset)
        level = _LEVELS.get(event["kind"], "INFO")
        words = f"{event['kind']}: {event['name']}"
        if event["kind"] == "tracking":
            words = f"{words}: {figures_in_words(event['data'])}"
        self._stream.log("events", rr.TextLog(words, level=level))

    def write(self) -> None:
        """Send what is held back."""
        for entity, pieces in self._held.items():
            columns = [np.concatenate(column) for column in zip(*pieces, strict=True)]
            kind, name = (*entity.split("/"), "")[:2]
            if kind in ("can", "residual"):  # spikes outlive it
                most = round(_PER_S * max(float(np.ptp(columns[0])), 1.0 / _PER_S))
                line = columns[1] if kind == "can" else columns[1][:, 0]
                columns = [column[outline(line, most)] for column in columns]
            time = index(columns[0])
            self._style(kind, name, entity)
            if kind == "state":
                own = COLOURS[list(self._states).index(name) % len(COLOURS)]
                colour = np.where(columns[3], own, INVALID).astype(np.uint32)
                rows = rr.Measurements.columns(
                    values=columns[1], variances=columns[2], colors=colour
                )
            elif kind == "mode":
                rows = rr.StateChange.columns(state=columns[1].tolist())
            else:
                rows = rr.Scalars.columns(scalars=columns[1])
            self._stream.send_columns(entity, time, rows)
        self._held.clear()
        self._since = None
        try:
            self._stream.flush(timeout_sec=FLUSH_S)
        except RuntimeError as problem:
            self._failed = True
            raise ClutchestError(f"{self._path}: cannot be written any more: {problem}") from None
        self._check()

    def close(self) -> None:
        """Write the rest, unless Rerun failed before; the server and its viewer end."""
        try:
            if not self._failed:
                self.write()
        finally:
            if not self._failed:
                with suppress(RuntimeError):
                    self._stream.disconnect()
                if self._file is not None:
                    self._file.close(FLUSH_S)
            if self._viewer is not None:
                self._viewer.close()
        self._check()

    def _check(self) -> None:
        if self._file is not None and self._file.problem:
            raise ClutchestError(f"{self._path}: cannot be written any more: {self._file.problem}")

    def _style(self, kind: str, name: str, entity: str) -> None:
        if entity in self._styled:
            return
        self._styled.add(entity)
        if kind == "state":
            quantity = self._states[name]
            style: Any = rr.Measurements.from_fields(
                names=quantity.words, units=quantity.shown or None, widths=2.0
            )
        elif kind == "residual":
            style = rr.SeriesLines(
                names=["measured − predicted", "+3σ", "−3σ"],
                colors=np.array([COLOURS[1], BOUND, BOUND], np.uint32),
                widths=[1.2, 1.0, 1.0],
                aggregation_policy="MinMax",
            )
        elif kind == "can":
            style = rr.SeriesLines(
                names=self._signals[name].words, widths=1.5, aggregation_policy="MinMax"
            )
        else:
            return
        self._stream.log(entity, style, static=True)

    def _lane(self, entity: str, colours: Mapping[str, int]) -> None:
        self._stream.log(
            entity,
            rr.StateConfiguration(
                values=list(colours),
                colors=np.array(list(colours.values()), np.uint32),
                visible=[True] * len(colours),
            ),
            static=True,
        )
