"""The truck, step by step: thermal network, clutch, engine, driveline, actuator, control unit.

numba keeps an old answer when a function in another file changes.  So the texts of the files of the
truck make one generated module, named by a hash of it and of the constants that are frozen into it.
Numbers are those of ``effects.NUMBERS``.
"""

from __future__ import annotations

from pathlib import Path

from clutchest.generated import load, named, text_of
from clutchest.generator import scenarios, structure, surroundings
from clutchest.generator.situation import (
    BODY,
    DISC,
    DRIVING,
    ENERGY,
    ENGINE,
    FAST,
    FOREIGN,
    HOUSING,
    IDLE,
    MODES,
    SHAFT,
    SITUATION,
    SPEED,
    STATES,
    STATES_IN_PARTS,
    STEP,
    TORQUE,
    TruckDrive,
    TruckRecord,
)
from clutchest.generator.surroundings import GRID

__all__ = [
    "BODY",
    "DISC",
    "DRIVING",
    "ENERGY",
    "ENGINE",
    "FAST",
    "FOREIGN",
    "GRID",
    "HOUSING",
    "IDLE",
    "MODES",
    "SHAFT",
    "SITUATION",
    "SPEED",
    "STATES",
    "STATES_IN_PARTS",
    "STEP",
    "TORQUE",
    "TruckDrive",
    "TruckRecord",
    "actuate",
    "advance",
    "capacity",
    "expansion",
    "follow",
    "rates",
    "run",
    "runge_kutta",
    "settle",
    "sticking",
    "transmitted",
    "zero_reference",
]

_FROZEN = {
    **{
        name: getattr(scenarios, name)
        for name in ("DRIVE", "GRAVITY", "POSITION", "REST", "ROLLING", "TORQUE_RATE")
    },
    **{name: getattr(structure, name) for name in ("CURVE_POINTS", "DEEPEST")},
    **{name: getattr(surroundings, name) for name in ("GEARBOX_TEMP", "GRID")},
}
_HEADER = f'''"""Generated; do not edit."""
from __future__ import annotations

from math import exp, inf
from typing import Any, NamedTuple

import numpy as np
from clutchest.native import compiled
from numpy.typing import NDArray

from clutchest.signals import Floats

PER_METRE = np.array({scenarios.PER_METRE.tolist()!r})
''' + "".join(f"{name} = {value!r}\n" for name, value in _FROZEN.items())
_FILES = ("situation.py", "parts.py", "physics.py", "control_unit.py", "driving.py", "forced.py")
_TEXTS = [text_of(Path(__file__).parent / file) for file in _FILES]
_MODULE = load(*named([_HEADER, *_TEXTS]), "truck")
run, advance, runge_kutta = _MODULE.run, _MODULE.advance, _MODULE.runge_kutta
capacity, transmitted, rates = _MODULE.capacity, _MODULE.transmitted, _MODULE.rates
expansion, zero_reference = _MODULE.expansion, _MODULE.zero_reference
sticking, actuate, settle = _MODULE.sticking, _MODULE.actuate, _MODULE.settle
follow = _MODULE.follow
