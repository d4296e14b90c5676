"""The dry clutch's equations against the paper's, written a second time in plain numpy."""

from __future__ import annotations

from functools import cache
from math import isclose

import casadi as ca
import numpy as np
import pytest

from bench import BENCHES
from clutchest.models import machine_of
from clutchest.models.dry_clutch import equations
from clutchest.models.dry_clutch.equations import (
    DRY_CLUTCH,
    WITHOUT_POSITION,
    WITHOUT_SLIP,
    following_speed,
    static,
    two_state,
    with_measured_power,
)
from clutchest.models.model import Model
from clutchest.vehicle import load_vehicle
from equations import argument_names, draw, evaluator, vector

POINTS = 300
# free_running, sliding, engaged: open, slipping, slipping near a transition, locked
REGIMES = ((1.0, 1.0, 0.0), (1.0, 1.0, 1.0), (0.0, 1.0, 1.0), (0.0, 0.0, 0.0))


def points(model: Model, seed: int = 0, **fixed: float) -> list[dict[str, float]]:
    """Plausible values of everything, parameters a tenth off the truck's."""
    plausible, rng = BENCHES["dry_clutch"].plausible, np.random.default_rng(seed)
    states = {s.name: plausible.states[s.name] for s in model.states}
    inputs = {i.name: plausible.inputs[i.name] for i in model.inputs}
    drawn = []
    for _ in range(POINTS):
        values = draw(rng, {**states, **inputs})
        values |= {key: v * rng.uniform(0.9, 1.1) for key, v in truck().items()}
        values["heat_fraction_body"] = rng.uniform(0.0, 1.0)
        values["zero_position_ref"] = values["position_origin"] = rng.uniform(38.0, 39.0)
        values |= dict(zip(model.regime, REGIMES[rng.integers(4)], strict=True))
        drawn.append({**values, **fixed})
    return drawn


@cache
def truck() -> dict[str, float]:
    return {key: value.value for key, value in load_vehicle("truck").parameters.items()}


def pressed() -> dict[str, float]:
    """A truck's clutch at T_ref, pressed 1.9 mm beyond the kiss point."""
    warm = dict.fromkeys(("temp_body", "temp_housing", "temp_disc"), truck()["reference_temp"])
    x = truck()["position_origin"] + truck()["kiss_point"] - 1.9
    new = {"zero_position": truck()["zero_position_ref"], "friction": 1.0, "slave_position": x}
    return {**points(DRY_CLUTCH)[0], **truck(), **warm, **new}


class Paper:
    """[ME12] at one point, with the power of the model's torque or of the measured one."""

    def __init__(self, v: dict[str, float], measured: bool = False) -> None:
        body, disc, housing = v["temp_body"], v["temp_disc"], v["temp_housing"]
        x = v["slave_position"] - v["position_origin"]
        self.slip = v["engine_speed"] - v["input_shaft_speed"]
        over = min(disc - body, v["disc_body_temp_cap"])
        self.expansion = (
            v["expansion_body"] * (body - v["reference_temp"]) + v["expansion_disc"] * over
        )  # (10), (15)
        self.zero = v["zero_position"] + self.expansion
        wear = v["zero_position"] - v["zero_position_ref"]
        self.corrected = x - self.expansion - wear  # (11)
        self.torque = v["friction"] * curve(self.corrected, v) * np.sign(self.slip)  # (16)
        self.measured = (
            v["engine_torque"] - v["torque_bias"] - v["engine_inertia"] * v["engine_acceleration"]
        )
        if measured:
            self.power = v["engaged"] * self.measured * self.slip
        else:
            self.power = v["sliding"] * self.torque * self.slip  # (8)
        k_p = v["heat_fraction_body"]
        self.body_rate = (
            v["conductance_engine_body"] * (v["coolant_temp"] - body)
            + v["conductance_body_housing"] * (housing - body)
            + v["conductance_disc_body"] * (disc - body)
            + k_p * self.power
        ) / v["heat_capacity_body"]  # (12)
        self.housing_rate = (
            v["conductance_body_housing"] * (body - housing)
            + v["conductance_housing_ambient"] * (v["ambient_temp"] - housing)
        ) / v["heat_capacity_housing"]  # (13)
        disc_heat = v["conductance_disc_body"] * (body - disc) + (1 - k_p) * self.power
        self.disc_rate = disc_heat / v["heat_capacity_disc"]  # (14)
        net = v["engine_torque"] - v["torque_bias"] - self.torque
        self.engine_rate = (
            net / v["engine_inertia"] if v["free_running"] else v["engine_acceleration"]
        )
        self.transmitted = self.torque if v["sliding"] else self.measured


