"""Every unit against its definition, written out here once more and by hand."""

from __future__ import annotations

import re
from math import pi
from pathlib import Path

import numpy as np
import pytest
from scipy import constants

from clutchest import units
from clutchest.errors import ClutchestError

KG, M, S, K, A = np.eye(5, dtype=int)
NONE = np.zeros(5, int)
N = KG + M - 2 * S
J = N + M
W = J - S
V = W - A
OHM = V - A

# symbol → (value of 1 in SI, dimensions as powers of kg, m, s, K, A)
FACTORS = {
    "1": (1.0, NONE),
    "rad": (1.0, NONE),
    "°": (constants.degree, NONE),
    "deg": (constants.degree, NONE),
    "%": (0.01, NONE),
    "rev": (6.283185307179586, NONE),
    "mrad": (constants.milli, NONE),
    "kNm": (1000.0, J),
    "mNm": (constants.milli, J),
    "Ncm": (constants.centi, J),
    "Nmm": (constants.milli, J),
    "lbft": (constants.lbf * constants.foot, J),
    "mph": (constants.mph, M - S),
    "kg": (1.0, KG),
    "m": (1.0, M),
    "mm": (constants.milli, M),
    "µm": (constants.micro, M),
    "km": (constants.kilo, M),
    "cm": (constants.centi, M),
    "l": (constants.liter, 3 * M),
    "ml": (constants.milli * constants.liter, 3 * M),
    "s": (1.0, S),
    "ms": (constants.milli, S),
    "µs": (constants.micro, S),
    "ns": (constants.nano, S),
    "min": (constants.minute, S),
    "h": (constants.hour, S),
    "K": (1.0, K),
    "A": (1.0, A),
    "mA": (constants.milli, A),
    "N": (1.0, N),
    "kN": (constants.kilo, N),
    "Nm": (1.0, J),
    "J": (1.0, J),
    "kJ": (constants.kilo, J),
    "MJ": (constants.mega, J),
    "Wh": (constants.hour, J),
    "kWh": (constants.kilo * constants.hour, J),
    "W": (1.0, W),
    "kW": (constants.kilo, W),
    "MW": (constants.mega, W),
    "V": (1.0, V),
    "mV": (constants.milli, V),
    "kV": (constants.kilo, V),
    "Ohm": (1.0, OHM),
    "Ω": (1.0, OHM),
    "mOhm": (constants.milli, OHM),
    "mΩ": (constants.milli, OHM),
    "kOhm": (constants.kilo, OHM),
    "kΩ": (constants.kilo, OHM),
    "H": (1.0, OHM + S),
    "mH": (constants.milli, OHM + S),
    "Pa": (1.0, N - 2 * M),
    "kPa": (constants.kilo, N - 2 * M),
    "MPa": (constants.mega, N - 2 * M),
    "GPa": (constants.giga, N - 2 * M),
    "bar": (constants.bar, N - 2 * M),
    "mbar": (constants.milli * constants.bar, N - 2 * M),
    "psi": (constants.psi, N - 2 * M),
    "rpm": (0.10471975511965977, -S),
    "°C": (1.0, K),
    "°F": (constants.degree_Fahrenheit, K),
}
# unit → (value of 1 in the unit behind it)
COMPOSED = {
    ("kelvin", "K"): 1.0,
    ("Kelvin", "K"): 1.0,
    ("km/h", "m/s"): 1 / 3.6,
    ("kph", "m/s"): constants.kmh,
    ("km/hour", "m/s"): constants.kmh,
    ("RPM", "rad/s"): 2 * pi / 60,
    ("1/min", "rad/s"): 2 * pi / 60,  # of a shaft, as in DBCs
    ("rev/s", "rpm"): 60.0,
    ("°/s", "rad/s"): constants.degree,
    ("Nm/mm^3", "Nm/m³"): 1e9,
    ("mm/MJ", "m/J"): 1e-9,
    ("1/(100 K)", "1/K"): 0.01,
    ("kg mm²", "kg m²"): 1e-6,
    ("W h", "J"): 3600.0,
    ("W·s", "J"): 1.0,
    ("V s", "Nm/A"): 1.0,
    ("Nm rad/s", "W"): 1.0,
    ("mH A/ms", "V"): 1.0,
    ("GPa mm²", "kN"): 1.0,
    ("L", "l"): 1.0,
    ("lpm", "l/min"): 1.0,
    ("l/min", "m³/s"): 1e-3 / 60.0,
    ("bar cm²", "N"): 10.0,
    ("bar l/min", "W"): 100.0 / 60.0,
    ("m s⁻²", "m/s^2"): 1.0,
    ("percent", "1"): 0.01,
    ("unitless", "1"): 1.0,
    ("Unitless", "-"): 1.0,
    ("", "1"): 1.0,
    ("um", "mm"): 1e-3,
    ("us", "s"): 1e-6,
    ("N.m", "J"): 1.0,
    ("N m", "J"): 1.0,
    ("N-m", "J"): 1.0,
    ("N.mm", "N-mm"): 1.0,
    ("N·mm", "Nmm"): 1.0,
    ("Grad", "°"): 1.0,
    ("\u03bcm", "µm"): 1.0,  # a Greek letter for the sign of micro
    ("Nm/rad", "Nm"): 1.0,
    ("ohm", "V/A"): 1.0,
    ("sec", "msec"): 1000.0,
    ("/min", "min-1"): 1.0,
    ("min^-1", "min⁻¹"): 1.0,
    ("U/min", "r/min"): 1.0,
    ("Umdr/min", "rpm"): 1.0,
    ("Prozent", "%"): 1.0,
    ("tr/min", "rev/min"): 1.0,
    ("ft-lb", "lb-ft"): 1.0,
    ("ft lb", "lb ft"): 1.0,
    ("lbf ft", "lbf·ft"): 1.0,
    ("lbf·ft", "Nm"): 1.3558179483314004,
}
# (value, unit, value, unit): the same temperature
TEMPERATURES = [
    (0.0, "°C", 32.0, "°F"),
    (100.0, "degC", 212.0, "degF"),
    (-40.0, "deg C", -40.0, "deg F"),
    (37.0, "C", 98.6, "°F"),
    (37.0, "Celsius", 98.6, "° F"),
    (85.0, "Grad C", 185.0, "Grad Fahrenheit"),
    (85.0, "° C", 185.0, "degrees F"),
    (85.0, "DegC", 85.0, "grad Celsius"),
]


