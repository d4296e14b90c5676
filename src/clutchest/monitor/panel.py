"""The terminal panel: the estimates at a glance, events, and the state of the bus."""

from __future__ import annotations

from math import isfinite

import numpy as np
from rich.console import Group, RenderableType
from rich.markup import escape
from rich.panel import Panel
from rich.table import Table
from rich.text import Text

from clutchest.estimate.run import Estimate
from clutchest.models.machine import Machine
from clutchest.monitor.events import MonitorEvent, SessionStatus
from clutchest.quantity import Quantity
from clutchest.record.quantities import OUTPUTS
from clutchest.record.report import plus_minus
from clutchest.record.tracking import figures_in_words

_MODE = {
    "open": "bright_blue",
    "slipping": "bold bright_red",
    "locked": "green",
    "retracted": "green",
    "unknown": "yellow",
}
_KIND = {"warning": "yellow", "gap": "yellow", "reconnect": "yellow", "fault": "bold bright_red"}
_BAR, _BAR_END = 20, 300.0  # characters of a temperature bar and its end, °C
_WARM, _HOT = 8, 14  # characters from which it is yellow, red


def panel(status: SessionStatus, machine: Machine) -> RenderableType:
    """The panel for the present state of a session."""
    return Panel(
        Group(_head(status), "", _estimates(status, machine), "", _events(status)),
        title=f"[bold]clutchest[/] · {escape(status.vehicle)}",
        title_align="left",
        subtitle=_foot(status),
        subtitle_align="left",
        border_style="dim",
        width=100,
    )


def _head(status: SessionStatus) -> Text:
    text = Text()
    piece = status.piece
    if piece is None or not len(piece.track.time):
        waiting = "receiving" if status.frames else "no frame yet"
        return text.append(f"{waiting} … {status.now:.0f} s", style="yellow")
    track = piece.track
    mode = track.mode_names[track.mode[-1]]
    text.append(f" {mode.upper()} ", style=f"reverse {_MODE.get(mode, '')}")
    text.append(f"  at {track.time[-1]:.1f} s")
    if track.contradiction:
        text.append("   signals and model contradict each other", style="bold bright_red")
    if status.away:
        text.append(f"   interface down: {status.away}", style="yellow")
    elif status.silent_s > 1.0:
        text.append(f"   bus silent for {status.silent_s:.0f} s", style="yellow")
    if status.address:
        text.append(f"\n{status.address}", style="underline")
    return text


def _estimates(status: SessionStatus, machine: Machine) -> Table:
    table = Table("quantity", "value ± 1σ", "", box=None, pad_edge=False, padding=(0, 4, 0, 0))
    piece = status.piece
    if piece is None or not len(piece.track.time):
        return table
    track = piece.track
    quantities = {s.name: Quantity(s.name, s.unit, s.what) for s in machine.states}
    rows = [(OUTPUTS[name], estimate) for name, estimate in track.outputs.items()]
    rows += [(quantities[n], e) for n, e in track.states.items() if n in quantities]
    for quantity, estimate in rows:
        value, std = float(estimate.value[-1]), float(estimate.std[-1])
        if not np.isfinite(value):
            continue
        valid = bool(estimate.valid[-1])
        table.add_row(
            quantity.words,
            plus_minus(quantity, value, std),
            _note(estimate, quantity, track.contradiction is not None),
            style="" if valid else "dim",
        )
    return table


def _note(estimate: Estimate, quantity: Quantity, contradicted: bool) -> Text:
    """A bar for a temperature; the reason why an estimate is not valid."""
    if contradicted:
        return Text("signals contradict the model")
    if not estimate.valid[-1]:
        return Text("too uncertain to be of use")
    if quantity.unit != "°C":
        return Text("")
    full = int(np.clip(estimate.value[-1] / _BAR_END * _BAR, 0, _BAR))
    style = "green" if full < _WARM else "yellow" if full < _HOT else "bright_red"
    return Text("█" * full + "·" * (_BAR - full), style=style)


def _events(status: SessionStatus) -> Table:
    table = Table("s", "event", "", box=None, pad_edge=False)
    for event in list(status.events)[-6:]:
        table.add_row(
            f"{event.time:.1f}",
            Text(event.kind, style=_KIND.get(event.kind, "")),
            Text(words(event)),
        )
    return table


def words(event: MonitorEvent) -> str:
    """An event in a few words."""
    data = event.data
    if event.kind == "engagement":
        slipped = f"slipped {data['duration_s']:.1f} s, {data['energy_J'] / 1e3:.0f} kJ"
        peak = data["peak_temp_disc"]
        return f"{slipped}, peak temperature {peak:.0f} °C" if isfinite(peak) else slipped
    if event.kind == "tracking":
        return figures_in_words(data)
    if event.kind == "gap" and "over" in data:
        if not data["over"]:
            return f"{event.name}: silent since {data['since_s']:.1f} s"
        return f"{event.name}: no data for {data['duration_s']:.1f} s"
    if event.kind == "gap":
        return f"{event.name}: " + ", ".join(f"{v} {k.replace('_', ' ')}" for k, v in data.items())
    if event.kind == "fault":
        others = [name for name in data["set"] if name != event.name]
        also = f", or {', '.join(others)}" if others else ""
        return f"{event.name}{also}{'' if data['failed'] else ': over'}"
    return event.name


def _foot(status: SessionStatus) -> str:
    parts = [f"{status.frames} frames", status.losses]
    if len(status.latency_s) > 5:
        parts.append(
            f"estimates {1e3 * float(np.median(status.latency_s)):.0f} ms after the frame "
            "that makes them final"
        )
    return " · ".join(parts)
