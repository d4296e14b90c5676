"""Is the p-value of ``discover``'s first question, does the model fit at all, what it says?

    python benchmarks/goodness_of_fit.py [--drives 64] [--first 70000] [--groups NAME …] [--jobs 2]
    python benchmarks/goodness_of_fit.py --power [--drives 8]

Healthy drives of 5 to 10 minutes: another truck, road and scenario with every seed, and what sets a
healthy truck apart from its model, one of the generator's groups after the other (or those named,
together).  Printed are the p-value of the test that they are uniform (Kolmogorov, Smirnov), and how
many lie below 5, 1 and 0.1 % with the interval of that share (Clopper, Pearson).  ``--power``: the
share of drives in which the model is rejected when something is wrong with the noise.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from itertools import product
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.stats import binomtest, kstest

import clutchest
from clutchest.discovery.goodness_of_fit import REJECTED, GoodnessOfFit, goodness_of_fit
from clutchest.discovery.search import begin
from clutchest.discovery.segmentation import segmented
from clutchest.generator import GROUPS, Mismatch, Outsider
from clutchest.inference.problem import Problem
from clutchest.models.error_term_effects import error_term_effects

sys.path.insert(0, str(Path(__file__).parent))
from parallel import ran

Floats = NDArray[np.float64]
Readings = Mapping[str, Callable[[Floats], Floats]]

SCENARIOS = "city", "launches", "mixed", "pulses", "heating", "slip-steps", "ramps"
SLIPPING = ("heating",)  # which slips for seconds below 20 rad/s, as others hardly do
TURNING, OPEN = 3.0, 8.0  # rad/s, mm of the motor: between them, surfaces touch and slip


@dataclass(frozen=True)
class Judder:
    """Friction torque × (1 + ``share`` · sin 2π ``frequency`` t) below ``below`` rad/s of slip."""

    share: float
    frequency: float
    below: float = 20.0
    pace = 0.002

    def law(self) -> Callable[[Mapping[str, float]], Mapping[str, float]]:
        def act(seen: Mapping[str, float]) -> dict[str, float]:
            acts = abs(seen["slip_speed"]) < self.below
            wave = np.sin(2.0 * np.pi * self.frequency * seen["time"])
            return {"torque_share": self.share * float(wave) * acts}

        return act

    def readings(self, true: Readings) -> Readings:
        return true


@dataclass(frozen=True)
class NoiseWhileSlipping:
    """Of the engine speed: ``more`` of variance, in units of the stated one, in a ``share`` of the
    readings while the clutch slips."""

    more: float
    share: float = 1.0

    def law(self) -> None:
        return None

    def readings(self, true: Readings) -> Readings:
        std = clutchest.load_vehicle("truck").signals["engine_speed"].noise

        def speed(t: Floats) -> Floats:
            random = np.random.default_rng(len(t))
            slips = np.abs(true["engine_speed"](t) - true["input_shaft_speed"](t)) > TURNING
            slips &= true["motor_position"](t) < OPEN
            hit = slips & (random.random(len(t)) < self.share)
            size = np.sqrt(self.more / self.share) * std
            return true["engine_speed"](t) + hit * size * random.standard_normal(len(t))

        return {**true, "engine_speed": speed}


WRONG: Mapping[str, Outsider] = {
    **{
        f"judder {100 * size:g} %, {hertz:g} Hz": Judder(size, hertz)
        for hertz, size in product((6.0, 9.0, 14.0), (0.01, 0.03, 0.12))
    },
    **{
        f"noise × {times:g} while slipping": NoiseWhileSlipping(times**2 - 1.0)
        for times in (1.1, 1.3, 2.0)
    },
    **{
        f"outliers in {100 * share:g} % while slipping": NoiseWhileSlipping(share * 36.0, share)
        for share in (0.01, 0.05)
    },
}


@dataclass(frozen=True)
class Task:
    """A drive by its ``seed``, with ``groups`` of mismatch and something ``wrong``, if anything."""

    seed: int
    groups: tuple[str, ...]
    wrong: str = ""


def checked(task: Task) -> GoodnessOfFit:
    """The fit of the model without a cause to one drive."""
    random = np.random.default_rng([task.seed, 32])
    truck = clutchest.load_vehicle("truck")
    machine = truck.machine
    states = {state.name: state for state in machine.states}
    signals = clutchest.simulate(
        truck,
        str(random.choice(SLIPPING if task.wrong else SCENARIOS)),
        task.seed,
        duration=float(random.uniform(300.0, 600.0)),
        disturbances={
            f"{name}_std": states[name].healthy_std or 0.0 for name in ("friction", "torque_bias")
        },
        mismatch=Mismatch.drawn(task.groups, task.seed),
        outsider=WRONG.get(task.wrong),
    )
    effects = (*machine.effects.values(), *error_term_effects(machine))
    search = begin(Problem.of(segmented(signals, truck), truck, effects))
    fit = search.objective.linearise_at(search.null.fit.theta)
    return goodness_of_fit(search.problem, fit.raw)


def nulls(seeds: Sequence[int], groups: Sequence[str], jobs: int) -> list[str]:
    """What is printed of healthy drives."""
    turns = [tuple(groups)] if groups else [(), *((name,) for name in GROUPS)]
    tasks = [Task(seed, turns[seed % len(turns)]) for seed in seeds]
    fits = ran("healthy drives", checked, tasks, jobs)
    lines = []
    for turn in turns:
        own = [f.p_value for t, f in zip(tasks, fits, strict=True) if t.groups == turn]
        p = " ".join(f"{value:.3f}" for value in sorted(x for x in own if x is not None))
        lines.append(f"{' + '.join(turn) or 'as the model has it'}: {p}")
    for task, fit in zip(tasks, fits, strict=True):
        if fit.rejects:
            lines.append(f"rejected: seed {task.seed}, {fit.p_value:.2g}: {fit.tests[0].words}")
    names = dict.fromkeys(name for fit in fits for name in (*fit.sensors, *fit.regimes))
    lines.append(_uniform("in all", [f.p_value for f in fits]))
    for name in names:
        lines.append(_uniform(name, [{**f.sensors, **f.regimes}.get(name) for f in fits]))
    return lines


def _uniform(what: str, values: Sequence[float | None]) -> str:
    p = np.array([value for value in values if value is not None])
    words = []
    for level in (0.05, 0.01, REJECTED):
        below = int(np.sum(p < level))
        interval = binomtest(below, len(p)).proportion_ci(0.95, "exact")
        words.append(f"{below} below {level:g} [{interval.low:.1%}, {interval.high:.1%}]")
    return f"{what}: {len(p)} drives, KS p = {kstest(p, 'uniform').pvalue:.2f}, {', '.join(words)}"


def power(seeds: Sequence[int], jobs: int) -> list[str]:
    """What is printed of drives with something wrong with the noise."""
    tasks = [Task(seed, (), wrong) for wrong in WRONG for seed in seeds]
    fits = ran("drives with distorted noise", checked, tasks, jobs)
    lines = []
    for wrong in WRONG:
        own = [f for t, f in zip(tasks, fits, strict=True) if t.wrong == wrong]
        rejected = [f for f in own if f.rejects]
        example = f": {rejected[0].tests[0].words}" if rejected else ""
        lines.append(f"{wrong}: {len(rejected)} of {len(own)}{example}")
    return lines


def main() -> None:
    """Run from the command line."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawTextHelpFormatter
    )
    parser.add_argument("--drives", type=int, default=64)
    parser.add_argument("--first", type=int, default=70_000)
    parser.add_argument("--groups", nargs="*", default=[])
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--power", action="store_true")
    asked = parser.parse_args()
    seeds = range(asked.first, asked.first + asked.drives)
    lines = power(seeds, asked.jobs) if asked.power else nulls(seeds, asked.groups, asked.jobs)
    print("\n".join(lines))


if __name__ == "__main__":
    main()
