"""The compiled filter over a whole drive."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from types import ModuleType

import numpy as np

from clutchest import generated
from clutchest.compute import build
from clutchest.compute.kept_text import Thetas
from clutchest.compute.records import (
    Belief,
    EventResults,
    Events,
    Numbers,
    RegimeTables,
    RowResults,
    Weighting,
)
from clutchest.errors import ClutchestError, nearest
from clutchest.estimate.timeline import Timeline
from clutchest.models.curve_effect import curve_effects
from clutchest.models.effects import Effect
from clutchest.models.effects.effect import INPUT_NOISE, PARAMETER, START, WANDER
from clutchest.models.machine import Machine
from clutchest.models.model import Model
from clutchest.progress import Progress
from clutchest.signals import Floats
from clutchest.vehicle import Vehicle

CHUNK = 200_000  # events between two reports of progress
ROBUST_LIMIT = 5.0  # standard deviations; beyond, an innovation counts for less


@dataclass(frozen=True, slots=True)
class Compiled:
    """A ``model`` of a ``machine`` with numbers: the lowered ``functions``, parameters ``p``,
    effect numbers ``g``.

    ``thetas`` are what the filter's own answer is differentiated by, ``spread`` (m) how far each
    may lie from its value; ``digest`` names the generated code.
    """

    machine: Machine
    model: Model
    functions: ModuleType
    digest: str
    p: Floats
    g: Floats
    thetas: tuple[tuple[str, str], ...]
    spread: Floats

    @property
    def numbers(self) -> Numbers:
        """Parameters and effect numbers as kernels take them."""
        return Numbers(self.p, self.g)


@dataclass(frozen=True, slots=True)
class FilterOptions:
    """How a filter weighs readings, and what it keeps.

    Innovations beyond ``limit`` standard deviations count for less.  ``signature``: the responses
    to the uncertain parameters are followed, and their spreads stand in the stated uncertainty.
    With ``consider`` the gains take the spreads into account, and innovations are judged with
    them; without, the filter takes the parameters for true.  ``keep``: gains and responses of all
    innovations are returned.  ``gains`` (K, n + doubted) replace the filter's own, so that two
    runs differ by the model alone.
    """

    limit: float = ROBUST_LIMIT
    signature: bool = True
    consider: bool = False
    keep: bool = False
    gains: Floats | None = None


PLAIN = FilterOptions()
CONSIDERING = FilterOptions(consider=True)


@dataclass(frozen=True, slots=True)
class Filtered:
    """What the kernel gives for one timeline; rows as ``Timeline.emit`` numbers them.

    ``x`` (r, n), ``P`` (r, n, n), ``total`` (r, n) variance with the parameters' spreads,
    ``outputs`` (r, outputs, 2) value and variance, ``energy`` (r, 3 + m),
    ``gained`` (r, n) the information in nats that measurements gave so far; per event
    ``innovation`` (K, 3): innovation, its predicted and its used variance.  ``final`` is the
    belief after the last event; ``signature`` (K, m) the innovations' response, and
    ``gains``, where they are kept.
    """

    x: Floats
    P: Floats
    total: Floats
    outputs: Floats
    energy: Floats
    gained: Floats
    innovation: Floats
    signature: Floats
    gains: Floats
    final: Belief
    log_likelihood: float


def present_effects(vehicle: Vehicle) -> tuple[Effect, ...]:
    """The effects that the vehicle file puts into the model.

    Raises ClutchestError for one that neither the library nor the vehicle's own files know.
    """
    known = dict(vehicle.library)
    for name, curve in vehicle.curves.items():
        known |= {effect.name: effect for effect in curve_effects(name, curve, vehicle.machine)}
    names = vehicle.effect_numbers
    unknown = [name for name in names if name not in known]
    if unknown:
        raise ClutchestError(
            f"{vehicle.path.name}: unknown effect '{unknown[0]}'" + nearest(unknown[0], known)
        )
    return tuple(known[name] for name in names)


def delays(vehicle: Vehicle) -> dict[str, float]:
    """Delay in s that the vehicle's effects put on a signal, the largest where it varies."""
    late: dict[str, float] = {}
    numbers = vehicle.effect_numbers
    for effect in present_effects(vehicle):
        for signal, key in effect.delays.items():
            most = effect.lateness[signal].most if signal in effect.lateness else 1.0
            size = numbers[effect.name].get(key, 0.0)
            late[signal] = late.get(signal, 0.0) + size * most
    return late


