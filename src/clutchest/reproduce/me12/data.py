"""Stand-in for the paper's measurements: drives of the independent generator, with imperfections
that are stated."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from types import MappingProxyType

from clutchest.generator.outsider import Law, Reading
from clutchest.signals import Signals
from clutchest.simulated import simulate
from clutchest.vehicle import Vehicle

WARM = 60.0  # °C of the body, from which on a cold truck is no longer cold
FREEZING = 0.0  # °C
HOT, HOTTEST = 200.0, 250.0  # °C of the disc, where the paper's model deteriorates

# The true truck is off the vehicle file in the sense in which the paper's was off its model, which
# "still simulates a slightly low clutch torque": more torque, more expansion, less capacity.
SENSE: Mapping[str, float] = MappingProxyType(
    {
        "torque_cubic": 1.0,
        "torque_quadratic": 1.0,
        "expansion_body": 1.0,
        "expansion_disc": 1.0,
        "heat_capacity_body": -1.0,
        "heat_capacity_housing": -1.0,
        "heat_capacity_disc": -1.0,
        "conductance_engine_body": -1.0,
        "conductance_body_housing": -1.0,
        "conductance_housing_ambient": -1.0,
        "conductance_disc_body": -1.0,
    }
)


@dataclass(frozen=True, slots=True)
class Imperfections:
    """How the data differ from the model, each 0 where it does not; see ``WHAT``."""

    torque_delay: float = 0.05
    torque_error: float = 20.0
    torque_error_ar: float = 0.98
    parameter_error: float = 0.02
    hot_gain: float = 0.15
    cold_loss: float = 0.25

    def sizes(self) -> dict[str, tuple[float, str, str]]:
        """Name → (size, unit, what)."""
        return {name: (getattr(self, name), *WHAT[name]) for name in WHAT}


WHAT: Mapping[str, tuple[str, str]] = MappingProxyType(
    {
        "torque_delay": ("s", "reported engine torque is late"),
        "torque_error": ("Nm", "standard deviation of the error of the reported torque"),
        "torque_error_ar": ("1", "AR(1) coefficient of that error, per 10 ms"),
        "parameter_error": (
            "1",
            "relative error of every parameter of heat, expansion and curve, all "
            "in the sense that makes the model's torque low",
        ),
        "hot_gain": (
            "1",
            "share of the torque gained from 250 °C of the disc on, none up to 200 °C",
        ),
        "cold_loss": ("1", "share of the torque lost at 0 °C of the body, none from 60 °C on"),
    }
)
NONE = Imperfections(0.0, 0.0, 0.0, 0.0, 0.0, 0.0)


@dataclass(frozen=True, slots=True)
class Temperatures:
    """What neither the model nor any effect of the library knows: a torque that is lower while the
    truck is cold, by ``cold_loss``, and higher above 200 °C of the disc, by ``hot_gain``."""

    cold_loss: float
    hot_gain: float
    pace: float = 0.1  # s; the disc takes many seconds

    def law(self) -> Law:
        """Share of the friction torque that comes on top of (16)."""

        def act(seen: Mapping[str, float]) -> Mapping[str, float]:
            cold = (WARM - seen["temp_body"]) / (WARM - FREEZING)
            hot = (seen["temp_disc"] - HOT) / (HOTTEST - HOT)
            gained, lost = (
                size * min(max(share, 0.0), 1.0)
                for size, share in ((self.hot_gain, hot), (self.cold_loss, cold))
            )
            return {"torque_share": gained - lost}

        return act

    def readings(self, true: Mapping[str, Reading]) -> Mapping[str, Reading]:
        """Sensors read as they should."""
        return true


@dataclass(frozen=True)
class Setup:
    """``vehicle``: the model's numbers; ``truck``: those of the generator's truck before any
    imperfection; ``effects`` that act in the truth; P measured or P modelled; whether C_d and k_d2b
    are ``refitted`` where k_P is another."""

    vehicle: Vehicle
    truck: Vehicle
    imperfections: Imperfections = field(default_factory=Imperfections)
    effects: Mapping[str, Mapping[str, float]] = field(default_factory=dict)
    power_measured: bool = True
    refitted: bool = True
    made: dict[str, Signals] = field(default_factory=dict, repr=False, compare=False)

    def modelled(self, **numbers: float) -> Setup:
        """The same with other numbers in the model."""
        return replace(self, vehicle=changed(self.vehicle, **numbers))

    def true(self, **numbers: float) -> Setup:
        """The same with another truck."""
        return replace(self, truck=changed(self.truck, **numbers))

    def both(self, **numbers: float) -> Setup:
        """The same with other numbers in truck and model alike."""
        return self.true(**numbers).modelled(**numbers)

    def wrong(self, **sizes: float) -> Setup:
        """The same with imperfections of other sizes."""
        return replace(self, imperfections=replace(self.imperfections, **sizes))

    def drive(self, scenario: str, seed: int, duration: float | None = None) -> Signals:
        """One drive of the true truck, made once; its parameters are drawn by no seed."""
        wrong = self.imperfections
        truth = {key: p.value for key, p in self.truck.parameters.items()}
        key = repr((scenario, seed, duration, wrong, truth, self.effects))
        if key not in self.made:
            self.made[key] = _drive(self.truck, scenario, seed, duration, wrong, self.effects)
        return self.made[key]


def changed(vehicle: Vehicle, **numbers: float) -> Vehicle:
    """The vehicle with other values of parameters."""
    values = {key: replace(vehicle.parameters[key], value=v) for key, v in numbers.items()}
    return replace(vehicle, parameters={**vehicle.parameters, **values})


def _drive(
    truck: Vehicle,
    scenario: str,
    seed: int,
    duration: float | None,
    wrong: Imperfections,
    effects: Mapping[str, Mapping[str, float]],
) -> Signals:
    off = {
        key: truck.parameters[key].value * (1 + sense * wrong.parameter_error)
        for key, sense in SENSE.items()
    }
    reported = replace(
        truck.signals["engine_torque"], noise=wrong.torque_error, noise_ar=wrong.torque_error_ar
    )
    true = replace(changed(truck, **off), signals={**truck.signals, "engine_torque": reported})
    acting = {**effects, "torque_delay": {"delay": wrong.torque_delay}}
    strange = wrong.cold_loss or wrong.hot_gain
    outsider = Temperatures(wrong.cold_loss, wrong.hot_gain) if strange else None
    return simulate(
        true, scenario, seed, acting, nominal=True, duration=duration, outsider=outsider
    )
