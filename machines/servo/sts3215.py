"""STS3215: a servo, DC motor and gearbox at 12 V, swings an arm with a mass on a bench."""

from __future__ import annotations

import casadi as ca
import numpy as np

from clutchest import machine as cm

GRAVITY = 9.81  # m/s²
TURNS = 0.02  # rad/s, within which dry friction turns its sign
SLOW = 0.3  # rad/s, four standard deviations of what a reading's prediction is off by
GUARD = 0.06  # s: half of what the converter's means reach over, and a reading


def motor(q):
    """τ = K (U − K ω)/R of the bridge's mean voltage U = duty · supply; none while it is off."""
    q.duty_now = q.duty
    q.supply_now = q.supply
    q.back_emf = q.torque_constant * q.speed
    q.current = (q.duty_now * q.supply_now - q.back_emf) / q.resistance
    q.drag = q.torque_constant * q.back_emf / q.resistance
    q.motor_torque = q.enabled * q.torque_constant * q.current


def arm(q):
    """(J + m l²) dω/dt = τ − m g l sin φ − friction."""
    q.angle = q.position
    q.moment_now = q.moment
    q.inertia = q.armature + q.load_inertia
    q.gravity_torque = q.moment_now * ca.sin(q.angle)
    q.load = (q.motor_torque + q.gravity_torque) / 2.0
    q.direction = ca.tanh(q.speed / TURNS)
    q.dry = q.coulomb
    q.viscous_now = q.viscous
    q.friction = q.dry * q.direction + q.viscous_now * q.speed
    q.speed_rate = q.free_running * (q.motor_torque - q.gravity_torque - q.friction) / q.inertia
    q.speed_reading = q.speed
    q.measured_torque = q.inertia * q.acceleration + q.gravity_torque + q.friction


MODEL = cm.Model(
    "sts3215",
    states=(cm.State("speed", "rad/s", "ω", "of the arm", 0.3, 0.5, 0.5, stiff=True),),
    parameters=(
        cm.Parameter("resistance", "Ohm", "R", "of the winding and the bridge", 0.1),
        cm.Parameter("torque_constant", "Nm/A", "K", "at the arm, behind the gearbox", 0.1),
        cm.Parameter("armature", "kg m^2", "J", "of the rotor, seen from the arm", 1e-4),
        cm.Parameter("coulomb", "Nm", "T_C", "dry friction", 0.0),
        cm.Parameter("viscous", "Nm s/rad", "b", "viscous friction", 0.0),
    ),
    inputs=(
        cm.Input("duty", "1", "δ", "of the bridge, with its sign", exact=True),
        cm.Input("supply", "V", "U_0", "at the bridge", default=12.0, exact=True),
        cm.Input("position", "rad", "φ", "of the arm, 0 hanging", exact=True),
        cm.Input("enabled", "1", "e", "1 while the bridge is on", default=1.0, exact=True),
        cm.Input("moment", "Nm", "m g l", "of mass and arm", exact=True),
        cm.Input("load_inertia", "kg m^2", "m l²", "of mass and arm", exact=True),
        cm.Input("acceleration", "rad/s^2", "dω/dt", "slope of the speed", default=0.0),
    ),
    sensors=(cm.Sensor("speed", "rad/s", "ω", "of the arm"),),
    pieces=(motor, arm),
    regime=("free_running",),
    renewed={"speed": ("free_running", 0.3)},  # closed loop: predicted from what was measured
    anchor="speed",
    slopes={"acceleration": "speed"},
    longest=(0.005, 0.005),
)


def turning(observed: cm.Observed) -> cm.Regimes:
    """The equations hold but for ``GUARD`` s around where the arm turns or is slower than ``SLOW``.

    Readings are means: where friction turns its sign within them, theirs is not that of the mean
    speed, and what disturbs the arm takes it to and fro across the turn.
    """
    speed, known = observed.at("speed"), ~observed.lost
    slow = np.abs(speed) < SLOW
    turned = speed[1:] * speed[:-1] < 0.0
    slow[1:] |= turned
    slow[:-1] |= turned
    at = observed.time[slow]
    if len(at):
        after = np.clip(np.searchsorted(at, observed.time), 0, len(at) - 1)
        near = np.minimum(np.abs(at[after] - observed.time), np.abs(observed.time - at[after - 1]))
        known &= near > GUARD
    return cm.Regimes(observed.lost.astype(np.uint8), known, ~observed.lost, ~observed.lost)


SPEEDS = cm.Number("speed", "rad/s", 0.02, 3.0, shape=True, default=0.3, grid=(0.1, 0.3, 1.0))


def slow(g, q):
    """1 at standstill, falling with the speed."""
    return ca.exp(-abs(q.speed) / g.speed)


class Stribeck(cm.Effect):
    """T_C + ``torque`` · exp(−|ω|/``speed``): more dry friction at low speed."""

    name, equation = "stribeck", "friction"
    parameters = (cm.Number("torque", "Nm", -0.05, 0.2), SPEEDS)

    def terms(self, g):
        return {"dry": lambda dry, q: dry + g.torque * slow(g, q)}


class FrictionLoad(cm.Effect):
    """T_C + ``share`` · |load|: teeth rub in proportion to what they carry."""

    name, equation = "friction_load", "friction"
    parameters = (cm.Number("share", "1", 0.0, 0.5),)

    def terms(self, g):
        return {"dry": lambda dry, q: dry + g.share * abs(q.load)}


class FrictionLoadSlow(cm.Effect):
    """T_C + ``share`` · |load| · exp(−|ω|/``speed``): the same at low speed only."""

    name, equation = "friction_load_slow", "friction"
    parameters = (cm.Number("share", "1", 0.0, 0.5), SPEEDS)

    def terms(self, g):
        return {"dry": lambda dry, q: dry + g.share * abs(q.load) * slow(g, q)}


