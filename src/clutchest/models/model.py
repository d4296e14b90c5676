"""A model: named equations in CasADi, pieces that can be swapped, effects that hook into them."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any
from warnings import catch_warnings

import numpy as np
from numpy.typing import NDArray

from clutchest.casadi_later import ca, one_at_a_time
from clutchest.models.effects.effect import Effect, Gains
from clutchest.models.regimes import SLIDING
from clutchest.models.symbols import Input, Parameter, Sensor, State
from clutchest.signals import Floats

Term = Callable[["ca.SX", "Quantities"], "ca.SX"]


class Quantities:
    """Every named quantity of the equations, as CasADi expressions.

    Reading ``q.name`` gives a state, input, parameter or a quantity assigned before; assigning
    ``q.name = expression`` passes the expression through the effects that change this quantity.
    """

    def __init__(self, terms: Mapping[str, tuple[Term, ...]]) -> None:
        object.__setattr__(self, "_terms", terms)
        object.__setattr__(self, "_values", {})

    def __setattr__(self, name: str, value: Any) -> None:
        expression = ca.SX(value)
        for term in vars(self)["_terms"].get(name, ()):
            expression = term(expression, self)
        vars(self)["_values"][name] = expression

    def __getattr__(self, name: str) -> ca.SX:
        try:
            return vars(self)["_values"][name]
        except KeyError:
            raise AttributeError(
                f"the equations have no quantity '{name}' here", name=name, obj=self
            ) from None

    def names(self) -> tuple[str, ...]:
        """Names of all quantities so far."""
        return tuple(vars(self)["_values"])


POWER = "power"  # output of what friction turns to heat, where there is any
BLOCK = 512  # moments evaluated at a time

Piece = Callable[[Quantities], None]


@dataclass(frozen=True, slots=True)
class Expressions:
    """The model written out: symbols and what they make.

    ``x`` states (n), ``u`` inputs (nu), ``w`` regime flags, ``p`` parameters, ``g`` numbers of the
    effects; ``rate`` dx/dt (n), ``readings`` one per sensor, ``outputs`` those named by
    :attr:`Model.outputs`, ``initial`` the start state (n) as a function of ``x``, ``mapped`` the
    state after the step map, of ``x`` at the step's end, ``u0`` and ``u`` at its start and end;
    ``implied`` (nu) the inputs, noisy ones as other measurements imply them.
    """

    x: ca.SX
    u: ca.SX
    u0: ca.SX
    w: ca.SX
    p: ca.SX
    g: ca.SX
    rate: ca.SX
    readings: ca.SX
    outputs: ca.SX
    initial: ca.SX
    mapped: ca.SX
    implied: ca.SX
    quantities: Quantities

    @property
    @one_at_a_time
    def dragging(self) -> list[int]:
        """Indices of the inputs that the step map sees move."""
        sees = ca.which_depends(self.mapped, self.u0, 1, False)
        return [j for j, seen in enumerate(sees) if seen]

    @property
    @one_at_a_time
    def plays(self) -> list[int]:
        """Indices of the numbers of effects that set the play in the step map."""
        sees = ca.which_depends(self.mapped, self.u0, 1, True)
        dragged = [i for i, seen in enumerate(sees) if seen]
        by = ca.which_depends(self.mapped[dragged], self.g, 1, False)
        return [k for k, depends in enumerate(by) if depends]

    @one_at_a_time
    def together(self, names: Iterable[str]) -> ca.SX:
        """Quantities one below the other."""
        return ca.vertcat(*(getattr(self.quantities, name) for name in names))

    @one_at_a_time
    def along(self, wanted: ca.SX, x: Floats, u: Floats, w: Floats, p: Floats, g: Floats) -> Floats:
        """Values (k, K) of the expressions ``wanted`` (k) at K moments: ``x`` (K, n), ``u``
        (K, nu) and ``w`` (K, flags) of each; ``p`` and ``g`` are the same in all of them.  They
        stay symbols: put in, they made constants, see ``one_at_a_time``."""
        values = np.empty((wanted.numel(), len(x)))
        symbols = [self.x, self.u, self.w, self.p, self.g]
        at = ca.Function("along", symbols, [ca.densify(wanted)])
        whole, most = at.map(BLOCK), min(BLOCK, len(x))
        same = [np.tile(each, (most, 1)) for each in (p, g)]
        for begin in range(0, len(x), BLOCK):  # memory for a block, not for the drive
            some, count = slice(begin, begin + BLOCK), min(BLOCK, len(x) - begin)
            block = whole if count == BLOCK else at.map(count)
            parts = [x[some], u[some], w[some], *(each[:count] for each in same)]
            values[:, some] = _each(block, *parts).T
        return values


def _each(block: ca.Function, *arguments: Floats) -> Floats:
    """The values (K, k) of a function of K vectors, the rows of its ``arguments`` (K, …), in memory
    as it is: CasADi's own matrices take several times as long to make as it does."""
    given = [np.ascontiguousarray(each, np.float64) for each in arguments]
    values = np.empty((block.size2_out(0), block.size1_out(0)))
    buffer: Any  # CasADi's hints leave memory views out
    buffer, evaluate = block.buffer()
    for i, each in enumerate(given):
        buffer.set_arg(i, each.data)
    buffer.set_res(0, values.data)
    evaluate()
    return values


