"""A discovery as a Rerun recording: torque measured, simulated and extended; residuals before and
after."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import rerun as rr
from numpy.typing import NDArray

from clutchest.discovery.misfit_picture import pieces
from clutchest.discovery.result import Discovery
from clutchest.quantity import Quantity
from clutchest.record.blueprint import BOUND, COLOURS, Panel, blueprint, panel
from clutchest.record.discovery_report import report
from clutchest.record.series import BETWEEN, TIMELINE, index, one_behind_another, send_lane, strung
from clutchest.signals import Floats

_MEASURED, _SIMULATED, _EXTENDED = BOUND, COLOURS[1], COLOURS[0]
REACH = 8.0  # standard deviations shown at most; the rest by zooming out


def write_discovery_recording(discovery: Discovery, path: Path) -> None:
    """Write ``discovery`` and the blueprint that shows it to ``path`` (``.rrd``).

    Entities: ``clutch_torque/measured``, ``/simulated``, ``/extended`` (the pair compared),
    ``residual/<sensor>`` and ``residual/<sensor>/extended`` (innovations over their standard
    deviations in the original and in the extended model), ``drive`` where there are several,
    ``report``.  Where no cause has a name there is no ``extended``.
    """
    misfit = discovery.misfit
    starts, end = one_behind_another(
        [
            max((float(t[-1]) for t in times if len(t)), default=0.0)
            for times in zip(misfit.time, [torque[0] for torque in misfit.torque], strict=True)
        ]
    )
    stream = rr.RecordingStream("clutchest", send_properties=False)
    stream.save(path)
    stream.send_recording_name(f"{discovery.vehicle.name}: discovery")
    stream.send_property("provenance", rr.AnyValues(True, **discovery.provenance))
    torque = _send_torque(stream, discovery, starts)
    residuals = _send_residuals(stream, discovery, starts)
    lanes = _send_drives(stream, starts, end)
    stream.log(
        "report", rr.TextDocument(report(discovery), media_type=rr.MediaType.MARKDOWN), static=True
    )
    stream.send_blueprint(blueprint([*torque, *residuals], {}, lanes, TIMELINE, end))
    stream.flush()
    stream.disconnect()


def _send_torque(
    stream: rr.RecordingStream, discovery: Discovery, starts: Sequence[float]
) -> list[Panel]:
    # Wide, so that it shows on both sides of what was measured where it follows it.
    names = [
        ("measured", _MEASURED, 1.0),
        ("simulated", _SIMULATED, 1.5),
        ("extended", _EXTENDED, 4.0),
    ]
    if not discovery.named:
        names.pop()
    compared = discovery.vehicle.machine.compared
    if compared is None:
        return []
    entity = compared.what.replace(" ", "_")
    shown, values = [], []
    for k, (name, colour, width) in enumerate(names, start=1):
        drives = [
            (start, _parted(torque[0], torque[k]))
            for start, torque in zip(starts, discovery.misfit.torque, strict=True)
        ]
        value = _send_line(stream, f"{entity}/{name}", name, colour, width, drives)
        if value is not None:
            shown.append(f"{entity}/{name}")
            values.append(value)
    if not shown:
        return []
    every = np.concatenate(values)
    return [
        panel(
            f"{compared.what}, simulated open loop [{compared.unit}]",
            compared.unit,
            shown,
            every,
            every,
        )
    ]


def _send_residuals(
    stream: rr.RecordingStream, discovery: Discovery, starts: Sequence[float]
) -> list[Panel]:
    misfit = discovery.misfit
    panels = []
    for number, sensor in enumerate(misfit.sensors):
        rows = [which == number for which in misfit.sensor]
        lines = [(f"residual/{sensor}", "original model", _SIMULATED, misfit.before)]
        if discovery.named:
            lines.append((f"residual/{sensor}/extended", "extended model", _EXTENDED, misfit.after))
        shown, values = [], []
        for entity, name, colour, residuals in lines:
            drives = [
                (start, (time[own], residual[own]))
                for start, time, own, residual in zip(
                    starts, misfit.time, rows, residuals, strict=True
                )
            ]
            value = _send_line(stream, entity, name, colour, 1.5, drives)
            if value is not None:
                shown.append(entity)
                values.append(np.clip(value, -REACH, REACH))
        if shown:
            heading = f"{Quantity(sensor, '1').words}: residual in standard deviations"
            every = np.concatenate(values)
            panels.append(panel(heading, "", shown, every, every))
    return panels


def _send_line(
    stream: rr.RecordingStream,
    entity: str,
    name: str,
    colour: int,
    width: float,
    drives: Sequence[tuple[float, Sequence[NDArray]]],
) -> Floats | None:
    """Log one series of all ``drives`` and give its values; None where it has no sample."""
    columns = strung(drives)
    if not columns:
        return None
    time, value = columns
    lines = rr.SeriesLines(
        names=name, colors=np.uint32(colour), widths=width, aggregation_policy="MinMax"
    )
    stream.log(entity, lines, static=True)
    stream.send_columns(entity, index(time), rr.Scalars.columns(scalars=value))
    return value


def _parted(time: Floats, value: Floats) -> tuple[Floats, Floats]:
    """The line broken between slips: each later one begins with a row without a value."""
    firsts = [piece.start for piece in pieces(time)][1:]
    return np.insert(time, firsts, time[firsts]), np.insert(value, firsts, np.nan)


def _send_drives(stream: rr.RecordingStream, starts: Sequence[float], end: float) -> list[str]:
    if len(starts) == 1:
        return []
    changes = [(start, f"drive {k}") for k, start in enumerate(starts)]
    send_lane(stream, "drive", [*changes, (end, BETWEEN)], {})
    return ["drive"]
