"""The run in words (Markdown): estimates, events, warnings, residuals."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np

from clutchest import units
from clutchest.estimate.observability import NOTHING, correlated_with
from clutchest.estimate.run import Run
from clutchest.estimate.track import SMALLEST
from clutchest.paths import names_of
from clutchest.quantity import Quantity
from clutchest.record.quantities import states_of
from clutchest.record.tracking import judder_words, tracking_head, tracking_note, tracking_rows
from clutchest.shown import rounded, with_unit
from clutchest.vehicle import Vehicle

_HOW_TO_READ = (
    "Lines are estimates, the bands around them one standard deviation; a line is grey "
    "while its estimate is not valid."
)


BITS = "One bit of information halves a standard deviation."
LIMITS = (
    "In drives like these one of that size is detected in half of all cases, a larger one more "
    "often. A size without a unit is a pure number, as a rule a relative change: 0.1 is 10 %."
)


def plus_minus(quantity: Quantity, value: float | None, std: float | None) -> str:
    """``82.1 ± 3.4 °C`` in the unit people read; a dash where either is missing."""
    if value is None or std is None or not (np.isfinite(value) and np.isfinite(std)):
        return "–"
    shown = float(quantity.read(np.array([value]))[0])
    spread = float(quantity.read_spread(np.array([std]))[0])
    return f"{rounded(shown, spread)} {quantity.shown}".rstrip()


def informed(state: Mapping[str, Any]) -> str:
    """Why an entry of the summary's ``states`` is not valid and what would inform it; else its
    source of information and what limits it."""
    bits, now = state["information_bits"], state["not_observable_now"]
    if not state["valid"]:
        return f"{state['why']}; needs {state['needs']}" if state["needs"] else state["why"]
    parts = ["carried over from the drive before" if state.get("carried_over") else "initial value"]
    if bits["total"] >= NOTHING:
        mode = max((m for m in bits if m != "total"), key=lambda m: bits[m])
        shown = f"{bits['total']:.1f}" if bits["total"] < 100 else f"{bits['total']:.0f}"
        parts = [f"{shown} bits, mostly {mode}"]
    parts += [words for words in (correlated_with(state["moves_with"]), now) if words]
    return "; ".join(parts)


def markdown(run: Run, how_to_read: str = _HOW_TO_READ, pictures: Sequence[str] = ()) -> str:
    """Summary, final states, engagements and warnings of ``run`` as one Markdown text, ``pictures``
    (Markdown too) behind what they show."""
    parts = [f"# {run.vehicle.name}: estimates", sources(run), *map(_bold, contradiction(run))]
    parts += [how_to_read] if how_to_read else []
    parts += ["## Estimates at the end", _states(run), BITS]
    if run.summary["wear"]:
        parts += ["## Wear", " ".join(run.summary["wear"]["words"])]
    if run.vehicle.machine.event:
        parts += [f"## {event_words(run)[1].capitalize()}", _engagements(run)]
    if rows := tracking_rows(run):
        parts += ["## Tracking", table(tracking_head(run), rows), tracking_note(run)]
    if words := judder_words(run):
        parts += ["## Judder", "\n".join(f"- {text}" for text in words)]
    if run.summary.get("warnings"):
        parts += ["## Warnings", "\n".join(f"- {text}" for text in run.summary["warnings"])]
    parts += [*pictures, "## Residuals of the sensors", _sensors(run)]
    made_by = [
        (what, value if len(value) < 24 else f"{value[:12]}…")
        for what, value in run.provenance.items()
    ]
    parts += ["## Provenance", table(("what", "version or hash"), made_by)]
    return "\n\n".join(parts) + "\n"


def contradiction(run: Run) -> list[str]:
    """That signals and model cannot both be right, and what explains it; empty where they can."""
    found = run.summary.get("contradiction")
    if found is None:
        return []
    where = f"drive {found['drive']}: " if len(run.tracks) > 1 else ""
    words = (
        f"{where}signals and model contradict each other, no estimate is valid: {found['words']}"
    )
    return [words, *([found["explanation"]] if found["explanation"] else [])]


def _bold(words: str) -> str:
    return f"**{words}**"


def sources(run: Run) -> str:
    """The vehicle of a run, its logs, how long they are, and when they begin."""
    names = names_of(name for drive in run.signals.drives for name in drive.sources)
    duration = sum(float(t.time[-1] - t.time[0]) for t in run.tracks if len(t.time))
    drives = "" if len(run.tracks) == 1 else f"{len(run.tracks)} drives, "
    return heading(run.vehicle, names, run.signals.begun, f"{drives}{duration:.0f} s")


def heading(vehicle: Vehicle, logs: str, begun: str, length: str = "") -> str:
    """What a page is of: vehicle, logs, how long they are, and when they begin."""
    parts = (length, f"begun {begun}" if begun else "")
    of = ", ".join(words for words in (logs or "decoded signals", *parts) if words)
    return f"Vehicle: {vehicle.name}. Log: {of}."


def _states(run: Run) -> str:
    rows = []
    for name, quantity in states_of(run).items():
        state = run.summary["states"][name]
        shown = plus_minus(quantity, state["value"], state["std"])
        known = "yes" if state["valid"] else "no"
        rows.append((quantity.words, shown, known, informed(state)))
    return table(
        ("quantity", "value ± 1σ", "valid", "source of information / reason missing"), rows
    )


def event_words(run: Run) -> tuple[str, str]:
    """What an event of the run's machine is called, and several."""
    event = run.vehicle.machine.event
    return event.words if event else ("event", "events")