def curve(x: float, v: dict[str, float]) -> float:
    """(5)."""
    c = max(x, 0.0) - v["kiss_point"]  # fully closed is the curve's end
    return v["torque_cubic"] * c**3 + v["torque_quadratic"] * c**2 if c < 0 else 0.0


QUANTITIES = {
    "expansion": "expansion",
    "corrected_position": "corrected",
    "slip_speed": "slip",
    "clutch_torque": "torque",
    "measured_torque": "measured",
    "power": "power",
    "temp_body_rate": "body_rate",
    "temp_housing_rate": "housing_rate",
    "temp_disc_rate": "disc_rate",
    "engine_speed_rate": "engine_rate",
    "transmitted_torque": "transmitted",
    "zero_position_reading": "zero",
}


@pytest.mark.parametrize("name", QUANTITIES)
@pytest.mark.parametrize("measured", [False, True], ids=["P modelled", "P measured"])
def test_equations_are_the_papers(name: str, measured: bool) -> None:
    model = with_measured_power(DRY_CLUTCH) if measured else DRY_CLUTCH
    evaluate = evaluator(model, [name])
    values = points(model)
    wanted = np.array([getattr(Paper(v, measured), QUANTITIES[name]) for v in values])
    result = np.array([evaluate(v)[name] for v in values])
    assert np.ptp(wanted) > 0
    np.testing.assert_allclose(result, wanted, rtol=1e-11, atol=1e-11 * np.abs(wanted).max())


def test_slow_states_have_no_drift_of_their_own() -> None:
    evaluate = evaluator(DRY_CLUTCH, ["zero_position_rate", "friction_rate", "torque_bias_rate"])
    assert set(evaluate(points(DRY_CLUTCH)[0]).values()) == {0.0}


def test_torque_and_slope_vanish_at_the_kiss_point() -> None:
    """(5): no torque beyond it."""
    evaluate = evaluator(DRY_CLUTCH, ["reference_torque", "corrected_position", "kiss_point"])
    base = points(DRY_CLUTCH)[0]
    made = evaluate(base)
    to_kiss = base["slave_position"] + made["kiss_point"] - made["corrected_position"]

    def torque(past: float) -> float:
        return evaluate({**base, "slave_position": to_kiss + past})["reference_torque"]

    assert torque(0.0) == pytest.approx(0.0, abs=1e-20)
    assert torque(1e-4) == 0.0 == torque(5.0)
    assert 0.0 < torque(-1e-4) < 1e-6
    assert torque(-1.0) > 10.0


def test_torque_grows_as_the_clutch_closes() -> None:
    evaluate = evaluator(DRY_CLUTCH, ["reference_torque"])
    base = points(DRY_CLUTCH)[1]
    torque = [
        evaluate({**base, "slave_position": x})["reference_torque"]
        for x in np.linspace(38.0, 51.0, 200)
    ]
    assert np.all(np.diff(torque) <= 0.0)
    assert torque[0] > 1000.0
    assert torque[-1] == 0.0


