"""Drives drawn from the filter's own stated model, to judge the filter by: start from its prior,
process noise Q and sensor noise R as stated, parameters exactly known.

What such a drive cannot judge is the model itself; that is the generator's part.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from types import ModuleType

import numpy as np

import drawing
from clutchest import generated
from clutchest.compute import build
from clutchest.errors import ClutchestError
from clutchest.estimate.timeline import Timeline
from clutchest.estimate.whole_log import Belief, Compiled, events_of, regimes_of
from clutchest.signals import Floats

FINEST = 0.01  # s, longest step of the truth
STIFF = 10  # steps of the truth to one of the filter where states are stiff: its rule is explicit


@dataclass(frozen=True, slots=True)
class Driver:
    """Keeps a ``sensor``'s reading near the plan's: ``answers`` says by how much each input goes
    up per unit that the last reading fell short."""

    sensor: str
    answers: Mapping[str, float]


ENGINE_DRIVER = Driver("engine_speed", {"engine_torque": 100.0, "engine_acceleration": 5.0})


@dataclass(frozen=True, slots=True)
class Drawn:
    """A drive from the model: ``timeline`` with its readings and inputs, truth ``x`` (rows, n).

    ``bound`` (rows, n): posterior Cramér–Rao bound of this trajectory, a variance.
    """

    timeline: Timeline
    x: Floats
    bound: Floats


def draw(
    compiled: Compiled,
    plan: Timeline,
    prior: Belief,
    seed: int,
    start: Floats | None = None,
    driver: Driver | None = ENGINE_DRIVER,
) -> Drawn:
    """A drive along ``plan``: its stamps, modes and inputs, with readings of a truth of its own.

    The truth starts at ``start`` (n), unless given a draw from ``prior``.  Its engine would not
    keep the plan's speed by itself: ``driver`` answers to readings, which the filter sees too.
    Raises ClutchestError for a model whose step map sees its inputs move, noise and all.
    """
    model, n = compiled.model, len(prior.x)
    if compiled.functions.HAS_MAP and model.expressions().dragging:
        raise ClutchestError("a drive cannot be drawn from a model whose state jumps with an input")
    finest = FINEST
    if any(state.stiff for state in model.states):
        finest = min(finest, model.longest[0] / STIFF)
    rng = np.random.default_rng(seed)
    if start is None:
        start = prior.x + np.linalg.cholesky(prior.P) @ rng.standard_normal(n)
    watched = model.sensor(driver.sensor) if driver else -1
    answers = driver.answers if driver else {}
    pull = np.array([answers.get(item.name, 0.0) for item in model.inputs])
    rows = int(plan.emit.max()) + 1
    u, z = plan.u.copy(), np.zeros(len(plan.t))
    x, bound = np.zeros((rows, n)), np.zeros((rows, n))
    _drawing(compiled).draw(
        rng,
        start.copy(),
        prior.P.copy(),
        events_of(plan)._replace(u=u),
        regimes_of(plan),
        compiled.numbers,
        drawing.Plan(watched, plan.z, pull, finest),
        z,
        x,
        bound,
    )
    return Drawn(replace(plan, u=u, z=z), x, bound)


def _drawing(compiled: Compiled) -> ModuleType:
    """The model's functions with those of :mod:`drawing` behind them."""
    _, text = build.generate(compiled.model, compiled.thetas)
    # numba can draw random numbers, and shows besides that it says the same
    text = text.replace("from clutchest.native import", "from clutchest.native.reference import")
    file = Path(drawing.__file__).read_text(encoding="utf-8")
    return generated.load(*generated.named([text, file.split(generated.MARK)[1]]))
