"""How probable a drive is by the program's own model, with an extension and without.

No oracle: what is hidden, and how large it is, is said by ``oracle``.  What an extended vehicle
file is worth can be said only by the model that it extends, with curves of its own among its terms.
The drive is linearised at the truck's own numbers (parameters and first states, fitted within their
priors); what a cause does is read off a drive without noise, so that no luck is in it.
"""

from __future__ import annotations

from collections.abc import Sequence
from copy import copy
from dataclasses import dataclass, replace
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import lsq_linear

from blind.drives import Drive
from blind.outsiders import Outsider
from clutchest.errors import ClutchestError
from clutchest.inference.input_noise_covariance import InputNoiseCovariance
from clutchest.inference.noise_model import NoiseModel
from clutchest.inference.prepared_drive import PreparedDrive
from clutchest.inference.problem import Problem
from clutchest.inference.unknowns import Shapes, UnknownGain
from clutchest.models import machine_of
from clutchest.signals import Floats, Signals
from clutchest.simulated import Effects
from clutchest.vehicle import Vehicle

FAR = 5.0  # standard deviations; what is further off is no noise
NOMINAL: Shapes = MappingProxyType({})
STEPS, SETTLED = 12, 0.05  # Gauss–Newton: at most so many, until so little is promised
KINK = 0.1  # s
SHARES = (0.125, 0.25, 0.5, 1.0)  # of a cause
COOLING = (1e6, 1e5, 1e4, 1e3, 1e2, 10.0, 1.0)  # a truck's own numbers lie far from the file's
LOST = 25.0  # d′, from which on a fit may have strayed: no cause is hidden so large


@dataclass(frozen=True)
class Twin:
    """A drive without noise as a cause in it ``grew``; the whole of it, ``signals``, comes last."""

    signals: Signals
    grew: tuple[Problem, ...]

    @property
    def problem(self) -> Problem:
        return self.grew[-1]


@dataclass(frozen=True)
class Look:
    """A drive at the numbers ``theta`` (m), made white: residuals ``r`` (K), their derivatives
    ``psi`` (K, m); ``pull`` (m): nuisances less the truck's own, in standard deviations."""

    theta: Floats
    r: Floats
    psi: Floats
    pull: Floats

    @property
    def cost(self) -> float:
        """−2 ln(probability) up to a constant."""
        return float(self.r @ self.r + self.pull @ self.pull)