def test_a_hot_clutch_gives_more_torque() -> None:
    """The sign of (11), as the paper's data have it."""
    evaluate = evaluator(DRY_CLUTCH, ["clutch_torque"])
    base = {**pressed(), "engine_speed": 150.0, "input_shaft_speed": 100.0}
    cold, hot_body, hot_disc = (
        evaluate({**base, "temp_body": body, "temp_disc": disc})["clutch_torque"]
        for body, disc in ((60.0, 60.0), (90.0, 90.0), (60.0, 120.0))
    )
    assert 0.0 < cold < hot_disc
    assert cold < hot_body


def test_torque_carries_the_sign_of_slip() -> None:
    evaluate = evaluator(DRY_CLUTCH, ["clutch_torque"])
    base = {**pressed(), "input_shaft_speed": 100.0}
    forward, still, backward = (
        evaluate({**base, "engine_speed": speed})["clutch_torque"] for speed in (120.0, 100.0, 80.0)
    )
    assert forward == -backward > 0.0
    assert still == 0.0


def test_worn_pads_lower_the_zero_position_and_shift_the_curve_with_it() -> None:
    evaluate = evaluator(DRY_CLUTCH, ["zero_position_reading", "reference_torque"])
    for base in points(DRY_CLUTCH)[:20]:
        new = evaluate(base)
        worn = {**base, "zero_position": base["zero_position"] - 0.7}
        assert evaluate(worn)["zero_position_reading"] == pytest.approx(
            new["zero_position_reading"] - 0.7
        )
        followed = evaluate({**worn, "slave_position": base["slave_position"] - 0.7})
        assert followed["reference_torque"] == pytest.approx(new["reference_torque"], abs=1e-8)


def test_the_disc_adds_nothing_beyond_110_kelvin() -> None:
    evaluate = evaluator(DRY_CLUTCH, ["expansion"])
    base = {**pressed(), "temp_body": 70.0}

    def expansion(over: float) -> float:
        return evaluate({**base, "temp_disc": 70.0 + over})["expansion"]

    assert expansion(110.0) == pytest.approx(0.0094 * 110.0)
    assert expansion(109.0) == pytest.approx(0.0094 * 109.0)
    assert expansion(111.0) == expansion(200.0) == expansion(110.0)
    assert expansion(-30.0) == pytest.approx(-0.0094 * 30.0)


def test_measured_power_counts_only_while_pressed_together() -> None:
    evaluate = evaluator(with_measured_power(DRY_CLUTCH), ["power"])
    for v in points(DRY_CLUTCH, engaged=0.0):
        assert evaluate(v)["power"] == 0.0


def test_power_of_locked_surfaces_is_zero() -> None:
    evaluate = evaluator(DRY_CLUTCH, ["power"])
    for v in points(DRY_CLUTCH, sliding=0.0)[:50]:
        assert evaluate(v)["power"] == 0.0


def test_speed_may_follow_its_measured_slope() -> None:
    evaluate = evaluator(following_speed(DRY_CLUTCH), ["engine_speed_rate"])
    for v in points(DRY_CLUTCH)[:50]:
        assert evaluate(v)["engine_speed_rate"] == v["engine_acceleration"]


def test_the_static_model_is_the_curve_alone() -> None:
    """M_c = M_ref(x), whatever the temperatures and the wear."""
    evaluate = evaluator(static(DRY_CLUTCH), ["reference_torque"])
    reached = 0
    for v in points(DRY_CLUTCH):
        x = v["slave_position"] - v["position_origin"]
        made = evaluate(v)["reference_torque"]
        assert isclose(made, curve(x, v), rel_tol=1e-12)
        reached += made > 0
    assert reached > POINTS // 4


