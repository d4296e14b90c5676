"""The run as a Rerun recording, and what other recordings are made with.

Drives stand one behind another on the timeline ``time``, a little apart: wear and friction over
several drives are then one line, and days without a drive take no room.  Long series are thinned
to the samples that make their outline, so that no spike is lost; every sample is in the Parquet.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import rerun as rr

from clutchest.errors import ClutchestError
from clutchest.estimate.run import Run
from clutchest.record.blueprint import (
    BOUND,
    COLOURS,
    INVALID,
    MODE_COLOURS,
    Panel,
    blueprint,
    opening,
    panel,
)
from clutchest.record.quantities import (
    OUTPUTS,
    SLIP_ENERGY,
    Quantity,
    sensors_of,
    states_of,
)
from clutchest.record.report import markdown
from clutchest.record.series import (
    BETWEEN,
    TIMELINE,
    index,
    one_behind_another,
    send_lane,
    strung,
)
from clutchest.record.tracking import FIGURES

if TYPE_CHECKING:
    from clutchest.diagnosis.result import Diagnosis


def write_recording(run: Run, path: Path, diagnosis: Diagnosis | None = None) -> None:
    """Write ``run`` and the blueprint that shows it to ``path`` (``.rrd``); with a ``diagnosis``
    of it also ``fault/<monitor>`` (a lane), ``fault/log`` and ``fault/freeze_frame``.

    Entities: ``can/<signal>``, ``state/<name>`` (value and variance, grey while not valid),
    ``state/<name>/smoothed`` where the run was smoothed,
    ``residual/<sensor>`` (innovation, +3σ, −3σ), ``tracking/<figure>`` of actuations, ``mode``,
    ``drive`` where there are several, and ``report``.  Values are in the units that people read
    (rpm, km/h, °C, mm, Nm, kJ).  Raises ClutchestError where the disk refuses.
    """
    stream = rr.RecordingStream("clutchest", send_properties=False)
    with _refusals_in_words(path):
        stream.save(path)
    send_run(stream, run, diagnosis)
    with _refusals_in_words(path):
        stream.flush()
    stream.disconnect()


@contextmanager
def _refusals_in_words(path: Path) -> Iterator[None]:
    try:
        yield
    except RuntimeError as problem:
        raise ClutchestError(f"{path}: cannot be written ({problem}); is the disk full?") from None


def send_run(stream: rr.RecordingStream, run: Run, diagnosis: Diagnosis | None = None) -> None:
    """Send to a stream what :func:`write_recording` writes."""
    starts, end = _starts(run)
    _send_properties(stream, run, starts)
    signals = _send_signals(stream, run, starts)
    known, faults = run, []
    if diagnosis is not None:
        from clutchest.record.diagnosis_recording import send_faults, without_what_rests_on_faults

        known = without_what_rests_on_faults(diagnosis)
        faults = send_faults(stream, diagnosis, starts)
    states = _send_states(stream, known, starts)
    residuals = _send_residuals(stream, run, starts)
    lanes = _send_lanes(stream, run, starts) + faults
    stream.log(
        "report", rr.TextDocument(markdown(run), media_type=rr.MediaType.MARKDOWN), static=True
    )
    shown = _overview(run) or [p for p in signals if p.unit == "rpm"]
    followed = _send_tracking(stream, run, starts)
    pages = {"signals": signals, "all states": states, "residuals": residuals}
    pages |= {"tracking": followed} if followed else {}
    stream.send_blueprint(
        blueprint(
            opening(shown, _informative(run, states)),
            pages,
            lanes,
            TIMELINE,
            end,
            faults=diagnosis is not None,
        )
    )


def _starts(run: Run) -> tuple[list[float], float]:
    """Where each drive begins on the timeline, and where the last one ends, s."""
    return one_behind_another(
        [
            max(drive.end, float(track.time[-1]) if len(track.time) else 0.0)
            for drive, track in zip(run.signals.drives, run.tracks, strict=True)
        ]
    )


def _by_unit(quantities: Iterable[Quantity]) -> dict[str, list[Quantity]]:
    groups: dict[str, list[Quantity]] = {}
    for quantity in quantities:
        groups.setdefault(quantity.shown, []).append(quantity)
    return groups


def _heading(group: Sequence[Quantity]) -> str:
    if len(group) == 1:
        return group[0].label
    kinds = {"°C": "temperatures", "rpm": "speeds", "mm": "positions", "Nm": "torques"}
    unit = group[0].shown
    words = kinds.get(unit, ", ".join(q.words for q in group))
    return f"{words} [{unit}]" if unit else words


def _series(quantity: Quantity, group: Sequence[Quantity]) -> str:
    """The legend's word; what the heading says already is left out."""
    return quantity.words.removesuffix(" temperature") if len(group) > 1 else quantity.words


