"""Procedures that determine parameters of the truck's clutch, as [ME12] identifies them."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from clutchest.models.effects.effect import Effect, Gains
from clutchest.models.procedures import (
    CurvePicture,
    Line,
    PicturePanel,
    Procedure,
    ReadingsPicture,
    TimePicture,
)

CURVE = ("torque_cubic", "torque_quadratic", "kiss_point")
# Friction is relative to the torque curve: where all of it is fitted, friction starts from 1.
RELATIVE_STATES = {"friction": CURVE}

TORQUE = TimePicture(
    "torque.png",
    (
        PicturePanel(
            "clutch torque [Nm]",
            (Line("measured_torque", "measured", "k"), Line("clutch_torque", "fitted", "C1")),
        ),
        PicturePanel(
            "temperature [°C]",
            (Line("temp_body", "body"), Line("temp_housing", "housing"), Line("temp_disc", "disc")),
        ),
    ),
)  # as [ME12], Fig. 10
ZERO_POSITION = ReadingsPicture(
    "zero_position.png", "zero_position", "zero position [mm]"
)  # Fig. 5
TORQUE_CURVE = CurvePicture(
    "torque_curve.png",
    "corrected_position",
    "measured_torque",
    "reference_torque",
    ("corrected position [mm]", "clutch torque [Nm]"),
)  # Fig. 8


class MeasuredPower(Effect):
    """(8) with the measured torque in place of the model's own; it has no size."""

    name = "measured_power"
    model = "dry_clutch"
    equation = "disc_heat"
    parameters = ()

    def terms(self, g: Gains) -> Mapping[str, Any]:
        """See :meth:`Effect.terms`."""
        return {"power": lambda _, q: q.engaged * q.measured_torque * q.slip_speed}


PROCEDURES = (
    # Fig. 2 and Fig. 8: the position is ramped back and forth while the clutch slips; corrected for
    # the heat that this brings, all ramps lie on one curve (5).
    Procedure(
        "torque-curve",
        "a, b and x_ISP of the torque curve, from ramps of the position",
        CURVE,
        pictures=(TORQUE_CURVE,),
    ),
    # How far a given heat moves the zero position (9) is k_exp,1 over a capacity: what the record
    # cannot separate from its thermal numbers follows from their priors.  x0_ref is a state, fitted
    # for each drive, and not written.
    Procedure(
        "expansion",
        "expansion with the body's temperature, from heating and cool-down",
        ("expansion_body",),
        sensor="zero_position",
        effects=(MeasuredPower(),),
        pictures=(ZERO_POSITION,),
    ),
    # (12) and (13), Fig. 5: the clutch is heated by slips, then left closed while the zero position
    # falls with two exponentials.
    Procedure(
        "thermal",
        "capacities and conductances of body and housing, from heating and cool-down",
        (
            "heat_capacity_body",
            "heat_capacity_housing",
            "conductance_engine_body",
            "conductance_body_housing",
            "conductance_housing_ambient",
        ),
        sensor="zero_position",
        effects=(MeasuredPower(),),
        pictures=(ZERO_POSITION,),
    ),
    # k_exp,2, C_d and k_d2b of (14) and (15): the slow numbers are known by then, within the
    # spreads that the procedures before left.  What shows them is how the torque at one position
    # drifts within seconds.
    Procedure(
        "disc",
        "the disc's expansion, capacity and conductance, from slips that heat it",
        ("expansion_disc", "heat_capacity_disc", "conductance_disc_body"),
        pictures=(TORQUE,),
    ),
)