def compile_model(
    vehicle: Vehicle,
    model: Model,
    effects: tuple[Effect, ...] | None = None,
    starts: Mapping[str, float] = {},
    noises: Sequence[str] = (),
    wanders: Sequence[str] = (),
    progress: Progress | None = None,
    generate: Callable[[Model, Thetas], tuple[str, str]] = build.generate,
) -> Compiled:
    """The model lowered and loaded, with the vehicle's numbers: for filters, or for what else
    ``generate``, of ``compute.build``, lowers it.

    ``effects`` stand in the equations, unless given those of the vehicle file that the model can
    take; what the file says of an effect holds, others are at gain 0.  ``starts`` names states
    whose first values are thetas too, with their standard deviations; ``noises`` inputs of which
    what they are off by is one, and ``wanders`` states of which what is added to their rate is one.
    """
    if effects is None:
        effects = model.taking(present_effects(vehicle))
    model = model.with_effects(effects)
    lacking = [p.key for p in model.parameters if p.key not in vehicle.parameters]
    if lacking:
        raise ClutchestError(f"{vehicle.path.name}: no parameter {', '.join(lacking)}")
    p = np.array([vehicle.parameters[q.key].value for q in model.parameters])
    g, deviations = model.effect_numbers(vehicle.effect_numbers), vehicle.effect_spreads
    spreads = {q.key: vehicle.parameters[q.key].spread for q in model.parameters}
    # the spread of a state's nominal value is that state's prior
    priors = {*(state.prior for state in model.states), *model.exact}
    uncertain = [key for key, s in spreads.items() if s > 0 and key not in priors]
    thetas = [(PARAMETER, key) for key in uncertain]
    spread = [spreads[key] for key in uncertain]
    for effect in effects:
        stated: Mapping[str, float] = deviations.get(effect.name, {})
        thetas += [(effect.name, n.key) for n in effect.gains]
        spread += [stated.get(n.key, 0.0) for n in effect.gains]
    thetas += [(START, name) for name in starts]
    spread += list(starts.values())
    thetas += [(INPUT_NOISE, name) for name in noises]
    thetas += [(WANDER, name) for name in wanders]
    spread += [0.0] * (len(noises) + len(wanders))
    digest, text = generate(model, tuple(thetas))
    if progress and not build.is_compiled(digest):
        progress("compiling the model, once on this machine", None)
    return Compiled(
        vehicle.machine,
        model,
        generated.load(digest, text),
        digest,
        p,
        np.array(list(g.values())),
        tuple(thetas),
        np.array(spread),
    )


def require_finite(x: Floats) -> None:
    """Raises ClutchestError for an estimate ``x`` (n) that is no longer one."""
    if not np.all(np.isfinite(x)):
        raise ClutchestError(
            "the estimate left the finite numbers: see the parameters' values and the units of "
            "signals"
        )


def run(
    compiled: Compiled,
    timeline: Timeline,
    start: Belief,
    options: FilterOptions = PLAIN,
    *,
    gained: Floats | None = None,
    progress: Progress | None = None,
) -> Filtered:
    """Filter one timeline from ``start``.

    ``gained`` (2, n), the kernel's information so far, is carried on in place.
    """
    n, m, K = len(start.x), len(compiled.thetas), len(timeline.t)
    belief = copied(start)
    gained = np.zeros((2, n)) if gained is None else gained
    rows = empty_rows(compiled, timeline)
    results = EventResults(np.zeros((K, 3)), np.zeros((K if options.keep else 0, m)))
    weighting = _weighting(compiled, K, options)
    regimes, work = regimes_of(timeline), compiled.functions.workspace(timeline.W.shape[1])
    total = 0.0
    for begin in range(0, K, CHUNK):
        if progress:
            progress("filtering", begin / K)
        # a piece starts with the event before it, which has been taken already
        piece = slice(max(begin - 1, 0), min(begin + CHUNK, K))
        events = events_of(timeline, piece, taken=begin > 0)
        total += compiled.functions.run(
            belief,
            gained,
            events,
            regimes,
            compiled.numbers,
            weighting._replace(gains=_cut(weighting.gains, piece)),
            rows,
            EventResults(*(_cut(result, piece) for result in results)),
            work,
        )
    if progress:
        progress("filtering", 1.0)
    require_finite(belief.x)
    return Filtered(*rows, *results, weighting.gains, belief, float(total))


def copied(belief: Belief) -> Belief:
    """An independent copy."""
    return Belief(*(array.copy() for array in belief))


def first_belief(x: Floats, P: Floats, S: Floats) -> Belief:
    """The belief before any slip; arrays as :class:`Belief` has them."""
    n, m = S.shape
    return Belief(x, P, S, np.zeros(2), np.zeros(n), np.zeros(m), np.full(n, -1.0))


def events_of(line: Timeline, piece: slice = slice(None), taken: bool = False) -> Events:
    """A piece of a timeline's events as kernels take them; the first only leads to the others
    where it has been ``taken`` already."""
    sensor, emit = line.sensor[piece], line.emit[piece]
    if taken:
        sensor, emit = sensor.copy(), emit.copy()
        sensor[0] = emit[0] = -1
    return Events(
        line.t[piece], sensor, line.z[piece], line.R[piece], line.u[piece], line.row[piece], emit
    )


def regimes_of(line: Timeline) -> RegimeTables:
    """A timeline's regimes as kernels take them."""
    return RegimeTables(line.W, line.Q, line.longest, line.noise, line.variance)


def _weighting(compiled: Compiled, K: int, options: FilterOptions) -> Weighting:
    """How ``K`` events are weighed."""
    considers = options.consider and options.signature
    width = len(compiled.model.states) + len(compiled.model.doubted)
    gains = np.zeros((K if options.keep else 0, width)) if options.gains is None else options.gains
    return Weighting(
        spread=compiled.spread,
        considered=compiled.spread**2 if considers else np.zeros(0),
        limit=options.limit,
        signature=options.signature,
        gains=gains,
        frozen=options.gains is not None,
    )


def empty_rows(compiled: Compiled, timeline: Timeline) -> RowResults:
    """Room for every row that the timeline emits."""
    n, m = len(compiled.model.states), len(compiled.thetas)
    rows = int(timeline.emit.max(initial=-1)) + 1
    return RowResults(
        x=np.zeros((rows, n)),
        P=np.zeros((rows, n, n)),
        total=np.zeros((rows, n)),
        outputs=np.zeros((rows, len(compiled.model.outputs), 2)),
        energy=np.zeros((rows, 3 + m)),
        gained=np.zeros((rows, n)),
    )


def _cut(values: Floats, piece: slice) -> Floats:
    """A piece of what there is per event; nothing of what is not kept."""
    return values[piece] if len(values) else values
