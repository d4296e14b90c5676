"""What a stiff state's step is made of keeps its digits, however little decays within it."""

from __future__ import annotations

from decimal import Decimal, localcontext

import casadi as ca
import numpy as np
import pytest

from clutchest.compute.step import _phi
from clutchest.estimate.ekf import phi

DECAYS = [-(10.0**exponent) for exponent in np.linspace(-12.0, 2.5, 59)]


def exact(z: float) -> list[float]:
    """φ_1, φ_2 and their derivatives, in sixty digits."""
    with localcontext() as context:
        context.prec = 60
        d = Decimal(z)
        e = d.exp()
        one = (e - 1) / d
        two = (one - 1) / d
        by_one = (e - one) / d
        return [float(v) for v in (one, two, by_one, (by_one - two) / d)]


@pytest.mark.parametrize("engine", ["lowered", "online"])
def test_quotients_and_derivatives_keep_their_digits(engine: str) -> None:
    z = ca.SX.sym("z")
    one, two = _phi(z)
    made = ca.Function("phi", [z], [one, two, ca.jacobian(one, z), ca.jacobian(two, z)])
    for value in DECAYS:
        found = made(value) if engine == "lowered" else phi(np.array([value]))
        np.testing.assert_allclose(np.array(found).ravel(), exact(value), rtol=1e-12)


def test_without_decay_it_is_heuns_rule() -> None:
    z = ca.SX.sym("z")
    assert [float(v) for v in ca.Function("phi", [z], [*_phi(z)])(0.0)] == [1.0, 0.5]
    assert [float(v[0]) for v in phi(np.zeros(1))][:2] == [1.0, 0.5]
