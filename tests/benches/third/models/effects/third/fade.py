"""Friction that fades with heat."""

import casadi as ca

from clutchest.models.effects.effect import Effect, Number


class Fade(Effect):
    """T_C × exp(−``slope`` · (ϑ − 20)/100)."""

    name = "fade"
    model = "third"
    equation = "torque"
    parameters = (Number("slope", "1/(100 K)", -0.5, 0.5),)

    def terms(self, g):
        return {
            "sliding_torque": lambda torque, q: torque * ca.exp(-g.slope * (q.temp - 20.0) / 100.0)
        }