def no_event_words(run: Run) -> str:
    """That there was no event, and for how long the event's mode lasted nevertheless."""
    mode = run.vehicle.machine.regimes.event
    seconds = run.summary.get("modes_s", {}).get(mode, 0.0)
    words = f"No {event_words(run)[0]} above {SMALLEST:g} J and its own uncertainty"
    return f"{words}; {mode} for {seconds:.1f} s." if seconds else f"{words}."


def hottest_words(run: Run) -> str:
    """What the peak temperature of an event is of."""
    event = run.vehicle.machine.event
    return Quantity(event.hottest, "°C").words if event else "temperature"


def _engagements(run: Run) -> str:
    events = run.summary["engagements"]
    if not events:
        return no_event_words(run)
    rows = []
    geared = any("gear" in event for event in events)
    for event in events:
        where = (str(event["drive"]),) if len(run.tracks) > 1 else ()
        rows.append(
            (
                *where,
                *((str(event.get("gear") or "–"),) if geared else ()),
                f"{event['start_s']:.1f}",
                f"{event['duration_s']:.2f}",
                _rpm(event.get("peak_slip")),
                plus_minus(Quantity("energy", "J"), event["energy_J"], event["energy_std_J"]),
                _whole(event["peak_torque"]),
                _whole(event["peak_temp_disc"]),
            )
        )
    head = (*(("drive",) if len(run.tracks) > 1 else ()), *(("gear",) if geared else ()))
    return table(
        (
            *head,
            "start [s]",
            "duration [s]",
            "peak slip [rpm]",
            "energy",
            "peak torque [Nm]",
            f"peak {hottest_words(run)} [°C]",
        ),
        rows,
    )


def _rpm(speed: float | None) -> str:
    """A speed in rad/s as people read it."""
    return "–" if speed is None else f"{units.convert(speed, 'rad/s', 'rpm'):.0f}"


def _whole(value: float) -> str:
    return f"{value:.0f}" if np.isfinite(value) else "–"


def _sensors(run: Run) -> str:
    units = {sensor.name: sensor.unit for sensor in run.vehicle.machine.sensors}
    rows = []
    for name, s in run.summary["sensors"].items():
        quantity, rms = Quantity(name, units.get(name, "1")), s["innovation_rms"]
        shown = "–" if rms is None else f"{float(quantity.read_spread(np.array(rms))):.3g}"
        rms = with_unit(shown, quantity.shown) if rms is not None else shown
        rows.append((quantity.words, str(s["count"]), rms, _short(s["nis_mean"])))
    note = "NIS, the normalised innovation squared, is 1 on average if the model is right."
    return table(("sensor", "samples", "rms innovation", "mean NIS"), rows) + "\n\n" + note


def _short(value: float | None) -> str:
    return "–" if value is None else f"{value:.3g}"


def table(head: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """A Markdown table."""
    lines = [" | ".join(head), " | ".join("---" for _ in head)]
    lines += [" | ".join(str(cell) for cell in row) for row in rows]
    return "\n".join(f"| {line} |" for line in lines)
