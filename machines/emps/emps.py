"""EMPS: a carriage on a ball screw, driven by a DC motor over a belt."""

from __future__ import annotations

import casadi as ca
import numpy as np

from clutchest import machine as cm

TURNS = 2e-4  # m/s, within which dry friction turns its sign
MIDDLE, HALF = 0.125, 0.125  # m, of the travel


def motion(q):
    """M dv/dt = F − F_0 − F_C sgn v − F_v v."""
    q.drive_force = q.force
    q.direction = ca.tanh(q.speed / TURNS)
    q.coulomb_now = q.coulomb
    q.viscous_now = q.viscous
    q.friction = q.coulomb_now * q.direction + q.viscous_now * q.speed
    q.speed_rate = q.free_running * (q.drive_force - q.offset - q.friction) / q.mass
    q.speed_reading = q.speed
    q.inverse_force = q.mass * q.acceleration + q.friction + q.offset


MODEL = cm.Model(
    "emps",
    states=(cm.State("speed", "m/s", "v", "of the carriage", 1e-3, 0.01, 0.01, stiff=True),),
    parameters=(
        cm.Parameter("mass", "kg", "M", "of the carriage, rotor and screw in it", 1.0),
        cm.Parameter("coulomb", "N", "F_C", "dry friction", 0.0),
        cm.Parameter("viscous", "N s/m", "F_v", "viscous friction", 0.0),
        cm.Parameter("offset", "N", "F_0", "of the amplifier, and what else is constant"),
    ),
    inputs=(
        cm.Input("force", "N", "F", "of the motor, at the carriage"),
        cm.Input("position", "m", "x", "of the carriage", default=MIDDLE),
        cm.Input("acceleration", "m/s^2", "dv/dt", "slope of the speed", default=0.0),
    ),
    sensors=(cm.Sensor("speed", "m/s", "v", "of the carriage"),),
    pieces=(motion,),
    regime=("free_running",),
    renewed={"speed": ("free_running", 1e-3)},  # closed loop: predicted from what was measured
    anchor="speed",
    slopes={"acceleration": "speed"},
    longest=(0.002, 0.002),
)


class Stribeck(cm.Effect):
    """F_C × (1 + ``change`` · exp(−|v|/``speed``)): more dry friction at low speed."""

    name, equation = "stribeck", "friction"
    parameters = (
        cm.Number("change", "1", -0.5, 1.0),
        cm.Number("speed", "m/s", 0.002, 0.1, shape=True, default=0.01, grid=(0.005, 0.015, 0.04)),
    )

    def terms(self, g):
        return {"coulomb_now": lambda f, q: f * (1 + g.change * ca.exp(-abs(q.speed) / g.speed))}


class ViscousDirection(cm.Effect):
    """F_v × (1 + ``change`` · sgn v): another viscous friction forwards than backwards."""

    name, equation = "viscous_direction", "friction"
    parameters = (cm.Number("change", "1", -0.3, 0.3),)

    def terms(self, g):
        return {"viscous_now": lambda f, q: f * (1 + g.change * q.direction)}


class ViscousSaturation(cm.Effect):
    """F_v × (1 + ``change`` · |v|/0.1 m/s): grease that thins when sheared, or air that drags."""

    name, equation = "viscous_saturation", "friction"
    parameters = (cm.Number("change", "1", -0.5, 0.5),)

    def terms(self, g):
        return {"viscous_now": lambda f, q: f * (1 + g.change * abs(q.speed) / 0.1)}


class FrictionLoad(cm.Effect):
    """F_C + ``share`` · |F|: friction of the screw grows with the force through it."""

    name, equation = "friction_load", "friction"
    parameters = (cm.Number("share", "1", 0.0, 0.2),)

    def terms(self, g):
        return {"coulomb_now": lambda f, q: f + g.share * abs(q.drive_force)}


class FrictionPosition(cm.Effect):
    """F_C × (1 + ``slope`` · (x − middle)/half travel): a guide that tightens to one end."""

    name, equation = "friction_position", "friction"
    parameters = (cm.Number("slope", "1", -0.5, 0.5),)

    def terms(self, g):
        return {"coulomb_now": lambda f, q: f * (1 + g.slope * (q.position - MIDDLE) / HALF)}


