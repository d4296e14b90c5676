"""The filter's start: from the prior, from the last drive, or from it after a standstill."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass, fields, replace
from math import isfinite
from typing import Any

import numpy as np

from clutchest.errors import ClutchestError
from clutchest.estimate.contradiction import Contradiction
from clutchest.estimate.timeline import Timeline
from clutchest.estimate.whole_log import Belief, Compiled, copied, first_belief, run
from clutchest.models.model import Model
from clutchest.shown import with_unit
from clutchest.signals import Floats
from clutchest.vehicle import Vehicle
from clutchest.vehicle.state_uncertainty import prior_std, process_noise

COOLING = 3600.0  # s, time constant at which the inputs of a parked machine go to their new values
LONGEST_SOAK = 48 * 3600.0  # s, after which every temperature has settled
PARKED_STEP = 5.0  # s
ROUNDING = 1e-6  # of a covariance
LARGEST = 1e300  # integers that are still numbers
LATEST_NS = 1 << 63  # of a clock


@dataclass(frozen=True, slots=True)
class History:
    """Sums over the drives so far: how hard the machine is used.

    ``slip_energy_J`` is of the same drives as the rest; the state file's own may be of more.
    ``wear_state`` ± ``wear_std``: the state that wears as it was known first, after ``wear_J`` of
    slip energy, where no state of the model is the rate of its wear.
    """

    driven_s: float = 0.0
    engagements: int = 0
    slip_energy_J: float = 0.0
    wear_J: float = 0.0
    wear_state: float = 0.0
    wear_std: float = 0.0

    @classmethod
    def of(cls, state: Mapping[str, Any] | None) -> History:
        """The history in what :func:`leave` wrote; empty where it has none or nothing is carried
        over.  Raises StateError where it is damaged."""
        history, wanted = (state or {}).get("history", {}), {field.name for field in fields(cls)}
        if not (
            isinstance(history, Mapping)
            and set(history) <= wanted
            and all(_finite(number) and number >= 0 for number in history.values())
        ):
            raise _damaged("history", f"numbers of {', '.join(sorted(wanted))}")
        return cls(**history)

    def after(self, driven_s: float, engagements: int, slip_energy_J: float) -> History:
        """The history with one more drive."""
        return replace(
            self,
            driven_s=self.driven_s + driven_s,
            engagements=self.engagements + engagements,
            slip_energy_J=self.slip_energy_J + slip_energy_J,
        )


def nominal(compiled: Compiled, timeline: Timeline) -> Floats:
    """The state (n) at the first event, of a machine at rest and without effects."""
    model = compiled.model
    inputs = {i.name: timeline.u[0, j] for j, i in enumerate(model.inputs)}
    parameters = {q.key: compiled.p[j] for j, q in enumerate(model.parameters)}
    values = dict(compiled.machine.at_rest(parameters, inputs))
    for i, sensor in enumerate(model.sensors):
        readings = np.flatnonzero(timeline.sensor == i)
        if model.anchor == (sensor.column or sensor.name) and len(readings):
            values[model.anchor] = timeline.z[readings[0]]
    return np.array([values.get(state.name, 0.0) for state in model.states])


def fresh(vehicle: Vehicle, compiled: Compiled, timeline: Timeline) -> Belief:
    """The prior at the first event."""
    x = nominal(compiled, timeline)
    xi, Si = np.zeros(len(x)), np.zeros((len(x), len(compiled.thetas)))
    compiled.functions.initial(x, compiled.p, compiled.g, xi, Si)
    return first_belief(xi, np.diag(prior_std(vehicle, compiled.model) ** 2), Si)


class StateError(ClutchestError):
    """A carried-over state that is damaged, or of another vehicle; the caller names its file."""


def carried_on(
    vehicle: Vehicle,
    compiled: Compiled,
    timeline: Timeline,
    state: Mapping[str, Any],
    start_ns: int | None,
) -> tuple[Belief, str | None]:
    """The belief at the first event, from that at the end of the last drive, and a warning or None.

    ``state`` is what :func:`leave` wrote.  Over a known time of standing, temperatures relax with
    the model; over an unknown one, and where that would take a stiff model millions of steps, they
    start from the prior.  Raises StateError if it is of another vehicle or model, or damaged.
    """
    belief, model = fresh(vehicle, compiled, timeline), compiled.model
    _check(vehicle, compiled, state)
    if state.get("contradiction"):
        return (
            belief,
            "signals and model contradict each other in the drive before: nothing of it is carried "
            "over",
        )
    before = _recalled(compiled, state, belief)
    known = np.array([s.name in state["states"] for s in model.states])
    kept = known & np.array([s.carried for s in model.states])
    warning = None
    first_ns = None if start_ns is None else start_ns + round(timeline.t[0] * 1e9)
    if first_ns is None or state.get("time_ns") is None:
        kept &= np.array([s.parked_noise == 0.0 for s in model.states])
        warning = "no absolute time: temperatures are not carried over from the last drive"
    elif first_ns < state["time_ns"]:
        raise StateError(
            "the log begins before the end of the drive that the carried-over state is from; "
            "give the drives in order of time"
        )
    elif any(s.stiff for s in model.states):  # days in steps of a millisecond
        kept &= np.array([s.parked_noise == 0.0 for s in model.states])
    else:
        before = _parked(
            vehicle, compiled, timeline, before, state, (first_ns - state["time_ns"]) * 1e-9
        )
    belief.x[kept], belief.S[kept], belief.cE[kept] = (
        before.x[kept],
        before.S[kept],
        before.cE[kept],
    )
    both = np.ix_(kept, kept)
    belief.P[both] = before.P[both]
    belief.E[:], belief.sE[:] = before.E, before.sE
    return belief, warning


def carried_states(model: Model, state: Mapping[str, Any] | None) -> frozenset[str]:
    """Those that begin as ``state`` left them, however long ago; none where it is not believed."""
    if state is None or state.get("contradiction"):
        return frozenset()
    kept = (s.name for s in model.states if s.carried and s.parked_noise == 0.0)
    return frozenset(kept) & frozenset(state["states"])


def leave(
    vehicle: Vehicle,
    compiled: Compiled,
    timeline: Timeline,
    belief: Belief,
    start_ns: int | None,
    history: History,
) -> dict[str, Any]:
    """The state that the next drive starts from, ready for JSON."""
    inputs = [i.name for i in compiled.model.inputs]
    return {
        "vehicle": vehicle.name,
        "model": compiled.model.name,
        "states": [state.name for state in compiled.model.states],
        "time_ns": None if start_ns is None else start_ns + round(timeline.t[-1] * 1e9),
        "x": belief.x.tolist(),
        "P": belief.P.tolist(),
        "thetas": [list(theta) for theta in compiled.thetas],
        "signature": belief.S.tolist(),
        "inputs": dict(zip(inputs, timeline.u[-1].tolist(), strict=True)),
        "slip_energy": belief.E.tolist(),
        "slip_energy_covariance": belief.cE.tolist(),
        "slip_energy_signature": belief.sE.tolist(),
        "history": asdict(_with_wear(vehicle, compiled, belief, history)),
    }


def _with_wear(vehicle: Vehicle, compiled: Compiled, belief: Belief, history: History) -> History:
    """The history, with the state that wears once it is known for the first time."""
    model, wear = compiled.model, compiled.machine.wear
    if wear is None or wear.rate_state or history.wear_std > 0.0:
        return history
    state = model.states[model.state(wear.state)]
    std = float(np.sqrt(belief.P[model.state(wear.state), model.state(wear.state)]))
    useful = vehicle.estimation.get(state.name, state).useful_std
    if state.name in model.unobservable or not 0.0 < std <= useful:
        return history
    value = max(float(belief.x[model.state(wear.state)]), 0.0)
    return replace(history, wear_J=history.slip_energy_J, wear_state=value, wear_std=std)


def contradicted(left: dict[str, Any], found: Contradiction | None) -> dict[str, Any]:
    """What a drive leaves, which says so where signals and model contradict each other in it."""
    return {**left, "contradiction": found.words} if found else left


def _check(vehicle: Vehicle, compiled: Compiled, state: Mapping[str, Any]) -> None:
    required = {
        "model",
        "states",
        "x",
        "P",
        "signature",
        "thetas",
        "inputs",
        "slip_energy",
        "slip_energy_covariance",
        "slip_energy_signature",
    }
    if lacking := required - set(state):
        raise StateError(
            f"the carried-over state has no {', '.join(sorted(lacking))}; expected what a replay "
            "has left: Run.final, or the contents of its state.json"
        )
    if state["model"] != compiled.model.name:
        raise StateError(
            f"the carried-over state is of model '{state['model']}', not '{compiled.model.name}'"
        )
    if state.get("vehicle", vehicle.name) != vehicle.name:
        raise StateError(
            f"the carried-over state is of vehicle '{state['vehicle']}', not '{vehicle.name}'"
        )
    names = state["states"]
    if not (isinstance(names, list) and all(isinstance(name, str) for name in names)):
        raise StateError("the carried-over state is damaged: 'states' must be a list of names")
    known = [s.name for s in compiled.model.states]
    if not set(known) & set(names):
        raise StateError(f"the carried-over state has none of the states {', '.join(known)}")
    _check_numbers(state, len(names))
    _check_possible(compiled, state)


def _check_numbers(state: Mapping[str, Any], n: int) -> None:
    """Shapes and finite numbers, which the compiled kernel does not check."""
    thetas = state["thetas"]
    if not (
        isinstance(thetas, list)
        and all(
            isinstance(pair, list | tuple)
            and len(pair) == 2
            and all(isinstance(p, str) for p in pair)
            for pair in thetas
        )
    ):
        raise _damaged("thetas", "a list of pairs of names")
    shapes = {
        "x": (n,),
        "P": (n, n),
        "signature": (n, len(thetas)),
        "slip_energy": (2,),
        "slip_energy_covariance": (n,),
        "slip_energy_signature": (len(thetas),),
    }
    for key, shape in shapes.items():
        try:
            given = np.array(state[key])
            numbers = given.astype(np.float64) if given.dtype.kind in "iuf" else np.zeros(0)
        except (TypeError, ValueError, OverflowError):
            numbers = np.zeros(0)
        if numbers.shape != shape or not np.all(np.isfinite(numbers)):
            raise _damaged(key, f"{' × '.join(map(str, shape))} finite numbers")
    P = np.array(state["P"], np.float64)
    scale = np.sqrt(np.maximum(np.diag(P), 1e-300))
    correlation = P / np.outer(scale, scale)
    if np.any(np.diag(P) < 0) or not np.all(np.isfinite(correlation)):
        raise _damaged("P", "a covariance: no variance below zero")
    if np.abs(P - P.T).max(initial=0.0) > ROUNDING * np.abs(P).max(initial=0.0) or (
        np.linalg.eigvalsh((correlation + correlation.T) / 2).min(initial=0.0) < -ROUNDING
    ):
        raise _damaged("P", "a covariance: symmetric and positive semidefinite")
    if state["slip_energy"][1] < 0:
        raise _damaged("slip_energy", "an energy and its variance, not below zero")
    inputs = state["inputs"]
    if not (isinstance(inputs, Mapping) and all(map(_finite, inputs.values()))):
        raise _damaged("inputs", "names with finite numbers")
    time = state.get("time_ns")
    if time is not None and (
        isinstance(time, bool) or not isinstance(time, int) or abs(time) >= LATEST_NS
    ):
        raise _damaged("time_ns", "a whole number of ns or null")


def _check_possible(compiled: Compiled, state: Mapping[str, Any]) -> None:
    """Every value is physically possible; what a contradicted drive left is not carried over."""
    numbers = dict(
        zip(state["states"], zip(state["x"], np.diag(state["P"]), strict=True), strict=True)
    )
    for each in () if state.get("contradiction") else compiled.model.states:
        value, variance = numbers.get(each.name, (None, 0.0))
        if value is None:
            continue
        (low, high), margin = each.possible, 3.0 * float(np.sqrt(variance))
        if not low - margin <= value <= high + margin:
            shown = with_unit(f"{value:.4g}", each.unit)
            raise _damaged("x", f"physically possible: {each.name} is {shown}")


def _damaged(key: str, expected: str) -> StateError:
    return StateError(f"the carried-over state is damaged: '{key}' must be {expected}")


def _finite(value: Any) -> bool:
    if isinstance(value, bool) or not isinstance(value, int | float):
        return False
    return isfinite(value) if isinstance(value, float) else abs(value) < LARGEST


def _recalled(compiled: Compiled, state: Mapping[str, Any], fresh: Belief) -> Belief:
    """The carried-over values of the states and thetas that the model has now; else ``fresh`` ones.

    Matched by name: effects may have been added to the vehicle file, or removed, since.
    """
    names, thetas = list(state["states"]), [tuple(theta) for theta in state["thetas"]]
    here = [i for i, s in enumerate(compiled.model.states) if s.name in names]
    there = [names.index(compiled.model.states[i].name) for i in here]
    k_here = [k for k, theta in enumerate(compiled.thetas) if theta in thetas]
    k_there = [thetas.index(compiled.thetas[k]) for k in k_here]
    belief = copied(fresh)
    signature = np.array(state["signature"]).reshape(len(names), len(thetas))
    belief.x[here] = np.array(state["x"])[there]
    belief.P[np.ix_(here, here)] = np.array(state["P"])[np.ix_(there, there)]
    belief.S[here] = 0.0
    belief.S[np.ix_(here, k_here)] = signature[np.ix_(there, k_there)]
    belief.E[:] = state["slip_energy"]
    belief.cE[here] = np.array(state["slip_energy_covariance"])[there]
    belief.sE[k_here] = np.array(state["slip_energy_signature"])[k_there]
    return belief


def _parked(
    vehicle: Vehicle,
    compiled: Compiled,
    timeline: Timeline,
    belief: Belief,
    state: Mapping[str, Any],
    span: float,
) -> Belief:
    """The belief after standing for ``span`` s, with inputs going to their new values."""
    model = compiled.model
    span = min(span, LONGEST_SOAK)
    if span <= 0.0:
        return belief
    t = np.concatenate([[0.0], np.geomspace(min(1.0, span / 2), span, 200)])
    towards = 1.0 - np.exp(-t / COOLING)
    u = np.empty((len(t), len(model.inputs)))
    for j, item in enumerate(model.inputs):
        a, b = state["inputs"].get(item.name, timeline.u[0, j]), timeline.u[0, j]
        u[:, j] = a + (b - a) * towards
    nothing, rows = np.zeros(len(t)), len(timeline.longest)
    quiet = replace(
        timeline,
        t=t,
        sensor=np.full(len(t), -1, np.int8),
        z=nothing,
        R=nothing,
        u=u,
        row=np.zeros(len(t), np.int64),
        Q=np.tile(process_noise(vehicle, model, True), (rows, 1)),
        longest=np.full(rows, PARKED_STEP),
        emit=np.full(len(t), -1, np.int64),
    )
    return run(compiled, quiet, belief).final
