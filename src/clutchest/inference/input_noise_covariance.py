"""What noise of the inputs does to states that no reading corrects.

The clutch is heated by the torque at a measured position and the slip of a measured speed, and
their noise is summed up in its temperatures: a random walk that parameters and causes would
otherwise have to explain, since a fit takes everything for exact that it does not estimate.  So
readings are known to scatter along certain directions, each that of the noise in one part of the
drive.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from clutchest.casadi_later import one_at_a_time
from clutchest.inference.linearisation import Modulation, modulated
from clutchest.inference.noise_model import NoiseModel, Stretches
from clutchest.inference.operating_point import ModelNumbers
from clutchest.inference.prepared_drive import PreparedDrive
from clutchest.inference.unknowns import InputNoise, of_compiled
from clutchest.models.model import Model
from clutchest.signals import Floats
from clutchest.vehicle import Vehicle
from clutchest.vehicle.state_uncertainty import prior_std

ENTRIES = 1e7  # of derivatives, held at a time
PARTS = 64  # of a drive, with as much noise in each
SOME = 1024  # readings that are whitened at a time: as many as a processor's own memory holds
LEAST = 0.3  # standard deviations of all readings together; noise that shows less is left out


@one_at_a_time
def taken_in(model: Model) -> list[str]:
    """Names of the inputs that states without readings of their own take in."""
    e = model.expressions()
    depends = ca.which_depends(_rates(model, e.rate), e.u, 1, False)
    return [item.name for item, does in zip(model.inputs, depends, strict=True) if does]


def _rates(model: Model, rate: ca.SX) -> ca.SX:
    return rate[[i for i, state in enumerate(model.states) if state.name not in model.followed]]


@np.errstate(over="ignore", invalid="ignore")  # where the equations run away
def input_noise_directions(drive: PreparedDrive, numbers: ModelNumbers, vehicle: Vehicle) -> Floats:
    """What the noise does to the readings of a drive at these ``numbers``, in their standard
    deviations: columns (K, c), each to be taken a number of times that is normal, of variance 1."""
    compiled, line, at = drive.compiled, drive.line, drive.at_nominal
    span = np.diff(line.t, prepend=line.t[0])
    rates = _taken_in(drive, vehicle)
    thetas, parts = list[int](), list[tuple[NDArray[np.int64], Floats]]()
    for k, unknown in enumerate(of_compiled(compiled, {})):
        if not isinstance(unknown, InputNoise):
            continue
        j = compiled.model.input(unknown.input)
        grown = np.cumsum(line.noise[j] * rates[j] ** 2 * span)  # variance of the random walk
        if not 0.0 < grown[-1] < np.inf:
            continue
        part = np.minimum(PARTS * grown / grown[-1], PARTS - 1).astype(int)
        # larger where noise does more: then all noise of a part does what one such number does
        own = np.bincount(part, rates[j] ** 2 * span, minlength=PARTS)
        size = np.sqrt(line.noise[j] / np.where(own > 0.0, own, np.inf))
        thetas.append(k)
        parts.append((part, rates[j] * size[part]))
    readings = len(drive.readings.t)
    every, some = [np.zeros((readings, 0))], max(int(ENTRIES / max(PARTS * readings, 1)), 1)
    for begin in range(0, len(parts), some):  # several in one run, as many as memory holds
        of = np.repeat(thetas[begin : begin + some], PARTS)
        basis = np.zeros((len(span), len(of)))
        for i, (part, value) in enumerate(parts[begin : begin + some]):
            basis[np.arange(len(span)), PARTS * i + part] = value
        columns = modulated(drive, numbers, at, of, Modulation(basis, np.arange(len(of))))
        columns /= drive.readings.std[:, None]
        every += map(main_directions, np.split(columns, len(of) // PARTS, axis=1))
    return main_directions(np.column_stack(every))


@np.errstate(over="ignore", invalid="ignore")
def main_directions(columns: Floats) -> Floats:
    """Columns (K, c) turned into fewer, orthogonal ones, without directions that hardly show; none
    where the equations run away."""
    square = columns.T @ columns
    if not np.isfinite(square).all():
        return columns[:, :0]
    strength, turned = np.linalg.eigh(square)
    return columns @ turned[:, strength > LEAST**2]


def shown(directions: Floats, share: float) -> Floats:
    """A ``share`` of orthogonal columns (K, c), of those that still show."""
    strength = share * np.linalg.norm(directions, axis=0)
    return share * directions[:, strength > LEAST]


@dataclass(frozen=True, slots=True)
class InputNoiseCovariance:
    """Of white readings (K), as columns (K, c): ``along`` orthonormal directions (K, d) that show,
    how ``strong`` (d) each is, and what it is made of, ``turned`` (c, d)."""

    along: Floats
    strong: Floats
    turned: Floats

    @classmethod
    def of(cls, columns: Floats) -> InputNoiseCovariance:
        """Of the columns (K, c) themselves."""
        squares, turned = np.linalg.eigh(columns.T @ columns)
        shows = squares > LEAST**2
        strong, turned = np.sqrt(squares[shows]), turned[:, shows]
        return cls(columns @ (turned / strong), strong, turned)

    def whiten_in_place(self, table: Floats) -> None:
        """Take from white readings (K, k) what makes them scatter more along these directions."""
        more = 1.0 - 1.0 / np.sqrt(1.0 + self.strong**2)
        share = more[:, None] * (self.along.T @ table)
        for begin in range(0, len(table), SOME):  # memory for some, not for all
            rows = slice(begin, begin + SOME)
            table[rows] -= self.along[rows] @ share

    def probable(self, white: Floats) -> Floats:
        """How often (c) each column is most probably in ``white`` readings (K)."""
        share = self.strong / (1.0 + self.strong**2)
        return self.turned @ (share * (self.along.T @ white))


@one_at_a_time
def _taken_in(drive: PreparedDrive, vehicle: Vehicle) -> Floats:
    """Derivatives (nu, K) of the rates of states that no reading corrects by every input; of their
    sum, each in its prior's standard deviations."""
    compiled, line = drive.compiled, drive.line
    model = compiled.model
    e = model.expressions()
    if all(state.name in model.followed for state in model.states):
        return np.zeros((len(model.inputs), len(line.t)))
    std = prior_std(vehicle, model)
    units = [1.0 / s if s > 0.0 else 0.0 for s in std]
    weights = _rates(model, ca.SX(units)).T
    summed = weights @ ca.jacobian(_rates(model, e.rate), e.u)
    states = drive.at_nominal.states
    return e.along(summed.T, states, line.u, line.W[line.row], compiled.p, compiled.g)


def white_covariances(
    stretches: Sequence[Stretches],
    noise_model: NoiseModel,
    weights: Sequence[Floats],
    scatter: Sequence[Floats],
) -> list[InputNoiseCovariance]:
    """How each drive's white readings scatter, as the noise model and outliers leave them."""
    noises = []
    for s, weight, columns in zip(stretches, weights, scatter, strict=True):
        white = noise_model.whiten(s, columns)
        white *= weight[:, None]
        noises.append(InputNoiseCovariance.of(white))
    return noises
