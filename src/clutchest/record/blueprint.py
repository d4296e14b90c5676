"""How a recording looks when it is opened: one page to understand the drive, tabs behind it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import ceil, floor, inf, log10

import numpy as np
import rerun as rr
import rerun.blueprint as rrb

from clutchest.models.machine import Machine
from clutchest.signals import Floats

# Distinct on Rerun's dark ground, warm first: the first state of the dry clutch is its body.
COLOURS = (0xF3A712FF, 0x4F9DDEFF, 0xE4572EFF, 0x76B041FF, 0xA06CD5FF, 0x2EC4B6FF, 0xE377C2FF)
INVALID = 0x8A8A8AFF
BOUND = 0x9A9A9AFF
MOST_PANELS = 7  # on the opening page, beside the lanes
TINY = 1e-300  # a range that is smaller has no ticks of its own
MODE_COLOURS = {
    "open": 0x3D5A80FF,
    "slipping": 0xC8553DFF,
    "locked": 0x4C8C4AFF,
    "retracted": 0x2F5D50FF,
}

# Linked time axes read their range from this view, which Rerun keeps for what all views share.
_SHARED_VIEW = "view/5c0dca6a-e63f-9cf7-f657-2602590474cc"


@dataclass(frozen=True, slots=True)
class Panel:
    """One time-series view: its heading, its unit, its entities, and its vertical range."""

    title: str
    unit: str
    entities: tuple[str, ...]
    low: float
    high: float

    def view(self) -> rrb.TimeSeriesView:
        """The view, its time axis moving with all others; a single series needs no legend."""
        return rrb.TimeSeriesView(
            name=self.title,
            origin="/",
            contents=[f"/{entity}" for entity in self.entities],
            axis_x=rrb.TimeAxis(link="LinkToGlobal"),
            axis_y=rrb.ScalarAxis(range=(self.low, self.high)),
            plot_legend=rrb.PlotLegend(rrb.Corner2D.LeftTop, visible=len(self.entities) > 1),
        )


def panel(title: str, unit: str, entities: Sequence[str], lows: Floats, highs: Floats) -> Panel:
    """A panel whose range shows every finite low and high, with a little air around them."""
    bottom = float(lows.min(initial=inf, where=np.isfinite(lows)))
    top = float(highs.max(initial=-inf, where=np.isfinite(highs)))
    if bottom > top:
        bottom, top = 0.0, 1.0
    air = 0.06 * (top - bottom) or max(0.1 * abs(top), 0.1)
    return Panel(title, unit, tuple(entities), *_with_two_ticks(bottom - air, top + air))


def _with_two_ticks(low: float, high: float) -> tuple[float, float]:
    """The range with at least two powers of ten's multiples in it: there the viewer has numbers."""
    if not TINY < high - low < inf:
        return low, high
    step = 10.0 ** floor(log10(high - low))
    first, last = ceil(low / step), floor(high / step)
    if last > first:
        return low, high
    edge = 0.02 * (high - low)
    below, above = (first - 1) * step, (last + 1) * step
    return (below - edge, high) if low - below < above - high else (low, above + edge)


class _Opening(rrb.Blueprint):
    """A blueprint that also says which stretch of time every linked view shows at first.

    Some room on the left keeps the legends off the lines.
    """

    def __init__(self, *parts: rrb.BlueprintPart, end: float) -> None:
        super().__init__(*parts)
        self._end = end

    def _log_to_stream(self, stream: rr.RecordingStream) -> None:
        super()._log_to_stream(stream)
        absolute = rr.TimeRangeBoundary.absolute
        shown = rr.TimeRange(
            start=absolute(seconds=-0.11 * self._end), end=absolute(seconds=1.01 * self._end)
        )
        stream.log(f"{_SHARED_VIEW}/TimeAxis", rrb.TimeAxis(view_range=shown))


def opening(signals: Sequence[Panel], states: Sequence[Panel]) -> list[Panel]:
    """Panels of the opening page: ``signals``, and as many ``states`` as leave the numbers of every
    axis and the lane of the mode legible; of more the last ones, since those of an actuator stand
    before those of the clutch.  All are on pages of their own."""
    room = max(MOST_PANELS - len(signals), 1)
    return [*signals, *states[-room:]]


