"""A brake on a flywheel: a machine whose log says so much of its faults that nothing is linear."""

import casadi as ca
import numpy as np

from clutchest import machine as cm


def turning(q):
    q.brake_torque = q.torque_gain * q.pressure * ca.tanh(q.speed)
    q.drag = q.viscous * q.speed
    q.speed_rate = (q.drive_torque - q.brake_torque - q.drag) / q.inertia
    q.speed_reading = q.speed


MODEL = cm.Model(
    "flywheel",
    states=(cm.State("speed", "rad/s", "ω", "shaft", 0.05, 1.0, 5.0),),
    parameters=(
        cm.Parameter("torque_gain", "Nm/bar", "G", "torque per pressure", 0.1),
        cm.Parameter("viscous", "Nm s/rad", "b", "drag", 0.0),
        cm.Parameter("inertia", "kg m^2", "J", "flywheel", 0.01),
    ),
    inputs=(
        cm.Input("pressure", "bar", "p", "brake pressure"),
        cm.Input("drive_torque", "Nm", "M", "of the drive"),
    ),
    sensors=(cm.Sensor("speed", "rad/s", "ω", "shaft"),),
    pieces=(turning,),
    anchor="speed",
    longest=(0.01, 0.02),
)


class TorqueLoss(cm.Effect):
    """Brake torque × (1 + ``change``)."""

    name, equation, scales = "torque_loss", "friction", {"brake_torque": "change"}
    parameters = (cm.Number("change", "1", -0.5, 1.0),)


def braking(rng, time, parameters):
    level = rng.uniform(2, 20, int(time[-1] // 4) + 2)
    return {
        "pressure": level[(time // 4).astype(int)] * ((time % 4) > 1.5),
        "drive_torque": np.full(len(time), 60.0),
    }


MACHINE = cm.Machine.of(
    MODEL,
    "flywheel",
    at_rest=lambda parameters, inputs: {},
    error_terms=(cm.ErrorTerm("friction", {"brake_torque": lambda v, g: v + 2.0 * g}),),
    covariates={"brake_torque": "Nm"},
    effects=(TorqueLoss(),),
    faults=(cm.ModelFault("torque_loss", TorqueLoss(), "change", 0.2, (0, 1)),),
    excitations={"braking": braking},
)
