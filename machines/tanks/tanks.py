"""Cascaded tanks: a pump fills the upper one, which runs into the lower one, which runs out."""

from __future__ import annotations

import casadi as ca

from clutchest import machine as cm

FULL = 10.0  # V, where the level sensor ends
EDGE = 0.02  # V, within which it does, and a rim begins to spill
FLAT = 0.01  # V, within which an empty tank's outlet stops


def depth(level):
    """A level that is not below 0."""
    return (level + ca.sqrt(level**2 + FLAT**2)) / 2


def above(level, rim):
    """By how much a level exceeds a rim."""
    return (level - rim + ca.sqrt((level - rim) ** 2 + EDGE**2)) / 2


def tanks(q):
    """dx₁/dt = k₄ u − k₁ √x₁, dx₂/dt = k₁ √x₁ − k₃ √x₂: Bernoulli's outlets, equal tanks."""
    q.pump_voltage = q.pump
    q.inflow = q.pump_gain * q.pump_voltage
    q.upper_depth = depth(q.upper)
    q.head = q.level
    q.lower_depth = depth(q.head)
    q.upper_outflow = q.outlet_upper * ca.sqrt(q.upper_depth)
    q.lower_outflow = q.outlet_lower * ca.sqrt(q.lower_depth)
    q.spilled = 0.0
    q.caught = q.upper_outflow
    q.lost = 0.0
    q.upper_net = q.inflow - q.upper_outflow - q.spilled
    q.lower_net = q.caught - q.lower_outflow - q.lost
    q.upper_rate = q.upper_net
    q.level_rate = q.lower_net
    q.level_reading = q.level - above(q.level, FULL)


MODEL = cm.Model(
    "tanks",
    states=(
        cm.State("upper", "V", "x₁", "level of the upper tank", 0.0, 3.0, 1.0),
        cm.State("level", "V", "x₂", "level of the lower tank", 0.0, 0.2, 0.5),
    ),
    parameters=(
        cm.Parameter("pump_gain", "1/s", "k₄", "rise of the upper level per V and s", 0.0),
        cm.Parameter("outlet_upper", "V/s", "k₁", "outflow of the upper tank at 1 V", 0.0),
        cm.Parameter("outlet_lower", "V/s", "k₃", "outflow of the lower tank at 1 V", 0.0),
    ),
    inputs=(cm.Input("pump", "V", "u", "voltage of the pump", gap=20.0),),
    sensors=(cm.Sensor("level", "V", "y", "level of the lower tank, up to 10 V"),),
    pieces=(tanks,),
    anchor="level",
    longest=(2.0, 2.0),
)


def spilling(g, q):
    """What runs over the upper tank's rim."""
    return g.rate * above(q.upper, g.rim)


class SpillLost(cm.Effect):
    """Above its ``rim`` the upper tank spills ``rate`` × excess, which is lost."""

    name, equation = "spill_lost", "upper"
    parameters = (
        cm.Number("rate", "1/s", 0.0, 0.3, trials=(0.03, 0.1)),
        cm.Number("rim", "V", 5.0, 13.0, shape=True, default=10.0, grid=(8.5, 9.25, 10.0, 10.75)),
    )

    def terms(self, g):
        return {"spilled": lambda s, q: s + spilling(g, q)}


class SpillCaught(cm.Effect):
    """Above its ``rim`` the upper tank spills ``rate`` × excess, which the lower one catches."""

    name, equation = "spill_caught", "upper"
    parameters = (
        cm.Number("rate", "1/s", 0.0, 0.3, trials=(0.03, 0.1)),
        cm.Number("rim", "V", 5.0, 13.0, shape=True, default=10.0, grid=(8.5, 9.25, 10.0, 10.75)),
    )

    def terms(self, g):
        return {
            "spilled": lambda s, q: s + spilling(g, q),
            "caught": lambda flow, q: flow + spilling(g, q),
        }


class LowerSpill(cm.Effect):
    """Above its ``rim`` the lower tank spills ``rate`` × excess."""

    name, equation = "lower_spill", "lower"
    parameters = (
        cm.Number("rate", "1/s", 0.0, 0.3, trials=(0.03, 0.1)),
        cm.Number("rim", "V", 5.0, 13.0, shape=True, default=10.0, grid=(9.25, 10.0, 10.75)),
    )

    def terms(self, g):
        return {"lost": lambda flow, q: flow + g.rate * above(q.level, g.rim)}


class Leak(cm.Effect):
    """A ``share`` of what leaves the upper tank never reaches the lower one."""

    name, equation = "leak", "lower"
    parameters = (cm.Number("share", "1", -0.3, 0.3),)  # below 0: tanks of unequal width

    def terms(self, g):
        return {"caught": lambda flow, q: flow * (1 - g.share)}


