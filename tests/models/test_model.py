"""A model as a value: its equations are written out once, those of another model anew."""

from __future__ import annotations

import casadi as ca
import numpy as np
import pytest

from clutchest.models import machine_of
from clutchest.models.model import BLOCK


def test_equations_are_written_out_once():
    machine = machine_of("dry_clutch")
    model = machine.equations(machine.units)
    assert model.expressions() is model.expressions()


def test_another_model_has_equations_of_its_own():
    machine = machine_of("dry_clutch")
    model = machine.equations(machine.units)
    model.expressions()
    faded = model.with_effects((machine.effects["friction_fade"],))
    assert faded.expressions().g.numel() == 2 and model.expressions().g.numel() == 0


@pytest.mark.parametrize("moments", [1, BLOCK - 1, BLOCK, 2 * BLOCK + 3])
def test_values_along_a_drive_are_those_of_each_moment(moments):
    machine, rng = machine_of("dry_clutch"), np.random.default_rng(1)
    e = machine.equations(machine.units).expressions()
    p, g = rng.uniform(1.0, 2.0, e.p.numel()), np.zeros(e.g.numel())
    x, u, w = (
        np.asfortranarray(rng.uniform(0.5, 2.0, (moments, of.numel()))) for of in (e.x, e.u, e.w)
    )
    wanted = ca.vertcat(e.rate, ca.SX(1, 1))
    values = e.along(wanted, x, u, w, p, g)
    alone = ca.Function("alone", [e.x, e.u, e.w, e.p, e.g], [wanted])
    for k in {0, moments // 2, moments - 1}:
        expected = np.array(alone(x[k], u[k], w[k], p, g)).ravel()
        np.testing.assert_allclose(values[:, k], expected, rtol=1e-12, atol=1e-12)