class FrictionDirection(cm.Effect):
    """Friction × (1 + ``change`` · sgn ω): another forwards than backwards."""

    name, equation = "friction_direction", "friction"
    parameters = (cm.Number("change", "1", -0.3, 0.3),)

    def terms(self, g):
        return {"friction": lambda f, q: f * (1 + g.change * q.direction)}


class ViscousSaturation(cm.Effect):
    """b × (1 + ``change`` · |ω|/5): grease that thins when sheared."""

    name, equation = "viscous_saturation", "friction"
    parameters = (cm.Number("change", "1", -0.8, 0.8),)

    def terms(self, g):
        return {"viscous_now": lambda b, q: b * (1 + g.change * abs(q.speed) / 5.0)}


class Backlash(cm.Effect):
    """A ``share`` of dry friction builds up over a ``distance`` after each reversal: play of the
    teeth."""

    name, equation = "backlash", "friction"
    parameters = (
        cm.Number("share", "1", 0.0, 1.0),
        cm.Number("distance", "rad", 0.001, 0.1, shape=True, default=0.01, grid=(0.005, 0.02)),
    )
    states = (cm.State("wound", "1", "z", "of the play", 0.0, 0.0, 1.0, stiff=True),)

    def terms(self, g):
        return {
            "direction": lambda d, q: d + g.share * (q.wound - d),
            "wound_rate": lambda rate, q: (q.speed - abs(q.speed) * q.wound) / g.distance,
        }


class SupplySag(cm.Effect):
    """The bridge gets U_0 − ``resistance`` · |δ i|: leads and connectors."""

    name, equation = "supply_sag", "drive"
    parameters = (cm.Number("resistance", "Ohm", 0.0, 1.5),)

    def terms(self, g):
        def sagging(supply, q):
            drawn = (q.duty_now * supply - q.torque_constant * q.speed) / q.resistance
            return supply - g.resistance * abs(q.duty_now * drawn)

        return {"supply_now": sagging}


class DutyGain(cm.Effect):
    """The bridge gives δ × (1 + ``change``)."""

    name, equation, scales = "duty_gain", "drive", {"duty_now": "change"}
    parameters = (cm.Number("change", "1", -0.15, 0.15),)


class DutyDeadband(cm.Effect):
    """δ less ``width`` in size: the dead time of the bridge."""

    name, equation = "duty_deadband", "drive"
    parameters = (cm.Number("width", "1", 0.0, 0.05),)

    def terms(self, g):
        return {"duty_now": lambda duty, q: duty - g.width * ca.tanh(duty / 0.02)}


class SwitchDelay(cm.Effect):
    """The flag of the bridge is recorded late."""

    name, equation, delays = "switch_delay", "timing:enabled", {"enabled": "delay"}
    parameters = (cm.Number("delay", "s", 0.0, 0.1),)


class MountAngle(cm.Effect):
    """The bench leans: gravity acts at φ + ``offset``."""

    name, equation = "mount_angle", "gravity"
    parameters = (cm.Number("offset", "rad", -0.1, 0.1),)

    def terms(self, g):
        return {"angle": lambda angle, q: angle + g.offset}


class ArmMass(cm.Effect):
    """The arm itself has a ``mass``, and so inertia and weight."""

    name, equation = "arm_mass", "gravity"
    parameters = (cm.Number("mass", "kg", 0.0, 0.2),)

    def terms(self, g):
        def length(q):
            return GRAVITY * q.load_inertia / q.moment

        return {
            "moment_now": lambda m, q: m + g.mass * GRAVITY * length(q) / 2.0,
            "inertia": lambda j, q: j + g.mass * length(q) ** 2 / 3.0,
        }


class Coasting(cm.Effect):
    """A ``share`` of the back-EMF brakes while the bridge is off: its diodes conduct."""

    name, equation = "coasting", "drive"
    parameters = (cm.Number("share", "1", 0.0, 1.0),)

    def terms(self, g):
        return {"motor_torque": lambda t, q: t - g.share * (1 - q.enabled) * q.drag}


# No error of the duty's time stamps: it answers to what disturbs the arm within the means of the
# converter, which look ahead, and that shows as one.  A constant delay is fitted (delay_spread).
MACHINE = cm.Machine.of(
    MODEL,
    "servo with gearbox and arm (STS3215)",
    error_terms=(
        cm.ErrorTerm("friction", {"dry": lambda value, g: value + 0.05 * g}),  # Nm, against motion
        cm.ErrorTerm(
            "drive",
            {"duty_now": lambda value, g: value * (1 + 0.05 * g)},
            covariates=("duty", "supply", "speed", "time"),
        ),
        cm.ErrorTerm(
            "gravity",
            {"gravity_torque": lambda value, g: value + 0.05 * g},  # Nm
            covariates=("position",),
        ),
        cm.ErrorTerm("timing:enabled", late=("enabled", 0.01)),
    ),
    regimes=cm.RegimeRules(signals=("speed",), judge=turning),
    covariates={"load": "Nm"},
    compared=cm.Comparison("measured_torque", "motor_torque", "Nm", "motor torque"),
    effects=(
        Stribeck(),
        FrictionLoad(),
        FrictionLoadSlow(),
        FrictionDirection(),
        ViscousSaturation(),
        Backlash(),
        SupplySag(),
        DutyGain(),
        DutyDeadband(),
        SwitchDelay(),
        MountAngle(),
        ArmMass(),
        Coasting(),
    ),
)
