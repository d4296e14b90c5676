"""What an estimation gives back: estimates with their uncertainty, validity and reason."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import asdict, dataclass, field, fields
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from clutchest import memory_mapped
from clutchest.checked import checked
from clutchest.errors import ClutchestError, UnknownNameError, nearest
from clutchest.estimate.contradiction import Contradiction
from clutchest.estimate.estimated_series import EstimatedSeries
from clutchest.estimate.judder_line import JudderLine
from clutchest.estimate.observability import Information
from clutchest.paths import names_of
from clutchest.shown import Comparable, Showing, Shown, counted, plus_minus
from clutchest.signals import Floats, Signals
from clutchest.vehicle import Vehicle

if TYPE_CHECKING:
    import pandas as pd

    from clutchest.pictures import Picture


SUFFIXES = {  # of columns, and what they hold
    "_smoothed_std": "standard deviation, over the whole drive, of ",
    "_smoothed": "from the whole drive: ",
    "_std": "standard deviation of ",
    "_valid": "whether it can be used: ",
}
OTHER_COLUMNS = {
    "time": "since the drive's first sample",
    "drive": "number of the drive, from 0",
    "log": "file names",
    "timestamp": "absolute time, UTC",
    "mode": "which equations hold",
    "clutch_torque": "torque through the clutch",
    "slip_energy": "heat made by slipping since the drive began",
}


@dataclass(frozen=True, slots=True, eq=False)
class Estimate(Comparable):
    """One quantity over the output grid: ``value``, ``std`` and ``valid``, shape (m,) each.

    ``std`` contains the filter's own uncertainty and that of the parameters' spreads.
    """

    value: Floats
    std: Floats
    valid: NDArray[np.bool_]

    def __repr__(self) -> str:
        return f"<Estimate: {len(self.valid)} values, {np.count_nonzero(self.valid)} of them valid>"


@dataclass(frozen=True, slots=True, eq=False)
class Innovations(Comparable):
    """Measured less predicted, per sensor event: ``time`` s, ``sensor`` index into ``names``,
    ``innovation`` and its predicted standard deviation ``std`` in the sensor's unit; shape (k,)."""

    names: tuple[str, ...]
    time: Floats
    sensor: NDArray[np.int8]
    innovation: Floats
    std: Floats

    def __repr__(self) -> str:
        return f"<Innovations: {len(self.time)} of {', '.join(self.names)}>"

    @checked
    def of(self, name: str) -> tuple[Floats, Floats, Floats]:
        """(time, innovation, std) of one sensor.  Raises ClutchestError where there is none."""
        if name not in self.names:
            raise UnknownNameError(f"no sensor '{name}'{nearest(name, self.names)}")
        which, n = self.names.index(name), 0
        pieces = [
            (rows, self.sensor[rows] == which) for rows in memory_mapped.portions(len(self.time))
        ]
        count = sum(int(np.count_nonzero(own)) for _, own in pieces)
        time, innovation, std = (memory_mapped.empty((count,), np.float64) for _ in range(3))
        for rows, own in pieces:
            place = slice(n, n := n + int(np.count_nonzero(own)))
            time[place] = self.time[rows][own]
            innovation[place], std[place] = self.innovation[rows][own], self.std[rows][own]
            memory_mapped.release_memory()
        return time, innovation, std


@dataclass(frozen=True, slots=True)
class Engagement:
    """One slip event: s, s, J (± std), Nm, °C; bits of information about each state in it."""

    start_s: float
    duration_s: float
    energy_J: float
    energy_std_J: float
    peak_torque: float
    peak_temp_disc: float
    information_bits: Mapping[str, float] = field(default_factory=dict)


@dataclass(frozen=True, slots=True)
class TrackingFigures:
    """The figures of one actuation; None where the data do not give one.

    ``start_s`` to ``release_s`` and ``end_s`` of the actuation on the drive's clock; ``delay_s``
    from the start to the first output; ``rise_s`` from 10 to 90 % of what is ``settled``;
    ``peak``; ``overshoot`` over the settled output, relative; ``settling_s`` from the start until
    it stays within 5 %; ``error`` of the settled output less what was requested; ``ripple``: its
    root mean square without trend and without the sensor's noise; ``fall_s`` from the release
    until there is none.  ``resolution_s`` between samples of the output, which is ``measured`` or
    estimated.  All from ``rise_s`` to ``ripple`` need a drive that is held.
    """

    start_s: float
    release_s: float
    end_s: float
    delay_s: float | None
    peak: float
    settled: float | None
    rise_s: float | None
    overshoot: float | None
    settling_s: float | None
    error: float | None
    ripple: float | None
    fall_s: float | None
    resolution_s: float
    measured: bool

    def figures(self, unit: str) -> dict[str, Any]:
        """As ``summary.json`` has them: quantities in the output's ``unit`` carry it in their
        name."""
        return {_with_unit(name, unit): value for name, value in asdict(self).items()}

    @classmethod
    def no_figures(cls, unit: str) -> dict[str, Any]:
        """The same names, of an event without an actuation."""
        return {_with_unit(field.name, unit): None for field in fields(cls)}