def _send_properties(stream: rr.RecordingStream, run: Run, starts: Sequence[float]) -> None:
    names = [Path(name).name for drive in run.signals.drives for name in drive.sources]
    stream.send_recording_name(": ".join([run.vehicle.name, ", ".join(names[:3])]).strip(": "))
    if run.signals.start_ns is not None:
        stream.send_recording_start_time_nanos(run.signals.start_ns)
    stream.send_property("provenance", rr.AnyValues(True, **run.provenance))
    stream.send_property("log", rr.AnyValues(sources=names or [""], drive_starts_s=starts))


def _send_signals(stream: rr.RecordingStream, run: Run, starts: Sequence[float]) -> list[Panel]:
    drives = list(zip(starts, run.signals.drives, strict=True))
    seen = {
        name: Quantity(name, signal.unit) for _, drive in drives for name, signal in drive.items()
    }
    panels = []
    for group in _by_unit(seen.values()).values():
        shown = []
        for k, quantity in enumerate(group):
            columns = strung(
                (start, (drive[quantity.name].time, drive[quantity.name].value))
                for start, drive in drives
                if quantity.name in drive
            )
            if not columns:
                continue
            time, value = columns[0], quantity.read(columns[1])
            entity = f"can/{quantity.name}"
            stream.log(
                entity,
                rr.SeriesLines(
                    names=_series(quantity, group),
                    colors=np.uint32(COLOURS[(k + 1) % len(COLOURS)]),
                    widths=1.5,
                    aggregation_policy="MinMax",
                ),
                static=True,
            )
            stream.send_columns(entity, index(time), rr.Scalars.columns(scalars=value))
            shown.append((entity, value))
        if shown:
            values = np.concatenate([value for _, value in shown])
            entities = [entity for entity, _ in shown]
            panels.append(panel(_heading(group), group[0].shown, entities, values, values))
    return panels


def _overview(run: Run) -> list[Panel]:
    """The signals that the machine wants on the opening page, those of a unit in one panel."""
    values = {
        Quantity(name, run.vehicle.machine.units[name]): [
            drive[name].value for drive in run.signals.drives if name in drive
        ]
        for name in run.vehicle.machine.overview
    }
    panels = []
    for group in _by_unit(quantity for quantity, seen in values.items() if seen).values():
        value = np.concatenate([q.read(np.concatenate(values[q])) for q in group])
        entities = [f"can/{quantity.name}" for quantity in group]
        panels.append(panel(_heading(group), group[0].shown, entities, value, value))
    return panels


def _send_states(stream: rr.RecordingStream, run: Run, starts: Sequence[float]) -> list[Panel]:
    quantities = states_of(run)
    outputs = [OUTPUTS[name] for name in run.tracks[0].outputs]
    groups = _by_unit([*outputs[:1], *quantities.values(), *outputs[1:]])
    panels = []
    for group in groups.values():
        lows, highs = [], []
        for k, quantity in enumerate(group):
            estimates = [{**t.states, **t.outputs}[quantity.name] for t in run.tracks]
            columns = strung(
                (
                    start,
                    (
                        track.time,
                        e.value,
                        e.std,
                        np.where(e.valid, COLOURS[k % len(COLOURS)], INVALID).astype(np.uint32),
                    ),
                )
                for start, track, e in zip(starts, run.tracks, estimates, strict=True)
            )
            if not columns:
                continue
            time, colours = columns[0], columns[3]
            value, std = quantity.read(columns[1]), quantity.read_spread(columns[2])
            valid = colours != INVALID
            colours[0] = COLOURS[k % len(COLOURS)]  # the legend takes the first one
            entity = f"state/{quantity.name}"
            stream.log(
                entity,
                rr.Measurements.from_fields(
                    names=_series(quantity, group), units=quantity.shown or None, widths=2.0
                ),
                static=True,
            )
            stream.send_columns(
                entity,
                index(time),
                rr.Measurements.columns(values=value, variances=std**2, colors=colours),
            )
            shown = valid if valid.any() else np.isfinite(value)
            lows.append((value - std)[shown])
            highs.append((value + std)[shown])
        low, high = np.concatenate([[], *lows]), np.concatenate([[], *highs])
        if np.isfinite(low).any():  # else this log has no information about these states
            title = f"{_heading(group)} ± 1σ"
            if len(group) == 1:
                title += f": {group[0].what}"
            entities = [f"state/{quantity.name}" for quantity in group]
            entities += _send_smoothed(stream, run, starts, group)
            panels.append(panel(title, group[0].shown, entities, low, high))
    return panels


