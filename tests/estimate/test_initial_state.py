"""Priors and process noise: the vehicle file's, a parameter's spread, or the state's own."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from clutchest.estimate.drive_setup import DriveSetup
from clutchest.models import machine_of
from clutchest.models.model import Model
from clutchest.vehicle import Estimation, Vehicle, load_vehicle
from clutchest.vehicle.state_uncertainty import prior_std, process_noise


def plain(name: str) -> tuple[Vehicle, Model]:
    """A shipped vehicle that states nothing of its states, and its equations."""
    vehicle = load_vehicle(name)
    machine = vehicle.machine
    return replace(vehicle, estimation={}), machine.equations(machine.units)


def with_spread(vehicle: Vehicle, key: str, spread: float) -> Vehicle:
    parameter = replace(vehicle.parameters[key], spread=spread)
    return replace(vehicle, parameters={**vehicle.parameters, key: parameter})


@pytest.mark.parametrize("name", ["truck", "alsd_rig"])
def test_a_state_without_anything_stated_has_its_own_prior(name: str) -> None:
    vehicle, model = plain(name)
    stds = prior_std(vehicle, model)
    own = [i for i, state in enumerate(model.states) if not state.prior]
    assert own
    assert stds[own].tolist() == [model.states[i].initial_std for i in own]


def test_the_files_standard_deviation_is_the_prior() -> None:
    vehicle, model = plain("truck")
    before = prior_std(vehicle, model)
    stated = {
        name: Estimation("adaptive", 1e-3, 0.0625, 1.0, 0.0) for name in ("friction", "temp_body")
    }
    stds = prior_std(replace(vehicle, estimation=stated), model)
    changed = [model.state(name) for name in stated]
    assert stds[changed].tolist() == [0.0625, 0.0625]
    assert np.array_equal(np.delete(stds, changed), np.delete(before, changed))


def test_the_spread_of_a_states_nominal_value_is_its_prior_unless_the_file_states_one() -> None:
    vehicle, model = plain("truck")
    row = model.state("zero_position")
    vehicle = with_spread(vehicle, "zero_position_ref", 0.375)
    assert prior_std(vehicle, model)[row] == 0.375
    stated = {"zero_position": Estimation("adaptive", 1e-5, 0.125, 1.0, 0.0)}
    assert prior_std(replace(vehicle, estimation=stated), model)[row] == 0.125
    unknown = with_spread(vehicle, "zero_position_ref", 0.0)
    assert prior_std(unknown, model)[row] == model.states[row].initial_std


def test_a_relative_state_has_the_relative_spread() -> None:
    vehicle, model = plain("alsd_rig")
    vehicle = with_spread(vehicle, "friction_coefficient", 0.02)
    expected = 0.02 / vehicle.parameters["friction_coefficient"].value
    assert prior_std(vehicle, model)[model.state("friction")] == pytest.approx(expected, rel=1e-12)


def test_process_noise_is_the_files_where_it_states_one_and_none_of_a_held_state() -> None:
    vehicle, model = plain("truck")
    n = len(model.states)
    stated = {
        "temp_body": Estimation("adaptive", 0.5, 1.0, 1.0, 0.0),
        "zero_position": Estimation("constant", 0.5, 1.0, 1.0, 0.0),
        "friction": Estimation("nuisance", 0.5, 1.0, 1.0, 0.0),
    }
    density = process_noise(replace(vehicle, estimation=stated), model)
    held = [model.state("zero_position"), model.state("friction")]
    assert density[model.state("temp_body")] == 0.25
    assert density[held].tolist() == [0.0, 0.0]
    assert density[[n + row for row in held]].tolist() == [0.0, 0.0]
    others = [i for i, state in enumerate(model.states) if state.name not in stated]
    assert density[others].tolist() == [model.states[i].process_noise ** 2 for i in others]
    assert process_noise(vehicle, model)[n + held[0]] == model.states[held[0]].slip_noise ** 2


def test_a_parked_vehicle_has_the_noise_of_a_parked_one() -> None:
    vehicle, model = plain("truck")
    density = process_noise(vehicle, model, parked=True)
    assert density[: len(model.states)].tolist() == [s.parked_noise**2 for s in model.states]


def test_a_renewed_state_is_a_random_walk_where_its_flag_is_0() -> None:
    vehicle, model = plain("truck")
    flags, density, longest = DriveSetup(vehicle, model, 10.0, {}).tables
    n = len(model.states)
    for name, (flag, noise) in model.renewed.items():
        row, free = model.state(name), flags[:, model.regime.index(flag)] == 1
        assert (density[~free, row] == noise**2).all()
        assert (density[free, row] == model.states[row].process_noise ** 2).all()
        others = [i for i in range(2 * n) if i != row]
        assert (density[:, others] == process_noise(vehicle, model)[others]).all()
    slides = flags[:, model.regime.index("sliding")] == 1
    assert (longest[slides] == model.longest[0]).all()
    assert (longest[~slides] == model.longest[1]).all()


def test_every_prior_names_a_parameter() -> None:
    for name in ("dry_clutch", "alsd"):
        machine = machine_of(name)
        keys = {parameter.key for parameter in machine.parameters}
        assert {state.prior for state in machine.states if state.prior} <= keys
