"""The heavy-truck dry clutch of [ME12], equation by equation.

[ME12] A. Myklebust, L. Eriksson, "Torque Model with Fast and Slow Temperature Dynamics of a
Slipping Dry Clutch", IEEE VPPC 2012.  Equation numbers are the paper's.

Temperatures are in °C, positions in mm growing in the opening direction, all else in SI.
Pieces that stand for each other, to be exchanged with ``Model.swap``:

=========================  ======================================================================
``expansion``              (15) body and disc, capped · ``body_expansion`` (9) the body alone
``correction``             (11) x_cor = x − Δx0 + wear · ``no_correction`` x_cor = x: static model
``torque_from_position``   (16) the curve (5) at x_cor · ``torque_from_engine`` reported engine
                           torque less the inertia term
``power_modelled``         (8) with the model's torque · ``power_measured`` (8) with the measured
``temperatures``           (12)–(14) three states · ``two_temperatures`` (6)–(7), no disc
=========================  ======================================================================
"""

from __future__ import annotations

from collections.abc import Container, Mapping

from clutchest.casadi_later import ca
from clutchest.models.dry_clutch.parameters import PARAMETERS
from clutchest.models.dry_clutch.symbols import ENGINE_LOAD, INPUTS, SENSORS, STATES
from clutchest.models.model import Model, Quantities

# Which equations act, set by the mode: the speed equation (not locked, no transition near),
# sliding surfaces, surfaces pressed together.
REGIME = ("free_running", "sliding", "engaged")


def slip(q: Quantities) -> None:
    """Δω = ω_e − ω_i."""
    q.slip_speed = q.engine_speed - q.input_shaft_speed


def no_slip(q: Quantities) -> None:
    """Slip unknown."""
    q.slip_speed = 0.0


def position(q: Quantities) -> None:
    """x from the raw reading, and how much thinner the pads are than nominal."""
    q.position = q.slave_position - q.position_origin
    q.wear = q.zero_position_ref - q.zero_position


def expansion(q: Quantities) -> None:
    """(15): the body, and the disc while it is hotter, push the zero position outwards."""
    disc_over_body = ca.fmin(q.temp_disc - q.temp_body, q.disc_body_temp_cap)
    q.expansion = (
        q.expansion_body * (q.temp_body - q.reference_temp) + q.expansion_disc * disc_over_body
    )


def body_expansion(q: Quantities) -> None:
    """(9): the body alone."""
    q.expansion = q.expansion_body * (q.temp_body - q.reference_temp)


def correction(q: Quantities) -> None:
    """(11): the position at which the cold, unworn clutch gives the same torque."""
    q.corrected_position = q.position - q.expansion + q.wear


def no_correction(q: Quantities) -> None:
    """The static model: the position as it is read."""
    q.corrected_position = q.position


def torque_from_position(q: Quantities) -> None:
    """(5), (16): torque and slope vanish at the kiss point; torque opposes slip.

    Fully closed, at x_cor = 0, the spring exerts its full force: the curve ends there.
    """
    q.compression = ca.fmax(q.corrected_position, 0.0) - q.kiss_point
    curve = q.torque_cubic * q.compression**3 + q.torque_quadratic * q.compression**2
    q.reference_torque = ca.if_else(q.compression < 0, curve, 0.0)  # (5)
    q.sliding_torque = q.friction * q.reference_torque
    q.drag_torque = 0.0
    q.clutch_torque = q.sliding_torque * ca.sign(q.slip_speed) + q.drag_torque  # (16)


def measured_torque(q: Quantities) -> None:
    """M_c,meas = M_e,reported − J_e dω_e/dt, the reported torque less its bias."""
    q.true_engine_torque = q.engine_torque - q.torque_bias
    q.measured_torque = q.true_engine_torque - q.engine_inertia * q.engine_acceleration


def guessed_torque(q: Quantities) -> None:
    """Without a reported torque: half the engine's largest, and what no signal informs."""
    q.true_engine_torque = (0.5 + q.engine_load) * q.engine_torque_max
    q.measured_torque = q.true_engine_torque - q.engine_inertia * q.engine_acceleration


def torque_from_engine(q: Quantities) -> None:
    """The measured torque stands for the clutch's own, where no position is known."""
    q.clutch_torque = q.engaged * q.measured_torque


