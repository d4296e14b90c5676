"""The form of a named cause, tested over its own driver.  Truths here were used in development."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pytest

import clutchest
from clutchest.discovery.candidates import CandidateCause
from clutchest.discovery.discover import discover
from clutchest.discovery.effect_drivers import by_shapes, drivers_of
from clutchest.discovery.result import Cause, Form, FormCurve, Size
from clutchest.discovery.sentences import refuted, trend
from clutchest.inference.innovations import NO_DERIVATIVES
from clutchest.inference.objective import Objective
from clutchest.inference.problem import Problem
from clutchest.models import machine_of
from clutchest.record.discovery import write_discovery

TRUCK = clutchest.load_vehicle("truck")
EFFECTS = machine_of("dry_clutch").effects
KNOWN = ("slip_speed", "temp_disc", "engine_speed", "engine_torque", "vehicle_speed", "energy")


@pytest.mark.parametrize(
    ("effect", "gain", "drivers"),
    [
        ("friction_slip", "change", ("slip_speed",)),
        ("friction_fade", "slope", ("temp_disc",)),
        ("centrifugal", "slope", ("engine_speed",)),
        ("torque_gain", "change", ()),
        ("housing_airflow", "slope", ("vehicle_speed",)),
        ("wear", "rate", ("energy",)),
        ("wear", "amount", ()),
        ("kiss_point", "shift", ()),
        ("torque_delay", "delay", ()),
    ],
)
def test_an_effect_is_driven_by_what_its_terms_read(effect, gain, drivers):
    assert drivers_of(EFFECTS[effect], gain, KNOWN) == drivers


@pytest.mark.slow
def test_derivatives_by_a_shape_are_those_of_the_innovations():
    hidden = {"friction_slip": {"change": 0.2, "speed": 15.0}}
    log = clutchest.simulate(TRUCK, "launches", 11, hidden, duration=90.0)
    effect = EFFECTS["friction_slip"]
    problem = Problem.of(log, TRUCK, tuple(EFFECTS.values()))
    index = problem.index("friction_slip.change")
    cause = CandidateCause(effect, effect.gains[0], index, (("speed", 15.0),))
    objective, theta = Objective.of(problem), np.zeros(len(problem.thetas))
    theta[index] = 0.5
    sides = [
        objective.linearise_at(theta, {("friction_slip", "speed"): value}, NO_DERIVATIVES).r
        for value in (15.3, 14.7)
    ]
    fit = objective.linearise_at(theta, {("friction_slip", "speed"): 15.0})
    (exact,) = by_shapes(objective, fit, cause).T
    difference = (sides[0] - sides[1]) / 0.6
    assert np.sum((exact - difference) ** 2) < 0.02 * np.sum(difference**2)


def curve(data: np.ndarray, std: float = 0.01) -> FormCurve:
    at = np.linspace(80.0, 180.0, len(data))
    own = np.linspace(0.0, -10.0, len(data))
    return FormCurve("temp_disc", "torque", "%", at, own, data, np.full(len(data), std))


def test_words_say_which_way_the_data_go_where_they_do():
    assert trend(curve(np.linspace(0.0, -8.0, 9))) == "falls"
    assert trend(curve(np.linspace(0.0, 8.0, 9))) == "rises"
    assert trend(curve(np.sin(np.linspace(0.0, np.pi, 9)))) == "varies"
    assert trend(curve(np.linspace(0.0, 8.0, 9), std=5.0)) == "varies"
    form = Form("refuted", "", 2e-6, curve(np.linspace(0.0, -8.0, 9)))
    cause = Cause("friction_fade", "torque", {"slope": Size(0.1, 0.01)}, 80.0, 1e-9, form)
    words = refuted(cause, EFFECTS["friction_fade"])
    assert words.startswith("The form of friction_fade is refuted (p = 2e-06)")
    assert "falls with disc temperature, but not as friction_fade has it (Torque × (1" in words


class BellShaped:
    """Friction that rises as slip ends, by a bell-shaped curve: not exponentially."""

    def law(self):
        def act(seen: Mapping[str, float]) -> dict[str, float]:
            return {"torque_share": 0.3 * float(np.exp(-((seen["slip_speed"] / 20.0) ** 2)))}

        return act

    def readings(self, true):
        return true


@pytest.mark.slow
def test_a_near_miss_keeps_its_name_but_its_form_is_refuted(tmp_path: Path):
    log = clutchest.simulate(TRUCK, "launches", 101, duration=300.0, outsider=BellShaped())
    answer = discover(log, TRUCK)
    assert answer.verdict == "named"
    (cause,) = answer.causes
    assert (cause.effect, cause.form.state) == ("friction_slip", "refuted")
    assert cause.form.curve is not None and cause.form.curve.covariate == "slip_speed"
    assert "falls with slip speed, but not as friction_slip has it" in answer.sentence
    assert answer.where is not None and answer.where.covariates[0] == "slip_speed"
    assert answer.curve is not None, "the patch is data"
    assert tmp_path / "form.png" in write_discovery(answer, tmp_path)
    (told,) = json.loads((tmp_path / "discovery.json").read_text())["causes"]
    assert told["form"] == "refuted" and told["form_test"]["p_value"] < 0.01
    assert len(told["curve"]["at"]) == len(told["curve"]["data"]) == len(told["curve"]["std"])
    clutchest.replay(log, clutchest.load_vehicle(tmp_path / "extended.toml"))


@pytest.mark.slow
def test_a_form_that_is_right_is_held():
    hidden = {"friction_slip": {"change": 0.25, "speed": 15.0}}
    log = clutchest.simulate(TRUCK, "launches", 101, hidden, duration=300.0)
    (cause,) = discover(log, TRUCK).causes
    assert (cause.effect, cause.form.state) == ("friction_slip", "held")