@dataclass(frozen=True)
class Model:
    """Equations as an ordered list of pieces, and the effects present in them.

    A piece reads quantities and assigns new ones; ``<state>_rate`` is a state's derivative (0
    unless assigned), ``<state>_after_step`` what each step resets it to.  ``regime``: flags
    that the pieces read; ``outputs``: quantities that results hold.  ``renewed`` names states that
    are a plain random walk while a regime flag is 0: state → (flag, noise in state unit/√s).
    ``tracked`` names states that a fit corrects by readings all the time, as a filter does, because
    no number that is the same throughout a drive says where they are: state → flag → noise in state
    unit/√s while it is 0, that of a later flag first; ``uncorrected`` names those of them that no
    reading corrects while a flag is 0: what sticks would be shaken, and creep; ``exact`` names
    parameters that it takes as they are, whatever their spread, because no log holds anything of
    them.
    ``anchor`` is the signal that every drive requires: its samples set the pace, and where it is a
    sensor of a state, its first reading is where that state starts.  ``slopes`` are inputs made
    of a signal's slope: input → signal.  ``longest`` s, a step may be under each of the
    flags ``fast_while``, the first of them that holds, and otherwise; the first throughout where
    ``regime`` has no such flag.  Of these steps, derivatives of a fit take ``at_once`` in one.
    ``doubted`` names states whose standard deviation, as a filter holds it, equations may use as
    ``<state>_std``; where nothing is estimated it is 0.
    ``unobservable``: state → why no available signal informs it.  ``implied``: noisy input → the
    quantity that other measurements imply for it.  Vary a
    model with :meth:`swap`, :meth:`without` and :meth:`with_effects`; each returns a new one.
    """

    name: str
    states: tuple[State, ...]
    parameters: tuple[Parameter, ...]
    inputs: tuple[Input, ...]
    sensors: tuple[Sensor, ...]
    pieces: tuple[Piece, ...]
    regime: tuple[str, ...] = ()
    outputs: tuple[str, ...] = ()
    anchor: str = ""
    slopes: Mapping[str, str] = field(default_factory=dict)
    longest: tuple[float, ...] = (0.02, 0.5)
    fast_while: tuple[str, ...] = (SLIDING,)
    at_once: tuple[int, ...] = (1, 1)
    doubted: tuple[str, ...] = ()
    renewed: Mapping[str, tuple[str, float]] = field(default_factory=dict)
    tracked: Mapping[str, Mapping[str, float]] = field(default_factory=dict)
    uncorrected: Mapping[str, str] = field(default_factory=dict)
    exact: tuple[str, ...] = ()
    unobservable: Mapping[str, str] = field(default_factory=dict)
    implied: Mapping[str, str] = field(default_factory=dict)
    effects: tuple[Effect, ...] = ()

    def swap(self, old: Piece, new: Piece) -> Model:
        """The same model with one piece exchanged.  Raises ValueError where ``old`` is no piece."""
        if old not in self.pieces:
            raise ValueError(f"'{self.name}' has no piece '{old.__name__}'")
        return replace(self, pieces=tuple(new if piece is old else piece for piece in self.pieces))

    def without(self, *pieces: Piece) -> Model:
        """The same model lacking some pieces."""
        return replace(self, pieces=tuple(p for p in self.pieces if p not in pieces))

    def without_input(self, name: str) -> Model:
        """The same model not driven by this input."""
        return replace(self, inputs=tuple(i for i in self.inputs if i.name != name))

    def by_pace(self, of: tuple[float, ...], flags: Floats) -> Floats:
        """The number ``of`` each pace that holds under each row of regime ``flags`` (r, ≥ f), the
        fastest first."""
        paces = [
            (flag, value)
            for flag, value in zip(self.fast_while, of, strict=False)
            if flag in self.regime
        ]
        pace = np.full(len(flags), of[-1] if paces else of[0])
        for flag, value in reversed(paces):
            pace[flags[:, self.regime.index(flag)] > 0] = value
        return pace

    def with_noise(self, state: str, process_noise: float) -> Model:
        """The same model with another process noise of one state, state unit/√s."""
        changed = tuple(
            replace(s, process_noise=process_noise) if s.name == state else s for s in self.states
        )
        return replace(self, states=changed)

    def with_states(self, *states: State) -> Model:
        """The same model with further states."""
        return replace(self, states=(*self.states, *states))

    def unobserved(self, why: Mapping[str, str]) -> Model:
        """The same model, with states that no available signal informs: state → why."""
        return replace(self, unobservable=dict(why))

    def with_effects(self, effects: tuple[Effect, ...]) -> Model:
        """The same model with these effects in its equations, and with their states."""
        own = tuple(state for effect in effects for state in effect.states)
        return replace(self, effects=effects, states=self.states + own)

    def effect_numbers(self, stated: Mapping[str, Mapping[str, float]]) -> dict[str, float]:
        """``effect.number`` → value, in the order of the equations: as ``stated`` by effect and
        number, else a shape's default and a gain of 0."""
        return {
            f"{effect.name}.{n.key}": stated.get(effect.name, {}).get(
                n.key, n.default if n.shape else 0.0
            )
            for effect in self.effects
            for n in effect.parameters
        }

    @one_at_a_time
    def taking(self, effects: Iterable[Effect]) -> tuple[Effect, ...]:
        """The effects of which these equations have every quantity and signal that they change."""
        bare = set(replace(self, effects=()).expressions().quantities.names())
        inputs = {item.name for item in self.inputs}

        def takes(effect: Effect) -> bool:
            g = Gains({number.key: ca.SX.sym(number.key) for number in effect.parameters})
            known = bare | {f"{state.name}_rate" for state in effect.states}
            return set(effect.terms(g)) <= known and set(effect.delays) <= inputs

        return tuple(effect for effect in effects if takes(effect))

    @property
    def followed(self) -> frozenset[str]:
        """States that a fit corrects by readings: those renewed, and those tracked."""
        return frozenset(self.renewed) | frozenset(self.tracked)

    @cached_property
    @one_at_a_time
    def settling(self) -> NDArray[np.int64]:
        """Indices of the tracked states that an input settles at once."""
        e = self.expressions()
        stiff = [i for i, s in enumerate(self.states) if s.name in self.tracked and s.stiff]
        return np.array([i for i in stiff if ca.depends_on(e.rate[i], e.u)], np.int64)

    @property
    def numbers(self) -> tuple[tuple[Effect, str], ...]:
        """(effect, parameter) of every entry of the vector ``g``."""
        return tuple((e, number.key) for e in self.effects for number in e.parameters)

    @one_at_a_time
    def expressions(self) -> Expressions:
        """The equations written out.  Raises AttributeError for a quantity that is not there."""
        return self._written

    @cached_property
    def _written(self) -> Expressions:
        x = ca.SX.sym("x", len(self.states))
        u = ca.SX.sym("u", len(self.inputs))
        u0 = ca.SX.sym("u0", len(self.inputs))
        w = ca.SX.sym("w", len(self.regime) + len(self.doubted))
        p = ca.SX.sym("p", len(self.parameters))
        g = ca.SX.sym("g", len(self.numbers))

        gains = self._gains(g)
        q = self._quantities(x, u, w, p, gains)
        mapped = ca.SX(x)
        for i, state in enumerate(self.states):
            if (reset := f"{state.name}_after_step") in q.names():
                mapped[i] = getattr(q, reset)
        for effect in self.effects:
            mapped = effect.after_step(self, mapped, u0, u, gains[effect])
        return Expressions(
            x,
            u,
            u0,
            w,
            p,
            g,
            rate=ca.vertcat(*(getattr(q, f"{s.name}_rate") for s in self.states)),
            readings=ca.vertcat(*(getattr(q, f"{s.name}_reading") for s in self.sensors)),
            outputs=ca.SX(ca.vertcat(*(getattr(q, name) for name in self.outputs))),
            initial=ca.vertcat(*(getattr(q, f"initial_{s.name}") for s in self.states)),
            mapped=mapped,
            implied=ca.vertcat(
                *(getattr(q, self.implied.get(i.name, i.name)) for i in self.inputs)
            ),
            quantities=q,
        )

    @cached_property
    @one_at_a_time
    def predicted(self) -> frozenset[str]:
        """The sensors whose readings the equations predict, rather than follow by the slope of
        the same signal."""
        e = self.expressions()
        own = [j for j, item in enumerate(self.inputs) if item.name in self.slopes]
        rest = [j for j in range(len(self.inputs)) if j not in own]
        predicted = set()
        for i, sensor in enumerate(self.sensors):
            states = np.flatnonzero(ca.which_depends(e.readings[i], e.x, 1, False))
            rate = e.rate[states.tolist()]
            by = ca.vertcat(e.x, e.u[rest], e.p)
            follows = len(own) > 0 and ca.depends_on(rate, e.u[own])
            if not follows or ca.depends_on(rate, by):
                predicted.add(sensor.name)
        return frozenset(predicted)

    def _gains(self, g: ca.SX) -> dict[Effect, Gains]:
        """The entries of ``g`` by effect."""
        return {
            effect: Gains({key: g[i] for i, (of, key) in enumerate(self.numbers) if of is effect})
            for effect in self.effects
        }

    def _quantities(
        self, x: ca.SX, u: ca.SX, w: ca.SX, p: ca.SX, gains: Mapping[Effect, Gains]
    ) -> Quantities:
        """Every quantity of the pieces, passed through the effects that change it."""
        terms: dict[str, tuple[Term, ...]] = {}
        for effect in self.effects:
            for quantity, term in effect.terms(gains[effect]).items():
                terms[quantity] = (*terms.get(quantity, ()), term)
        q = Quantities(terms)
        for i, state in enumerate(self.states):
            setattr(q, state.name, x[i])
            setattr(q, f"initial_{state.name}", x[i])
        for i, item in enumerate(self.inputs):
            setattr(q, item.name, u[i])
        for i, flag in enumerate(self.regime):
            setattr(q, flag, w[i])
        for i, name in enumerate(self.doubted, len(self.regime)):
            setattr(q, f"{name}_std", w[i])
        states = {state.name for state in self.states}
        for i, parameter in enumerate(self.parameters):
            if parameter.key not in states:  # a state's nominal value leaves it the name
                setattr(q, parameter.key, p[i])
        with catch_warnings(action="ignore", category=FutureWarning):  # CasADi's of NumPy's tanh
            for piece in self.pieces:
                piece(q)
        for name in (f"{state.name}_rate" for state in self.states):
            if name not in q.names():
                setattr(q, name, 0.0)
        if unused := set(terms) - set(q.names()):
            raise AttributeError(f"effects change quantities that '{self.name}' lacks: {unused}")
        return q

    def power(self, written: Expressions) -> ca.SX:
        """The output ``power``, W that friction turns to heat; 0 of equations without one."""
        if POWER not in self.outputs:
            return ca.SX(0)
        return written.outputs[self.outputs.index(POWER)]

    def state(self, name: str) -> int:
        """Index of a state in x."""
        return [s.name for s in self.states].index(name)

    def input(self, name: str) -> int:
        """Index of an input in u."""
        return [i.name for i in self.inputs].index(name)

    def sensor(self, name: str) -> int:
        """Index of a sensor."""
        return [s.name for s in self.sensors].index(name)
