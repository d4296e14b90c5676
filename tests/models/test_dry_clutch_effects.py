"""What every effect of the dry clutch does, written a second time in plain numbers."""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise

import casadi as ca
import numpy as np
import pytest

from bench import BENCHES
from clutchest.models import machine_of
from clutchest.models.dry_clutch.equations import DRY_CLUTCH
from clutchest.models.model import Model
from clutchest.vehicle import load_vehicle
from equations import argument_names, draw, evaluator, vector

EFFECTS = machine_of("dry_clutch").effects
TRUCK = {key: value.value for key, value in load_vehicle("truck").parameters.items()}
MADE = [f"{state.name}_rate" for state in DRY_CLUTCH.states]
MADE += ["engine_speed_reading", "zero_position_reading", "transmitted_torque", "power"]

Values = dict[str, float]
Says = Callable[[Values, Values, Values], Values]


def scaled(key: str) -> Says:
    """A parameter × (1 + change)."""
    return lambda v, g, q: {key: v[key] * (1 + g["change"])}


def friction(factor: Callable[[Values, Values, Values], float]) -> Says:
    """Torque times a factor."""
    return lambda v, g, q: {"friction": v["friction"] * factor(v, g, q)}


# Effect → the same equations at which other values; v all values, g the effect's numbers,
# q slip speed and corrected position.
SAYS: dict[str, Says] = {
    "friction_level": friction(lambda v, g, q: 1 + g["change"]),
    "friction_slip": friction(
        lambda v, g, q: 1 + g["change"] * np.exp(-abs(q["slip_speed"]) / g["speed"])
    ),
    "friction_speed": friction(lambda v, g, q: 1 + g["slope"] * abs(q["slip_speed"]) / 100),
    "friction_temperature": friction(lambda v, g, q: 1 + g["slope"] * (v["temp_disc"] - 100) / 100),
    "friction_fade": friction(
        lambda v, g, q: 1 - g["slope"] * max(v["temp_disc"] - g["onset"], 0) / 100
    ),
    "torque_curve": friction(
        lambda v, g, q: 1 + g["change"] * (v["kiss_point"] - max(q["corrected_position"], 0.0))
    ),
    "centrifugal": friction(lambda v, g, q: 1 + g["slope"] * (v["engine_speed"] / 100) ** 2),
    "torque_gain": lambda v, g, q: {"engine_torque": v["engine_torque"] / (1 + g["change"])},
    "torque_bias": lambda v, g, q: {"engine_torque": v["engine_torque"] - g["bias"]},
    "engine_inertia": scaled("engine_inertia"),
    "kiss_point": lambda v, g, q: {"kiss_point": v["kiss_point"] + g["shift"]},
    "expansion_body": scaled("expansion_body"),
    "expansion_disc": scaled("expansion_disc"),
    "heat_capacity_disc": scaled("heat_capacity_disc"),
    "heat_capacity_body": scaled("heat_capacity_body"),
    "heat_split": lambda v, g, q: {"heat_fraction_body": v["heat_fraction_body"] + g["fraction"]},
    "coolant_coupling": scaled("conductance_engine_body"),
    "housing_airflow": lambda v, g, q: {
        "conductance_housing_ambient": v["conductance_housing_ambient"]
        * (1 + g["slope"] * v["vehicle_speed"] / 20)
    },
    "position_offset": lambda v, g, q: {"slave_position": v["slave_position"] - g["offset"]},
    "position_hysteresis": lambda v, g, q: {
        "slave_position": v["slave_position"] + v["position_play"]
    },
    "torque_delay": lambda v, g, q: {},
    "position_delay": lambda v, g, q: {},
    "transmission_heat_path": lambda v, g, q: {},
    "wear": lambda v, g, q: {},
    "viscous_drag": lambda v, g, q: {},
}

# … and what it adds to the outputs; q holds power and the rest without the effect.
ADDS: dict[str, Callable[[Values, Values, Values], Values]] = {
    "position_offset": lambda v, g, q: {"zero_position_reading": g["offset"]},
    "transmission_heat_path": lambda v, g, q: {
        "temp_body_rate": -g["conductance"] * (v["temp_body"] - 80) / v["heat_capacity_body"]
    },
    "wear": lambda v, g, q: {"zero_position_rate": -g["rate"] * q["power"] / 1e6},
    "viscous_drag": lambda v, g, q: drag(v, g["coefficient"] * q["slip_speed"] / 100, q),
}


def drag(v: Values, torque: float, q: Values) -> Values:
    """A torque on top of the clutch's own, and its heat."""
    heat = v["sliding"] * torque * q["slip_speed"]
    share = v["heat_fraction_body"]
    return {
        "transmitted_torque": v["sliding"] * torque,
        "power": heat,
        "zero_position_rate": -v["wear_rate"] * heat / 1e6,
        "temp_body_rate": share * heat / v["heat_capacity_body"],
        "temp_disc_rate": (1 - share) * heat / v["heat_capacity_disc"],
        "engine_speed_rate": -v["free_running"] * torque / v["engine_inertia"],
    }


def points(model: Model, name: str) -> list[tuple[Values, Values]]:
    """Values of everything, and the effect's numbers, anywhere within their bounds."""
    plausible, rng = BENCHES["dry_clutch"].plausible, np.random.default_rng(11)
    ranges = {s.name: plausible.states[s.name] for s in model.states}
    ranges |= {i.name: plausible.inputs[i.name] for i in model.inputs}
    numbers = {n.key: (n.lower, n.upper) for n in EFFECTS[name].parameters}
    drawn = []
    for _ in range(100):
        values = {**draw(rng, ranges), **TRUCK, "heat_fraction_body": 0.3}
        values |= {flag: float(rng.integers(2)) for flag in model.regime}
        drawn.append((values, draw(rng, numbers)))
    return drawn