def power_modelled(q: Quantities) -> None:
    """(8) with the model's own torque."""
    q.slip_power = ca.fabs(q.clutch_torque * q.slip_speed)
    q.power = q.sliding * q.clutch_torque * q.slip_speed


def power_measured(q: Quantities) -> None:
    """(8) with the measured torque, while the surfaces are pressed together."""
    q.slip_power = ca.fabs(q.measured_torque * q.slip_speed)
    q.power = q.engaged * q.measured_torque * q.slip_speed


def temperatures(q: Quantities) -> None:
    """(12)–(14): slow body, slower housing, fast disc."""
    q.body_heat = (
        q.conductance_engine_body * (q.coolant_temp - q.temp_body)
        + q.conductance_body_housing * (q.temp_housing - q.temp_body)
        + q.conductance_disc_body * (q.temp_disc - q.temp_body)
        + q.heat_fraction_body * q.power
    )  # (12)
    q.disc_heat = (
        q.conductance_disc_body * (q.temp_body - q.temp_disc) + (1 - q.heat_fraction_body) * q.power
    )  # (14)
    housing(q)
    q.temp_body_rate = q.body_heat / q.heat_capacity_body
    q.temp_disc_rate = q.disc_heat / q.heat_capacity_disc


def two_temperatures(q: Quantities) -> None:
    """(6)–(7): the limit for (m c_p)_d → 0; all power enters the body, the disc follows it."""
    q.body_heat = (
        q.conductance_engine_body * (q.coolant_temp - q.temp_body)
        + q.conductance_body_housing * (q.temp_housing - q.temp_body)
        + q.power
    )  # (6)
    housing(q)
    q.temp_body_rate = q.body_heat / q.heat_capacity_body
    q.temp_disc_rate = q.temp_body_rate


def housing(q: Quantities) -> None:
    """(7), (13): the housing between body and air."""
    q.housing_heat = q.conductance_body_housing * (
        q.temp_body - q.temp_housing
    ) + q.conductance_housing_ambient * (q.ambient_temp - q.temp_housing)
    q.temp_housing_rate = q.housing_heat / q.heat_capacity_housing


def wear(q: Quantities) -> None:
    """Extension: the pads wear in proportion to the slip energy (Archard's law)."""
    q.wear_per_energy = q.wear_rate  # mm/MJ
    q.zero_position_rate = -q.wear_per_energy * 1e-6 * q.power


def engine(q: Quantities) -> None:
    """J_e dω_e/dt = M_e − M_c while not locked; the measured slope otherwise.

    That slope also implies the torque of the engine, without the noise of the reported one.
    """
    unlocked = (q.true_engine_torque - q.clutch_torque) / q.engine_inertia
    q.engine_speed_rate = q.free_running * unlocked + (1 - q.free_running) * q.engine_acceleration
    lacking = q.engine_inertia * (q.engine_acceleration - unlocked)
    q.implied_engine_torque = q.engine_torque + q.free_running * lacking


def engine_as_measured(q: Quantities) -> None:
    """The speed follows its own measured slope, where the torque is taken from that slope."""
    q.engine_speed_rate = q.engine_acceleration
    q.implied_engine_torque = q.engine_torque


def engine_alone(q: Quantities) -> None:
    """The same, where no torque is reported that could be implied."""
    q.engine_speed_rate = q.engine_acceleration


def readings(q: Quantities) -> None:
    """What the sensors show, x0 = x0_ref + Δx0 among them, and the torque that passes through."""
    q.engine_speed_reading = q.engine_speed
    q.zero_position_reading = q.zero_position + q.expansion
    q.transmitted_torque = q.sliding * q.clutch_torque + (1 - q.sliding) * q.measured_torque


DRY_CLUTCH = Model(
    name="dry_clutch",
    states=STATES,
    parameters=PARAMETERS,
    inputs=INPUTS,
    regime=REGIME,
    sensors=SENSORS,
    outputs=("transmitted_torque", "power"),
    anchor="engine_speed",
    slopes={"engine_acceleration": "engine_speed"},
    renewed={"engine_speed": ("free_running", 0.2)},
    implied={"engine_torque": "implied_engine_torque"},
    pieces=(
        slip,
        position,
        measured_torque,
        expansion,
        correction,
        torque_from_position,
        power_modelled,
        temperatures,
        wear,
        engine,
        readings,
    ),
)

