"""The identification experiments I1 to I8 of [ID08], one file each, and the benches they need."""

from clutchest.models.alsd.experiments.ball_ramp_loop import I6
from clutchest.models.alsd.experiments.benches import BENCHES
from clutchest.models.alsd.experiments.inductance import I2
from clutchest.models.alsd.experiments.motor_runs import I5
from clutchest.models.alsd.experiments.resistance import I1
from clutchest.models.alsd.experiments.stiffness import I7
from clutchest.models.alsd.experiments.torque_constant import I4
from clutchest.models.alsd.experiments.torsion import I8
from clutchest.models.alsd.experiments.voltage_constant import I3

EXPERIMENTS = (I1, I2, I3, I4, I5, I6, I7, I8)

__all__ = ["BENCHES", "EXPERIMENTS"]