class Likelihood:
    """Of one drive; ``scenario``: of another one by the same truck."""

    def __init__(self, drive: Drive, scenario: str | None = None) -> None:
        self.drive, self.scenario, self.vehicle = drive, scenario, drive.vehicle
        self.effects = machine_of(drive.vehicle.model).effects
        noisy = self._problem(drive.signals(scenario=scenario))
        self.thetas, self.nuisances = noisy.thetas, noisy.nuisances
        self.centre, self.noise_model = np.zeros(len(self.thetas)), None
        self.exact = self._problem(self._exact())
        near = self._cooled(self.exact, self.centre)
        for _ in range(2):  # a drive begins where its own noisy readings say: fitted anew
            self.noise_model = self._colour_of(noisy, self._fit(noisy, near).theta)
        self.centre = self._fit(self.exact, near).theta  # from here on the truck's own numbers
        settled = self._fit(self.exact, self.centre)
        self.clean = self._look(self.exact, settled.theta, NOMINAL)

    def _problem(self, signals: Signals) -> Problem:
        return Problem.of(signals, self.vehicle, tuple(self.effects.values()))

    def _extended(self, vehicle: Vehicle, signals: Signals) -> tuple[Likelihood, Problem]:
        """One that has another model of the same truck and no cause to free; and its drive."""
        other = copy(self)
        # a delay too small to be a cause belongs to the truck
        other.effects = {name: effect for name, effect in self.effects.items() if effect.delays}
        other.vehicle = vehicle
        problem = other._problem(signals)
        other.thetas, other.nuisances = problem.thetas, problem.nuisances
        other.centre = other._taken(self, self.centre)
        return other, problem

    def _taken(self, other: Likelihood, theta: Floats) -> Floats:
        """What another one has at ``theta``, its causes aside."""
        own = {
            str(t): value
            for t, value in zip(other.thetas, theta, strict=True)
            if not isinstance(t, UnknownGain)
        }
        return np.array([own.get(str(t), 0.0) for t in self.thetas])

    def _exact(self, effects: Effects | None = None, outsider: Outsider | None = None) -> Signals:
        return self.drive.signals(effects, outsider, noiseless=True, scenario=self.scenario)

    def twin(self, effects: Effects | None = None, outsider: Outsider | None = None) -> Twin:
        """The drive with a cause in it and no noise."""
        grew = [self._exact(*self._shared(effects, outsider, share)) for share in SHARES]
        return Twin(grew[-1], tuple(map(self._problem, grew)))

    def _shared(
        self, effects: Effects | None, outsider: Outsider | None, share: float
    ) -> tuple[Effects, Outsider | None]:
        """``share`` of a cause: its gains, not its shapes."""
        gains = {(t.effect, t.key) for t in self.thetas if isinstance(t, UnknownGain)}
        less = {
            name: {
                key: value * (share if (name, key) in gains else 1.0)
                for key, value in numbers.items()
            }
            for name, numbers in (effects or {}).items()
        }
        return less, outsider and replace(outsider, size=share * outsider.size)

    def _look(
        self,
        problem: Problem,
        theta: Floats,
        shapes: Shapes,
        heat: float = 1.0,
        causes: Sequence[str] | None = None,
    ) -> Look:
        """A drive at ``theta``; of gains, derivatives by those of ``causes``, all unless given."""
        active = None if causes is None else np.append(self.nuisances, self._columns(causes))
        at = problem.implied(theta, shapes)
        [rows], [drive] = problem.linearise(theta, shapes, active, at), problem.drives
        readings = drive.readings
        white = np.column_stack([rows.r, rows.psi])
        if self.noise_model is not None:
            both = np.column_stack([readings.input_noise, white])
            both = self.noise_model.whiten(readings.stretches, both)[_telling(drive)]
            directions, white = np.split(both, [readings.input_noise.shape[1]], axis=1)
            InputNoiseCovariance.of(directions).whiten_in_place(white)
        white /= np.sqrt(heat)
        pull = np.zeros(len(theta))
        pull[self.nuisances] = (theta - self.centre)[self.nuisances]
        return Look(theta, white[:, 0], white[:, 1:], pull)

    def _colour_of(self, problem: Problem, theta: Floats) -> NoiseModel:
        """That of the noise: of what no nuisance explains of a drive without a cause."""
        none = np.zeros(0, np.int64)
        [drive], [rows] = problem.drives, problem.linearise(theta, NOMINAL, none)
        return NoiseModel.fit([drive.readings.stretches], [np.clip(rows.r, -FAR, FAR)])

    # --- gains -------------------------------------------------------------------------------

    def gains(self, twin: Twin, vehicle: Vehicle | None) -> tuple[float, float]:
        """−ln(probability) of a twin that another model of the same truck gains, nought without
        one, and that the model which knows what is hidden does.  The other's numbers are found
        from those that come nearest without a cause and with those causes that it names."""
        looks = [self._followed(twin)]
        possible = self._beyond(looks[0].cost) ** 2 / 2.0
        if vehicle is None:
            return 0.0, possible
        if named := tuple(name for name in vehicle.effects if name in self.effects):
            looks.append(self._followed(twin, named))
        other, problem = self._extended(vehicle, twin.signals)
        found = [other._fit(problem, other._taken(self, look.theta)) for look in looks]
        return possible - other._beyond(min(look.cost for look in found)) ** 2 / 2.0, possible

    def _beyond(self, cost: float) -> float:
        return float(np.sqrt(max(cost - self.clean.cost, 0.0)))

    def _followed(self, twin: Twin, causes: Sequence[str] = (), shapes: Shapes = NOMINAL) -> Look:
        """The most probable numbers, with the gains of ``causes`` free, followed up as what is
        hidden grows: looked for at once, they stray where they bend."""
        near = self.centre
        for problem in twin.grew:
            begins = near, self.centre + 2.0 * (near - self.centre)
            looks = [self._look(problem, begin, shapes, causes=causes) for begin in begins]
            best = min(looks, key=lambda look: look.cost)
            look = self._fit(problem, best.theta, causes, shapes)
            if self._beyond(look.cost) > LOST:
                begin = self._cooled(problem, best.theta, causes, shapes)
                again = self._fit(problem, begin, causes, shapes)
                look = min(look, again, key=lambda look: look.cost)
            near = look.theta
        return look

    def _cooled(
        self,
        problem: Problem,
        begin: Floats,
        causes: Sequence[str] = (),
        shapes: Shapes = NOMINAL,
    ) -> Floats:
        """Numbers (m) near the most probable ones, from a ``begin`` (m) far off."""
        for heat in COOLING:
            begin = self._fit(problem, begin, causes, shapes, heat).theta
        return begin

    def _fit(
        self,
        problem: Problem,
        begin: Floats,
        causes: Sequence[str] = (),
        shapes: Shapes = NOMINAL,
        heat: float = 1.0,
    ) -> Look:
        """The most probable numbers from ``begin`` (m) on, with the gains of ``causes`` free:
        Gauss–Newton.  ``heat``: by how much the noise seems to have more variance than it has."""
        columns = self._columns(causes)
        look = self._look(problem, begin, shapes, heat, causes)
        for _ in range(STEPS):
            step, promised = self._step(look, columns)
            if look.cost - promised < SETTLED:
                break
            for share in (1.0, 0.5, 0.25, 0.1):
                try:
                    tried = self._look(problem, look.theta + share * step, shapes, heat, causes)
                except ClutchestError:  # so far off that the equations leave the finite numbers
                    continue
                if tried.cost < look.cost:
                    break
            else:
                break
            look = tried
        return look

    def _step(self, look: Look, columns: NDArray[np.int64]) -> tuple[Floats, float]:
        """The step (m) to where the linearised cost is least, and that cost; gains within their
        plausible sizes."""
        own, pull = look.psi[:, self.nuisances], look.pull[self.nuisances]
        whole = np.column_stack([look.psi[:, columns], look.r])
        curvature, across = own.T @ own + np.eye(own.shape[1]), own.T @ whole
        across[:, -1] += pull
        answer = np.linalg.solve(curvature, across)
        inner = whole.T @ whole - across.T @ answer
        a, b, c = inner[:-1, :-1], inner[:-1, -1], inner[-1, -1] + pull @ pull
        gains = self._within(a, b, columns, look.theta[columns])
        step = np.zeros(len(look.theta))
        step[columns] = gains
        step[self.nuisances] = -answer[:, -1] - answer[:, :-1] @ gains
        return step, float(c + gains @ a @ gains + 2.0 * gains @ b)

    def _within(self, a: Floats, b: Floats, columns: NDArray[np.int64], at: Floats) -> Floats:
        """Steps of gains ``at`` that minimise gᵀ a g + 2 gᵀ b and leave them plausible."""
        if not len(columns):
            return np.zeros(0)
        low, high = np.array([self._range(i) for i in columns]).T
        values, vectors = np.linalg.eigh(a)
        root = np.sqrt(np.maximum(values, 1e-9 * max(values[-1], 1e-9)))
        target = -(vectors.T @ b) / root
        bounds = (low - at, high - at)
        return np.asarray(lsq_linear(root[:, None] * vectors.T, target, bounds).x)

    def _range(self, index: int) -> tuple[float, float]:
        """The plausible range of a gain in its own unit."""
        gain = self.thetas[index]
        assert isinstance(gain, UnknownGain)
        return gain.lower, gain.upper

    def _columns(self, causes: Sequence[str]) -> NDArray[np.int64]:
        """The gains of these effects."""
        columns = [
            i
            for i, t in enumerate(self.thetas)
            if isinstance(t, UnknownGain) and t.effect in causes
        ]
        return np.array(columns, np.int64)


def _telling(drive: PreparedDrive) -> NDArray[np.bool_]:
    """Which readings tell of the clutch, shape (K,): all but speeds while it is locked, and those
    just after, when the straight lines between samples have yet to catch up with the kink."""
    readings = drive.readings
    free = drive.compiled.model.regime.index("free_running")
    flags = drive.line.W[drive.line.row, free] > 0
    begins = drive.line.t[1:][flags[1:] & ~flags[:-1]]
    last = np.searchsorted(begins, readings.t, side="right") - 1
    since = readings.t - np.where(last >= 0, begins[np.maximum(last, 0)], -np.inf)
    slow = drive.line.W[readings.row, free] == 0
    renewed = np.isin(
        readings.sensor, [drive.compiled.model.sensor(n) for n in drive.compiled.model.renewed]
    )
    return ~renewed | (~slow & (since > KINK))
