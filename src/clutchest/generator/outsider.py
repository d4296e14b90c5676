"""Unmodelled effects: terms that neither the model nor the generator's equations have, and where
they act upon a machine, here the truck, and its sensors."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Protocol, runtime_checkable

from clutchest.errors import ClutchestError, nearest
from clutchest.signals import Floats

if TYPE_CHECKING:
    from clutchest.generator.situation import TruckDrive, TruckRecord

SLICE = 0.01  # s for which a value of a law holds, unless the effect has a pace of its own

Reading = Callable[[Floats], Floats]
Law = Callable[[Mapping[str, float]], Mapping[str, float]]


@runtime_checkable
class Outsider(Protocol):
    """An unmodelled effect, none of ``EFFECTS``; any object with these two methods.  A slow one
    may have a ``pace``, s, at which its law is evaluated; ``SLICE`` unless it has.

    What a law of the differential is given, and gives, stands in ``generator.alsd.outsider``.  One
    of the truck is given the true ``time`` s, ``temp_body``, ``temp_housing``, ``temp_disc`` °C,
    ``engine_speed``, ``input_shaft_speed``, ``slip_speed`` rad/s, ``vehicle_speed`` m/s,
    ``engine_torque``, ``clutch_torque`` Nm, ``energy`` J of slip, ``slave_position``,
    ``motor_position`` mm, ``position_rate`` mm/s, ``coolant_temp``, ``ambient_temp`` °C.  It gives
    any of ``torque_share`` (added to the friction torque, relative), ``torque`` Nm (added to it
    while the surfaces touch), ``engine_load`` Nm (taken from the engine, in no report),
    ``body_heat``, ``housing_heat``, ``disc_heat`` W and ``zero_position`` mm (shifts x0_ref).
    """

    def law(self) -> Law | None:
        """What acts, as a function of the true quantities, evaluated once per SLICE in order of
        time; a new one for every drive, so that it may have memory.  None: only sensors are
        affected."""
        ...

    def readings(self, true: Mapping[str, Reading]) -> Mapping[str, Reading]:
        """What each sensor shows, noise apart, as functions of time in s; ``true`` without it."""
        ...


def acting(
    law: Law, true: Mapping[str, float], foreign: Sequence[str], machine: str
) -> dict[str, float]:
    """What a ``law`` does at the ``true`` quantities, under the names of the plant's numbers.

    Raises ClutchestError where it names something that is not among what is ``foreign``.
    """
    acts = law(true)
    for name in acts:
        if name not in foreign:
            raise ClutchestError(
                f"an unmodelled effect acts on '{name}', which the {machine} does not have"
                + nearest(name, foreign)
            )
    return {f"foreign_{name}": value for name, value in acts.items()}


def run_under(law: Law, pace: float, steps: int, drive: TruckDrive, record: TruckRecord) -> None:
    """``plant.run`` from 0 to ``steps`` in slices of ``pace`` s, between which ``law`` may act; see
    :func:`acting`."""
    from clutchest.generator import plant

    each = round(pace / plant.STEP)
    s, slave = drive.situation[0], float(drive.situation[0]["slave"])
    for begin in range(0, steps + 1, each):
        true = _true(begin, (s["slave"] - slave) / pace, drive)
        slave = float(s["slave"])
        for name, value in acting(law, true, plant.FOREIGN, "truck").items():
            s[name] = value
        plant.run(begin, min(begin + each, steps + 1), 1, drive, record)


def _true(step: int, position_rate: float, drive: TruckDrive) -> dict[str, float]:
    """What a law is given at this step."""
    from clutchest.generator import plant

    s, state, slow = drive.situation[0], drive.state, drive.slow
    row = min(step // round(plant.GRID / plant.STEP), len(slow) - 1)
    return {
        "time": step * plant.STEP,
        "temp_body": state[plant.BODY],
        "temp_housing": state[plant.HOUSING],
        "temp_disc": state[plant.DISC],
        "energy": state[plant.ENERGY],
        "engine_speed": state[plant.ENGINE],
        "input_shaft_speed": state[plant.SHAFT],
        "slip_speed": state[plant.ENGINE] - state[plant.SHAFT],
        "vehicle_speed": state[plant.SPEED],
        "engine_torque": state[plant.TORQUE],
        "clutch_torque": s["carried"],
        "motor_position": s["motor"],
        "slave_position": s["slave"] + drive.numbers[0]["position_origin"],
        "position_rate": position_rate,
        "coolant_temp": slow[row, 1],
        "ambient_temp": slow[row, 2],
    }