def test_every_effect_has_its_words() -> None:
    assert set(SAYS) == set(EFFECTS)


@pytest.mark.parametrize("name", SAYS)
def test_an_effect_does_what_its_equation_says(name: str) -> None:
    model = DRY_CLUTCH.with_effects((EFFECTS[name],))
    present = evaluator(model, MADE)
    absent = evaluator(DRY_CLUTCH, [*MADE, "slip_speed", "corrected_position"])
    known = {key for group in argument_names(DRY_CLUTCH) for key in group}
    changed = 0
    for values, numbers in points(model, name):
        plain = {key: value for key, value in values.items() if key in known}
        made = present({**values, **{f"{name}.{key}": v for key, v in numbers.items()}})
        other = absent({**plain, **SAYS[name](values, numbers, absent(plain))})
        added = ADDS.get(name, lambda v, g, q: {})(values, numbers, other)
        for key in MADE:
            wanted = other[key] + added.get(key, 0.0)
            assert made[key] == pytest.approx(wanted, rel=1e-10, abs=1e-12), key
        changed += made != {key: value for key, value in absent(plain).items() if key in made}
    assert (changed > 0) == (not EFFECTS[name].delays), "delays act on time stamps alone"


def test_worn_pads_start_lower() -> None:
    model = DRY_CLUTCH.with_effects((EFFECTS["wear"],))
    evaluate = evaluator(model, ["initial_zero_position", "initial_temp_body"])
    made = evaluate({"zero_position": 38.4, "temp_body": 70.0, "wear.amount": 0.5})
    assert made == {"initial_zero_position": pytest.approx(37.9), "initial_temp_body": 70.0}


@pytest.mark.parametrize("estimated", [0.0, 0.1])
def test_a_megajoule_wears_its_rate(estimated: float) -> None:
    """The rates of the effect and of the state add up."""
    evaluate = evaluator(
        DRY_CLUTCH.with_effects((EFFECTS["wear"],)), ["zero_position_rate", "power"]
    )
    values, _ = next(v for v in points(DRY_CLUTCH, "wear") if v[0]["sliding"] == 1.0)
    values |= {"slave_position": 42.0, "zero_position": 38.4, "wear_rate": estimated}
    made = evaluate({**values, "wear.rate": 0.2})
    assert made["power"] > 0.0
    assert made["zero_position_rate"] * 1e6 / made["power"] == pytest.approx(-0.2 - estimated)


@pytest.mark.parametrize("play", [0.0, 0.1, 0.5])
def test_the_plate_follows_the_sensor_with_play(play: float) -> None:
    """y ← x clipped to y ± play: held while x moves inside, dragged along at the ends."""
    model = DRY_CLUTCH.with_effects((EFFECTS["position_hysteresis"],))
    e = model.expressions()
    step = ca.Function("map", [e.x, e.u0, e.u, e.p, e.g], [e.mapped])
    names = argument_names(model)
    rng = np.random.default_rng(12)
    trajectory = np.cumsum(rng.normal(0.0, 0.1, 300)) + 44.0
    row, plate = model.state("position_play"), trajectory[0]
    x = np.zeros(len(names[0]))
    for before, after in pairwise(trajectory):
        u0, u1 = (vector(names[1], {"slave_position": at}) for at in (before, after))
        others = rng.normal(size=len(x))
        x = np.where(np.arange(len(x)) == row, x, others)
        x = np.array(step(x, u0, u1, vector(names[3], TRUCK), [play])).ravel()
        plate = np.clip(plate, after - play, after + play)
        assert after + x[row] == pytest.approx(plate, abs=1e-11)
        assert np.array_equal(np.delete(x, row), np.delete(others, row)), "no other state jumps"


def test_only_a_play_drags() -> None:
    """The input that is dragged along behind, and the number by which, follow from the map."""
    model = DRY_CLUTCH.with_effects(tuple(EFFECTS.values()))
    result = model.expressions()
    assert [model.inputs[j].name for j in result.dragging] == ["slave_position"]
    named = [(effect.name, number) for effect, number in model.numbers]
    assert [named[k] for k in result.plays] == [("position_hysteresis", "play")]
    assert DRY_CLUTCH.expressions().plays == []


@pytest.mark.parametrize("hotter", [-40.0, 0.0, 15.0, 90.0])
def test_the_disc_expands_until_it_is_hotter_than_the_plate_by_its_cap(hotter):
    """Flywheel and plate as two masses: the plate's own temperature counts, not the body's mean."""
    machine, truck = machine_of("dry_clutch"), load_vehicle("truck")
    model = machine.equations(machine.units).with_effects((machine.unmodelled["flywheel"],))
    e = model.expressions()
    p = {q.key: truck.parameters[q.key].value for q in model.parameters}
    g = np.array([1.0 if key == "slip" else 0.0 for _, key in model.numbers])
    x = np.zeros((1, len(model.states)))
    body, over = 80.0, p["disc_body_temp_cap"] + 30.0
    for name, value in (("temp_body", body), ("temp_disc", body + over), ("plate_by_slip", hotter)):
        x[0, model.state(name)] = value
    u, w = np.zeros((1, len(model.inputs))), np.zeros((1, e.w.numel()))
    ((expansion,),) = e.along(e.quantities.expansion, x, u, w, np.array(list(p.values())), g)
    plate = body + hotter
    disc = min(body + over - plate, p["disc_body_temp_cap"])
    expected = p["expansion_body"] * (plate - p["reference_temp"]) + p["expansion_disc"] * disc
    assert expansion == pytest.approx(expected, rel=1e-9)
