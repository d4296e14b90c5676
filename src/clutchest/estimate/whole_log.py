"""The compiled filter over a whole drive."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields
from types import ModuleType

import numpy as np

from clutchest.compute import build
from clutchest.compute.lower import NOISE, START
from clutchest.errors import ClutchestError, nearest
from clutchest.estimate.timeline import Timeline
from clutchest.models.effects import Effect, effects_of_file
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


@dataclass(slots=True)
class Belief:
    """State ``x`` (n), covariance ``P`` (n, n), and the response ``S`` (n, m) to every theta.

    The slip energy so far, which no measurement corrects: ``E`` (2) J and its variance, ``cE`` (n)
    its covariance with x, ``sE`` (m) its response to every theta.  ``held`` (n): the standard
    deviations that equations use, as the last reading left them; negative before the first.
    """

    x: Floats
    P: Floats
    S: Floats
    E: Floats
    cE: Floats
    sE: Floats
    held: Floats

    @classmethod
    def of(cls, x: Floats, P: Floats, S: Floats) -> Belief:
        """Before any slip."""
        return cls(
            x, P, S, np.zeros(2), np.zeros(len(x)), np.zeros(S.shape[1]), np.full(len(x), -1.0)
        )

    def copy(self) -> Belief:
        """An independent copy."""
        return Belief(*(getattr(self, f.name).copy() for f in fields(self)))


@dataclass(frozen=True, slots=True)
class Filtered:
    """What the kernel gives for one timeline; rows as ``Timeline.emit`` numbers them.

    ``x`` (r, n), ``P`` (r, n, n), ``total`` (r, n) variance with the parameters' spreads,
    ``outputs`` (r, outputs, 2) value and variance, ``energy`` (r, 3 + m),
    ``gained`` (r, n) the information in nats that measurements gave so far; per event
    ``innovation`` (K, 3): innovation, its predicted and its used variance.  ``final`` is the
    belief after the last event; ``signature`` (K, m) the innovations' response, if asked for.
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
    known = dict(vehicle.machine.effects)
    for path in vehicle.effects_files:
        known |= effects_of_file(path)
    unknown = [name for name in vehicle.effects if name not in known]
    if unknown:
        raise ClutchestError(
            f"{vehicle.path.name}: unknown effect '{unknown[0]}'" + nearest(unknown[0], known)
        )
    return tuple(known[name] for name in vehicle.effects)


def delays(vehicle: Vehicle) -> dict[str, float]:
    """Delay in s that the vehicle's effects put on a signal, the largest where it varies."""
    late: dict[str, float] = {}
    for effect in present_effects(vehicle):
        for signal, key in effect.delays.items():
            most = effect.lateness[signal].most if signal in effect.lateness else 1.0
            size = vehicle.effects[effect.name].get(key, 0.0)
            late[signal] = late.get(signal, 0.0) + size * most
    return late


def compile_model(
    vehicle: Vehicle,
    model: Model,
    effects: tuple[Effect, ...] | None = None,
    starts: Mapping[str, float] = {},
    noises: Sequence[str] = (),
    progress: Progress | None = None,
) -> Compiled:
    """The model lowered and loaded, with the vehicle's numbers.

    ``effects`` stand in the equations, unless given those of the vehicle file that the model can
    take; what the file says of an effect holds, others are at gain 0.  ``starts`` names states
    whose first values are thetas too, with their standard deviations; ``noises`` inputs of which
    what they are off by is one.
    """
    if effects is None:
        effects = model.taking(present_effects(vehicle))
    model = model.with_effects(effects)
    lacking = [p.key for p in model.parameters if p.key not in vehicle.parameters]
    if lacking:
        raise ClutchestError(f"{vehicle.path.name}: no parameter {', '.join(lacking)}")
    p = np.array([vehicle.parameters[q.key].value for q in model.parameters])
    g = []
    for effect in effects:
        given: Mapping[str, float] = vehicle.effects.get(effect.name, {})
        g += [given.get(n.key, n.default if n.shape else 0.0) for n in effect.parameters]
    spreads = {q.key: vehicle.parameters[q.key].spread for q in model.parameters}
    # the spread of a state's nominal value is that state's prior
    priors = {state.prior for state in model.states}
    uncertain = [key for key, s in spreads.items() if s > 0 and key not in priors]
    thetas = [("parameter", key) for key in uncertain]
    spread = [spreads[key] for key in uncertain]
    for effect in effects:
        stated: Mapping[str, float] = vehicle.effects_spread.get(effect.name, {})
        thetas += [(effect.name, n.key) for n in effect.gains]
        spread += [stated.get(n.key, 0.0) for n in effect.gains]
    thetas += [(START, name) for name in starts]
    spread += list(starts.values())
    thetas += [(NOISE, name) for name in noises]
    spread += [0.0] * len(noises)
    digest, text = build.generate(model, tuple(thetas))
    if progress and not build.is_compiled(digest):
        progress("compiling the model, once on this machine", None)
    return Compiled(
        vehicle.machine,
        model,
        build.load(digest, text),
        digest,
        p,
        np.array(g),
        tuple(thetas),
        np.array(spread),
    )


