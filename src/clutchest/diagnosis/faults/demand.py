"""A quantity that is delivered though nothing asks for it."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from clutchest.diagnosis.faults.sticking import words
from clutchest.diagnosis.faults.stream_test import Alarm, Batch, StreamTest
from clutchest.diagnosis.sequential import new_tail, tail_bound, tail_mean, tail_take
from clutchest.models.fault import Demand
from clutchest.native import compiled
from clutchest.signals import Floats
from clutchest.vehicle import Vehicle

BLOCK_S = 0.5  # one sample of the excess is the smallest of so long
FOLLOWS_S = 1.0  # s for which what was asked for may still be delivered
USUAL = 0.05  # of the full scale: what auxiliaries and idling may take, at any time
MATTERS = 2.0  # times the usual excess
RELEASED = 2.0  # %, up to which a pedal asks for nothing


class Demanded(StreamTest):
    """CUSUM (Page) of the excess over the largest demand of the last second, beyond twice its usual
    size; its threshold is the estimated tail of this vehicle's excess.

    Less than is asked for is no fault: limiters and gear changes take torque away.  A pedal tells
    no more than that nothing is asked for, and that only where no demand is sent.
    """

    kind, fmi = "demand", 2
    harmless = True
    masked_by_signal = ("stuck", "noise", "implausible")

    def __init__(self, vehicle: Vehicle, demand: Demand, per_1000h: float) -> None:
        super().__init__(demand.subject, per_1000h)
        self.demands = tuple(name for name in demand.demands if name in vehicle.signals)
        pedal = demand.released in vehicle.signals and not self.demands
        self.pedal = demand.released if pedal else ""
        self.signals = (demand.subject, *self.demands, *([self.pedal] if pedal else []))
        self.scale, self.unit = vehicle.parameters[demand.full_scale].value, demand.unit
        self.tail, self.pending = new_tail(USUAL), list[float]()
        self.held = {name: np.zeros((2, 0)) for name in self.signals}
        self.sum, self.begun = 0.0, 0.0
        self.blocks = 0

    @classmethod
    def of(cls, vehicle: Vehicle, per_1000h: float) -> Sequence[StreamTest]:
        """See :meth:`StreamTest.of`; of what is mapped together with a demand or a pedal."""
        return [
            cls(vehicle, demand, per_1000h)
            for demand in vehicle.machine.demands
            if demand.subject in vehicle.signals
            and {*demand.demands, demand.released} & set(vehicle.signals)
        ]

    def take(self, batch: Batch) -> None:
        """See :meth:`StreamTest.take`."""
        for name in self.signals:
            if name in batch.signals:
                new = batch.signals[name].only_valid()
                self.held[name] = np.append(self.held[name], [new.time, new.value], axis=1)
        time, value = self.held[self.subject]
        block = np.floor(time / BLOCK_S)
        whole = int(np.searchsorted(block, block[-1])) if len(block) else 0
        if not whole:
            return
        excess = (value[:whole] - self._allowed(time[:whole])) / self.scale
        starts = np.flatnonzero(np.diff(block[:whole], prepend=-1.0))
        smallest = np.minimum.reduceat(excess, starts)
        for k, level in zip(starts.tolist(), smallest.tolist(), strict=True):
            if np.isfinite(level):
                self._test(float(block[k] * BLOCK_S), max(level, 0.0), float(value[k]))
        self.held[self.subject] = self.held[self.subject][:, whole:]
        since = float(block[whole]) * BLOCK_S - FOLLOWS_S
        for name in self.signals[1:]:
            self.held[name] = self.held[name][:, self.held[name][0] >= since]

    def _allowed(self, time: Floats) -> Floats:
        """What may be delivered at ``time`` (n): infinite where nothing is known of a demand."""
        allowed = np.full(len(time), -np.inf)
        for name in self.signals[1:]:
            asked, value = self.held[name]
            if name == self.pedal:
                value = np.where(value <= RELEASED, 0.0, np.inf)
            _largest_since(time, asked, np.maximum(value, 0.0), FOLLOWS_S, allowed)
        return np.where(np.isneginf(allowed), np.inf, allowed)

    def _test(self, begin: float, level: float, value: float) -> None:
        """Test one more block that begins at ``begin`` s, with an excess of ``level``."""
        end, bound = begin + BLOCK_S, self._bound()
        self.blocks += 1
        self.enabled += BLOCK_S
        if self.sum <= 0.0:
            self.sum, self.begun = 0.0, begin
        self.sum = min(self.sum + level - MATTERS * tail_mean(self.tail), 2.0 * bound)
        if self.failing:
            if self.sum <= 0.0:
                self.heal(end)
            return
        self.pending.append(max(level, USUAL))  # enters the tail once known to be healthy
        if self.sum <= 0.0:
            for usual in self.pending:
                tail_take(self.tail, usual)
            self.pending.clear()
        elif self.sum > bound:
            self.pending.clear()
            excess = level * self.scale
            what = (
                f"{words(self.subject)} of {value:.4g} {self.unit}, {excess:.3g} {self.unit} more "
                f"than {' or '.join(map(words, self.signals[1:]))} asks for"
            )
            self.fail(Alarm(self.begun, end, what=what))

    def _bound(self) -> float:
        return float(tail_bound(self.tail, 3.6e6 / BLOCK_S / self.per_1000h))

    @property
    def threshold(self) -> float | None:
        """See :meth:`StreamTest.threshold`; a sum of shares of the full scale."""
        return self._bound() if self.blocks else None

    @property
    def why(self) -> str:
        """See :meth:`StreamTest.why`."""
        asked = " and ".join(map(words, self.signals[1:]))
        if not self.blocks:
            return f"no time with samples of both {words(self.subject)} and {asked}"
        return (
            f"limit: {self._bound():.2g} of full scale, summed up over blocks of {BLOCK_S:g} s, "
            f"above what {asked} asks for; {tail_mean(self.tail):.1%} on average, "
            f"from {self.blocks} blocks"
        )


@compiled
def _largest_since(time, asked, value, span, largest):  # type: ignore[no-untyped-def]
    """Raise ``largest`` (n) to the largest ``value`` asked for within ``span`` before ``time``."""
    first = 0
    for i in range(len(time)):
        while first < len(asked) and asked[first] < time[i] - span:
            first += 1
        k = first
        while k < len(asked) and asked[k] <= time[i]:
            largest[i] = max(largest[i], value[k])
            k += 1
