"""Warnings beside the answer."""

from __future__ import annotations

from types import SimpleNamespace

import pytest

from clutchest.discovery.sentences import doubtful


@pytest.mark.parametrize(("p", "said"), [(5e-5, True), (2e-4, False)])
def test_an_error_that_a_second_drive_would_decide_is_said(p: float, said: bool) -> None:
    errors = [SimpleNamespace(equation=name, p_value=p) for name in ("torque", "body_heat")]
    warnings = doubtful(errors)
    assert len(warnings) == said
    assert all("'torque' has p = 5e-05" in warning for warning in warnings)
    assert doubtful([]) == ()
