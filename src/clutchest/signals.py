"""Signals: what the rest of the toolkit works on, from any bus or file."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from datetime import UTC, datetime
from enum import IntEnum
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from clutchest import memory_mapped
from clutchest.checked import check, checked, checked_fields
from clutchest.errors import ClutchestError, UnknownNameError, nearest
from clutchest.native import compiled
from clutchest.paths import names_of
from clutchest.shown import Comparable, Showing, Shown

if TYPE_CHECKING:
    import pandas as pd

    from clutchest.pictures import Picture

Floats = NDArray[np.float64]
Rows = NDArray[np.bool_] | NDArray[np.intp] | slice  # which samples: a mask, indices, or from … to

LOST = 10.0  # s; over a longer gap in a signal nothing is interpolated
HEAD = 5.0  # s from its first sample, by which a signal's sender and period are determined


class Why(IntEnum):
    """Why a sample is not a number."""

    VALID = 0
    NOT_AVAILABLE = 1  # stated by the bus (J1939: all ones)
    ERROR = 2  # stated by the bus (J1939: 0xFE…)
    RESERVED = 3  # a code that J1939 keeps back
    TOO_SHORT = 4  # the frame ends before the signal does
    OUT_OF_RANGE = 5  # not finite, or outside what the vehicle file allows
    CHECKSUM = 6
    COUNTER = 7


_VALID = np.uint8(Why.VALID)  # attributes of an enumeration are slow


@dataclass(frozen=True, slots=True, eq=False)
class Signal(Comparable):
    """Samples of one quantity at their own times.

    ``time`` s since the log's start, non-decreasing, shape (n,); ``value`` shape (n,) in ``unit``,
    NaN where ``why`` (uint8, codes of :class:`Why`) is not VALID.
    """

    name: str
    unit: str
    time: Floats
    value: Floats
    why: NDArray[np.uint8]

    @classmethod
    @checked
    def of(
        cls, name: str, unit: str, time: Floats, value: Floats, why: NDArray[np.uint8] | None = None
    ) -> Signal:
        """A signal from plain arrays; samples that are not finite become invalid, times sorted."""
        time, value = np.asarray(time, np.float64), np.array(value, np.float64)
        why = np.zeros(len(time), np.uint8) if why is None else np.array(why, np.uint8)
        if not time.shape == value.shape == why.shape or time.ndim != 1:
            raise ClutchestError(
                f"signal '{name}': {time.shape} times, {value.shape} values and {why.shape} "
                "reasons, expected as many of each"
            )
        if unknown := int(np.count_nonzero(~np.isfinite(time))):
            raise ClutchestError(f"signal '{name}': {unknown} of its times are no numbers")
        why[(why == _VALID) & ~np.isfinite(value)] = Why.OUT_OF_RANGE
        value[why != _VALID] = np.nan
        if len(time) > 1 and np.any(time[1:] < time[:-1]):
            order = np.argsort(time, kind="stable")
            time, value, why = time[order], value[order], why[order]
        return cls(name, unit, time, value, why)

    @property
    def valid(self) -> NDArray[np.bool_]:
        """Where the sample is a number; shape (n,)."""
        return self.why == _VALID

    def only_valid(self) -> Signal:
        """The same signal without its invalid samples."""
        keep = self.valid
        return self if keep.all() else self.take(keep)

    def mapped_to_disk(self) -> Signal:
        """The same signal, a long one in files."""
        if self.time.nbytes < memory_mapped.LEAST:
            return self
        return replace(
            self,
            time=memory_mapped.mapped_to_disk(self.time),
            value=memory_mapped.mapped_to_disk(self.value),
            why=memory_mapped.mapped_to_disk(self.why),
        )

    @checked
    def take(self, rows: Rows) -> Signal:
        """The samples of ``rows``."""
        return Signal(self.name, self.unit, self.time[rows], self.value[rows], self.why[rows])

    @checked
    def between(self, start: float, end: float) -> Signal:
        """The samples from ``start`` s on, before ``end`` s."""
        return self.take(slice(*np.searchsorted(self.time, (start, end))))

    @checked
    def then(self, later: Signal) -> Signal:
        """These samples and behind them those of ``later``."""
        return Signal.joined((self, later))

    @classmethod
    @checked
    def joined(cls, parts: Sequence[Signal]) -> Signal:
        """The samples of all ``parts``, at least one, which follow each other in time."""
        if not parts:
            raise ClutchestError("parts: expected one signal at least")
        some = [part for part in parts if len(part)]
        if len(some) < 2:
            return some[0] if some else parts[-1]
        time, value, why = (
            np.concatenate([getattr(part, column) for part in some])
            for column in ("time", "value", "why")
        )
        return cls(some[0].name, some[0].unit, time, value, why)

    @checked
    def at(self, time: Floats, gap: float = LOST) -> Floats:
        """Values at ``time`` (n,), of a signal without invalid samples: straight between samples no
        further apart than ``gap`` s, else the last one, which is held; the first before it."""
        return np.asarray(_between(np.asarray(time, np.float64), self.time, self.value, gap))

    def __repr__(self) -> str:
        valid = np.count_nonzero(self.valid)
        return f"<Signal: {self.name} in {self.unit}, {len(self)} samples, {valid} of them valid>"

    def __len__(self) -> int:
        return len(self.time)


@compiled
def _between(time, samples, value, gap):  # type: ignore[no-untyped-def]
    """``value`` at ``time``, straight between ``samples`` at most ``gap`` apart, else held."""
    result, n, k, i = np.empty(len(time)), len(samples), 0, 0
    while i < len(time):
        if k and time[i] < samples[k - 1]:
            k = np.searchsorted(samples, time[i], side="right")
        while k < n and samples[k] <= time[i]:  # k: the first sample behind
            k += 1
        last = max(k - 1, 0)
        since, held, slope = samples[last], value[last], 0.0
        if 0 < k < n and samples[k] - since <= gap:
            slope = (value[k] - held) / (samples[k] - since)
        begin = since if k else -np.inf
        end = samples[k] if k < n else np.inf
        while i < len(time) and begin <= time[i] < end:
            result[i] = slope * (time[i] - since) + held
            i += 1
    return result


@dataclass(frozen=True, slots=True)
class Counts:
    """How many frames of a log were decoded or rejected, by reason."""

    frames: int = 0
    decoded: int = 0  # frames of mapped messages that gave at least one sample
    rejected: Mapping[str, int] = field(default_factory=dict)  # reason → frames
    messages: Mapping[str, Mapping[str, int]] = field(default_factory=dict)  # message → counts

    def __add__(self, other: Counts) -> Counts:
        """Those of two logs together."""
        mine, theirs = self.messages, other.messages
        names = dict.fromkeys([*mine, *theirs])
        messages = {name: _together(mine.get(name, {}), theirs.get(name, {})) for name in names}
        return Counts(
            self.frames + other.frames,
            self.decoded + other.decoded,
            _together(self.rejected, other.rejected),
            messages,
        )

    def summary(self) -> dict[str, Any]:
        """As the JSON files have it."""
        return {
            "frames": self.frames,
            "frames_decoded": self.decoded,
            "frames_rejected": dict(self.rejected),
        }


def _together(some: Mapping[str, int], more: Mapping[str, int]) -> dict[str, int]:
    return {key: some.get(key, 0) + more.get(key, 0) for key in dict.fromkeys([*some, *more])}


@dataclass(frozen=True, slots=True)
class Traffic:
    """The frames of one message from one sender, in order of time; shape (n,) each.

    ``time`` s since the log's start; ``same``: the payload, counter and checksum left out, is that
    of the frame before; ``step`` by how much the counter went on (−1 for the first frame and where
    there is none), ``turns`` the number of its values (0: no counter); ``sound``: the
    checksum is right, or there is none.  ``period`` s as the DBC or the vehicle file states it,
    None where they do not.  ``checked``: counter and checksum are known to be meant as such.
    ``channel``: of the bus that the frames were received from, None if there are none.
    """

    time: Floats
    same: NDArray[np.bool_]
    step: NDArray[np.int16]
    turns: int
    sound: NDArray[np.bool_]
    period: float | None = None
    checked: bool = False
    channel: int | None = None

    def take(self, rows: Rows) -> Traffic:
        """The frames of ``rows``."""
        return replace(
            self,
            time=self.time[rows],
            same=self.same[rows],
            step=self.step[rows],
            sound=self.sound[rows],
        )

    @classmethod
    def joined(cls, parts: Sequence[Traffic]) -> Traffic:
        """The frames of all ``parts``, at least one, which follow each other in time."""
        if len(parts) == 1:
            return parts[0]
        columns: dict[str, Any] = {
            name: np.concatenate([getattr(part, name) for part in parts])
            for name in ("time", "same", "step", "sound")
        }
        return replace(parts[0], **columns)

    def __len__(self) -> int:
        return len(self.time)


@dataclass(frozen=True, slots=True, eq=False)
class Truth(Comparable):
    """True values of a simulated drive on one time grid, (n,) each; ``mode`` holds names."""

    time: Floats
    columns: Mapping[str, NDArray]


@checked_fields
@dataclass(frozen=True, repr=False, eq=False)
class Signals(Showing, Mapping[str, Signal]):
    """The named signals of one drive; later drives of the same read hang on ``later``.

    Behaves as a mapping of canonical name → :class:`Signal`.  ``start_ns`` is the epoch time of
    t = 0 in ns, None where the log only has relative times.  ``end``: the log's last time, s, that
    of a sample at least.  ``activity``: channel → times, s, of frames of whatever id, thinned.
    ``gear``: the engaged gear by which a wheel speed became a shaft speed, first gear 1.
    """

    signals: Mapping[str, Signal]
    start_ns: int | None = None
    end: float = 0.0
    counts: Counts = field(default_factory=Counts)
    warnings: tuple[str, ...] = ()
    sources: tuple[str, ...] = ()
    truth: Truth | None = None
    traffic: Mapping[str, Traffic] = field(default_factory=dict)  # by message; empty for tables
    activity: Mapping[int, Floats] = field(default_factory=dict)
    gear: Signal | None = None
    later: tuple[Signals, ...] = ()

    def __post_init__(self) -> None:
        for name, signal in self.signals.items():
            check(f"signal '{name}'", signal, Signal)
        ends = [self.end, *(float(s.time[-1]) for s in self.signals.values() if len(s))]
        object.__setattr__(self, "end", max(ends))

    @property
    def drives(self) -> tuple[Signals, ...]:
        """Every drive, this one first."""
        return (replace(self, later=()), *self.later)

    @property
    def begun(self) -> str:
        """When t = 0 was, in words; "" where the log only has relative times."""
        if self.start_ns is None:
            return ""
        return f"{datetime.fromtimestamp(self.start_ns / 1e9, UTC):%F %T} UTC"

    @property
    def available(self) -> frozenset[str]:
        """Names of the signals with a valid sample in this drive."""
        return frozenset(name for name, signal in self.signals.items() if signal.valid.any())

    @property
    def available_throughout(self) -> frozenset[str]:
        """Names of the signals with a valid sample in every drive."""
        return frozenset.intersection(*(drive.available for drive in self.drives))

    @checked
    def between(self, start: float = -np.inf, end: float = np.inf) -> Signals:
        """The samples of this drive alone from ``start`` s on, before ``end`` s, at the times that
        they have; signals without any are left out."""
        inside = {name: signal.between(start, end) for name, signal in self.signals.items()}
        kept = {name: signal for name, signal in inside.items() if len(signal)}
        return replace(self, signals=kept, end=min(end, self.end), later=())

    @checked
    def has_samples_of(self, other: Signals) -> bool:
        """Whether the signals available in both drives have the same values, at whatever times."""
        both = self.available & other.available
        return bool(both) and all(
            np.array_equal(self[name].value, other[name].value, equal_nan=True) for name in both
        )

    def shown(self) -> Shown:
        """The signals of this drive: samples, how many of them are valid, and the range."""
        drives = len(self.later) + 1
        of = names_of(self.sources)
        line = f"{of}{': ' if of else ''}{len(self.signals)} signals, {self.end:.1f} s"
        rows = []
        for name, signal in self.signals.items():
            valid = signal.value[signal.valid]
            low, high = (f"{limit(valid):.4g}" if len(valid) else "" for limit in (np.min, np.max))
            rows.append((name, signal.unit, str(len(signal)), str(len(valid)), low, high))
        return Shown(
            line + (f", the first of {drives} drives" if drives > 1 else ""),
            ("signal", "unit", "samples", "valid", "lowest", "highest"),
            rows,
        )

    def to_pandas(self) -> pd.DataFrame:
        """This drive as a table: ``time`` and a column per signal, one row per time stamp.

        Invalid samples are empty cells; of two samples of a signal at one time the later one
        counts.  ``attrs`` of the table: ``units`` by column, and ``start_ns``.
        """
        import pandas as pd

        valid = {name: signal.only_valid() for name, signal in self.signals.items()}
        times = [signal.time for signal in self.signals.values()]
        time = np.unique(np.concatenate(times)) if times else np.zeros(0)
        columns = {"time": time}
        for name, signal in valid.items():
            column = np.full(len(time), np.nan)
            column[np.searchsorted(time, signal.time)] = signal.value
            columns[name] = column
        table = pd.DataFrame(columns)
        units = {"time": "s", **{name: s.unit for name, s in self.signals.items() if s.unit}}
        table.attrs.update(units=units, start_ns=[self.start_ns])
        return table

    def to_polars(self) -> Any:
        """The same as a DataFrame of polars, which must be installed; it has no place for units."""
        import polars

        return polars.from_pandas(self.to_pandas())

    @checked
    def plot(self, *names: str) -> Picture:
        """This drive's signals over time, one below the other; all of them unless named."""
        from clutchest.pictures import stacked, thinned
        from clutchest.quantity import Quantity

        some = [self[name] for name in names or self.signals]
        if not some:
            raise ClutchestError("this drive has no signals that could be plotted")
        figure, panels = stacked(len(some))
        for signal, axes in zip(some, panels, strict=True):
            quantity = Quantity(signal.name, signal.unit or "1")
            axes.plot(*thinned(signal.time, quantity.read(signal.value)), lw=0.8)
            axes.set_title(quantity.label, loc="left", fontsize=9)
        return figure

    def __getitem__(self, name: str) -> Signal:
        try:
            return self.signals[name]
        except (KeyError, TypeError):  # TypeError: what no mapping has
            raise UnknownNameError(
                f"no signal '{name}' in this log" + nearest(str(name), self.signals)
            ) from None

    def __iter__(self) -> Iterator[str]:
        return iter(self.signals)

    def __len__(self) -> int:
        return len(self.signals)

    def __contains__(self, name: object) -> bool:
        return name in self.signals