def _with_unit(name: str, unit: str) -> str:
    return f"{name}_{unit}" if name in ("peak", "settled", "error", "ripple") else name


@dataclass(frozen=True, slots=True, eq=False)
class Track(Comparable):
    """The estimates of one drive on the output grid.

    ``mode`` uint8 (m,), index into ``mode_names``; ``states`` by state name; ``information``
    is denser than the grid while the clutch slips.  ``smoothed``: the states from what was
    measured over the whole drive; empty unless asked for.  ``clutch_torque`` is None of a machine
    without an output of that name, ``slip_energy`` where its equations have no output ``power``.
    ``contradiction``: why none of the states is valid, if so.  ``responses``: how the output
    followed each actuation, and ``judder``, the strongest line in its residual while surfaces
    slide, of a machine that declares them.  ``uncertain_slips``: events beside ``engagements`` of
    which the parameters' spreads leave open whether there was any energy.
    """

    time: Floats
    mode: NDArray[np.uint8]
    mode_names: tuple[str, ...]
    states: Mapping[str, Estimate]
    clutch_torque: Estimate | None
    slip_energy: Estimate | None
    innovations: Innovations
    engagements: tuple[Engagement, ...]
    log_likelihood: float
    information: Information
    smoothed: Mapping[str, Estimate] = field(default_factory=dict)
    contradiction: Contradiction | None = None
    responses: tuple[TrackingFigures, ...] = ()
    judder: JudderLine | None = None
    uncertain_slips: tuple[Engagement, ...] = ()

    def __repr__(self) -> str:
        return f"<Track: {len(self.time)} rows, {counted(len(self.engagements), 'slip event')}>"

    @property
    def outputs(self) -> dict[str, Estimate]:
        """``clutch_torque`` and ``slip_energy`` by name, where the machine has them."""
        both = {"clutch_torque": self.clutch_torque, "slip_energy": self.slip_energy}
        return {name: estimate for name, estimate in both.items() if estimate is not None}


