"""What an actuator has to do for a requested output: a machine's inverse, run along the request."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from clutchest.checked import checked
from clutchest.compute.forward import forward
from clutchest.errors import ClutchestError
from clutchest.estimate.whole_log import present_effects
from clutchest.models.declarations import Inverse
from clutchest.quantity import Quantity
from clutchest.reading import Logs, as_signals
from clutchest.reading.table_columns import TIME
from clutchest.shipped import shipped
from clutchest.shown import Showing, Shown, with_unit
from clutchest.signals import Floats, Signal, Signals
from clutchest.vehicle import BusSignal, SignalMap, Vehicle, load_vehicle

if TYPE_CHECKING:
    import pandas as pd

PERIOD = 1e-3  # s between rows
MET = 0.9  # of the highest request, from which on it is met
LONGEST = 3600.0  # s of a request
MANY, HOLE = 20, 10.0  # values of a request; usual steps that one without a value is longer than
NOTHING = 1e-9  # of the largest value: what is left of a sum that is zero

Request = Signals | Logs | Sequence[Sequence[float]]  # the last: times and values


@dataclass(frozen=True, slots=True, repr=False, eq=False)
class Feedforward(Showing):
    """``columns`` (k,) by name, ``time`` s and the ``request`` first, which ``reached`` answers to,
    with their ``units``, which has those of ``taken`` too: states that come from an estimate,
    others are the vehicle file's."""

    vehicle: str
    request: str
    reached: str
    columns: Mapping[str, Floats]
    units: Mapping[str, str]
    taken: Mapping[str, float]
    warnings: tuple[str, ...] = ()  # of the request

    def shown(self) -> Shown:
        """The range of every column."""
        rows = []
        for name, each in self.ranges.items():
            digits = NOTHING * max(map(abs, each.values()))
            ends = (0.0 if abs(end) < digits else end for end in each.values())
            rows.append((name, self.units[name], *(f"{end:.4g}" for end in ends)))
        taken = ", ".join(self._words(name, value) for name, value in self.taken.items())
        line = f"{self.vehicle}, {len(self.columns['time'])} rows"
        line += f"; estimated: {taken}" if taken else "; by the vehicle file alone"
        line += f"; {self.unmet}" if self.unmet else ""
        return Shown(line, ("column", "unit", "lowest", "highest"), rows)

    def _words(self, name: str, value: float) -> str:
        """A state with its value, in the unit that people read."""
        quantity = Quantity(name, self.units[name])
        shown = float(quantity.read(np.array(value)))
        return f"{quantity.words} {with_unit(f'{shown:.4g}', quantity.shown)}"

    @property
    def unmet(self) -> str:
        """In words, how far the highest request is from being met; empty where it is."""
        asked, given = (np.abs(self.columns[n]).max() for n in (self.request, self.reached))
        if given >= MET * asked:
            return ""
        unit = self.units[self.reached]
        return f"the request is not met: {given:.4g} {unit} at most, of {asked:.4g} {unit}"

    @property
    def ranges(self) -> dict[str, dict[str, float]]:
        """Lowest and highest value of every column."""
        found = {}
        for name, column in self.columns.items():
            found[name] = {"lowest": float(column.min()), "highest": float(column.max())}
        return found

    def to_pandas(self) -> pd.DataFrame:
        """The columns as a table; ``attrs["units"]``: column → unit."""
        import pandas as pd

        table = pd.DataFrame(dict(self.columns))
        table.attrs["units"] = {name: self.units[name] for name in self.columns}
        return table


@checked
def feedforward(
    vehicle: Vehicle | str | Path, request: Request, *, state: Mapping[str, Any] | None = None
) -> Feedforward:
    """The actuator's course for a requested output over time.

    ``request``: times (s) and values, decoded signals, or a log or table of the vehicle that has
    the request; inputs of the equations that it has too are used, others are at their default.
    ``state``: what a replay left (``Run.final``): its estimates of what changes from drive to drive
    take the place of the vehicle file's values.  Raises ClutchestError where the machine declares
    no inverse, without a request, and for a state of another vehicle.
    """
    vehicle = load_vehicle(vehicle)
    machine = vehicle.machine
    inverse = machine.inverse
    if inverse is None:
        raise ClutchestError(
            f"feedforward: machine '{machine.name}' of '{vehicle.name}' declares no inverse; of "
            f"the shipped vehicles {', '.join(_with_inverse())} have one"
        )
    signals = _signals(request, vehicle, inverse)
    time, inputs = _inputs(signals, inverse)
    taken = _taken(vehicle, state)
    model = inverse.model.with_effects(inverse.model.taking(present_effects(vehicle)))
    parameters = {key: parameter.value for key, parameter in vehicle.parameters.items()}
    start = dict.fromkeys((s.name for s in model.states), 0.0)
    start |= machine.at_rest(parameters, {name: float(v[0]) for name, v in inputs.items()})
    columns = forward(model, tuple(inverse.columns)).run(
        parameters,
        start | taken,
        inputs,
        PERIOD,
        round(PERIOD / inverse.step),
        vehicle.effect_numbers,
    )
    if not all(np.isfinite(column).all() for column in columns.values()):
        raise ClutchestError(
            f"the actuator of '{vehicle.name}' leaves the finite numbers: see the parameters"
        )
    asked = {"time": time, inverse.request: inputs[inverse.request]}
    units = {s.name: s.unit for s in model.states if s.name in taken}
    units |= {"time": "s", inverse.request: _unit(inverse), **inverse.columns}
    every = {**asked, **columns}
    of = (vehicle.name, inverse.request, inverse.reached)
    holes = _holes(signals[inverse.request].only_valid())
    return Feedforward(*of, every, units, taken, (*signals.warnings, *holes))


