"""The form of a named cause, tested over its own driver.  Truths here were used in development."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import pytest

import clutchest
from clutchest.discovery.discover import discover
from clutchest.discovery.effect_drivers import drivers_of
from clutchest.discovery.result import Cause, Form, FormCurve, Size
from clutchest.discovery.sentences import refuted, trend
from clutchest.models import machine_of

TRUCK = clutchest.load_vehicle("truck")
EFFECTS = machine_of("dry_clutch").effects
KNOWN = ("slip_speed", "temp_disc", "engine_speed", "engine_torque", "vehicle_speed", "energy")


@pytest.mark.parametrize(
    ("effect", "gain", "drivers"),
    [
        ("friction_slip", "change", ("slip_speed",)),
        ("friction_fade", "slope", ("temp_disc",)),
        ("centrifugal", "slope", ("engine_speed",)),
        ("torque_gain", "change", ("engine_torque",)),
        ("housing_airflow", "slope", ("vehicle_speed",)),
        ("wear", "rate", ("energy",)),
        ("wear", "amount", ()),
        ("kiss_point", "shift", ()),
        ("torque_delay", "delay", ()),
    ],
)
def test_an_effect_is_driven_by_what_its_terms_read(effect, gain, drivers):
    assert drivers_of(EFFECTS[effect], gain, KNOWN) == drivers


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
    assert "falls with temp_disc, but not as friction_fade has it (Torque × (1" in words


class Parabola:
    """Friction falls with the square of the disc's temperature above 80 °C."""

    def law(self):
        def act(seen: Mapping[str, float]) -> dict[str, float]:
            return {"torque_share": -0.15 * (max(seen["temp_disc"] - 80.0, 0.0) / 100.0) ** 2}

        return act

    def readings(self, true):
        return true


class SettlingWear:
    """Wear that comes to an end: pads that run in."""

    def law(self):
        def act(seen: Mapping[str, float]) -> dict[str, float]:
            return {"zero_position": -0.3 * (1.0 - float(np.exp(-seen["energy"] / 6e5)))}

        return act

    def readings(self, true):
        return true


@pytest.mark.slow
@pytest.mark.parametrize(
    ("truth", "scenario", "name", "driver"),
    [
        (Parabola(), "pulses", "friction_fade", "temp_disc"),
        (SettlingWear(), "mixed", "wear", "energy"),
    ],
    ids=["parabola", "settling wear"],
)
def test_a_near_miss_is_no_name(truth, scenario, name, driver):
    log = clutchest.simulate(TRUCK, scenario, 101, duration=700.0, outsider=truth)
    answer = discover(log, TRUCK)
    assert answer.verdict in ("named", "unknown")
    if answer.verdict == "named":
        (cause,) = (c for c in answer.causes if c.effect == name)
        assert cause.form.state == "refuted"
        assert cause.form.curve is not None and cause.form.curve.covariate == driver
        assert f"The form of {name} is refuted" in answer.sentence


@pytest.mark.slow
@pytest.mark.parametrize(
    ("hidden", "scenario"),
    [
        ({"friction_slip": {"change": 0.25, "speed": 15.0}}, "launches"),
        ({"wear": {"amount": 0.0, "rate": 0.3}}, "launches"),
    ],
    ids=["friction_slip", "wear"],
)
def test_a_form_that_is_right_is_not_refuted(hidden, scenario):
    log = clutchest.simulate(TRUCK, scenario, 101, hidden, duration=700.0)
    answer = discover(log, TRUCK)
    (name,) = hidden
    assert name in {c.effect for c in answer.causes}
    assert all(c.form.state != "refuted" for c in answer.causes)