def run(
    compiled: Compiled,
    timeline: Timeline,
    start: Belief,
    *,
    limit: float = ROBUST_LIMIT,
    with_signature: bool = True,
    keep_signature: bool = False,
    consider: bool = False,
    keep_gains: bool = False,
    frozen: Floats | None = None,
    gained: Floats | None = None,
    progress: Progress | None = None,
) -> Filtered:
    """Filter one timeline from ``start``.

    With ``consider`` the gains weigh the parameters' spreads, and innovations are judged with
    them; without, the filter takes the parameters for true and only its stated uncertainty has
    the spreads (``with_signature``).  ``frozen`` gains (K, n) replace the filter's own, so that
    two runs differ by the model alone; ``keep_gains`` and ``keep_signature`` fill those arrays.
    ``gained`` (2, n), the kernel's information so far, is carried on in place.
    """
    n, m, K = len(start.x), len(compiled.thetas), len(timeline.t)
    rows = int(timeline.emit.max(initial=-1)) + 1
    outputs = len(compiled.model.outputs)
    belief = start.copy()
    gained = np.zeros((2, n)) if gained is None else gained
    considered = compiled.spread**2 if consider and with_signature else np.zeros(0)
    width = n + len(compiled.model.doubted)
    gains = np.zeros((K if keep_gains else 0, width)) if frozen is None else frozen
    out = (
        np.zeros((rows, n)),
        np.zeros((rows, n, n)),
        np.zeros((rows, n)),
        np.zeros((rows, outputs, 2)),
        np.zeros((rows, 3 + m)),
        np.zeros((rows, n)),
    )
    innovation = np.zeros((K, 3))
    signature = np.zeros((K if keep_signature else 0, m))
    total = 0.0
    for begin in range(0, K, CHUNK):
        if progress:
            progress("filtering", begin / K)
        # a piece starts with the event before it, which has been taken already
        piece = slice(max(begin - 1, 0), min(begin + CHUNK, K))
        sensor, emit = timeline.sensor[piece].copy(), timeline.emit[piece].copy()
        if begin:
            sensor[0] = emit[0] = -1
        total += compiled.functions.run(
            belief.x,
            belief.P,
            belief.S,
            belief.E,
            belief.cE,
            belief.sE,
            belief.held,
            gained,
            compiled.spread,
            considered,
            timeline.t[piece],
            sensor,
            timeline.z[piece],
            timeline.R[piece],
            timeline.u[piece],
            timeline.row[piece],
            timeline.W,
            timeline.Q,
            timeline.longest,
            timeline.noise,
            timeline.variance,
            compiled.p,
            compiled.g,
            limit,
            emit,
            with_signature,
            frozen is not None,
            gains[piece] if len(gains) else gains,
            *out,
            innovation[piece],
            signature[piece] if len(signature) else signature,
        )
    if progress:
        progress("filtering", 1.0)
    if not np.all(np.isfinite(belief.x)):
        raise ClutchestError("the estimate left the finite numbers: see the parameters' values")
    return Filtered(*out, innovation, signature, gains, belief, float(total))