def test_without_a_position_the_engine_tells_the_torque() -> None:
    names = ["clutch_torque", "power", "transmitted_torque", "engine_speed_rate"]
    evaluate = evaluator(WITHOUT_POSITION, names)
    for v in points(WITHOUT_POSITION):
        measured = (
            v["engine_torque"] - v["torque_bias"] - v["engine_inertia"] * v["engine_acceleration"]
        )
        slip = v["engine_speed"] - v["input_shaft_speed"]
        made = evaluate(v)
        assert isclose(made["clutch_torque"], v["engaged"] * measured, rel_tol=1e-12)
        assert isclose(made["power"], v["engaged"] * measured * slip, rel_tol=1e-12)
        assert made["engine_speed_rate"] == v["engine_acceleration"]
        wanted = v["engaged"] * measured if v["sliding"] else measured
        assert isclose(made["transmitted_torque"], wanted, rel_tol=1e-12)
    unknown = {"zero_position", "wear_rate", "friction", "torque_bias"}
    assert set(WITHOUT_POSITION.unobservable) == unknown
    assert "slave_position" not in {i.name for i in WITHOUT_POSITION.inputs}


def test_signals_at_hand_choose_the_model() -> None:
    every = set(machine_of("dry_clutch").units)
    assert machine_of("dry_clutch").equations(every) is DRY_CLUTCH
    assert machine_of("dry_clutch").equations(every - {"slave_position"}) is WITHOUT_POSITION
    assert machine_of("dry_clutch").equations(every - {"input_shaft_speed"}) is WITHOUT_SLIP


def test_without_slip_nothing_heats() -> None:
    evaluate = evaluator(WITHOUT_SLIP, ["power", "transmitted_torque", "engine_speed_rate"])
    for v in points(WITHOUT_SLIP, sliding=0.0, engaged=0.0)[:50]:
        measured = (
            v["engine_torque"] - v["torque_bias"] - v["engine_inertia"] * v["engine_acceleration"]
        )
        made = evaluate(v)
        assert made["power"] == 0.0
        assert isclose(made["transmitted_torque"], measured, rel_tol=1e-12)
        assert made["engine_speed_rate"] == v["engine_acceleration"]
    heated = {"temp_body", "temp_housing", "temp_disc"}
    assert heated | set(WITHOUT_POSITION.unobservable) <= set(WITHOUT_SLIP.unobservable)


# --- the collapse to two states ---


def trajectory(
    model: Model, v: dict[str, float], names: tuple[str, ...], span: float
) -> np.ndarray:
    """The named temperatures after ``span`` s of constant inputs and speeds."""
    from scipy.integrate import solve_ivp

    e = model.expressions()
    rate = ca.Function("rate", [e.x, e.u, e.w, e.p, e.g], [e.rate])
    x0, *rest = (vector(group, v) for group in argument_names(model))
    solved = solve_ivp(
        lambda _, x: np.array(rate(x, *rest)).ravel(),
        (0.0, span),
        x0,
        method="Radau",
        rtol=1e-9,
        atol=1e-9,
    )
    return np.array([solved.y[model.state(name), -1] for name in names])


def test_two_states_are_the_limit_of_a_disc_without_capacity() -> None:
    """(6)–(7) from (12)–(14) as (m c_p)_d → 0: the error falls in proportion."""
    v = {
        **pressed(),
        "engine_speed": 120.0,
        "input_shaft_speed": 80.0,
        "free_running": 0.0,
        "engine_acceleration": 0.0,
        "sliding": 1.0,
        "engaged": 1.0,
        "expansion_disc": 0.0,
    }
    temperatures = ("temp_body", "temp_housing")
    two = trajectory(two_state(DRY_CLUTCH), v, temperatures, 60.0)
    assert two[0] > truck()["reference_temp"] + 10.0  # the slip does heat the body
    errors = []
    for capacity in (200.0, 20.0, 2.0):
        three = trajectory(DRY_CLUTCH, {**v, "heat_capacity_disc": capacity}, temperatures, 60.0)
        errors.append(np.abs(three - two).max())
    assert errors[0] / errors[1] == pytest.approx(10.0, rel=0.05)
    assert errors[1] / errors[2] == pytest.approx(10.0, rel=0.05)


