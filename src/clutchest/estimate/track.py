"""The kernel's rows as named estimates, modes and slip events."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import NDArray

from clutchest import memory_mapped
from clutchest.estimate.observability import Information
from clutchest.estimate.run import Engagement, Estimate, Innovations, Track
from clutchest.estimate.timeline import Timeline
from clutchest.estimate.whole_log import Compiled, Filtered
from clutchest.models.model import POWER
from clutchest.models.regimes import runs
from clutchest.signals import Floats
from clutchest.vehicle import Vehicle

SHORTEST = 0.1  # s; a slip event is longer than this
SMALLEST = 200.0  # J; and stronger than this and than its own uncertainty, or it is noise


@dataclass(frozen=True, slots=True)
class Rows:
    """What slip events are made of, on the grid and densely wherever the surfaces slide.

    ``time`` (r,) s, ``mode`` (r,), ``torque`` (r, 2) Nm and variance, ``energy`` (r, 3 + m) and
    ``gained`` (r, n) as the kernel has them, ``hottest`` (r,) °C of the friction surface.
    """

    time: Floats
    mode: NDArray[np.uint8]
    torque: Floats
    energy: Floats
    gained: Floats
    hottest: Floats

    @classmethod
    def of(cls, compiled: Compiled, timeline: Timeline, filtered: Filtered) -> Rows:
        """The rows of what was filtered, the mode as the model's torque has it."""
        model = compiled.model
        rows = np.flatnonzero(timeline.emit >= 0)
        mode = timeline.mode[rows].copy()
        machine, inputs = compiled.machine, [item.name for item in model.inputs]
        outputs = {name: filtered.outputs[:, i, 0] for i, name in enumerate(model.outputs)}
        mode = machine.regimes.refine(mode, outputs, inputs)
        torque, hottest = np.zeros((len(rows), 2)), np.zeros(len(rows))
        if machine.output:
            torque = filtered.outputs[:, model.outputs.index(machine.output)]
            if machine.output in model.unobservable:
                torque = np.full((len(rows), 2), np.nan)
        if machine.event is not None:
            hottest = filtered.x[:, model.state(machine.event.hottest)]
            if machine.event.hottest in model.unobservable:
                hottest = np.full(len(rows), np.nan)
        return cls(timeline.t[rows], mode, torque, filtered.energy, filtered.gained, hottest)

    def then(self, later: Rows) -> Rows:
        """These rows and those that follow them."""
        return Rows(
            *(
                np.concatenate([getattr(self, name), getattr(later, name)])
                for name in Rows.__slots__
            )
        )

    def until(self, row: int) -> Rows:
        """The rows before one."""
        return Rows(*(getattr(self, name)[:row] for name in Rows.__slots__))

    def since(self, row: int) -> Rows:
        """The rows from one on."""
        return Rows(*(getattr(self, name)[row:] for name in Rows.__slots__))


@dataclass(frozen=True, slots=True)
class Slips:
    """Slip events that are certain, and those that stand out of the noise but not of what the
    parameters' spreads leave open."""

    certain: tuple[Engagement, ...] = ()
    uncertain: tuple[Engagement, ...] = ()


NO_SLIPS = Slips()


def track_of(
    vehicle: Vehicle,
    compiled: Compiled,
    timeline: Timeline,
    filtered: Filtered,
    rows: Rows | None = None,
    events: Slips | None = None,
    before: Floats | float = 0.0,
) -> Track:
    """The estimates of a drive, or of a piece of one, on the regular grid.

    ``rows`` and slip ``events`` are made of what was filtered unless given; ``before`` is what its
    last row had ``gained`` (n) when a piece begins.
    """
    model, grid = compiled.model, timeline.grid
    rows = rows or Rows.of(compiled, timeline, filtered)
    events = events or engagements(compiled, rows)
    sensed = timeline.sensor >= 0
    return Track(
        time=rows.time[grid],
        mode=rows.mode[grid],
        mode_names=compiled.machine.regimes.modes,
        states=states_of(vehicle, compiled, filtered.x[grid], filtered.total[grid]),
        clutch_torque=_estimate(rows.torque[grid, 0], rows.torque[grid, 1])
        if compiled.machine.output
        else None,
        slip_energy=_estimate(
            filtered.energy[grid, 0],
            filtered.energy[grid, 1],
            "slip_energy" not in model.unobservable,
        )
        if POWER in model.outputs
        else None,
        innovations=Innovations(
            tuple(sensor.name for sensor in model.sensors),
            timeline.t[sensed],
            timeline.sensor[sensed],
            filtered.innovation[sensed, 0],
            _root(filtered.innovation[sensed, 1]),
        ),
        engagements=events.certain,
        log_likelihood=filtered.log_likelihood,
        information=Information.of(compiled, rows.time, rows.mode, filtered.gained, before),
        uncertain_slips=events.uncertain,
    )