_NO_POSITION = "no slave position signal"
_UNINFORMED = ("zero_position", "wear_rate", "friction", "torque_bias")
_NO_SLIP = "no input shaft speed signal, so that slip and its heat are unknown"

# Without a slave position the clutch torque is what the engine gives less its inertia term.
WITHOUT_POSITION = (
    DRY_CLUTCH.without(position, correction, wear)
    .without_input("slave_position")
    .swap(torque_from_position, torque_from_engine)
    .swap(power_modelled, power_measured)
    .swap(engine, engine_as_measured)
    .with_noise("engine_speed", 15.0)  # the slope of a coarse signal with vibrations is imprecise
    .unobserved(dict.fromkeys(_UNINFORMED, _NO_POSITION))
)

# Without the input shaft's speed slip and its heat are unknown: only torque and speed remain.
WITHOUT_SLIP = (
    WITHOUT_POSITION.swap(slip, no_slip)
    .without_input("input_shaft_speed")
    .unobserved(
        {
            **dict.fromkeys(("temp_body", "temp_housing", "temp_disc", "slip_energy"), _NO_SLIP),
            **dict.fromkeys(_UNINFORMED, _NO_SLIP),
        }
    )
)

# Without a reported torque the energy of a slip is known within what the engine can give.
_NO_TORQUE = "no engine torque signal"
_NEED_TORQUE = ("temp_body", "temp_housing", "temp_disc", "engine_load", "transmitted_torque")
WITHOUT_TORQUE = (
    WITHOUT_POSITION.swap(measured_torque, guessed_torque)
    .swap(engine_as_measured, engine_alone)
    .without_input("engine_torque")
    .with_states(ENGINE_LOAD)
    .unobserved(dict.fromkeys((*_UNINFORMED, *_NEED_TORQUE), _NO_TORQUE))
)
SPEED_ALONE = (
    WITHOUT_TORQUE.swap(slip, no_slip)
    .without_input("input_shaft_speed")
    .unobserved({**WITHOUT_TORQUE.unobservable, "slip_energy": _NO_SLIP})
)


def at_rest(parameters: Mapping[str, float], inputs: Mapping[str, float]) -> dict[str, float]:
    """State at the start of a drive by its first inputs: (12)–(14) at rest, no slip."""
    to_engine = parameters["conductance_engine_body"]
    to_housing = parameters["conductance_body_housing"]
    to_air = parameters["conductance_housing_ambient"]
    through = to_housing * to_air / max(to_housing + to_air, 1e-9)
    coolant, ambient = inputs["coolant_temp"], inputs["ambient_temp"]
    body = (to_engine * coolant + through * ambient) / max(to_engine + through, 1e-9)
    housing = (to_housing * body + to_air * ambient) / max(to_housing + to_air, 1e-9)
    return {
        "temp_body": body,
        "temp_housing": housing,
        "temp_disc": body,
        "zero_position": parameters["zero_position_ref"],
        "friction": 1.0,
    }


def for_signals(names: Container[str]) -> Model:
    """The form of the equations that the available signals can drive."""
    if "engine_torque" not in names:
        return WITHOUT_TORQUE if "input_shaft_speed" in names else SPEED_ALONE
    if "input_shaft_speed" not in names:
        return WITHOUT_SLIP
    return DRY_CLUTCH if "slave_position" in names else WITHOUT_POSITION


def two_state(model: Model) -> Model:
    """The body-and-housing model (6)–(9): no disc heat, no disc expansion."""
    return model.swap(temperatures, two_temperatures).swap(expansion, body_expansion)


def static(model: Model) -> Model:
    """The static model: torque from the position alone."""
    return model.swap(correction, no_correction)


def following_speed(model: Model) -> Model:
    """The same model with the engine speed as measured: for running it open loop."""
    return model.swap(engine, engine_as_measured)


def with_measured_power(model: Model) -> Model:
    """The same model heated by the measured torque ("P measured")."""
    return model.swap(power_modelled, power_measured)
