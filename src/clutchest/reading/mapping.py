"""From frames to canonical signals, by a vehicle file, with an account of every frame."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from clutchest import memory_mapped, units
from clutchest.can import activity
from clutchest.can.database import Database, Message, SignalLayout
from clutchest.can.decode import DecodedColumn, rows_of
from clutchest.can.encode import check
from clutchest.can.frames import Frames
from clutchest.can.transport import reassembled
from clutchest.errors import ClutchestError
from clutchest.reading.account import Account, contents_of, together, words
from clutchest.reading.gears import gear_signal, never_sent, through_gear, through_sent_gear
from clutchest.reading.message_columns import column_of, without_corrupted
from clutchest.reading.percent_torque import of_reference
from clutchest.reading.plausible import clipped, excluded
from clutchest.reading.samples import NONE, VALID, Samples
from clutchest.reading.senders import most_frequent_sender, name_of, senders_of
from clutchest.reading.traffic import traffic_of
from clutchest.reading.wanted import mapped_messages, parts
from clutchest.signals import Counts, Floats, Signal, Signals, Traffic, Why
from clutchest.vehicle import BusSignal, SignalMap, Vehicle

LATELY = 0.5  # s, for which a reading of the other side stands for the present one
NOT_KNOWN = np.uint8(Why.NOT_AVAILABLE)


class NoMappedFrame(ClutchestError):
    """A log, or a part of one, without a frame of any mapped message."""


def signals_of(
    frames: Frames,
    vehicle: Vehicle,
    database: Database,
    sources: tuple[str, ...] = (),
    with_traffic: bool = True,
) -> Signals:
    """The canonical signals in ``frames`` (sorted by time, not empty); t = 0 at the first frame.

    Warnings name what is mapped and missing.  Raises NoMappedFrame if no mapped message has a
    frame, ClutchestError if the vehicle file and the DBC contradict each other.
    """
    wanted = [database.message(name) for name in mapped_messages(vehicle, database)]
    whole = reassembled(frames, wanted)
    signals = Decoding(whole, vehicle, database, sources).signals()
    if not with_traffic:
        return signals
    traffic = {
        message.name: _with_shared_times(traffic_of(whole, message, vehicle), signals)
        for message in wanted
    }
    active = activity.times(frames, int(frames.t_ns[0]))
    return replace(signals, traffic=traffic, activity=active)


def _with_shared_times(traffic: Traffic, signals: Signals) -> Traffic:
    """``traffic`` with the array of times of the signals that its frames carried."""
    for signal in signals.values():
        if np.array_equal(signal.time, traffic.time):
            return replace(traffic, time=signal.time)
    return traffic


@dataclass
class Decoding:
    """The decoding of one drive, or of a part of one, with the warnings so far.

    ``wanted`` is what :func:`mapped_messages` gives.  ``senders``: the sender of each bus signal of
    a canonical one, where it is chosen already; t = 0 is at ``start_ns``, the first frame unless
    given.  Without an ``account`` nothing is counted and fewer warnings are given.
    """

    frames: Frames
    vehicle: Vehicle
    database: Database
    sources: tuple[str, ...] = ()
    senders: dict[tuple[str, BusSignal], int] = field(default_factory=dict)
    start_ns: int | None = None
    rows: dict[str, NDArray[np.intp]] = field(default_factory=dict)  # of messages not yet decoded
    columns: dict[tuple[str, str], DecodedColumn] = field(default_factory=dict)
    account: Account | None = field(default_factory=Account)
    warnings: list[str] = field(default_factory=list)
    samples: dict[tuple[str, BusSignal], Samples] = field(default_factory=dict)
    times: list[tuple[NDArray[np.intp], Floats]] = field(default_factory=list)  # of rows, s
    wanted: Mapping[str, Mapping[str, SignalLayout]] = field(default_factory=dict)
    gear: Signal | None = None

    def __post_init__(self) -> None:
        self.wanted = self.wanted or mapped_messages(self.vehicle, self.database)
        self.senders = dict(self.senders)

    def signals(self) -> Signals:
        """Everything, with an account of it; see :func:`signals_of`."""
        frames, account = self.frames, self.account
        assert account is not None
        mapped = self.locate_messages()
        source = " ".join(self.sources) or "this log"
        if not mapped.any():
            raise NoMappedFrame(
                f"{source}: no frame of {', '.join(self.wanted)}; "
                + contents_of(frames, self.database)
            )
        account.of_the_rest(frames, mapped, map(self.database.message, self.wanted))
        made, wheel_speeds = self.canonical()
        for name, wheel in wheel_speeds.items():
            column = self.vehicle.machine.column(name)
            made[name] = self._geared(wheel, made.get(column.geared_by) if column else None)
        self._warn_of_missing(account)
        self.warnings += together(made, source)
        first, last = int(frames.t_ns[0]), int(frames.t_ns[-1])
        decoded = sum(counts["decoded"] for counts in account.messages.values())
        passed_over = Counter(dict(frames.passed_over))
        rejected = dict(account.rejected + passed_over + Counter(dict(frames.rejected)))
        return Signals(
            made,
            start_ns=first if frames.absolute else None,
            end=(last - first) / 1e9,
            counts=Counts(len(frames) + passed_over.total(), decoded, rejected, account.messages),
            warnings=(*self.database.warnings, *frames.notes, *self.warnings),
            sources=self.sources,
            gear=self.gear,
        )

    def _warn_of_missing(self, account: Account) -> None:
        missing = [name for name, counts in account.messages.items() if not counts["frames"]]
        contents = contents_of(self.frames, self.database) if missing else ""
        self.warnings += [
            f"message {name} has no frame in this log ({', '.join(self._carried_by(name))}); "
            f"{contents}"
            for name in missing
        ]

    def locate_messages(self) -> NDArray[np.bool_]:
        """The rows of every mapped message, to be decoded when they are needed; which frames (n,)
        are of one."""
        mapped = np.zeros(len(self.frames), bool)
        for name in self.wanted:
            rows = rows_of(self.frames, self.database.message(name))
            if self.account is not None:
                self.account.messages[name] = {"frames": len(rows), "decoded": 0}
            self.rows[name] = memory_mapped.mapped_to_disk(rows)
            mapped[rows] = True
        return mapped

    def canonical(
        self, names: Iterable[str] | None = None
    ) -> tuple[dict[str, Signal], dict[str, Signal]]:
        """The canonical signals, of these ``names`` if given, and the wheel speeds that make one
        by a gear that is not sent."""
        made: dict[str, Signal] = {}
        wheel_speeds: dict[str, Signal] = {}
        unit_of = self.vehicle.machine.units
        for name in self.vehicle.signals if names is None else names:
            signal = self.vehicle.signals[name]
            if not signal.on_bus:
                continue
            samples = self._samples(signal, signal.bus)
            if len(samples.rows):
                complete = not signal.gears or self._gear_is_sent(signal)
                made_of = self._canonical(signal, samples, unit_of[name])
                (made if complete else wheel_speeds)[name] = made_of
            if self.account is not None:
                self._release_up_to(name)
                memory_mapped.release_memory()
        undecoded = list(self.rows) if self.account is not None else []
        for message in undecoded:
            self._decode(message)
        return made, wheel_speeds

    def carried_from(self, first: int) -> list[str]:
        """The canonical signals of which a frame from row ``first`` on carries a part."""
        new = {name for name, rows in self.rows.items() if len(rows) and rows[-1] >= first}
        return [
            name
            for name, signal in self.vehicle.signals.items()
            if any(bus.message in new for bus in parts(signal))
        ]

    def last_valid_rows(self, names: Iterable[str]) -> dict[tuple[str, BusSignal], int]:
        """The row of the last valid sample of each companion of these signals, which later frames
        may need."""
        last = {}
        for signal in (self.vehicle.signals[name] for name in names):
            for bus in parts(signal)[1:]:
                samples = self._samples(signal, bus)
                valid = samples.rows[samples.why == VALID]
                if len(valid):
                    last[signal.name, bus] = int(valid[-1])
        return last

    # --- frames of one message ---------------------------------------------------------------

    def _decode(self, name: str) -> None:
        """Decode what is needed of one message, and count its frames."""
        message, rows = self.database.message(name), self.rows.pop(name)
        if not len(rows) and self.account is None:
            return
        columns = {
            signal: column_of(self.frames, rows, message, signal)
            for signal in sorted(self.wanted[name])
        }
        if message.name in self.vehicle.checked and len(rows):
            verdict = check(self.frames, rows, message)
            if self.account is not None:
                self.account.messages[name]["counter jumps"] = verdict.jumps
            columns = {
                signal: without_corrupted(column, rows, ~verdict.checksum)
                for signal, column in columns.items()
            }
        self.columns |= {(name, signal): column for signal, column in columns.items()}
        if self.account is not None:
            self.account.of_message(rows, columns, self.account.messages[name])

    def _release_up_to(self, done: str) -> None:
        """Drop what no signal after the one that is ``done`` is made of."""
        names = list(self.vehicle.signals)
        later = names[names.index(done) + 1 :]
        needed = {
            (bus.message, bus.signal) for name in later for bus in parts(self.vehicle.signals[name])
        }
        self.columns = {key: column for key, column in self.columns.items() if key in needed}
        self.samples = {key: held for key, held in self.samples.items() if key[0] in later}
        rows = [column.rows for column in self.columns.values()]
        self.times = [pair for pair in self.times if any(pair[0] is held for held in rows)]

    def _carried_by(self, message: str) -> list[str]:
        """The canonical signals of which a message carries a part."""
        return [
            name
            for name, signal in self.vehicle.signals.items()
            if any(bus.message == message for bus in parts(signal))
        ]

    # --- one canonical signal ----------------------------------------------------------------

    def _samples(self, signal: SignalMap, bus: BusSignal) -> Samples:
        """Samples of ``bus`` from one sender: the one that the vehicle file names, else the one
        with most valid samples in the first ``HEAD`` s."""
        key = (signal.name, bus)
        if key not in self.samples:
            self.samples[key] = self._sampled(signal, bus)
        return self.samples[key]

    def _sampled(self, signal: SignalMap, bus: BusSignal) -> Samples:
        if bus.message in self.rows:
            self._decode(bus.message)
        column = self.columns.get((bus.message, bus.signal))
        if column is None or not len(column.rows):
            if self.account and self.account.messages[bus.message]["frames"]:
                where = f"{bus.message}.{bus.signal}"
                self.warnings.append(f"{signal.name}: no frame has {where} (multiplexed otherwise)")
            return NONE
        message = self.database.message(bus.message)
        sender = senders_of(self.frames, column.rows, message)
        keep = np.ones(len(column.rows), bool)
        own = bus.message == signal.bus.message  # a companion may be sent by another unit
        if signal.source_address is not None and message.is_j1939 and own:
            keep &= (sender & np.uint16(0xFF)) == signal.source_address
        if signal.channel is not None:
            keep &= (sender >> np.uint16(8)) == signal.channel
        chosen = self.senders.get((signal.name, bus))
        if chosen is None:
            chosen = self._chosen_sender(signal, bus, message, sender, column, keep)
        if chosen is not None:
            keep &= sender == chosen
        if not keep.any():
            self.warnings.append(
                f"{signal.name}: no frame of {bus.message} from the source_address or channel of "
                "the vehicle file; sent by "
                + ", ".join(name_of(s, message) for s in np.unique(sender).tolist())
            )
        samples = Samples(column.rows, column.value, column.why)
        if not keep.all():
            samples = Samples(column.rows[keep], column.value[keep], column.why[keep])
        return self._plausible(signal, bus, samples, message.signal(bus.signal))

    def _chosen_sender(
        self,
        signal: SignalMap,
        bus: BusSignal,
        message: Message,
        sender: NDArray[np.uint16],
        column: DecodedColumn,
        keep: NDArray[np.bool_],
    ) -> int | None:
        """The sender with most valid samples to begin with; None if there is no valid sample."""
        chosen, senders = most_frequent_sender(
            self.frames, column.rows, sender, keep & (column.why == VALID)
        )
        if chosen is None:
            return None
        self.senders[signal.name, bus] = chosen
        if len(senders) > 1:
            listed = ", ".join(name_of(s, message) for s in senders)
            self.warnings.append(
                f"{signal.name}: {bus.message}.{bus.signal} is sent by several senders ({listed}); "
                f"used: {name_of(chosen, message)}"
            )
        return chosen

    def _plausible(
        self, signal: SignalMap, bus: BusSignal, samples: Samples, layout: SignalLayout
    ) -> Samples:
        """The samples within the file's min … max; warns of those that are clipped or of no valid
        one."""
        where = f"{signal.name}: {bus.message}.{bus.signal}"
        if bus is signal.bus:
            why, outside = excluded(samples.value, samples.why, signal)
            if outside is not None:
                value = np.where(why == Why.OUT_OF_RANGE, np.nan, samples.value)
                samples = Samples(samples.rows, value, why)
                self.warnings.append(f"{where}: {outside}")
        if self.account is None:
            return samples
        if len(samples.rows) and not samples.any_valid():
            most = Why(int(np.argmax(np.bincount(samples.why))))
            self.warnings.append(f"{where} has no valid sample ({words(most)})")
        self.warnings += [f"{where}: {end}" for end in clipped(samples.value, layout)]
        return samples

    def _canonical(self, signal: SignalMap, samples: Samples, unit: str) -> Signal:
        time = self._time(samples.rows)
        value, why = samples.value, samples.why
        if signal.other:
            other = self._samples(signal, signal.other)
            if other.any_valid():
                value = (value + other.at(samples.rows)) / 2
        if signal.less:
            value, why = self._difference(signal, samples)
        if signal.reference is not None:
            value = self._of_reference(signal, samples)
        elif signal.radius is not None:
            value = signal.through_radius(value)
        else:
            value = units.convert_reading(value, signal.bus.unit, unit)
        if signal.gear and self._gear_is_sent(signal):
            gear = self._samples(signal, signal.gear).at(samples.rows)
            value, why = through_sent_gear(value, why, gear, signal.gears, signal.gear_numbers)
            self.gear = gear_signal(time, gear).mapped_to_disk()
            self.warnings += never_sent(gear, signal)
        return Signal.of(signal.name, unit, time, value, why).mapped_to_disk()

    def _time(self, rows: NDArray[np.intp]) -> Floats:
        """The times of ``rows``; signals of one message share theirs."""
        for known, time in self.times:
            if known is rows:
                return time
        start = self.frames.t_ns[0] if self.start_ns is None else self.start_ns
        time = (self.frames.t_ns[rows] - start) / 1e9
        time = memory_mapped.mapped_to_disk(time)
        self.times.append((rows, time))
        return time

    def _difference(self, signal: SignalMap, samples: Samples) -> tuple[Floats, NDArray[np.uint8]]:
        """What is left of a signal less the other one; not known where that was not read lately."""
        assert signal.less is not None
        other = self._samples(signal, signal.less)
        if not other.any_valid():
            self.warnings.append(
                f"{signal.name} is not known: no valid {signal.less.message}.{signal.less.signal}"
            )
            return samples.value, np.where(samples.why == VALID, NOT_KNOWN, samples.why)
        held = units.convert(other.at(samples.rows), signal.less.unit, signal.bus.unit)
        read = replace(other, value=self._time(other.rows)).at(samples.rows)
        late = (samples.why == VALID) & (np.abs(self._time(samples.rows) - read) > LATELY)
        return samples.value - held, np.where(late, NOT_KNOWN, samples.why)

    def _gear_is_sent(self, signal: SignalMap) -> bool:
        return signal.gear is not None and self._samples(signal, signal.gear).any_valid()

    def _of_reference(self, signal: SignalMap, samples: Samples) -> Floats:
        fraction = self._samples(signal, signal.fraction) if signal.fraction else None
        friction = self._samples(signal, signal.friction) if signal.friction else None
        if friction is not None and signal.friction and not friction.any_valid():
            self.warnings.append(
                f"{signal.name}: no valid friction torque "
                f"({signal.friction.message}.{signal.friction.signal}); taken as 0"
            )
        return of_reference(signal, samples, fraction, friction)

    def _geared(self, wheel: Signal, engine: Signal | None) -> Signal:
        """A wheel speed times the ratio of the gear inferred from it and the engine's speed."""
        shaft, gear = through_gear(wheel, engine, self.vehicle.signals[wheel.name].gears)
        if gear is None:
            self.warnings.append(
                f"{wheel.name}: no gear can be inferred, because engine and wheels are never "
                "locked in one; first gear assumed"
            )
        else:
            self.gear = gear.mapped_to_disk()
        return shaft.mapped_to_disk()
