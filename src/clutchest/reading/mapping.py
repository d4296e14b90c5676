"""From frames to canonical signals, the way a vehicle file says, with an account of every frame."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from clutchest import memory_mapped, units
from clutchest.can.database import Database, Message, SignalLayout
from clutchest.can.decode import Column, decode, rows_of
from clutchest.can.encode import check
from clutchest.can.frames import Flag, Frames
from clutchest.can.transport import reassembled
from clutchest.errors import ClutchestError
from clutchest.reading.account import Account, words
from clutchest.reading.gears import through_gear
from clutchest.reading.plausible import excluded
from clutchest.reading.samples import NONE, VALID, Samples
from clutchest.reading.senders import most_frequent_sender, name_of, senders_of
from clutchest.reading.traffic import traffic_of
from clutchest.reading.wanted import mapped_messages, parts
from clutchest.signals import Counts, Floats, Signal, Signals, Traffic, Why
from clutchest.vehicle import BusSignal, SignalMap, Vehicle


class NoMappedFrame(ClutchestError):
    """A stretch of a log in which nothing is mapped."""


_NO_RAW = np.zeros(0, np.uint64)


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
    found = Decoding(whole, vehicle, database, sources).signals()
    if not with_traffic:
        return found
    traffic = {
        message.name: _sharing(traffic_of(whole, message, vehicle), found) for message in wanted
    }
    return replace(found, traffic=traffic)


def _sharing(traffic: Traffic, signals: Signals) -> Traffic:
    """``traffic`` that shares its times with the signals that its frames carried."""
    for signal in signals.values():
        if np.array_equal(signal.time, traffic.time):
            return replace(traffic, time=signal.time)
    return traffic


@dataclass
class Decoding:
    """The decoding of one drive, or of a piece of one; collects warnings as it goes.

    ``wanted`` is what :func:`mapped_messages` gives.  ``senders`` says whom each bus signal of a
    canonical one is taken from, as far as that is decided; t = 0 is at ``start_ns``, the first
    frame unless given.  Without an ``account`` nothing is counted and less warned of.
    """

    frames: Frames
    vehicle: Vehicle
    database: Database
    sources: tuple[str, ...] = ()
    senders: dict[tuple[str, BusSignal], int] = field(default_factory=dict)
    start_ns: int | None = None
    rows: dict[str, NDArray[np.intp]] = field(default_factory=dict)  # of messages not yet decoded
    columns: dict[tuple[str, str], Column] = field(default_factory=dict)
    account: Account | None = field(default_factory=Account)
    warnings: list[str] = field(default_factory=list)
    samples: dict[tuple[str, BusSignal], Samples] = field(default_factory=dict)
    times: list[tuple[NDArray[np.intp], Floats]] = field(default_factory=list)  # of rows, s
    wanted: Mapping[str, Mapping[str, SignalLayout]] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self.wanted = self.wanted or mapped_messages(self.vehicle, self.database)

    def signals(self) -> Signals:
        """Everything, with an account of it; see :func:`signals_of`."""
        frames, account = self.frames, self.account
        assert account is not None
        mapped = self.decode()
        if not mapped.any():
            raise NoMappedFrame(
                f"{' '.join(self.sources) or 'this log'}: no frame of "
                f"{', '.join(self.wanted)}{self._seen()}"
            )
        account.of_the_rest(frames, mapped, map(self.database.message, self.wanted))
        made, geared = self.canonical()
        for name, signal in geared.items():
            column = self.vehicle.machine.column(name)
            by = made.get(column.geared_by) if column else None
            made[name] = self._through_gear(name, signal, by)
        self.warnings += [
            f"message {name} has no frame in this log"
            f" ({', '.join(self._made_of(name))})" + self._seen()
            for name, counts in account.messages.items()
            if not counts["frames"]
        ]
        first, last = int(frames.t_ns[0]), int(frames.t_ns[-1])
        decoded = sum(counts["decoded"] for counts in account.messages.values())
        passed_over = Counter(dict(frames.passed_over))
        rejected = dict(account.rejected + passed_over + Counter(dict(frames.rejected)))
        return Signals(
            made,
            start_ns=first if frames.absolute else None,
            end=(last - first) / 1e9,
            counts=Counts(len(frames) + passed_over.total(), decoded, rejected, account.messages),
            warnings=(*self.database.warnings, *self.warnings),
            sources=self.sources,
        )

    def decode(self) -> NDArray[np.bool_]:
        """Find every mapped message; which frames (n,) are of one."""
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
        """The canonical signals, of these ``names`` if given, and the wheel speeds that become one
        by a gear nobody sends."""
        made: dict[str, Signal] = {}
        geared: dict[str, Signal] = {}
        unit_of = self.vehicle.machine.units
        for name in self.vehicle.signals if names is None else names:
            signal = self.vehicle.signals[name]
            samples = self._samples(signal, signal.bus)
            if len(samples.rows):
                known = not signal.gears or self._tells_gear(signal)
                found = self._canonical(signal, samples, unit_of[name])
                (made if known else geared)[name] = found
            if self.account is not None:
                self._forget(name)
                memory_mapped.release_memory()
        unneeded = list(self.rows) if self.account is not None else []
        for message in unneeded:
            self._decode(message)
        return made, geared

    def touched(self, first: int) -> list[str]:
        """The canonical signals of which a frame from row ``first`` on carries a part."""
        new = {name for name, rows in self.rows.items() if len(rows) and rows[-1] >= first}
        return [
            name
            for name, signal in self.vehicle.signals.items()
            if any(bus.message in new for bus in parts(signal))
        ]

    def _forget(self, done: str) -> None:
        """Let go of what no signal behind the one that is ``done`` is made of."""
        names = list(self.vehicle.signals)
        later = names[names.index(done) + 1 :]
        needed = {
            (bus.message, bus.signal) for name in later for bus in parts(self.vehicle.signals[name])
        }
        self.columns = {key: column for key, column in self.columns.items() if key in needed}
        self.samples = {key: found for key, found in self.samples.items() if key[0] in later}
        held = [column.rows for column in self.columns.values()]
        self.times = [pair for pair in self.times if any(pair[0] is rows for rows in held)]

    def remembered(self, names: Iterable[str]) -> dict[tuple[str, BusSignal], int]:
        """The row of the last frame in which each companion of these signals said something: what
        is to come may need it."""
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
        """Decode what is needed of one message, count what became of its frames."""
        message, rows = self.database.message(name), self.rows.pop(name)
        if not len(rows) and self.account is None:
            return
        columns = {
            signal: self._column(rows, message, signal) for signal in sorted(self.wanted[name])
        }
        broken = None
        if message.name in self.vehicle.checked and len(rows):
            verdict = check(self.frames, rows, message)
            broken = ~verdict.checksum
            if self.account is not None:
                self.account.messages[name]["counter jumps"] = verdict.jumps
        for signal, column in columns.items():
            self.columns[name, signal] = column
            if broken is not None:
                place = slice(None) if column.rows is rows else np.searchsorted(rows, column.rows)
                column.why[broken[place] & (column.why == VALID)] = Why.CHECKSUM
                column.value[column.why != VALID] = np.nan
        if self.account is not None:
            self.account.of_message(rows, columns, self.account.messages[name])

    def _column(self, rows: NDArray[np.intp], message: Message, signal: str) -> Column:
        """One signal, decoded a portion at a time; without ``raw``, since it has been judged."""
        pieces: list[tuple[NDArray, ...]] = []
        for part in memory_mapped.portions(max(len(rows), 1)):
            some = rows if len(rows) <= memory_mapped.PORTION else rows[part]
            found = decode(self.frames, some, message, [signal])[signal]
            pieces.append((found.rows, found.value, found.why))
            if some is rows:
                return replace(found, raw=_NO_RAW)
            pieces[-1] = tuple(map(memory_mapped.mapped_to_disk, pieces[-1]))
        here, value, why = (
            memory_mapped.concatenated(column) for column in zip(*pieces, strict=True)
        )
        return Column(rows if len(here) == len(rows) else here, value, _NO_RAW, why)

    def _made_of(self, message: str) -> list[str]:
        return [
            name
            for name, signal in self.vehicle.signals.items()
            if any(bus.message == message for bus in parts(signal))
        ]

    def _seen(self) -> str:
        """What the log holds instead, for a warning."""
        extended = (self.frames.flags & Flag.EXTENDED) != 0
        pairs = np.unique(np.stack((self.frames.id, extended.astype(np.uint32))), axis=1)
        found = {m.name for i, e in pairs.T if (m := self.database.find(int(i), bool(e)))}
        if found:
            names = sorted(found)
            return "; of this DBC it holds " + ", ".join(names[:8]) + ", …" * (len(names) > 8)
        ids = [f"0x{i:03X}" for i, _ in pairs.T[:6]]
        return "; it holds " + ", ".join(ids) + ", …" * (pairs.shape[1] > 6)

    # --- one canonical signal ----------------------------------------------------------------

    def _samples(self, signal: SignalMap, bus: BusSignal) -> Samples:
        """Samples of ``bus`` from one sender: the one asked for, else the one that says most in the
        first ``HEAD`` s."""
        known = self.samples.get((signal.name, bus))
        if known is None:
            known = self.samples[signal.name, bus] = self._sampled(signal, bus)
        return known

    def _sampled(self, signal: SignalMap, bus: BusSignal) -> Samples:
        if bus.message in self.rows:
            self._decode(bus.message)
        column = self.columns.get((bus.message, bus.signal))
        if column is None or not len(column.rows):
            return NONE
        message = self.database.message(bus.message)
        sender = senders_of(self.frames, column.rows, message)
        keep = np.ones(len(column.rows), bool)
        own = bus.message == signal.bus.message  # a companion may come from another unit
        if signal.source_address is not None and message.is_j1939 and own:
            keep &= (sender & np.uint16(0xFF)) == signal.source_address
        if signal.channel is not None:
            keep &= (sender >> np.uint16(8)) == signal.channel
        chosen = self.senders.get((signal.name, bus))
        if chosen is None:
            chosen = self._chosen(signal, bus, message, sender, column, keep)
        if chosen is not None:
            keep &= sender == chosen
        if len(column.rows) and not keep.any():
            self.warnings.append(
                f"{signal.name}: no frame of {bus.message} from the "
                "source_address or channel asked for"
            )
        samples = Samples(column.rows, column.value, column.why)
        if not keep.all():
            samples = Samples(column.rows[keep], column.value[keep], column.why[keep])
        return self._judged(signal, bus, samples, message.signal(bus.signal))

    def _chosen(
        self,
        signal: SignalMap,
        bus: BusSignal,
        message: Message,
        sender: NDArray[np.uint16],
        column: Column,
        keep: NDArray[np.bool_],
    ) -> int | None:
        """The sender that says most to begin with; None if none says anything."""
        chosen, heard = most_frequent_sender(
            self.frames, column.rows, sender, keep & (column.why == VALID)
        )
        if chosen is None:
            return None
        self.senders[signal.name, bus] = chosen
        if len(heard) > 1:
            listed = ", ".join(name_of(s, message) for s in heard)
            self.warnings.append(
                f"{signal.name}: {bus.message}.{bus.signal} comes from several "
                f"senders ({listed}); taken from {name_of(chosen, message)}"
            )
        return chosen

    def _judged(
        self, signal: SignalMap, bus: BusSignal, samples: Samples, layout: SignalLayout
    ) -> Samples:
        """The samples within the file's plausible range; warns of what is clipped or never
        there."""
        where = f"{signal.name}: {bus.message}.{bus.signal}"
        if bus is signal.bus:
            why, told = excluded(samples.value, samples.why, signal)
            if told is not None:
                value = np.where(why == Why.OUT_OF_RANGE, np.nan, samples.value)
                samples = Samples(samples.rows, value, why)
                self.warnings.append(f"{where}: {told}")
        if self.account is None:
            return samples
        if len(samples.rows) and not samples.any_valid():
            most = Why(int(np.argmax(np.bincount(samples.why))))
            self.warnings.append(f"{where} never has a value ({words(most)})")
        for end, edge in ((layout.maximum, "upper"), (layout.minimum, "lower")):
            # Standing at zero is no sign of clipping, and a switch has nothing but ends.
            if end and layout.width > 4 and layout.maximum != layout.minimum:
                clipped = int(
                    np.sum(samples.value >= end if edge == "upper" else samples.value <= end)
                )
                if clipped:
                    self.warnings.append(
                        f"{where}: {clipped} samples at the {edge} end of the "
                        f"DBC's range ({end:g} {layout.unit})".rstrip()
                    )
        return samples

    def _canonical(self, signal: SignalMap, samples: Samples, unit: str) -> Signal:
        time = self._time(samples.rows)
        value, why = samples.value, samples.why
        if signal.other:
            other = self._samples(signal, signal.other)
            if other.any_valid():
                value = (value + other.at(samples.rows)) / 2
        if signal.reference is not None:
            value = self._torque(signal, samples)
        else:
            value = units.convert(value, signal.bus.unit, unit)
        if signal.gears and self._tells_gear(signal):
            assert signal.gear is not None
            gear, ratios = self._samples(signal, signal.gear).at(samples.rows), signal.gears
            inside = (gear >= 1) & (gear <= len(ratios))
            index = np.where(inside, gear, 1).astype(np.intp) - 1
            value = value * np.array(ratios)[index]
            why = np.where(inside, why, np.uint8(Why.NOT_AVAILABLE))
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

    def _tells_gear(self, signal: SignalMap) -> bool:
        return bool(signal.gear) and self._samples(signal, signal.gear).any_valid()  # type: ignore[arg-type]

    def _torque(self, signal: SignalMap, samples: Samples) -> Floats:
        """Nm from percent of the reference: actual + fraction − nominal friction."""
        shares: list[tuple[int, Floats, str]] = []
        if signal.fraction:
            fraction = self._samples(signal, signal.fraction)
            here = Samples(
                fraction.rows,
                np.where(fraction.why == Why.VALID, fraction.value, 0.0),
                np.zeros_like(fraction.why),
            )
            if len(here.rows):
                shares.append((1, here.at(samples.rows), signal.fraction.unit))
        if signal.friction:
            friction = self._samples(signal, signal.friction)
            if friction.any_valid():
                shares.append((-1, friction.at(samples.rows), signal.friction.unit))
            else:
                self.warnings.append(
                    f"{signal.name}: no friction torque "
                    f"({signal.friction.message}.{signal.friction.signal}); "
                    "taken as 0"
                )
        torque = memory_mapped.empty((len(samples.rows),), np.float64)
        for part in memory_mapped.portions(len(samples.rows)):
            percent = units.convert(samples.value[part], signal.bus.unit, "%")
            for sign, share, unit in shares:
                percent = percent + sign * units.convert(share[part], unit, "%")
            torque[part] = percent * (signal.reference or 0.0) / 100
            memory_mapped.release_memory()
        return torque

    def _through_gear(self, name: str, wheel: Signal, engine: Signal | None) -> Signal:
        """Wheel speed times the ratio of the gear that engine and wheels tell."""
        shaft, told = through_gear(wheel, engine, self.vehicle.signals[name].gears)
        if not told:
            self.warnings.append(
                f"{name}: engine and wheels are never locked in a gear; taken as first gear"
            )
        return shaft.mapped_to_disk()