class PumpCurve(cm.Effect):
    """k₄ × (1 + ``bend`` · (u − 3)/3): the pump's flow is not proportional to its voltage."""

    name, equation = "pump_curve", "inflow"
    parameters = (cm.Number("bend", "1", -0.3, 0.3),)

    def terms(self, g):
        return {"inflow": lambda flow, q: flow * (1 + g.bend * (q.pump_voltage - 3.0) / 3.0)}


class PumpOffset(cm.Effect):
    """The pump starts at ``offset``."""

    name, equation = "pump_offset", "inflow"
    parameters = (cm.Number("offset", "V", -0.5, 0.5),)

    def terms(self, g):
        return {"pump_voltage": lambda u, q: u - g.offset}


class PumpHead(cm.Effect):
    """Flow × (1 − ``loss`` · x₁/10): the pump lifts against the upper level."""

    name, equation = "pump_head", "inflow"
    parameters = (cm.Number("loss", "1", 0.0, 0.2),)

    def terms(self, g):
        return {"inflow": lambda flow, q: flow * (1 - g.loss * q.upper / 10.0)}


class UpperOutlet(cm.Effect):
    """Outflow × (x₁/5)^``exponent``: the upper outlet is a tube more than an orifice."""

    name, equation = "upper_outlet", "upper"
    parameters = (cm.Number("exponent", "1", -0.2, 0.5),)

    def terms(self, g):
        def changed(flow, q):
            return flow * ca.exp(g.exponent * ca.log(q.upper_depth / 5.0 + 1e-3))

        return {"upper_outflow": changed}


class LowerOutlet(cm.Effect):
    """Outflow × (x₂/5)^``exponent``: the lower outlet is a tube more than an orifice."""

    name, equation = "lower_outlet", "lower"
    parameters = (cm.Number("exponent", "1", -0.2, 0.5),)

    def terms(self, g):
        def changed(flow, q):
            return flow * ca.exp(g.exponent * ca.log(q.lower_depth / 5.0 + 1e-3))

        return {"lower_outflow": changed}


class SensorZero(cm.Effect):
    """The level reads ``zero`` where the lower outlet is: its head is the reading less that."""

    name, equation = "sensor_zero", "sensor:level"
    parameters = (cm.Number("zero", "V", -1.0, 1.0),)

    def terms(self, g):
        return {"head": lambda head, q: head - g.zero}


class UpperWidth(cm.Effect):
    """The upper tank widens: its level moves by exp(−``slope`` · (x₁ − 5)/5) of what it would."""

    name, equation = "upper_width", "upper"
    parameters = (cm.Number("slope", "1", -0.3, 0.3),)

    def terms(self, g):
        return {"upper_net": lambda net, q: net * ca.exp(-g.slope * (q.upper - 5.0) / 5.0)}


class LowerWidth(cm.Effect):
    """The lower tank widens: its level moves by exp(−``slope`` · (x₂ − 5)/5) of what it would."""

    name, equation = "lower_width", "lower"
    parameters = (cm.Number("slope", "1", -0.3, 0.3),)

    def terms(self, g):
        return {"lower_net": lambda net, q: net * ca.exp(-g.slope * (q.level - 5.0) / 5.0)}


class PumpDelay(cm.Effect):
    """The pump's voltage is recorded late."""

    name, equation, delays = "pump_delay", "timing:pump", {"pump": "delay"}
    parameters = (cm.Number("delay", "s", 0.0, 12.0),)


MACHINE = cm.Machine.of(
    MODEL,
    "two tanks in cascade",
    at_rest=lambda parameters, inputs: {"upper": 5.0},
    error_terms=(
        cm.ErrorTerm("inflow", {"inflow": lambda value, g: value + 0.002 * g}),  # V/s
        cm.ErrorTerm("upper", {"upper_net": lambda value, g: value - 0.002 * g}),
        cm.ErrorTerm("lower", {"lower_net": lambda value, g: value - 0.002 * g}),
        cm.ErrorTerm(
            "sensor:level",
            {"level_reading": lambda value, g: value + 0.02 * g},  # V
            covariates=("level", "time"),
        ),
        cm.ErrorTerm("timing:pump", late=("pump", 2.0)),
    ),
    effects=(
        SpillLost(),
        SpillCaught(),
        LowerSpill(),
        Leak(),
        PumpCurve(),
        PumpOffset(),
        PumpHead(),
        UpperOutlet(),
        LowerOutlet(),
        SensorZero(),
        UpperWidth(),
        LowerWidth(),
        PumpDelay(),
    ),
)