def _root(variance: Floats) -> Floats:
    """Standard deviations (n), NaN where absurd numbers left no variance."""
    with np.errstate(invalid="ignore"):
        root: Floats = np.sqrt(variance)
    return root


def joined(tracks: Sequence[Track]) -> Track:
    """The pieces of one drive, at least one, as a whole."""
    first = tracks[0]

    def estimate(parts: Sequence[Estimate]) -> Estimate:
        return Estimate(
            *(
                memory_mapped.concatenated([getattr(part, f.name) for part in parts])
                for f in fields(Estimate)
            )
        )

    def output(name: str) -> Estimate | None:
        return estimate([t.outputs[name] for t in tracks]) if name in first.outputs else None

    def column(of: Callable[[Track], NDArray]) -> NDArray:
        return memory_mapped.concatenated([of(track) for track in tracks])

    return Track(
        time=column(lambda t: t.time),
        mode=column(lambda t: t.mode),
        mode_names=first.mode_names,
        states={name: estimate([t.states[name] for t in tracks]) for name in first.states},
        clutch_torque=output("clutch_torque"),
        slip_energy=output("slip_energy"),
        innovations=Innovations(
            first.innovations.names,
            column(lambda t: t.innovations.time),
            column(lambda t: t.innovations.sensor),
            column(lambda t: t.innovations.innovation),
            column(lambda t: t.innovations.std),
        ),
        engagements=tuple(event for track in tracks for event in track.engagements),
        log_likelihood=sum(track.log_likelihood for track in tracks),
        information=Information(
            first.information.names,
            column(lambda t: t.information.time),
            column(lambda t: t.information.mode),
            column(lambda t: t.information.bits),
            first.information.mode_names,
        ),
        contradiction=tracks[-1].contradiction,
        uncertain_slips=tuple(event for track in tracks for event in track.uncertain_slips),
    )


def states_of(
    vehicle: Vehicle, compiled: Compiled, x: Floats, variance: Floats
) -> dict[str, Estimate]:
    """Columns of ``x`` and ``variance`` (r, n) by name, and whether they are narrow enough and
    physically possible."""
    states = {}
    for i, state in enumerate(compiled.model.states):
        std = np.sqrt(variance[:, i])
        useful = vehicle.estimation.get(state.name, state).useful_std
        if state.name in compiled.model.unobservable:  # a prior is no estimate
            nothing = np.full(len(std), np.nan)
            states[state.name] = Estimate(nothing, nothing, np.zeros(len(std), bool))
        else:
            (low, high), value = state.possible, x[:, i]
            possible = (value >= low) & (value <= high)
            states[state.name] = Estimate(value, std, (std <= useful) & possible)
    return states


def _estimate(value: Floats, variance: Floats, known: bool = True) -> Estimate:
    valid = np.isfinite(value) & known
    std = np.sqrt(np.maximum(variance, 0.0))
    return Estimate(np.where(valid, value, np.nan), np.where(valid, std, np.nan), valid)


def engagements(compiled: Compiled, rows: Rows) -> Slips:
    """Slip events: runs of rows in which the clutch slips and passes torque; of a torque that no
    signal informs, all in which it slips."""
    rules = compiled.machine.regimes
    known = compiled.machine.output not in compiled.model.unobservable
    if not rules.event:
        return NO_SLIPS
    time, slips = rows.time, rows.mode == rules.modes.index(rules.event)
    if not slips.any():
        return NO_SLIPS
    information = Information.of(compiled, time, rows.mode, rows.gained)
    certain: list[Engagement] = []
    uncertain: list[Engagement] = []
    for a, b in zip(*runs(slips), strict=True):
        first, last = max(int(a) - 1, 0), min(int(b), len(time) - 1)
        gained = rows.energy[last] - rows.energy[first]
        duration = time[last] - time[first]
        # the parameters' share of the variance from the difference of the energy's responses
        noise = max(gained[2], 0.0)
        variance = noise + float(np.sum((gained[3:] * compiled.spread) ** 2))
        if duration < SHORTEST or (known and gained[0] < max(SMALLEST, np.sqrt(noise))):
            continue
        passed = rows.torque[int(a) : int(b), 0]
        events = uncertain if known and gained[0] < np.sqrt(variance) else certain
        events.append(
            Engagement(
                start_s=float(time[first]),
                duration_s=float(duration),
                # of a torque that is a guess it may come out below zero, which heat cannot be
                energy_J=float(gained[0] if known else max(gained[0], 0.0)),
                energy_std_J=float(np.sqrt(variance)),
                peak_torque=float(passed[np.argmax(np.abs(passed))]),
                peak_temp_disc=float(rows.hottest[first : last + 1].max()),
                information_bits=information.between(time[first], time[last]).total(),
            )
        )
    return Slips(tuple(certain), tuple(uncertain))
