"""A discovery in words, and the files that it becomes."""

from __future__ import annotations

import inspect
import shlex
from collections.abc import Mapping, Sequence
from math import exp, isfinite, log
from pathlib import Path

from clutchest import __version__
from clutchest.discovery.patch import FILE
from clutchest.discovery.result import Cause, Discovery, Found, Gain, Rival, either
from clutchest.errors import ClutchestError
from clutchest.models.effects import Effect, effects_of_file
from clutchest.record.files import finished_into, json_text
from clutchest.record.misfit_pictures import PICTURE, draw_misfit
from clutchest.record.quantities import Quantity
from clutchest.record.report import rounded, table
from clutchest.shipped import shipped
from clutchest.signals import Counts
from clutchest.vehicle import Vehicle
from clutchest.vehicle.text import vehicle_text

_EQUATION = {"sensor": "the readings of", "timing": "the time stamps of"}


def write_discovery(discovery: Discovery, out: Path) -> list[Path]:
    """Write ``discovery.json``, ``extended.toml`` (with ``patch_effects.py`` where it needs one),
    ``report.md`` with its picture and ``recording.rrd``.

    All are finished beside their place first.  Gives the paths written.  Raises ClutchestError if
    ``out`` is no folder or holds a patch that the extended vehicle needs besides its own, OSError
    if the disk refuses.
    """
    from clutchest.record.discovery_recording import write_discovery_recording

    extended, patched = discovery.extended, (out / FILE).resolve()
    needed = {path.resolve() for path in extended.effects_files if path.is_absolute()}
    if discovery.patch is not None:
        may_hold(out, discovery.vehicle)
    with finished_into(out) as folder:
        (folder / "discovery.json").write_text(json_text(discovery.summary()), encoding="utf-8")
        text = vehicle_text(extended, out / "extended.toml", _heading(discovery))
        (folder / "extended.toml").write_text(text, encoding="utf-8")
        if discovery.patch is not None:
            (folder / FILE).write_text(discovery.patch, encoding="utf-8")
        draw_misfit(discovery, folder / PICTURE)
        (folder / "report.md").write_text(report(discovery, PICTURE), encoding="utf-8")
        write_discovery_recording(discovery, folder / "recording.rrd")
        names = sorted(path.name for path in folder.iterdir())
    if discovery.patch is None and patched not in needed:
        patched.unlink(missing_ok=True)  # that of an earlier run belongs to no file any more
    return [out / name for name in names]


def may_hold(out: Path, vehicle: Vehicle) -> None:
    """Raises ClutchestError where ``out`` holds a patch that the vehicle needs: another one must
    not take its place."""
    if (out / FILE).resolve() in {path.resolve() for path in vehicle.effects_files}:
        raise ClutchestError(
            f"{out / FILE}: is needed by {vehicle.path.name}, expected another "
            "folder for the results"
        )


def title(discovery: Discovery) -> str:
    """The verdict in a few words."""
    if discovery.verdict == "none":
        told = any(i.excited for i in discovery.identifiability)
        return "the model explains the data" if told else "the data cannot tell"
    if discovery.named:
        return f"found {either(discovery.sets)}"
    return "something wrong that no known effect explains"


def whereabouts(discovery: Discovery) -> str | None:
    """Which equation is wrong and what its error goes with, as a sentence."""
    where = discovery.where
    if where is None:
        return None
    kind, colon, signal = where.equation.partition(":")
    place = f"{_EQUATION.get(kind, kind)} {signal}" if colon else f"the equation {where.equation}"
    words = [Quantity(name, "1").words for name in where.drivers[:3]]
    if where.peak:
        words[0] = f"the highest {words[0]} so far"
    drivers = ", then with ".join(words)
    return f"The error is in {place}" + (f" and goes with {drivers}." if drivers else ".")


def causes_rows(discovery: Discovery) -> list[tuple[str, str, str, str]]:
    """Per cause its name, numbers with ±, gain in −2 ln(probability) and p-value."""
    known = _effects(discovery.extended)
    return [
        (
            c.effect,
            _fitted(c, known.get(c.effect)),
            f"{c.statistic:.1f}",
            f"{c.p_value:.2g}" if c.p_value > 0.0 else "< 1e-300",
        )
        for c in discovery.causes
    ]