def blueprint(
    overview: Sequence[Panel],
    pages: Mapping[str, Sequence[Panel]],
    lanes: Sequence[str],
    timeline: str,
    end: float,
    *,
    faults: bool = False,
) -> rrb.Blueprint:
    """The opening page (lanes and ``overview`` beside the report), then one tab per page.

    ``end``: last time on ``timeline``, s.  With ``faults`` their log and freeze frame stand beside
    the report.
    """
    views: list[tuple[rrb.View, float]] = [
        (p.view(), 2.0 + 0.5 * len(p.entities)) for p in overview
    ]
    if lanes:
        lane_view = rrb.StateTimelineView(
            name=" and ".join(lanes) if len(lanes) < 3 else "mode and monitors",
            origin="/",
            contents=[f"/{lane}" for lane in lanes],
            time_view=rrb.TimeAxis(link="LinkToGlobal"),
        )
        views.insert(1, (lane_view, 1.5 + 0.9 * len(lanes)))
    words: rrb.View | rrb.Container = rrb.TextDocumentView(name="report", origin="/report")
    if faults:
        frame = rrb.TextDocumentView(name="freeze frame", origin="/fault/freeze_frame")
        log = rrb.TextLogView(name="faults", origin="/fault/log")
        words = rrb.Vertical(log, rrb.Tabs(frame, words, active_tab=0), row_shares=[1, 3])
    start = rrb.Horizontal(
        rrb.Vertical(*(view for view, _ in views), row_shares=[share for _, share in views]),
        words,
        column_shares=[3, 1],
        name="overview",
    )
    tabs = [
        rrb.Vertical(*(p.view() for p in page), name=name) for name, page in pages.items() if page
    ]
    return _Opening(
        rrb.Tabs(start, *tabs, active_tab=0),
        rrb.BlueprintPanel(state="collapsed"),
        rrb.SelectionPanel(state="collapsed"),
        rrb.TimePanel(state="collapsed", timeline=timeline, play_state="paused"),
        end=end,
    )


def live_blueprint(machine: Machine, timeline: str) -> rrb.Blueprint:
    """The last minutes of a drive that is going on: mode, temperatures, torque, and the rest behind
    tabs; it follows the newest sample."""
    temperatures = [s.name for s in machine.states if s.unit == "°C"]
    others = [s.name for s in machine.states if s.unit != "°C"]

    def view(title: str, entities: Sequence[str]) -> rrb.TimeSeriesView:
        return rrb.TimeSeriesView(
            name=title,
            origin="/",
            contents=[f"/{entity}" for entity in entities],
            axis_x=rrb.TimeAxis(link="LinkToGlobal"),
            time_ranges=_last_minutes(timeline),
        )

    lanes = rrb.StateTimelineView(
        name="mode", origin="/", contents=["/mode"], time_view=rrb.TimeAxis(link="LinkToGlobal")
    )
    torque = [view("clutch torque [Nm] ± 1σ", ["state/clutch_torque"])] if machine.output else []
    start = rrb.Vertical(
        lanes,
        view("temperatures [°C] ± 1σ", [f"state/{name}" for name in temperatures]),
        *torque,
        rrb.TextLogView(name="events", origin="/events"),
        row_shares=[1.0, 3.0, *(2.0 for _ in torque), 1.5],
        name="overview",
    )
    states = rrb.Vertical(
        *(view(name.replace("_", " "), [f"state/{name}"]) for name in others), name="all states"
    )
    signals = rrb.Vertical(
        *(view(name.replace("_", " "), [f"can/{name}"]) for name in list(machine.units)[:8]),
        name="signals",
    )
    residuals = rrb.Vertical(
        *(view(s.name.replace("_", " "), [f"residual/{s.name}"]) for s in machine.sensors),
        name="residuals",
    )
    return rrb.Blueprint(
        rrb.Tabs(start, states, signals, residuals, active_tab=0),
        rrb.BlueprintPanel(state="collapsed"),
        rrb.SelectionPanel(state="collapsed"),
        rrb.TimePanel(state="collapsed", timeline=timeline, play_state="following"),
    )


def _last_minutes(timeline: str) -> rrb.VisibleTimeRange:
    return rrb.VisibleTimeRange(
        timeline,
        start=rrb.TimeRangeBoundary.cursor_relative(seconds=-120.0),
        end=rrb.TimeRangeBoundary.cursor_relative(seconds=0.0),
    )