class Presliding(cm.Effect):
    """A ``share`` of F_C builds up over a ``distance`` after each reversal (Dahl)."""

    name, equation = "presliding", "friction"
    parameters = (
        cm.Number("share", "1", 0.0, 1.0),
        cm.Number("distance", "mm", 0.01, 5.0, shape=True, default=0.1, grid=(0.05, 0.3, 1.5)),
    )
    states = (
        cm.State("bristle", "1", "z", "of the presliding friction", 0.0, 0.0, 1.0, stiff=True),
    )

    def terms(self, g):
        return {
            "direction": lambda d, q: d + g.share * (q.bristle - d),
            "bristle_rate": lambda rate, q: (
                (q.speed - abs(q.speed) * q.bristle) / (1e-3 * g.distance)
            ),
        }


class Cogging(cm.Effect):
    """A force that repeats every ``pitch`` of travel: slots of the motor, balls of the screw."""

    name, equation = "cogging", "friction"
    parameters = (
        cm.Number("sine", "N", -5.0, 5.0),
        cm.Number("cosine", "N", -5.0, 5.0),
        cm.Number("pitch", "mm", 1.0, 20.0, shape=True, default=5.0, grid=(2.5, 5.0, 10.0)),
    )

    def terms(self, g):
        def added(force, q):
            angle = 2e3 * np.pi * q.position / g.pitch
            return force + g.sine * ca.sin(angle) + g.cosine * ca.cos(angle)

        return {"friction": added}


class Cable(cm.Effect):
    """A cable chain that pulls back: ``stiffness`` · (x − middle)."""

    name, equation = "cable", "friction"
    parameters = (cm.Number("stiffness", "N/m", -50.0, 50.0),)

    def terms(self, g):
        return {"friction": lambda f, q: f + g.stiffness * (q.position - MIDDLE)}


class DriveGain(cm.Effect):
    """The amplifier gives F × (1 + ``change``)."""

    name, equation, scales = "drive_gain", "drive", {"drive_force": "change"}
    parameters = (cm.Number("change", "1", -0.1, 0.1),)


class DriveDirection(cm.Effect):
    """The amplifier gives F × (1 + ``change`` · sgn F): its two halves differ."""

    name, equation = "drive_direction", "drive"
    parameters = (cm.Number("change", "1", -0.1, 0.1),)

    def terms(self, g):
        return {"drive_force": lambda f, q: f * (1 + g.change * ca.tanh(f / 0.5))}


class DriveSaturation(cm.Effect):
    """The amplifier gives F × (1 − ``loss`` · |F|/100 N): iron that saturates."""

    name, equation = "drive_saturation", "drive"
    parameters = (cm.Number("loss", "1", 0.0, 0.2),)

    def terms(self, g):
        return {"drive_force": lambda f, q: f * (1 - g.loss * abs(f) / 100.0)}


class ForceDelay(cm.Effect):
    """The force is recorded late."""

    name, equation, delays = "force_delay", "timing:force", {"force": "delay"}
    parameters = (cm.Number("delay", "s", 0.0, 0.005),)


MACHINE = cm.Machine.of(
    MODEL,
    "carriage on a ball screw, driven over a belt (EMPS)",
    error_terms=(
        cm.ErrorTerm("friction", {"friction": lambda value, g: value + 1.0 * g}),  # N
        cm.ErrorTerm(
            "drive",
            {"drive_force": lambda value, g: value * (1 + 0.02 * g)},
            covariates=("force", "time"),
        ),
        cm.ErrorTerm("timing:force", late=("force", 0.001)),
    ),
    compared=cm.Comparison("drive_force", "inverse_force", "N", "force of the motor"),
    effects=(
        Stribeck(),
        ViscousDirection(),
        ViscousSaturation(),
        FrictionLoad(),
        FrictionPosition(),
        Presliding(),
        Cogging(),
        Cable(),
        DriveGain(),
        DriveDirection(),
        DriveSaturation(),
        ForceDelay(),
    ),
)