def test_two_states_use_the_body_alone_and_all_the_power() -> None:
    names = ["expansion", "temp_body_rate", "temp_disc_rate", "temp_housing_rate", "power"]
    evaluate = evaluator(two_state(DRY_CLUTCH), names)
    for v in points(DRY_CLUTCH):
        made = evaluate(v)
        heat = (
            v["conductance_engine_body"] * (v["coolant_temp"] - v["temp_body"])
            + v["conductance_body_housing"] * (v["temp_housing"] - v["temp_body"])
            + made["power"]
        )
        assert isclose(made["temp_body_rate"], heat / v["heat_capacity_body"], rel_tol=1e-9)
        assert made["temp_disc_rate"] == made["temp_body_rate"]
        body = v["expansion_body"] * (v["temp_body"] - v["reference_temp"])
        assert isclose(made["expansion"], body, rel_tol=1e-12)


# --- a model and its pieces ---


def test_swapping_what_is_not_there_is_refused() -> None:
    with pytest.raises(ValueError, match="no piece 'correction'"):
        static(static(DRY_CLUTCH))
    with pytest.raises(ValueError, match="no piece 'power_modelled'"):
        with_measured_power(WITHOUT_POSITION)
    with pytest.raises(ValueError, match="no piece 'temperatures'"):
        two_state(two_state(DRY_CLUTCH))


def test_a_piece_that_lacks_its_quantity_says_which() -> None:
    with pytest.raises(AttributeError, match="no quantity 'position'"):
        DRY_CLUTCH.without(equations.position).expressions()


def test_an_effect_on_a_quantity_that_is_not_there_is_refused() -> None:
    level = machine_of("dry_clutch").effects["friction_level"]
    with pytest.raises(AttributeError, match="sliding_torque"):
        WITHOUT_POSITION.with_effects((level,)).expressions()


def test_a_model_says_which_effects_it_takes() -> None:
    effects = machine_of("dry_clutch").effects
    assert DRY_CLUTCH.taking(effects.values()) == tuple(effects.values())
    refused = set(effects) - {effect.name for effect in WITHOUT_POSITION.taking(effects.values())}
    about_torque = {name for name, e in effects.items() if e.equation == "torque"}
    at_parameters = {"kiss_point", "expansion_disc"}  # there, if without consequence
    assert refused == about_torque - at_parameters | {
        "position_offset",
        "position_hysteresis",
        "position_delay",
    }
    for name in set(effects) - refused:
        WITHOUT_POSITION.with_effects((effects[name],)).expressions()


def test_variants_leave_the_original_as_it_was() -> None:
    pieces = DRY_CLUTCH.pieces
    static(DRY_CLUTCH), two_state(DRY_CLUTCH), DRY_CLUTCH.without_input("vehicle_speed")
    assert DRY_CLUTCH.pieces is pieces
    assert any(i.name == "vehicle_speed" for i in DRY_CLUTCH.inputs)


def test_the_card_names_what_the_equations_have() -> None:
    made = machine_of("dry_clutch")
    assert made.states == DRY_CLUTCH.states
    assert made.parameters == DRY_CLUTCH.parameters
    assert made.inputs == DRY_CLUTCH.inputs
    assert made.sensors == DRY_CLUTCH.sensors
    columns = set(made.units)
    assert {i.name for i in made.inputs} - columns == {"engine_acceleration"}


def test_rest_is_where_nothing_flows() -> None:
    """``at_rest`` is a steady state of (12)–(14) without slip."""
    names = [f"{t}_rate" for t in ("temp_body", "temp_housing", "temp_disc")]
    evaluate = evaluator(DRY_CLUTCH, names)
    for v in points(DRY_CLUTCH, sliding=0.0)[:50]:
        still = equations.at_rest(v, v)
        assert np.abs(list(evaluate({**v, **still}).values())).max() < 1e-12
        assert still["zero_position"] == v["zero_position_ref"]
        assert still["friction"] == 1.0
