"""A plate with a heater under its middle, thermometers in the middle and at the edge, and air."""

import numpy as np

from clutchest import machine as cm


def plate(q):
    """C_m dT_m/dt = P − G_c (T_m − T_e) − G_m (T_m − T_0),
    C_e dT_e/dt = G_c (T_m − T_e) − G_e (T_e − T_0)."""
    q.heat = q.power
    q.conducted = q.contact * (q.middle - q.edge)
    q.lost_middle = q.loss_middle * (q.middle - q.ambient)
    q.lost_edge = q.loss_edge * (q.edge - q.ambient)
    q.middle_rate = (q.heat - q.conducted - q.lost_middle) / q.capacity_middle
    q.edge_rate = (q.conducted - q.lost_edge) / q.capacity_edge
    q.middle_reading = q.middle
    q.edge_reading = q.edge


MODEL = cm.Model(
    "plate",
    states=(
        cm.State("middle", "°C", "T_m", "middle of the plate", 0.01, 5.0, 2.0),
        cm.State("edge", "°C", "T_e", "edge of the plate", 0.01, 5.0, 2.0),
    ),
    parameters=(
        cm.Parameter("capacity_middle", "J/K", "C_m", "of the middle", 1.0),
        cm.Parameter("capacity_edge", "J/K", "C_e", "of the edge", 1.0),
        cm.Parameter("contact", "W/K", "G_c", "from middle to edge", 0.0),
        cm.Parameter("loss_middle", "W/K", "G_m", "from the middle to air", 0.0),
        cm.Parameter("loss_edge", "W/K", "G_e", "from the edge to air", 0.0),
    ),
    inputs=(
        cm.Input("power", "W", "P", "of the heater"),
        cm.Input("ambient", "°C", "T_0", "air", default=22.0, gap=60.0),
    ),
    sensors=(
        cm.Sensor("middle", "°C", "T_m", "middle of the plate"),
        cm.Sensor("edge", "°C", "T_e", "edge of the plate"),
    ),
    pieces=(plate,),
    anchor="middle",
    longest=(2.0, 2.0),
)


def kelvin(celsius):
    """A temperature in K."""
    return celsius + 273.15


def heating(rng, time, parameters):
    """The heater on and off for some minutes each."""
    level = rng.uniform(0.0, 200.0, int(time[-1] // 240.0) + 2)
    return {"power": level[(time // 240.0).astype(int)], "ambient": np.full(len(time), 22.0)}


class ContactLoose(cm.Effect):
    """G_c × (1 + ``change``): a screw that is loose."""

    name, equation = "contact_loose", "contact"
    scales = {"conducted": "change"}
    parameters = (cm.Number("change", "1", -0.8, 0.3),)


class Radiation(cm.Effect):
    """The middle radiates ``factor`` · ((T_m/300 K)⁴ − (T_0/300 K)⁴)."""

    name, equation = "radiation", "loss"
    parameters = (cm.Number("factor", "W", 0.0, 40.0),)

    def terms(self, g):
        def added(loss, q):
            hot, cold = kelvin(q.middle) / 300.0, kelvin(q.ambient) / 300.0
            return loss + g.factor * (hot**4 - cold**4)

        return {"lost_middle": added}


class HeaterWarm(cm.Effect):
    """P × (1 + ``change`` · (T_m − 50)/50): the heater's resistance grows with its temperature."""

    name, equation = "heater_warm", "heat"
    parameters = (cm.Number("change", "1", -0.3, 0.3),)

    def terms(self, g):
        return {"heat": lambda p, q: p * (1 + g.change * (q.middle - 50.0) / 50.0)}


class EdgeSensor(cm.Effect):
    """The edge's sensor reads ``offset`` too much."""

    name, equation = "edge_sensor", "sensor:edge"
    parameters = (cm.Number("offset", "°C", -5.0, 5.0),)

    def terms(self, g):
        return {"edge_reading": lambda t, q: t + g.offset}


MACHINE = cm.Machine.of(
    MODEL,
    "heated plate",
    at_rest=lambda parameters, inputs: {"middle": inputs["ambient"], "edge": inputs["ambient"]},
    error_terms=(
        cm.ErrorTerm("heat", {"heat": lambda value, g: value + 5.0 * g}),  # W
        cm.ErrorTerm("contact", {"conducted": lambda value, g: value + 2.0 * g}),  # W
        cm.ErrorTerm("loss", {"lost_middle": lambda value, g: value + 2.0 * g}),  # W
        cm.ErrorTerm("sensor:edge", {"edge_reading": lambda value, g: value + 0.5 * g}),  # °C
    ),
    effects=(ContactLoose(), Radiation(), HeaterWarm(), EdgeSensor()),
    excitations={"heating": heating},
)