@dataclass(frozen=True, slots=True, repr=False, eq=False)
class Run(Showing, Mapping[str, EstimatedSeries]):
    """A replay: signals in, one :class:`Track` per drive out.

    Behaves as a mapping of names of states and outputs → their estimates in the first drive, as
    :class:`Signals` does; those of another one are ``run.estimate(name, drive=1)``.

    ``summary`` is what ``summary.json`` holds; ``final`` what ``state.json`` carries to the
    next drive.
    """

    vehicle: Vehicle
    signals: Signals
    tracks: tuple[Track, ...]
    summary: Mapping[str, Any]
    final: Mapping[str, Any]
    provenance: Mapping[str, str]  # versions, hashes of vehicle, parameters and compiled model

    def shown(self) -> Shown:
        """The last estimate of every state, and why one is not valid."""
        units = self._units
        events = sum(len(track.engagements) for track in self.tracks)
        seconds = sum(float(track.time[-1]) for track in self.tracks if len(track.time))
        rows = [
            (
                name,
                plus_minus(state["value"], state["std"], units.get(name, ""))
                if state["valid"]
                else "",
                "" if state["valid"] else str(state["why"]),
            )
            for name, state in self.summary["states"].items()
        ]
        return Shown(
            f"{self.vehicle.name}, {counted(len(self.tracks), 'drive')}, {seconds:.1f} s, "
            f"{counted(events, 'slip event')}",
            ("state", "last estimate", "not valid"),
            rows,
        )

    @checked
    def track(self, drive: int) -> Track:
        """The estimates of a drive.  Raises ClutchestError where there is none."""
        if drive not in range(len(self.tracks)):
            raise ClutchestError(f"no drive {drive}, expected 0 … {len(self.tracks) - 1}")
        return self.tracks[drive]

    @property
    def estimated(self) -> tuple[str, ...]:
        """Names of what is estimated: states, then outputs."""
        return tuple(dict.fromkeys(n for t in self.tracks for n in (*t.states, *t.outputs)))

    @property
    def states(self) -> tuple[str, ...]:
        """Names of the states, in any drive."""
        return tuple(dict.fromkeys(name for track in self.tracks for name in track.states))

    @property
    def warnings(self) -> list[str]:
        """What is to be kept in mind of it."""
        return list(map(str, self.summary["warnings"]))

    @partial(checked, own=("name",))
    def estimate(self, name: str, drive: int = 0) -> EstimatedSeries:
        """A state or an output of one drive, by name.

        Raises ClutchestError where there is no such drive, or no such name.
        """
        track = self.track(drive)
        estimates = {**track.states, **track.outputs}
        if not isinstance(name, str) or name not in estimates:
            raise UnknownNameError(f"no estimate '{name}'{self._instead(name, estimates)}")
        e = estimates[name]
        unit = self._units.get(name, "1")
        return EstimatedSeries(name, unit, track.time, e.value, e.std, e.valid)

    def __getitem__(self, name: str) -> EstimatedSeries:
        return self.estimate(name)

    def __iter__(self) -> Iterator[str]:
        return iter((*self.tracks[0].states, *self.tracks[0].outputs))

    def __len__(self) -> int:
        return len(self.tracks[0].states) + len(self.tracks[0].outputs)

    @partial(checked, own=("names",))
    def plot(self, *names: str, drive: int = 0) -> Picture:
        """Mode, states and outputs of one drive over time, all or those of these ``names``, each
        with a band of two standard deviations; grey where an estimate is not valid.  Signals are
        drawn by ``signals.plot``.

        Raises ClutchestError where there is no such drive, or no such name.
        """
        from clutchest.estimate.run_picture import Band, draw_estimates
        from clutchest.quantity import Quantity

        track = self.track(drive)
        bands = {}
        for name in names or (*track.states, *track.outputs):
            each = self.estimate(name, drive)
            bands[Quantity(name, each.unit)] = Band(each.value, each.std, each.valid)
        return draw_estimates(track.time, track.mode, track.mode_names, bands)

    def _instead(self, name: object, estimates: Iterable[str]) -> str:
        """What was meant by what is no estimate."""
        if isinstance(name, int):
            return f"; a drive is given as drive={name}"
        if isinstance(name, str) and name in self.signals.signals:
            return f"; of a signal: run.signals.plot('{name}')"
        return nearest(str(name), estimates)

    def to_pandas(self) -> pd.DataFrame:
        """The columns of ``estimates.parquet``; all drives, one below the other.

        ``attrs`` of the table: ``units`` and ``comments`` by column, and ``start_ns``.
        """
        import pandas as pd

        frames = []
        logs = list(dict.fromkeys(map(log_of, self.signals.drives)))
        for drive, (track, signals) in enumerate(
            zip(self.tracks, self.signals.drives, strict=True)
        ):
            columns = columns_of(track, drive, signals.start_ns)
            codes = np.full(len(track.time), logs.index(log_of(signals)))
            columns["log"] = pd.Categorical.from_codes(codes, logs)
            columns["timestamp"] = pd.DatetimeIndex(columns["timestamp"]).tz_localize("UTC")
            columns["mode"] = pd.Categorical.from_codes(track.mode, list(track.mode_names))
            frames.append(pd.DataFrame(columns))
        table = pd.concat(frames, ignore_index=True)
        table.attrs.update(self.about([str(name) for name in table]))
        return table

    def to_polars(self) -> Any:
        """The same as a DataFrame of polars, which must be installed; it has no place for units."""
        import polars

        return polars.from_pandas(self.to_pandas())

    @checked
    def about(self, columns: Iterable[str]) -> dict[str, Any]:
        """``units`` and ``comments`` of these columns, and ``start_ns`` of every drive's time 0:
        the attributes of a table."""
        units, words = {**self._units, "time": "s"}, dict(OTHER_COLUMNS)
        words |= {state.name: state.what for state in self.vehicle.machine.states}
        stems = {name: name.removesuffix("_std").removesuffix("_smoothed") for name in columns}
        comments = {}
        for name, stem in stems.items():
            of = words.get(stem.removesuffix("_valid"), "")
            prefix = next((what for end, what in SUFFIXES.items() if name.endswith(end)), "")
            comments[name] = f"{prefix}{of}"
        return {
            "units": {name: units[stem] for name, stem in stems.items() if stem in units},
            "comments": {name: text for name, text in comments.items() if text},
            "start_ns": [drive.start_ns for drive in self.signals.drives],
        }

    @property
    def _units(self) -> dict[str, str]:
        """State or output → unit."""
        states = {state.name: state.unit for state in self.vehicle.machine.states}
        return {**states, "clutch_torque": "Nm", "slip_energy": "J"}


def log_of(signals: Signals) -> str:
    """The file names of a drive's logs; "" where it was read from none."""
    return names_of(signals.sources)


def columns_of(track: Track, drive: int, start_ns: int | None) -> dict[str, Any]:
    """The columns of ``estimates.parquet``, (m,) each, but for ``log``: zeros in its place; the
    mode as index into ``mode_names``, ``timestamp`` in UTC, not a time where it is not known."""
    n = len(track.time)
    stamp = np.full(n, "NaT", "datetime64[ns]")
    if start_ns is not None:
        since = np.round(np.asarray(track.time) * 1e9).astype("timedelta64[ns]")
        stamp = np.datetime64(start_ns, "ns") + since
    columns: dict[str, Any] = {
        "time": track.time,
        "drive": np.full(n, drive, np.int32),
        "log": np.zeros(n, np.int8),
        "timestamp": stamp,
        "mode": track.mode,
    }
    for name, estimate in track.states.items():
        columns[name] = estimate.value
        columns[f"{name}_std"] = estimate.std
        columns[f"{name}_valid"] = estimate.valid
        if name in track.smoothed:
            columns[f"{name}_smoothed"] = track.smoothed[name].value
            columns[f"{name}_smoothed_std"] = track.smoothed[name].std
    for name, quantity in track.outputs.items():
        columns[name] = quantity.value
        columns[f"{name}_std"] = quantity.std
    return columns
