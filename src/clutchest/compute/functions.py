"""The functions that kernels and filters call, of one model: its equations, their derivatives, and
how a step and a reading respond to every theta."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import casadi as ca

from clutchest.casadi_later import one_at_a_time
from clutchest.compute.lower import (
    CONTRACTED,
    columns_of,
    covariance_step,
    dispatch,
    lower,
    product,
    signature_step,
)
from clutchest.compute.step import Step, decays, heun
from clutchest.models.effects.effect import INPUT_NOISE, PARAMETER, START, WANDER
from clutchest.models.model import Expressions, Model


@one_at_a_time
def filter_text(model: Model, thetas: Sequence[tuple[str, str]]) -> str:
    """Source of the functions of one model that its filters call.

    ``thetas`` are what signatures are taken of: (``"parameter"``, key), (effect name, number),
    (``"start"``, state), the value with which a state begins, (``"input_noise"``, input), what an
    input is off by in the rates of all states but those that readings renew, or (``"wander"``,
    state), what is added to a state's rate: only fits that track what is renewed (``transition``)
    ask for the last two.
    """
    functions = _Functions.of(model, tuple(thetas))
    parts = [*functions.steps(), *functions.moments(), *functions.readings()]
    return "\n\n".join([*_constants(model, thetas), *functions.shared(), *parts])


@one_at_a_time
def fit_text(model: Model, thetas: Sequence[tuple[str, str]]) -> str:
    """Source of the functions of one model that its fits call; see :func:`filter_text`."""
    functions = _Functions.of(model, tuple(thetas))
    parts = [*functions.denoised_steps(), *functions.readings()]
    return "\n\n".join([*_constants(model, thetas), *functions.shared(), *parts])


def _constants(model: Model, thetas: Sequence[tuple[str, str]]) -> list[str]:
    """Sizes, and which states are treated in a way of their own."""
    e = model.expressions()
    return [
        f"STATES, INPUTS, OUTPUTS, SENSORS, THETAS = {len(model.states)}, {len(model.inputs)}, "
        f"{len(model.outputs)}, {len(model.sensors)}, {len(thetas)}",
        f"HAS_MAP = {not ca.is_equal(e.mapped, e.x)}",
        f"SCALES = np.array({[i for i, s in enumerate(model.states) if s.factor]}, np.int64)",
        f"DOUBTED = np.array({[model.state(name) for name in model.doubted]}, np.int64)",
    ]


@dataclass(frozen=True)
class _Functions:
    """The functions of one model, to be lowered: its expressions ``e``, the symbols ``theta`` (m),
    the inputs' slopes (nu) and what delays do to the inputs, ``late`` (nu, m)."""

    model: Model
    thetas: tuple[tuple[str, str], ...]
    e: Expressions
    theta: ca.SX
    slope: ca.SX
    late: ca.SX

    @classmethod
    def of(cls, model: Model, thetas: tuple[tuple[str, str], ...]) -> _Functions:
        e, slope = model.expressions(), ca.SX.sym("slope", len(model.inputs))
        theta = ca.vertcat(ca.SX(0, 1), *(_symbol(model, e, *names) for names in thetas))
        return cls(model, thetas, e, theta, slope, _late(model, thetas, slope))

    @property
    def at(self) -> dict[str, ca.SX]:
        """What holds at one moment."""
        e = self.e
        return {"x": e.x, "u": e.u, "w": e.w, "p": e.p, "g": e.g}

    def over(self, taken: Step) -> dict[str, ca.SX]:
        """What holds over a step."""
        e = self.e
        return {"x": e.x, "u0": e.u, "u1": taken.u1, "dt": taken.dt, "w": e.w, "p": e.p, "g": e.g}

    def by_theta(self, of: ca.SX, taken: Step) -> ca.SX:
        """Derivative by θ of what comes of a step."""
        by_inputs = ca.jacobian(of, self.e.u) + ca.jacobian(of, taken.u1)
        return ca.jacobian(of, self.theta) + ca.mtimes(by_inputs, self.late)

    def steps(self) -> list[str]:
        """``step`` and ``step_signature``."""
        taken = heun(self.model, self.e)
        over, by_state = self.over(taken), ca.jacobian(taken.x, self.e.x)
        return [
            lower(
                "step",
                over | {"q": taken.q, "noise": taken.noise},
                {
                    "xn": taken.x,
                    "F": by_state,
                    "Q": taken.Q,
                    "energy": taken.energy,
                    "e": ca.jacobian(taken.energy, self.e.x).T,
                },
                "energy",
            ),
            lower(
                "step_signature",
                over | {"slope": self.slope},
                {
                    "G": self.by_theta(taken.x, taken),
                    "eG": self.by_theta(taken.energy, taken).T,
                },
            ),
            covariance_step("propagate", by_state),
            signature_step("propagate_signature", by_state),
        ]

    def denoised_steps(self) -> list[str]:
        """The same where step maps see inputs without their noise, part by part: ``follow``,
        ``settle``, ``transition`` with ``carry``, ``gathered``."""
        model, e = self.model, self.e
        moves = ca.SX.sym("moves", len(model.inputs))
        taken = heun(model, e, moves) if e.dragging else heun(model, e)
        over = self.over(taken) | {"moves": moves}
        by_state = ca.jacobian(taken.x, e.x)
        by_theta = self.by_theta(taken.x, taken) + self.by_noise(taken)
        settled = ca.SX(len(model.states), 1)
        for i in map(int, model.settling):
            settled[i] = taken.x[i]
        return [
            lower("follow", over, {"xn": taken.x}),
            lower("settle", over, {"xn": settled}),
            lower(
                "transition",
                over | {"slope": self.slope},
                {"F": by_state, "G": by_theta},
                compiled=CONTRACTED,
            ),
            product("carry", by_state),
            *columns_of("FIRST", "ROW", by_theta),
            lower("gathered", over | {"q": taken.q, "noise": taken.noise}, {"Q": taken.Q}),
        ]

    def by_noise(self, taken: Step) -> ca.SX:
        """Derivative (n, m) of a step by what inputs are off by, and by how fast states wander: to
        first order, as it is too small to matter within a step."""
        model, e = self.model, self.e
        taken_in = ca.SX(len(model.states), len(self.thetas))
        kept = [i for i, state in enumerate(model.states) if state.name not in model.followed]
        for k, (owner, name) in enumerate(self.thetas):
            if owner == INPUT_NOISE:
                taken_in[kept, k] = taken.dt * ca.jacobian(e.rate, e.u)[kept, model.input(name)]
            elif owner == WANDER:
                taken_in[model.state(name), k] = taken.dt
        return taken_in

    def shared(self) -> list[str]:
        """``dynamics`` and ``initial``."""
        e = self.e
        started = ca.SX(e.initial.numel(), len(self.thetas))
        for k, (owner, name) in enumerate(self.thetas):
            if owner == START:
                started[:, k] = ca.jacobian(e.initial, e.x[self.model.state(name)])
        by_x, by_inputs = ca.jacobian(e.rate, e.x), ca.jacobian(e.rate, e.u)
        first = {"xi": e.initial, "Si": ca.jacobian(e.initial, self.theta) + started}
        return [
            lower("dynamics", self.at, {"f": e.rate, "A": by_x, "B": by_inputs}),
            lower("initial", {"x": e.x, "p": e.p, "g": e.g}, first),
        ]

    def moments(self) -> list[str]:
        """``implied``, ``decays``, ``step_map`` and ``outputs``."""
        model, e, at = self.model, self.e, self.at
        decay = ca.SX(len(model.states), 1)
        for i, rate in decays(model, e).items():
            decay[i] = rate
        outputs, by_state = e.outputs, ca.jacobian(e.outputs, e.x)
        ends = {"x": e.x, "u0": e.u0, "u": e.u, "w": e.w, "p": e.p, "g": e.g}
        jumps = {"mapped": e.mapped, "J": ca.jacobian(e.mapped, e.x)}
        return [
            lower("implied", at, {"v": e.implied}),
            lower("decays", at, {"decay": decay, "D": ca.jacobian(decay, e.x)}),
            lower("step_map", ends, jumps),
            lower("outputs", at, {"y": outputs, "Y": by_state, "Yu": ca.jacobian(outputs, e.u)}),
            lower("outputs_signature", at, {"Ym": ca.jacobian(outputs, self.theta)}),
        ]

    def readings(self) -> list[str]:
        """``reading`` and ``reading_signature``, with those of every sensor."""
        parts, sensors = [], len(self.model.sensors)
        for i in range(sensors):
            h, by_theta = self.e.readings[i], ca.jacobian(self.e.readings[i], self.theta).T
            of = {"h": h, "H": ca.jacobian(h, self.e.x).T}
            parts.append(lower(f"reading_{i}", self.at, of, "h"))
            parts.append(lower(f"reading_{i}_signature", self.at, {"Hm": by_theta}))
        parts.append(dispatch("reading", "H", "", sensors))
        parts.append(dispatch("reading_signature", "Hm", "_signature", sensors))
        return parts


