"""Where the error is, as it is said."""

from __future__ import annotations

import numpy as np

from clutchest.discovery.answer import where_of
from clutchest.discovery.result import Cause, Form, FormCurve


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
        where = where_of("named", order, (), (), {})
        assert where is not None
        assert (where.equation, where.covariates[0]) == ("torque", "slip_speed")
