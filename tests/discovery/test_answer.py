"""Where the error is, as it is said."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from clutchest.discovery.answer import where_of
from clutchest.discovery.experiment_design import sensor_for
from clutchest.discovery.residual_curves import Curve
from clutchest.discovery.result import Cause, Form, FormCurve
from clutchest.discovery.where import places_words
from clutchest.models import machine_of


def refuted(effect: str, equation: str, driver: str, p_value: float) -> Cause:
    line = np.linspace(0.0, 1.0, 3)
    curve = FormCurve(driver, "torque", "%", line, line, line, line, False)
    return Cause(effect, equation, {}, 80.0, 1e-9, Form("refuted", "", p_value, curve))


def test_of_several_wrong_forms_the_surest_is_the_error():
    causes = (
        refuted("position_hysteresis", "sensor:slave_position", "temp_housing", 4e-3),
        refuted("friction_slip", "torque", "slip_speed", 8e-7),
    )
    for order in (causes, causes[::-1]):
        where = where_of("named", order, (), (), (), {})
        assert where is not None
        assert (where.equation, where.covariates[0]) == ("torque", "slip_speed")


def test_an_error_that_has_a_name_goes_with_what_its_effect_reads():
    """Whatever curves without the cause are likelier: in a short drive all goes with time."""
    cause = Cause("friction_slip", "torque", {}, 80.0, 1e-9, drivers=("slip_speed",))
    knots = np.linspace(0.0, 1.0, 5)
    errors = [
        Curve("torque", "torque", covariate, knots, knots, np.eye(5), 50.0, 40.0, 1e-6)
        for covariate in ("time", "slip_speed", "temp_disc")
    ]
    where = where_of("named", (cause,), errors, (), (), {})
    assert where is not None
    assert where.covariates == ("slip_speed", "time", "temp_disc")
    where = where_of("named", (replace(cause, drivers=()),), errors, (), (), {})
    assert where is not None and where.covariates[0] == "time"


def test_an_error_that_may_be_in_either_of_two_equations_is_said_to_be():
    knots = np.linspace(0.0, 1.0, 5)
    errors = [
        Curve(term, term, "engine_speed", knots, knots, np.eye(5), 50.0, 40.0, 1e-6)
        for term in ("torque", "sensor:slave_position")
    ]
    where = where_of("unknown", (), errors, (), ["sensor:slave_position"], {})
    assert where is not None and where.errors[0]["instead"] == ["sensor:slave_position"]
    assert where.errors[0]["instead_drivers"] == {"sensor:slave_position": ["engine_speed"]}
    cause = refuted("friction_slip", "torque", "slip_speed", 1e-5)
    named = where_of("named", (cause,), errors, (), ["sensor:slave_position"], {})
    assert named is not None and named.instead == where.instead
    assert named.summary()["instead_drivers"] == where.errors[0]["instead_drivers"]
    words = places_words(where)
    assert words.startswith("the equation torque that correlates with ")
    instead = "the readings of slave_position that correlates with engine speed"
    assert words.endswith(f" or in {instead} (the data do not say in which)")
    assert sensor_for("torque", "disc_heat", machine_of("dry_clutch")).words.startswith(
        "a temperature sensor near the disc would tell"
    )


def test_covariates_that_are_as_likely_as_the_first_are_said_to_be():
    knots = np.linspace(0.0, 1.0, 5)
    likely = {"temp_body": 900.0, "temp_body_peak": 899.0, "slip_rate": 896.0, "time": 880.0}
    errors = [
        Curve("torque", "torque", covariate, knots, knots, np.eye(5), 50.0, evidence, 1e-6)
        for covariate, evidence in likely.items()
    ]
    peaks = {"temp_body_peak": "temp_body"}
    where = where_of("unknown", (), errors, (), (), peaks)
    assert where is not None and where.covariates == ("temp_body", "slip_rate", "time")
    assert where.tied == ("slip_rate",) and where.errors[0]["tied"] == ["slip_rate"]
    reordered = where_of("unknown", (), [errors[3], *errors], (), (), peaks)
    assert reordered is not None and reordered.tied == ()  # held-out drives have said which