def _with_inverse() -> list[str]:
    """Names of the shipped vehicles whose machine declares an inverse."""
    return [name for name in shipped("vehicles") if load_vehicle(name).machine.inverse is not None]


def _unit(inverse: Inverse) -> str:
    return next(item.unit for item in inverse.model.inputs if item.name == inverse.request)


def _signals(request: Request, vehicle: Vehicle, inverse: Inverse) -> Signals:
    """The request as signals.  Raises ClutchestError where there is none in it."""
    if (columns := _columns(request)) is not None:
        if len(columns) != 2:
            raise ClutchestError(f"request: expected times and values, not {len(columns)} columns")
        try:
            time, value = map(_numbers, columns)
        except (TypeError, ValueError) as problem:
            raise ClutchestError(
                f"request: expected times and values, numbers: {problem}"
            ) from None
        if time.shape != value.shape or time.ndim != 1:
            raise ClutchestError(
                f"request: {time.shape} times and {value.shape} values, expected as many of both"
            )
        request = Signals({inverse.request: Signal.of(inverse.request, "", time, value)})
    request = as_signals(request, _reduced(vehicle, inverse))
    if inverse.request not in request.available:
        has = ", ".join(sorted(request.available)) or "nothing"
        why = "; ".join(("", *request.warnings))
        raise ClutchestError(f"no column '{inverse.request}' in the request, which has {has}{why}")
    return request


def _columns(request: Any) -> list[Any] | None:
    """The columns of a request that is numbers; None of one of paths, tables or signals."""
    logs = (str, Path, Showing)
    if not isinstance(request, tuple | list | np.ndarray):
        return None
    if any(isinstance(each, logs) or hasattr(each, "columns") for each in request):
        return None
    return list(request)


def _numbers(column: Any) -> Floats:
    """A column as numbers.  Raises ValueError where they are none in s or Nm."""
    column = np.asarray(column)
    if column.dtype.kind in "mM":
        raise ValueError("dates, not s")
    return column.astype(np.float64)


def _reduced(vehicle: Vehicle, inverse: Inverse) -> Vehicle:
    """The vehicle without the signals and columns that the inverse does not use."""
    of = {inverse.model.slopes.get(item.name, item.name) for item in inverse.model.inputs}
    # tables may have a request that the vehicle file does not map
    own = SignalMap(inverse.request, BusSignal("", "", ""), noise=1.0)
    signals = {inverse.request: own, **{n: s for n, s in vehicle.signals.items() if n in of}}
    columns = {n: c for n, c in vehicle.columns.items() if n in of or n == TIME}
    return replace(vehicle, signals=signals, columns=columns)


def _holes(request: Signal) -> tuple[str, ...]:
    """In words, the longest time without a value in a request of many; a table of a few corners
    has straight lines between them on purpose."""
    steps = np.diff(request.time)
    if len(steps) < MANY or steps.max() <= HOLE * np.median(steps):
        return ()
    k = int(np.argmax(steps))
    begin, end = request.time[k], request.time[k + 1]
    return (f"{request.name}: no value from {begin:g} to {end:g} s: a straight line is taken",)


def _inputs(signals: Signals, inverse: Inverse) -> tuple[Floats, dict[str, Floats]]:
    """Times of the rows, s, and the inputs of the equations at them."""
    asked = signals[inverse.request].only_valid()
    first, last = float(asked.time[0]), float(asked.time[-1])
    if not 0.0 < last - first <= LONGEST:
        why = "; ".join(("", *signals.warnings))
        raise ClutchestError(
            f"the request lasts {last - first:g} s, expected more than 0 and at most "
            f"{LONGEST:g} s{why}"
        )
    time = first + np.arange(round((last - first) / PERIOD) + 1, dtype=np.float64) * PERIOD
    inputs: dict[str, Floats] = {}
    for item in inverse.model.inputs:
        if (of := inverse.model.slopes.get(item.name)) is not None:
            inputs[item.name] = np.gradient(signals[of].only_valid().at(time), PERIOD)
        elif item.name in signals.available:
            inputs[item.name] = signals[item.name].only_valid().at(time)
        else:
            inputs[item.name] = np.full(len(time), item.default or 0.0)
    return time, inputs


def _taken(vehicle: Vehicle, state: Mapping[str, Any] | None) -> dict[str, float]:
    """Estimates that outlast a drive, from a state file.  Raises ClutchestError for one of another
    vehicle."""
    if state is None:
        return {}
    if state.get("vehicle") != vehicle.name or state.get("contradiction"):
        raise ClutchestError(
            f"state of '{state.get('vehicle')}', expected one of '{vehicle.name}' whose signals "
            "do not contradict the model"
        )
    lasting = {s.name for s in vehicle.machine.states if s.carried and s.parked_noise == 0.0}
    pairs = zip(state.get("states", ()), state.get("x", ()), strict=True)
    return {name: float(value) for name, value in pairs if name in lasting}