def _late(model: Model, thetas: Sequence[tuple[str, str]], slope: ca.SX) -> ca.SX:
    """Derivative (nu, m) of the inputs by delays.  A delay shifts a signal in time: its response is
    that signal's slope over the step, times the most that a delay is which varies."""
    late = ca.SX(len(model.inputs), len(thetas))
    for k, (owner, key) in enumerate(thetas):
        for effect in model.effects:
            for signal, number in effect.delays.items():
                if effect.name == owner and number == key:
                    varies, j = effect.lateness.get(signal), model.input(signal)
                    late[j, k] = slope[j] * (varies.reach if varies else 1.0)
    return late


@one_at_a_time
def forward_text(model: Model, watched: Sequence[str]) -> str:
    """Source of the functions that run a model by itself: a step, and ``watched`` quantities."""
    e = model.expressions()
    taken = heun(model, e)
    shown = ca.vertcat(*(getattr(e.quantities, name) for name in watched))
    over = {"x": e.x, "u0": e.u, "u1": taken.u1, "dt": taken.dt, "w": e.w, "p": e.p, "g": e.g}
    at = {"x": e.x, "u": e.u, "w": e.w, "p": e.p, "g": e.g}
    return "\n\n".join([lower("advance", over, {"xn": taken.x}), lower("watch", at, {"y": shown})])


def _symbol(model: Model, e: Expressions, owner: str, key: str) -> ca.SX:
    if owner in (START, INPUT_NOISE, WANDER):
        return ca.SX.sym(key)  # the equations know it by what it leads to only
    if owner == PARAMETER:
        return e.p[[p.key for p in model.parameters].index(key)]
    return e.g[[(effect.name, number) for effect, number in model.numbers].index((owner, key))]
