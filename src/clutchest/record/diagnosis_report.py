"""A diagnosis in words: a fault's headline, details and freeze frame."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from clutchest.diagnosis.codes import WEAR
from clutchest.diagnosis.result import Diagnosis, Fault, Isolability
from clutchest.diagnosis.structure import AffectedSensor
from clutchest.models.machine import Machine
from clutchest.quantity import Quantity
from clutchest.record.report import LIMITS, plus_minus, sources, table
from clutchest.shown import with_unit

SEPARABILITY = "Separability (σ) from none and from every other; 4 or more: isolable"


def headline(fault: Fault) -> str:
    """The fault, or the set that cannot be separated."""
    if fault.what.startswith(f"{fault.fault} ") and len(fault.set) == 1:
        return f"{fault.first_detected_s:.1f} s: {fault.what}"
    names = fault.fault if len(fault.set) == 1 else f"one of {', '.join(fault.set)}"
    return f"{fault.first_detected_s:.1f} s: {names}: {fault.what}"


def details(fault: Fault) -> str:
    """Since when, and its code."""
    began = "present from the start" if fault.began_s <= 0.0 else f"began at {fault.began_s:.1f} s"
    over = "" if fault.ended_s is None else f", ended at {fault.ended_s:.1f} s"
    return (
        f"{began}{over}; SPN {fault.spn}, FMI {fault.fmi}, status {fault.status_byte:#04x}, "
        f"confidence {fault.confidence:.4f}"
    )


def freeze_frame(fault: Fault, machine: Machine) -> str:
    """State, inputs and ranked causes at the moment of detection, as Markdown, in the units that
    people read."""
    frame = fault.freeze_frame
    unit = {state.name: state.unit for state in machine.states}
    states, inputs = [], []
    for name, state in frame["states"].items():
        quantity = Quantity(name, unit.get(name, "1"))
        shown = (
            plus_minus(quantity, state["value"], state["std"]) if state["valid"] else "not valid"
        )
        states.append((quantity.words, shown))
    for name, value in frame["inputs"].items():
        quantity = Quantity(name, machine.units.get(name, "1"))
        shown = "–" if value is None else f"{quantity.read(np.array(value)):.4g} {quantity.shown}"
        inputs.append((quantity.words, shown.rstrip()))
    parts = [
        f"## {headline(fault)}",
        details(fault),
        f"At {frame['time']:.1f} s, mode **{frame['mode']}**:",
        table(("state", "value ± 1σ"), states),
        table(("signal", "value"), inputs),
    ]
    if fault.causes:
        rows = [(c.fault, c.magnitude, f"{c.behind:.1f}") for c in fault.causes]
        parts.append(table(("cause", "magnitude ± 1σ", "worse fit than the first, 2 Δ ln L"), rows))
    return "\n\n".join(parts) + "\n"


def diagnosis_markdown(diagnosis: Diagnosis, pictures: Sequence[str] = ()) -> str:
    """One page of Markdown: faults with their freeze frames, every monitor, and what this drive
    could have shown; ``pictures``: names of those of the monitors, one a drive."""
    faults, run = diagnosis.faults, diagnosis.run
    title = ", ".join(fault.fault for fault in faults) or "no fault detected"
    parts = [f"# {run.vehicle.name}: {title}", sources(run)]
    parts += [freeze_frame(fault, run.vehicle.machine) for fault in faults]
    if pictures:
        parts.append("## Monitors over time: passed (green), failed (red)")
        parts += [f"![Monitors of a drive over time]({name})" for name in pictures]
    rows = [(m.name, m.status, m.why) for m in diagnosis.monitors]
    parts += ["## Monitors", table(("monitor", "status", "why"), rows)]
    if diagnosis.isolability is not None:
        parts += ["## Detection limits of this drive", LIMITS, _limits(diagnosis.isolability)]
        parts += [f"## {SEPARABILITY}", table(*separability(diagnosis.isolability))]
    if diagnosis.warnings:
        parts += ["## Warnings", "\n".join(f"- {text}" for text in diagnosis.warnings)]
    return "\n\n".join(parts) + "\n"


def affected(isolability: Isolability, fault: str) -> str:
    """The sensors that a fault affects, those through the same states together."""
    through: dict[tuple[str, ...], list[str]] = {}
    for each in isolability.structure.get(fault, ()):
        through.setdefault(each.through, []).append(each.sensor)
    parts = [
        str(AffectedSensor(", ".join(sensors), states))
        for states, sensors in sorted(through.items())
    ]
    return "; ".join(parts) or "no sensor"


def separability(isolability: Isolability) -> tuple[list[str], list[list[str]]]:
    """Head and rows: every fault, of a size, from no fault and from every other one."""
    numbers = [str(i + 1) for i in range(len(isolability.faults))]
    rows = []
    for i, fault in enumerate(isolability.faults):
        *others, none = (f"{d:.1f}" for d in isolability.d_prime[i])
        others[i] = "–"
        size = with_unit(f"{isolability.sizes[i]:.2g}", isolability.units[i])
        rows.append([numbers[i], f"{fault} {size}", none, *others])
    return ["", "fault of a size", "none", *numbers], rows


def _limits(isolability: Isolability) -> str:
    """From which size on each fault would have been detected, and the sensors that it affects."""
    rows = []
    for i, fault in enumerate(isolability.faults):
        size, unit = isolability.detectable[i], isolability.units[i]
        never = "its limit" if fault == WEAR else "never"
        words = never if size is None else with_unit(f"{size:.2g}", unit)
        rows.append((fault, words, affected(isolability, fault)))
    return table(("fault", "detectable from (50 %)", "affects"), rows)