def rivals_rows(rivals: Sequence[Rival]) -> list[tuple[str, str, str]]:
    """Per rival, best first, its name, fitted numbers, and why it lost."""
    rows = []
    for rival in rivals:
        numbers = ", ".join(f"{key} {value:.3g}" for key, value in rival.parameters.items())
        rows.append((rival.effect, numbers, f"{_times(rival.behind)} less probable"))
    return rows


def gain_words(gain: Gain) -> str:
    """What the extension is worth on data not used to find it, with its interval."""
    on = "On held-out data" if gain.other_logs else "With each part of the log foretold by the rest"
    low, high = gain.ci95
    value, before, after = gain.total, gain.simulation_rmse_before, gain.simulation_rmse_after
    digits = 1 if high - low < 100 else 0
    pays = "" if low > 0 else "  The interval includes nought: the extension does not surely pay."
    pays = pays if high > 0 else "  The extension does not pay there."
    moves = f"rises by {value:.{digits}f} [95 %: {low:.{digits}f} to {high:.{digits}f}]"
    if value < 0:
        moves = f"falls by {-value:.{digits}f} [95 %: {-high:.{digits}f} to {-low:.{digits}f}]"
    torque = ""
    if before is not None and after is not None:
        torque = f", the open-loop torque error from {before:.1f} to {after:.1f} Nm"
    return (
        f"{on} ln(probability) {moves}, "
        f"the misfit goes from {gain.rmse_before:.3f} to {gain.rmse_after:.3f} standard "
        f"deviations{torque}.{pays}"
    )


def unmeasured_words(discovery: Discovery) -> str:
    """Why there is no gain to tell of."""
    if discovery.verdict == "none":
        return "Nothing was found that could gain anything."
    if discovery.provenance["held_out"]:
        return "No curve could be put into the model, so that there is no gain to measure."
    return "Not measured.  `--holdout LOG` gives data for it."


def unexcited_words(discovery: Discovery) -> str:
    """The effects that could be there unseen, in one line."""
    if not discovery.unexcited:
        return "Every effect of a plausible size would have shown in this log."
    return f"Would not show in this log even if large: {', '.join(discovery.unexcited)}."


def next_commands(discovery: Discovery) -> list[str]:
    """The next manoeuvre as commands to run; empty where there is none to drive."""
    if discovery.experiment is None or discovery.experiment.scenario is None:
        return []
    vehicle = _argument(discovery.vehicle)
    scenario = shlex.quote(discovery.experiment.scenario)
    hidden = "".join(
        f" --effect {name}:" + ",".join(f"{key}={value:.4g}" for key, value in numbers.items())
        for name, numbers in _added(discovery).items()
    )
    return [
        f"clutchest simulate --vehicle {vehicle} --scenario {scenario} --seed 1{hidden} -o next.log"
    ]


def report(discovery: Discovery, picture: str | None = None) -> str:
    """One page of Markdown; ``picture`` is the file name of the misfit's, if it stands beside."""
    parts = [f"# {discovery.vehicle.name}: {title(discovery)}", f"**{discovery.sentence}**"]
    parts += [words] if (words := whereabouts(discovery)) else []
    if picture:
        parts.append(f"![What the model misses, and what the misfit goes with]({picture})")
    if discovery.causes:
        heading = "Candidates" if discovery.verdict == "ambiguous" else "Causes"
        parts += [f"## {heading}", _causes(discovery)]
    if discovery.rivals:
        rows = rivals_rows(discovery.rivals)
        parts += ["## Rivals that lost", table(("effect", "fitted", "why"), rows)]
    gain = gain_words(discovery.gain) if discovery.gain else unmeasured_words(discovery)
    parts += ["## The extended model", _extension(discovery), gain]
    if discovery.experiment:
        parts += ["## Next manoeuvre", discovery.experiment.words]
        if commands := next_commands(discovery):
            parts.append("Tried out in simulation by:\n\n" + _code(commands))
    parts += ["## What could be there unseen", unexcited_words(discovery)]
    if discovery.misfit.levels:
        parts += ["## Misfit of the model as it was", _levels(discovery)]
    if discovery.warnings:
        parts += ["## Warnings", "\n".join(f"- {text}" for text in discovery.warnings)]
    made = discovery.provenance
    if logs := made.get("logs"):
        held_out = f", measured on {made['held_out']}," if made["held_out"] else ""
        parts.append(
            f"From {logs}{_lost(discovery.counts)}{held_out} by clutchest {made['clutchest']}."
        )
    return "\n\n".join(parts) + "\n"


