"""What a truck consists of beside the masses and stiff shafts of the clutch's textbook model."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, replace

import numpy as np

from clutchest.generator.scenarios import Random
from clutchest.signals import Floats

CURVE_POINTS = 25  # of the torque curve's error, evenly from 0 to DEEPEST
DEEPEST = 6.0  # mm below the kiss point: no clutch is closed further
KNOTS = 6  # of a spline that is drawn


@dataclass(frozen=True)
class Structure:
    """Parts that the plain truck lacks; at 0 a part does not exist.

    ``disc_faces``: share of the disc's heat capacity in its faces, where the slip power arises,
    and ``disc_conductance`` W/K from them to the core.  ``flywheel``: share of the body's heat
    capacity, which the coolant and half of the disc's contact act on, and ``flywheel_conductance``
    W/K to the rest; at rest the coolant holds the body where it would without.  ``housing_rear``:
    share of the housing's heat capacity and of its surface that the body does not touch, and
    ``housing_conductance`` W/K to it.  ``delivery_lag`` s: the engine's torque follows the reported
    one, first order.  ``driveline_stiffness`` N/m and ``driveline_damping`` N s/m between gearbox
    and truck, seen at the wheels' rim.  ``curve``: relative error of the torque at CURVE_POINTS
    depths, 0 everywhere where there is none.
    """

    disc_faces: float = 0.0
    disc_conductance: float = 0.0
    flywheel: float = 0.0
    flywheel_conductance: float = 0.0
    housing_rear: float = 0.0
    housing_conductance: float = 0.0
    delivery_lag: float = 0.0
    driveline_stiffness: float = 0.0
    driveline_damping: float = 0.0
    curve: tuple[float, ...] = field(default=(0.0,) * CURVE_POINTS)

    @property
    def plain(self) -> bool:
        """Whether no part is there."""
        return self == Structure()

    def numbers(self) -> Mapping[str, float | tuple[float, ...]]:
        """By the names that the plant knows them by."""
        return {**asdict(self), "structured": 0.0 if self.plain else 1.0}


NAMES = (*(name for name in Structure().numbers() if name != "curve"),)


def two_node_disc(plain: Structure, random: Random) -> Structure:
    """Linings of some 3 mm on a steel core: a time constant of 0.4 to 2 s between them."""
    faces, lasts = random.uniform(0.25, 0.45), random.uniform(0.4, 2.0)
    conductance = 2270.0 * faces * (1.0 - faces) / lasts
    return replace(plain, disc_faces=faces, disc_conductance=conductance)


def own_flywheel(plain: Structure, random: Random) -> Structure:
    """Flywheel and pressure plate are of like mass, bolted together over the cover."""
    return replace(
        plain,
        flywheel=random.uniform(0.35, 0.55),
        flywheel_conductance=random.uniform(60.0, 200.0),
    )


def split_housing(plain: Structure, random: Random) -> Structure:
    """The bell's front is warmed by the clutch, its rear by the front alone."""
    return replace(
        plain,
        housing_rear=random.uniform(0.3, 0.6),
        housing_conductance=random.uniform(15.0, 40.0),
    )


def lagging_engine(plain: Structure, random: Random) -> Structure:
    """The report is what the injection will do: a cylinder or two later it has done so."""
    return replace(plain, delivery_lag=random.uniform(0.003, 0.012))


def soft_driveline(plain: Structure, random: Random) -> Structure:
    """Propeller and half shafts of 80 to 200 kNm/rad over wheels of 0.5 m; some 0.15 of critical
    damping at a shuffle of 3 Hz."""
    stiffness = random.uniform(80e3, 200e3) / 0.5**2
    return replace(
        plain,
        driveline_stiffness=stiffness,
        driveline_damping=stiffness * random.uniform(0.010, 0.025),
    )


def bent_curve(plain: Structure, random: Random) -> Structure:
    """A smooth error of ± 1 % (standard deviation at the knots) along the whole stroke."""
    from scipy.interpolate import CubicSpline

    spline = CubicSpline(np.linspace(0.0, DEEPEST, KNOTS), 0.01 * random.standard_normal(KNOTS))
    error: Floats = spline(np.linspace(0.0, DEEPEST, CURVE_POINTS))
    return replace(plain, curve=tuple(map(float, error)))
