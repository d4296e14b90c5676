"""Units, checked when they are declared: SI inside, bus and plot units only at the edges.

A unit is written as people write it: ``W/K``, ``kg m²``, ``Nm/mm^3``, ``1/(100 K)``, ``mm/MJ``,
``rpm``, ``°C``.  An angle counts as dimensionless, so ``Nm`` times ``rad/s`` is ``W``.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from functools import lru_cache
from math import inf, pi
from typing import Any, overload

import numpy as np
from numpy.typing import NDArray

from clutchest.errors import ClutchestError, nearest

Dimensions = tuple[int, int, int, int, int]  # exponents of kg, m, s, K, A


@dataclass(frozen=True, slots=True)
class Unit:
    """SI value = ``scale`` · number + ``offset``; ``dimensions``: exponents of kg, m, s, K, A."""

    scale: float
    dimensions: Dimensions
    offset: float = 0.0


ZERO_CELSIUS = 273.15  # K
_NONE: Dimensions = (0, 0, 0, 0, 0)
_POUND = 0.45359237 * 9.80665  # N
_SYMBOLS = {
    "1": Unit(1.0, _NONE),
    "rad": Unit(1.0, _NONE),
    "°": Unit(pi / 180, _NONE),
    "deg": Unit(pi / 180, _NONE),
    "%": Unit(0.01, _NONE),
    "rev": Unit(2 * pi, _NONE),
    "kg": Unit(1.0, (1, 0, 0, 0, 0)),
    "m": Unit(1.0, (0, 1, 0, 0, 0)),
    "s": Unit(1.0, (0, 0, 1, 0, 0)),
    "ms": Unit(1e-3, (0, 0, 1, 0, 0)),
    "µs": Unit(1e-6, (0, 0, 1, 0, 0)),
    "ns": Unit(1e-9, (0, 0, 1, 0, 0)),
    "min": Unit(60.0, (0, 0, 1, 0, 0)),
    "h": Unit(3600.0, (0, 0, 1, 0, 0)),
    "K": Unit(1.0, (0, 0, 0, 1, 0)),
    "A": Unit(1.0, (0, 0, 0, 0, 1)),
    "mA": Unit(1e-3, (0, 0, 0, 0, 1)),
    "mrad": Unit(1e-3, _NONE),
    "mm": Unit(1e-3, (0, 1, 0, 0, 0)),
    "µm": Unit(1e-6, (0, 1, 0, 0, 0)),
    "km": Unit(1e3, (0, 1, 0, 0, 0)),
    "cm": Unit(1e-2, (0, 1, 0, 0, 0)),
    "l": Unit(1e-3, (0, 3, 0, 0, 0)),
    "ml": Unit(1e-6, (0, 3, 0, 0, 0)),
    "N": Unit(1.0, (1, 1, -2, 0, 0)),
    "kN": Unit(1e3, (1, 1, -2, 0, 0)),
    "Nm": Unit(1.0, (1, 2, -2, 0, 0)),
    "kNm": Unit(1e3, (1, 2, -2, 0, 0)),
    "mNm": Unit(1e-3, (1, 2, -2, 0, 0)),
    "Ncm": Unit(1e-2, (1, 2, -2, 0, 0)),
    "Nmm": Unit(1e-3, (1, 2, -2, 0, 0)),
    "lbft": Unit(_POUND * 0.3048, (1, 2, -2, 0, 0)),
    "J": Unit(1.0, (1, 2, -2, 0, 0)),
    "kJ": Unit(1e3, (1, 2, -2, 0, 0)),
    "MJ": Unit(1e6, (1, 2, -2, 0, 0)),
    "Wh": Unit(3600.0, (1, 2, -2, 0, 0)),
    "kWh": Unit(3.6e6, (1, 2, -2, 0, 0)),
    "W": Unit(1.0, (1, 2, -3, 0, 0)),
    "kW": Unit(1e3, (1, 2, -3, 0, 0)),
    "MW": Unit(1e6, (1, 2, -3, 0, 0)),
    "V": Unit(1.0, (1, 2, -3, 0, -1)),
    "mV": Unit(1e-3, (1, 2, -3, 0, -1)),
    "kV": Unit(1e3, (1, 2, -3, 0, -1)),
    "Ohm": Unit(1.0, (1, 2, -3, 0, -2)),
    "Ω": Unit(1.0, (1, 2, -3, 0, -2)),
    "mOhm": Unit(1e-3, (1, 2, -3, 0, -2)),
    "mΩ": Unit(1e-3, (1, 2, -3, 0, -2)),
    "kOhm": Unit(1e3, (1, 2, -3, 0, -2)),
    "kΩ": Unit(1e3, (1, 2, -3, 0, -2)),
    "H": Unit(1.0, (1, 2, -2, 0, -2)),
    "mH": Unit(1e-3, (1, 2, -2, 0, -2)),
    "Pa": Unit(1.0, (1, -1, -2, 0, 0)),
    "kPa": Unit(1e3, (1, -1, -2, 0, 0)),
    "MPa": Unit(1e6, (1, -1, -2, 0, 0)),
    "GPa": Unit(1e9, (1, -1, -2, 0, 0)),
    "bar": Unit(1e5, (1, -1, -2, 0, 0)),
    "mbar": Unit(1e2, (1, -1, -2, 0, 0)),
    "psi": Unit(_POUND / 0.0254**2, (1, -1, -2, 0, 0)),
    "mph": Unit(0.44704, (0, 1, -1, 0, 0)),
    "rpm": Unit(2 * pi / 60, (0, 0, -1, 0, 0)),
    "°C": Unit(1.0, (0, 0, 0, 1, 0)),  # inside, temperatures are in °C: differences are K
    "°F": Unit(5 / 9, (0, 0, 0, 1, 0), -160 / 9),
}
_ALIASES = {
    "": "1",
    "-": "1",
    "kph": "km/h",
    "km/hour": "km/h",
    "C": "°C",
    "Celsius": "°C",
    "kelvin": "K",
    "Kelvin": "K",
    "RPM": "rpm",
    "1/min": "rpm",
    "/min": "rpm",
    "min-1": "rpm",
    "min^-1": "rpm",
    "min⁻¹": "rpm",
    "U/min": "rpm",
    "Umdr/min": "rpm",
    "r/min": "rpm",
    "tr/min": "rpm",
    "sec": "s",
    "msec": "ms",
    "ft-lb": "lbft",
    "lb-ft": "lbft",
    "ft lb": "lbft",
    "lb ft": "lbft",
    "lbf ft": "lbft",
    "lbf·ft": "lbft",
    "N.m": "Nm",
    "N m": "Nm",
    "N-m": "Nm",
    "N.mm": "Nmm",
    "N-mm": "Nmm",
    "percent": "%",
    "Prozent": "%",
    "ohm": "Ohm",
    "Grad": "°",
    "um": "µm",
    "us": "µs",
    "L": "l",
    "lpm": "l/min",
    "Nm/rad": "Nm",
    "unitless": "1",
    "Unitless": "1",
}
# as people write °C: with a blank between, that is no product of an angle and a temperature
_DEGREES = re.compile(
    r"(?:°|deg(?:rees?)?|grad)\s*(?:(c)(?:elsius)?|(f)(?:ahrenheit)?|(k)(?:elvin)?)", re.IGNORECASE
)
_SUPERSCRIPTS = str.maketrans("⁻⁰¹²³⁴⁵⁶⁷⁸⁹", "-0123456789")
_FACTOR = re.compile(
    r"\s*(?:(?P<number>\d+(?:\.\d+)?(?:e-?\d+)?)|(?P<symbol>[A-Za-zµΩ°%]+))"
    r"(?:\^(?P<power>-?\d+))?\s*"
)


@lru_cache(maxsize=512)
def parse(text: str) -> Unit:
    """The unit that ``text`` names.  Raises ClutchestError for one that is not known, or is zero or
    without bounds."""
    try:
        unit = _parsed(text)
    except (ArithmeticError, ValueError):
        unit = None
    if unit is None or not 0.0 < unit.scale < inf:
        raise ClutchestError(f"unit '{text[:60]}': its number is zero, or beyond any unit")
    return unit


def _parsed(text: str) -> Unit:
    text = text.strip().replace("\u03bc", "µ")  # a Greek letter for the sign of micro
    source = _temperature(_ALIASES.get(text, text))
    source = re.sub(r"[⁻⁰¹²³⁴-⁹]+", lambda m: "^" + m.group().translate(_SUPERSCRIPTS), source)
    source = re.sub(r"[·*]", " ", source)
    numerator, _, denominator = source.partition("/")
    denominator = denominator.strip()
    times = 1
    if match := re.fullmatch(r"\((.*)\)(?:\^(\d))?", denominator):
        denominator, times = match[1], int(match[2] or 1)
    if "/" in denominator or "(" in denominator:
        raise ClutchestError(f"unit '{text}': write one division only, as in 'W/(m K)'")
    top, bottom = _product(numerator, text), _product(denominator or "1", text)
    dimensions = tuple(
        a - times * b for a, b in zip(top.dimensions, bottom.dimensions, strict=True)
    )
    return Unit(top.scale / bottom.scale**times, dimensions, top.offset)  # type: ignore[arg-type]


def _temperature(text: str) -> str:
    """A unit of temperature as this module writes it; any other text as it is."""
    if match := _DEGREES.fullmatch(text):
        return "°C" if match[1] else "°F" if match[2] else "K"
    return text


def _product(text: str, whole: str) -> Unit:
    scale, offset, dimensions, end = 1.0, 0.0, [0] * 5, 0
    while end < len(text):
        match = _FACTOR.match(text, end)
        if not match:
            raise ClutchestError(f"unit '{whole}' cannot be read at '{text[end:]}'")
        power = int(match["power"] or 1)
        if match["number"]:
            scale *= float(match["number"]) ** power
        else:
            symbol = _ALIASES.get(match["symbol"], match["symbol"])
            if symbol not in _SYMBOLS:
                raise ClutchestError(
                    f"unknown unit '{match['symbol']}' in '{whole}'" + nearest(symbol, _SYMBOLS)
                )
            unit = _SYMBOLS[symbol]
            scale, offset = scale * unit.scale**power, unit.offset
            dimensions = [d + power * e for d, e in zip(dimensions, unit.dimensions, strict=True)]
        end = match.end()
    return Unit(scale, tuple(dimensions), offset)  # type: ignore[arg-type]


@overload
def convert(value: float, unit: str, to: str) -> float: ...
@overload
def convert(value: NDArray[np.float64], unit: str, to: str) -> NDArray[np.float64]: ...
def convert(value: Any, unit: str, to: str) -> Any:
    """``value`` given in ``unit``, expressed in the unit ``to``.

    Raises ClutchestError if the two do not measure the same thing.
    """
    a, b = parse(unit), parse(to)
    if a.dimensions != b.dimensions:
        raise ClutchestError(f"unit '{unit}' cannot be converted to '{to}'")
    if a.scale == b.scale and a.offset == b.offset:
        return value
    return value * (a.scale / b.scale) + (a.offset - b.offset) / b.scale


def convert_reading(value: NDArray[np.float64], unit: str, to: str) -> NDArray[np.float64]:
    """Readings (n) in ``unit``, expressed in the unit ``to``: as :func:`convert`, but a temperature
    in K is an absolute one, not a difference.

    Raises ClutchestError if the two do not measure the same thing.
    """
    shift = (_is_kelvin(to) - _is_kelvin(unit)) * ZERO_CELSIUS
    if not shift:
        return convert(value, unit, to)
    if _is_kelvin(unit):
        return convert(value + shift, "°C", to)
    return convert(value, unit, "°C") + shift


def _is_kelvin(unit: str) -> int:
    return int(_temperature(unit.strip()) in ("K", "kelvin", "Kelvin"))


def compatible(unit: str, to: str) -> bool:
    """Whether both units measure the same kind of quantity."""
    return parse(unit).dimensions == parse(to).dimensions
