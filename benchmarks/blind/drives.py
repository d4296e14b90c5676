"""One truck's drive under one kind of noise, everything about it drawn from a seed."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

import clutchest
from blind.outsiders import Outsider
from clutchest.generator import Disturbances, DriveRequest, Mismatch, Sampled
from clutchest.models import machine_of
from clutchest.signals import Signal, Signals
from clutchest.simulated import Effects, Options, simulate, simulate_sampled
from clutchest.vehicle import Vehicle

VEHICLE = "truck"
SCENARIOS = ("city", "launches", "mixed", "pulses", "heating", "slip-steps")
SHORTEST, LONGEST = 600.0, 1200.0  # s
OTHER_ROAD = 1_000_000  # from a drive's seed to that of the one held out
# Quantised readings: steps of √3 noises over a sensor's own noise of half a step.  Together they
# have the stated variance, and so much own noise lets no error depend on where between two steps
# the truth lies.
STEP, OWN = 3.0**0.5, 0.75**0.5


@dataclass(frozen=True)
class Noise:
    """``ar``: AR(1) coefficient per sample, which the vehicle file states; share of ``outliers``;
    ``coarse``: readings come in steps of ``STEP`` noises."""

    ar: float = 0.0
    outliers: float = 0.0
    coarse: bool = False


NOISES: Mapping[str, Noise] = {
    "white": Noise(),
    "ar05": Noise(ar=0.5),
    "ar09": Noise(ar=0.9),
    "quantised": Noise(coarse=True),
    "outliers": Noise(outliers=0.02),
}


@dataclass(frozen=True)
class Drive:
    """What ``seed`` draws: scenario, length, truck, road, weather; ``noise`` of NOISES;
    ``mismatches``: groups of the generator's in which the truck differs from the model, as the seed
    draws them too."""

    seed: int
    noise: str
    mismatches: tuple[str, ...] = ()

    @cached_property
    def _draw(self) -> tuple[str, float]:
        random = np.random.default_rng([self.seed, 1])
        return str(random.choice(SCENARIOS)), float(random.uniform(SHORTEST, LONGEST))

    @property
    def scenario(self) -> str:
        return self._draw[0]

    @property
    def duration(self) -> float:
        """s."""
        return self._draw[1]

    @cached_property
    def vehicle(self) -> Vehicle:
        """The file handed over: it states the noise as it is."""
        stated = clutchest.load_vehicle(VEHICLE)
        ar = NOISES[self.noise].ar
        signals = {name: replace(s, noise_ar=ar) for name, s in stated.signals.items()}
        return replace(stated, signals=signals)

    def signals(
        self,
        effects: Effects | None = None,
        outsider: Outsider | None = None,
        *,
        held_out: bool = False,
        noiseless: bool = False,
        scenario: str | None = None,
    ) -> Signals:
        """What the bus shows of the drive, or of another one by the same truck (``held_out``, or
        another ``scenario`` of its own length); ``noiseless``: what exact sensors would show."""
        noise = NOISES[self.noise]
        share = 0.0 if noiseless else OWN if noise.coarse else 1.0
        sensors = {
            name: replace(s, noise=share * s.noise) for name, s in self.vehicle.signals.items()
        }
        options: Options = {
            "truck_seed": self.seed,
            "disturbances": healthy(self.vehicle.model),
            "outliers": 0.0 if noiseless else noise.outliers,
            "duration": self.duration if scenario is None else None,
            "outsider": outsider,
            "mismatch": Mismatch.drawn(self.mismatches, self.seed),
        }
        road = self.seed + OTHER_ROAD * (held_out or scenario is not None)
        drive = replace(self.vehicle, signals=sensors), scenario or self.scenario, road, effects
        if not noiseless and not noise.coarse:
            return simulate(*drive, **options)
        # rounded once: of two roundings, the finer would shift what the coarser one takes for half
        unrounded = _unrounded(simulate_sampled(*drive, **options), self.vehicle.model)
        return unrounded if noiseless else self._coarse(unrounded)

    def request(
        self,
        effects: Effects | None = None,
        outsider: Outsider | None = None,
        scenario: str | None = None,
    ) -> DriveRequest:
        """The same drive, or another ``scenario`` by the same truck, asked of the generator without
        any bus."""
        parameters = self.vehicle.parameters
        return DriveRequest(
            {key: p.value for key, p in parameters.items()},
            {key: p.spread for key, p in parameters.items()},
            scenario or self.scenario,
            self.seed + OTHER_ROAD * (scenario is not None),
            (),
            duration=self.duration if scenario is None else None,
            effects=effects or {},
            truck_seed=self.seed,
            disturbances=Disturbances.of(healthy(self.vehicle.model)),
            outsider=outsider,
            mismatch=Mismatch.drawn(self.mismatches, self.seed),
        )

    def _coarse(self, signals: Signals) -> Signals:
        rounded = {}
        for name, signal in signals.items():
            step = STEP * self.vehicle.signals[name].noise
            rounded[name] = replace(signal, value=np.rint(signal.value / step) * step)
        return replace(signals, signals=rounded)


def _unrounded(sampled: Sampled, model: str) -> Signals:
    """Readings as the sensors give them, not rounded by a bus."""
    units = machine_of(model).units
    signals = {n: Signal.of(n, units[n], *columns) for n, columns in sampled.signals.items()}
    end = max(signal.time[-1] for signal in signals.values())
    return Signals(signals, end=end, truth=sampled.truth)


def healthy(model: str) -> dict[str, float]:
    """What a healthy truck's friction and torque report are off by from drive to drive, as the
    model supposes; disturbances of the generator."""
    states = {state.name: state for state in machine_of(model).states}
    return {f"{name}_std": states[name].healthy_std or 0.0 for name in ("friction", "torque_bias")}