def test_the_table_is_of_all_symbols():
    assert set(FACTORS) == set(units._SYMBOLS)


def test_the_page_of_vehicle_files_has_all_symbols():
    page = (Path(__file__).parents[1] / "docs" / "vehicle-file.md").read_text(encoding="utf-8")
    listed = page.split("**Units.**")[1].split("\n\n")[1]
    assert set(re.findall(r"`([^`]+)`", listed)) == set(units._SYMBOLS)


@pytest.mark.parametrize("symbol", FACTORS)
def test_a_symbol_is_what_its_definition_says(symbol):
    factor, dimensions = FACTORS[symbol]
    unit = units.parse(symbol)
    assert unit.scale == pytest.approx(factor, rel=1e-15)
    assert unit.dimensions == tuple(dimensions)
    assert (unit.offset != 0.0) == (symbol == "°F")


@pytest.mark.parametrize(("unit", "to"), COMPOSED)
def test_composed_units_and_other_spellings(unit, to):
    factor = COMPOSED[unit, to]
    assert units.convert(1.0, unit, to) == pytest.approx(factor, rel=1e-14)
    values = np.array([-2.0, 0.0, 3.5])
    np.testing.assert_allclose(units.convert(values, unit, to), values * factor, rtol=1e-14)
    assert units.convert(1.0, to, unit) == pytest.approx(1 / factor, rel=1e-14)


def test_every_other_spelling_is_converted_above():
    written = {unit for pair in COMPOSED for unit in pair}
    written |= {unit for _, unit, _, other in TEMPERATURES for unit in (unit, other)}
    assert set(units._ALIASES) <= written


@pytest.mark.parametrize(("value", "unit", "same", "other"), TEMPERATURES)
def test_temperatures(value, unit, same, other):
    assert units.convert(value, unit, other) == pytest.approx(same, abs=1e-12)
    assert units.convert(same, other, unit) == pytest.approx(value, abs=1e-12)


@pytest.mark.parametrize("unit", ["K", "kelvin", "Kelvin", "deg K", "° K"])
def test_a_reading_in_kelvin_is_a_temperature(unit):
    assert units.convert_reading(300.0, unit, "°C") == pytest.approx(26.85, abs=1e-12)


def test_what_cannot_be_converted_is_refused():
    with pytest.raises(ClutchestError, match="cannot be converted"):
        units.convert(1.0, "Nm", "N")
    with pytest.raises(ClutchestError, match="unknown unit 'kmm'"):
        units.parse("kmm/h")
    with pytest.raises(ClutchestError, match="one division only"):
        units.parse("W/m/K")


@pytest.mark.parametrize(
    "unit", ["0 s", "s/0", "1e999 s", "s/1e400", "1e300^9 s", "1e-300^9 s", f"s^{'9' * 5000}"]
)
def test_a_unit_of_nothing_or_without_bounds_is_refused(unit):
    with pytest.raises(ClutchestError, match="zero, or beyond any unit") as caught:
        units.convert(1.0, unit, "s")
    assert len(str(caught.value)) < 150


@pytest.mark.parametrize("unit", ["1/min", "min-1", "min^-1", "min⁻¹", "U/min", "r/min", "rev/min"])
def test_revolutions_per_minute_in_all_notations(unit):
    assert units.convert(60.0, unit, "rad/s") == pytest.approx(2 * pi)