def _send_smoothed(
    stream: rr.RecordingStream, run: Run, starts: Sequence[float], group: Sequence[Quantity]
) -> list[str]:
    """Thin lines beside the filtered ones, where the run was smoothed."""
    entities = []
    for k, quantity in enumerate(group):
        columns = strung(
            (start, (track.time, track.smoothed[quantity.name].value))
            for start, track in zip(starts, run.tracks, strict=True)
            if quantity.name in track.smoothed
        )
        if not columns:
            continue
        time, value = columns[0], quantity.read(columns[1])
        entity = f"state/{quantity.name}/smoothed"
        stream.log(
            entity,
            rr.SeriesLines(
                names=f"{_series(quantity, group)}, smoothed",
                colors=np.uint32(COLOURS[k % len(COLOURS)]),
                widths=1.0,
            ),
            static=True,
        )
        stream.send_columns(entity, index(time), rr.Scalars.columns(scalars=value))
        entities.append(entity)
    return entities


def _informative(run: Run, states: Sequence[Panel]) -> list[Panel]:
    """The panels about the clutch: not those of states that are measured as they are, or are never
    valid."""
    never = {
        f"state/{name}"
        for name in run.tracks[0].states
        if not any(track.states[name].valid.any() for track in run.tracks)
    }
    plain = {f"state/{name}" for drive in run.signals.drives for name in drive}
    plain.add(f"state/{SLIP_ENERGY.name}")  # the report has it event by event
    return [p for p in states if not plain & set(p.entities) and not never >= set(p.entities)]


def _send_residuals(stream: rr.RecordingStream, run: Run, starts: Sequence[float]) -> list[Panel]:
    panels = []
    for k, quantity in enumerate(sensors_of(run).values()):
        pieces = []
        for start, track in zip(starts, run.tracks, strict=True):
            if quantity.name in track.innovations.names:
                pieces.append((start, track.innovations.of(quantity.name)))
        time, *both = strung(pieces)
        innovation, std = map(quantity.read_spread, both)
        entity = f"residual/{quantity.name}"
        colours = np.array([COLOURS[(k + 1) % len(COLOURS)], BOUND, BOUND], np.uint32)
        stream.log(
            entity,
            rr.SeriesLines(
                names=["measured − predicted", "+3σ", "−3σ"],
                colors=colours,
                widths=[1.2, 1.0, 1.0],
                aggregation_policy="MinMax",
            ),
            static=True,
        )
        stream.send_columns(
            entity,
            index(time),
            rr.Scalars.columns(scalars=np.column_stack([innovation, 3 * std, -3 * std])),
        )
        # The start of a drive is uncertain by orders of magnitude more than the rest of it.
        reach = max(np.nanmax(np.abs(innovation)), 4 * np.nanmedian(std))
        reach = min(reach, 20 * np.nanmedian(std))
        panels.append(
            panel(
                f"{quantity.label}: measured − predicted, within ± 3σ",
                quantity.shown,
                [entity],
                np.array([-reach]),
                np.array([reach]),
            )
        )
    return panels


def _send_tracking(stream: rr.RecordingStream, run: Run, starts: Sequence[float]) -> list[Panel]:
    """A point per actuation for each figure of how the output followed."""
    panels = []
    tracking = run.vehicle.machine.tracking
    for k, (name, heading, factor) in enumerate(FIGURES):
        points = [
            (start + response.start_s, factor * value)
            for start, track in zip(starts, run.tracks, strict=True)
            for response in track.responses
            if (value := getattr(response, name)) is not None
        ]
        if not points or tracking is None:
            continue
        time, value = np.array(points).T
        entity = f"tracking/{name}"
        colour = np.uint32(COLOURS[k % len(COLOURS)])
        stream.log(entity, rr.SeriesPoints(colors=colour, marker_sizes=4.0), static=True)
        stream.send_columns(entity, index(time), rr.Scalars.columns(scalars=value))
        panels.append(panel(heading.format(unit=tracking.unit), "", [entity], value, value))
    return panels


def _send_lanes(stream: rr.RecordingStream, run: Run, starts: Sequence[float]) -> list[str]:
    """The mode over time, and which drive it is where there are several."""
    modes: list[tuple[float, str]] = []
    drives: list[tuple[float, str]] = []
    for number, (start, drive, track) in enumerate(
        zip(starts, run.signals.drives, run.tracks, strict=True)
    ):
        if len(track.time) == 0:
            continue
        changes = np.flatnonzero(np.diff(track.mode, prepend=255))
        modes += [(start + track.time[k], track.mode_names[track.mode[k]]) for k in changes]
        modes.append((start + track.time[-1], BETWEEN))
        begun = drive.start_ns
        when = "" if begun is None else f", {datetime.fromtimestamp(begun / 1e9, UTC):%F %R} UTC"
        drives += [
            (start + track.time[0], f"drive {number}{when}"),
            (start + track.time[-1], BETWEEN),
        ]
    if not modes:
        return []
    send_lane(stream, "mode", modes, MODE_COLOURS)
    if len(run.tracks) == 1:
        return ["mode"]
    send_lane(stream, "drive", drives, {})
    return ["mode", "drive"]