def _lost(counts: Counts) -> str:
    """In words, what of the mapped frames could not be used, and why."""
    lost = {why: n for why, n in counts.rejected.items() if why != "not mapped"}
    told = ", ".join(f"{n} {why}" for why, n in lost.items())
    return f" (not used of {counts.frames} frames: {told})" if lost else ""


def _causes(discovery: Discovery) -> str:
    known = _effects(discovery.extended)
    rows = [
        (name, _meaning(known.get(name)), numbers, statistic, p_value)
        for name, numbers, statistic, p_value in causes_rows(discovery)
    ]
    head = ("effect", "what it is", "fitted ± 1σ", "gain in −2 ln p", "chance by noise alone")
    return table(head, rows)


def _added(discovery: Discovery) -> dict[str, Mapping[str, float]]:
    """The effects that act in the extended vehicle and not so in the given one, with their
    numbers."""
    before, after = discovery.vehicle.effects, discovery.extended.effects
    return {
        name: numbers
        for name, numbers in after.items()
        if before.get(name) != numbers and any(numbers.values())
    }


def _extension(discovery: Discovery) -> str:
    """What the extended vehicle has in its model that the given one has not."""
    added = _added(discovery)
    if not added:
        return "`extended.toml` is the vehicle as it was."
    how = "replay LOG --vehicle extended.toml"
    patch = (
        f"  The patch ({FILE}) follows these data; it explains nothing." if discovery.patch else ""
    )
    return f"`extended.toml` has {' and '.join(added)} in its model: `clutchest {how}`.{patch}"


def _levels(discovery: Discovery) -> str:
    rows = [
        (x.sensor, x.mode, f"{x.level:.3f}", f"{x.lag:+.3f}", str(x.count))
        for x in discovery.misfit.levels
    ]
    head = (
        "sensor",
        "mode",
        "mean square (1 if right)",
        "from one to the next (0 if right)",
        "readings",
    )
    return table(head, rows)


def _fitted(cause: Cause, effect: Effect | None) -> str:
    units = {number.key: number.unit for number in effect.parameters} if effect else {}
    return ", ".join(
        f"{key} {_number(found)} {_unit(units.get(key, ''))}".rstrip()
        for key, found in cause.parameters.items()
    )


def _number(found: Found) -> str:
    known = isfinite(found.std) and found.std > 0
    return rounded(found.value, found.std) if known else f"{found.value:.4g}"


def _unit(unit: str) -> str:
    return "" if unit == "1" else unit


def _times(behind: float) -> str:
    """``behind`` in −2 ln(probability) as a factor of probability."""
    decades = behind / 2 / log(10)
    return f"{exp(behind / 2):.2g} times" if decades < 4 else f"10^{decades:.0f} times"


def _meaning(effect: Effect | None) -> str:
    if effect is None:
        return ""
    first = inspect.cleandoc(type(effect).__doc__ or "").split("\n\n")[0]
    return " ".join(first.split()).replace("``", "`").replace("|", "\\|")


def _effects(vehicle: Vehicle) -> Mapping[str, Effect]:
    """The library and the user's own; a patch is not written yet and goes by no name."""
    known = dict(vehicle.machine.effects)
    for path in vehicle.effects_files:
        if path.is_absolute():
            known |= effects_of_file(path)
    return known


def _argument(vehicle: Vehicle) -> str:
    """What ``--vehicle`` takes for this vehicle."""
    for name, path in shipped("vehicles").items():
        if path.resolve() == vehicle.path.resolve():
            return name
    return shlex.quote(str(vehicle.path))


def _code(commands: Sequence[str]) -> str:
    return "\n".join(["```sh", *commands, "```"])


def _heading(discovery: Discovery) -> str:
    return (
        f"clutchest {__version__}, discover: {title(discovery)}.\n"
        f"All else is {discovery.vehicle.path.name}'s.  Why: report.md, discovery.json."
    )
