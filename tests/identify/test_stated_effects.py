"""Effects of the vehicle file whose numbers are not known exactly: their spreads are priors."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import clutchest
from clutchest.diagnosis.recursive_residuals import nuisances
from clutchest.estimate.whole_log import compile_model
from clutchest.inference.map_fit import improve
from clutchest.inference.objective import Objective
from clutchest.inference.problem import Problem
from clutchest.models import machine_of
from clutchest.signals import Signal, Signals
from clutchest.simulated import simulate, simulate_sampled
from clutchest.vehicle import Vehicle

TRUCK = clutchest.load_vehicle("truck")
LIBRARY = tuple(machine_of("dry_clutch").effects.values())
AT, SECONDS = (60.0, 130.0, 220.0), (0.06, 0.01, 0.03)
LATE = f"""
from clutchest.models.effects import Effect, Lateness, Number

class Uneven(Effect):
    name, model, equation = "uneven", "dry_clutch", "timing:engine_torque"
    parameters = (Number("size", "1", -2.0, 2.0),)
    delays = {{"engine_torque": "size"}}
    lateness = {{"engine_torque": Lateness("engine_speed", {AT}, {SECONDS})}}
"""


def stated(effect: str, key: str, value: float, spread: float) -> Vehicle:
    return replace(TRUCK, effects={effect: {key: value}}, effects_spread={effect: {key: spread}})


@pytest.mark.slow
def test_what_is_not_known_exactly_is_fitted_on(tmp_path: Path) -> None:
    """A size two spreads off the truth: the data bring it back, and with it what they lack."""
    true, spread = 0.06, 0.02
    vehicle = stated("torque_gain", "change", true - 2.0 * spread, spread)
    signals = simulate(
        TRUCK, "city", 5, {"torque_gain": {"change": true}}, nominal=True, duration=600.0
    )
    problem = Problem.of(signals, vehicle, LIBRARY)
    k = problem.index("torque_gain.change")
    assert k in problem.nuisances and problem.units[k] == spread
    objective = Objective.of(problem)
    begin = objective.linearise_at(np.zeros(len(problem.thetas)))
    fit = improve(objective, begin, problem.nuisances)
    assert fit.theta[k] == pytest.approx(2.0, abs=1.0)
    exact = Problem.of(signals, replace(vehicle, effects_spread={}), LIBRARY)
    assert exact.index("torque_gain.change") not in exact.nuisances


def test_a_filter_holds_them_as_uncertain() -> None:
    signals = simulate(TRUCK, "city", 5, duration=200.0)
    exact = replace(TRUCK, effects={"torque_gain": {"change": 0.03}})
    vehicle = stated("torque_gain", "change", 0.03, 0.05)
    compiled = compile_model(vehicle, machine_of("dry_clutch").equations(signals.available))
    assert compiled.spread[compiled.thetas.index(("torque_gain", "change"))] == 0.05
    sure, unsure = (clutchest.replay(signals, v).to_pandas() for v in (exact, vehicle))
    assert unsure["friction_std"].iloc[-1] > 1.2 * sure["friction_std"].iloc[-1]
    changed = clutchest.replay(signals, vehicle).provenance["parameters_hash"]
    assert changed != clutchest.replay(signals, exact).provenance["parameters_hash"]


@pytest.mark.slow
def test_a_delay_that_varies_is_as_uncertain_as_one_that_does_not(tmp_path: Path) -> None:
    """Of a curve that is the same everywhere, in s: its size counts for so many."""
    flat = LATE.replace(str(SECONDS), "(0.02, 0.02, 0.02)")
    (tmp_path / "flat.py").write_text(flat, encoding="utf-8")
    curve = replace(stated("uneven", "size", 0.0, 0.5), effects_files=(tmp_path / "flat.py",))
    signals = simulate(TRUCK, "city", 5, duration=120.0)
    std = [
        clutchest.replay(signals, vehicle).to_pandas()["clutch_torque_std"].to_numpy()
        for vehicle in (curve, stated("torque_delay", "delay", 0.0, 0.01), TRUCK)
    ]
    np.testing.assert_allclose(std[0], std[1], rtol=1e-9)
    assert np.max(std[0] - std[2]) > 1.0


def test_what_is_exact_is_no_nuisance_of_a_diagnosis() -> None:
    signals = simulate(TRUCK, "city", 5, duration=120.0)
    for spread, counts in ((0.0, False), (0.01, True)):
        vehicle = stated("torque_gain", "change", 0.03, spread)
        thetas = Problem.of(signals, vehicle, LIBRARY).thetas
        free, _, _ = nuisances(thetas, TRUCK.machine.states)
        assert ("torque_gain.change" in [str(thetas[i]) for i in free]) == counts


def test_a_wear_rate_of_the_file_is_as_uncertain_as_it_says() -> None:
    """In a drive too short to tell much of wear, both uncertainties of its rate add up."""
    signals = simulate(TRUCK, "city", 5, duration=200.0)
    vehicle = stated("wear", "rate", 0.02, 0.08)
    exact = replace(vehicle, effects_spread={})
    own, both = (clutchest.replay(signals, v).summary["wear"]["rate"] for v in (exact, vehicle))
    assert both["value"] == pytest.approx(own["value"], abs=0.02)
    assert 0.08 < both["std"] <= np.hypot(own["std"], 0.08)


@pytest.fixture(scope="module")
def uneven(tmp_path_factory: pytest.TempPathFactory) -> tuple[Vehicle, Signals]:
    """A truck whose torque report is late by turns in its file, of size 0 ± 1, and a drive, nearly
    without noise, in which it is so by the whole curve."""
    path = tmp_path_factory.mktemp("effects") / "uneven.py"
    path.write_text(LATE, encoding="utf-8")
    fine = {n: replace(s, noise=1e-3 * s.noise, noise_ar=0.0) for n, s in TRUCK.signals.items()}
    made = simulate_sampled(replace(TRUCK, signals=fine), "city", 3, nominal=True, duration=300.0)
    signals = {n: Signal.of(n, "", time, value) for n, (time, value) in made.signals.items()}
    torque, speed = signals["engine_torque"], signals["engine_speed"]
    by = np.interp(speed.at(torque.time), AT, SECONDS)
    late = replace(torque, value=np.interp(torque.time - by, torque.time, torque.value))
    vehicle = replace(stated("uneven", "size", 0.0, 1.0), effects_files=(path,))
    return vehicle, Signals(signals | {"engine_torque": late}, end=300.0, truth=made.truth)


def test_a_delay_that_varies_is_undone_by_its_size(uneven) -> None:
    vehicle, signals = uneven
    problem = Problem.of(signals, vehicle, ())
    k, theta = problem.index("uneven.size"), np.zeros(len(problem.thetas))
    shows = problem.drives[0].readings.sensor == problem.compiled.model.sensor("engine_speed")

    def misses(size: float) -> float:
        theta[k] = size
        return float(np.mean(problem.linearise(theta, {})[0].r[shows] ** 2))

    assert misses(1.0) < 0.1 * misses(0.0) < 0.1 * misses(-1.0)


def test_where_nothing_tells_what_it_goes_with_it_is_at_its_most(uneven) -> None:
    """As a replay has it, which puts all samples off until they are at their latest."""
    vehicle, signals = uneven
    path = vehicle.effects_files[0]
    ambient = LATE.replace("engine_speed", "ambient_temp")
    other = path.with_name("ambient.py")
    other.write_text(ambient, encoding="utf-8")
    there = signals["coolant_temp"]
    lost = Signal.of("ambient_temp", "", there.time, np.full(len(there), np.nan))
    without = {n: s for n, s in signals.items() if n != "ambient_temp"}
    for left in (without, without | {"ambient_temp": lost}):
        problem = Problem.of(
            replace(signals, signals=left), replace(vehicle, effects_files=(other,)), ()
        )
        np.testing.assert_array_equal(problem.drives[0].delayed[0].size, max(SECONDS))


def test_its_derivative_is_the_differences(uneven) -> None:
    vehicle, signals = uneven
    problem = Problem.of(signals, vehicle, ())
    k, theta, h = problem.index("uneven.size"), np.zeros(len(problem.thetas)), 0.05
    rows = problem.linearise(theta, {}, at=problem.implied(theta, {}))[0]
    step, none = np.zeros(len(theta)), np.zeros(0, np.int64)
    step[k] = h
    above, below = (problem.linearise(theta + s, {}, none)[0].r for s in (step, -step))
    difference = (above - below) / (2.0 * h)
    off = np.linalg.norm(rows.psi[:, k] - difference) / np.linalg.norm(difference)
    assert off < 0.1
