"""TOML files read strictly: every error names file, line and key."""

from __future__ import annotations

import re
import tomllib
from collections.abc import Callable, Collection, Iterable
from dataclasses import dataclass
from math import inf, isfinite
from pathlib import Path
from typing import Any

from clutchest import units
from clutchest.budgets import LARGEST, VEHICLE_BYTES, within
from clutchest.errors import ClutchestError, nearest
from clutchest.vehicle.vehicle import ParameterValue

Keys = tuple[str, ...]

_QUANTITY = ("value", "unit", "spread", "source")


@dataclass(frozen=True, slots=True)
class TomlFile:
    """The parsed file, with its text to find the line of a key."""

    path: Path
    text: str
    data: dict[str, Any]

    @classmethod
    def read(cls, path: Path) -> TomlFile:
        """Parse the file.  Raises ClutchestError naming file and line if it is not TOML."""
        within(path, VEHICLE_BYTES, "a vehicle file")
        raw = path.read_bytes()
        try:
            text = raw.decode("utf-8-sig")
        except UnicodeDecodeError as problem:
            line = raw[: problem.start].count(b"\n") + 1
            raise ClutchestError(f"{path.name}:{line}: not UTF-8 text") from None
        try:
            return cls(path, text, tomllib.loads(text))
        except tomllib.TOMLDecodeError as problem:
            at = re.search(r"line (\d+)", str(problem))
            line = int(at[1]) if at else text.count("\n") + 1
            what = re.sub(r" \(at [^)]*\)", "", str(problem))
            hint = _hint(what, text.split("\n")[line - 1])
            raise ClutchestError(f"{path.name}:{line}: not TOML: {what}{hint}") from None
        except ValueError:  # Python reads no longer numbers
            line = _line_of(text, lambda line: max(map(len, re.findall(r"\d+", line)), default=0))
            raise ClutchestError(f"{path.name}:{line}: a number of too many digits") from None
        except RecursionError:
            line = _line_of(text, lambda line: line.count("[") + line.count("{") + line.count("."))
            raise ClutchestError(f"{path.name}:{line}: nested too deeply") from None

    def error(self, keys: Keys, complaint: str) -> ClutchestError:
        """An error about the key ``keys`` (a path from the top), with its line."""
        where = f"{self.path.name}:{line}" if (line := self._line(keys)) else self.path.name
        return ClutchestError(f"{where}: {complaint}")

    def _line(self, keys: Keys) -> int:
        """The line that declares the longest part of ``keys``; 0 where none does."""
        table: Keys = ()
        longest, line_number = 0, 0
        for number, line in enumerate(self.text.splitlines(), 1):
            if header := re.match(r"\s*\[+\s*([^\]]+?)\s*\]", line):
                path = table = _split(header[1])
            elif key := re.match(r"\s*([\w\"'.:\- ]+?)\s*=", line):
                path = (*table, *_split(key[1]))
            else:
                continue
            if path == keys[: len(path)] and len(path) > longest:
                longest, line_number = len(path), number
        return line_number

    def known(self, keys: Keys, given: Iterable[str], valid: Collection[str], what: str) -> None:
        """Every key of ``given`` must be one of ``valid``."""
        for key in given:
            if key not in valid:
                hint = nearest(key, valid) or "; none is expected here"
                raise self.error((*keys, key), f"unknown {what} '{key}'{hint}")

    def required(self, key: str) -> Any:
        """The value of a key at the top that every vehicle file has."""
        if key not in self.data:
            raise self.error((), f"this vehicle file has no '{key}'")
        return self.data[key]

    def table(self, keys: Keys, value: Any) -> dict[str, Any]:
        """A sub-table."""
        if not isinstance(value, dict):
            raise self.error(keys, f"{'.'.join(keys)} must be a table, not {shown(value)}")
        return value

    def string(self, keys: Keys, value: Any) -> str:
        """A string that is not empty."""
        if not isinstance(value, str) or not value:
            raise self.error(keys, f"{'.'.join(keys)} must be a string, not {shown(value)}")
        return value

    def strings(self, keys: Keys, value: Any) -> list[str]:
        """A list of strings."""
        if not isinstance(value, list) or not all(isinstance(item, str) for item in value):
            raise self.error(keys, f"{'.'.join(keys)} must be a list of strings: {shown(value)}")
        return value

    def number(self, keys: Keys, value: Any, lower: float = -inf, upper: float = inf) -> float:
        """A finite number from ``lower`` to ``upper``."""
        name = ".".join(keys)
        if isinstance(value, bool) or not isinstance(value, int | float):
            raise self.error(keys, f"{name} must be a number, not {shown(value)}")
        if isinstance(value, float) and not isfinite(value):
            raise self.error(keys, f"{name} = {value} is not finite")
        if abs(value) > LARGEST:
            raise self.error(keys, f"{name} = {shown(value)} must be at most {LARGEST:g}")
        if not lower <= value <= upper:
            raise self.error(keys, f"{name} = {value:g} must be {_range(lower, upper)}")
        return float(value)

    def integer(self, keys: Keys, value: Any, upper: int) -> int:
        """An integer from 0 to ``upper``."""
        if isinstance(value, bool) or not isinstance(value, int) or not 0 <= value <= upper:
            raise self.error(
                keys, f"{'.'.join(keys)} must be an integer 0 … {upper}, not {shown(value)}"
            )
        return value

    def unit(self, keys: Keys, value: Any, expected: str) -> str:
        """A unit that can be converted to ``expected``."""
        unit = self.string(keys, value)
        try:
            agrees = units.compatible(unit, expected)
        except ClutchestError as problem:
            raise self.error(keys, str(problem)) from None
        if not agrees:
            words = f"unit '{unit}' of {'.'.join(keys[:-1])} cannot be converted to '{expected}'"
            if unit == "%" and len(keys) == 3:  # of a signal or column
                words += f"; 'reference' states what 100 % stands for, in {expected}"
            raise self.error(keys, words)
        return unit

    def quantity(
        self, keys: Keys, value: Any, unit: str, lower: float = -inf, upper: float = inf
    ) -> ParameterValue:
        """A bare number, or ``{ value, unit, spread, source }``, converted to ``unit``."""
        if not isinstance(value, dict):
            return ParameterValue(self.number(keys, value, lower, upper), unit)
        self.known(keys, value, _QUANTITY, "key")
        if "value" not in value:
            raise self.error(keys, f"{'.'.join(keys)} has no 'value' (in {unit})")
        given = self.unit((*keys, "unit"), value.get("unit", unit), unit)
        number = units.convert(self.number((*keys, "value"), value["value"]), given, unit)
        self.number(keys, number, lower, upper)
        # A spread is a difference: an offset such as that of °F does not enter.
        scale = units.parse(given).scale / units.parse(unit).scale
        spread = self.number((*keys, "spread"), value.get("spread", 0.0), 0.0)
        source = value.get("source", "")
        if not isinstance(source, str):
            raise self.error((*keys, "source"), f"{'.'.join(keys)}.source must be a string")
        return ParameterValue(number, unit, spread if scale == 1.0 else spread * scale, source)


def error_in(path: Path, keys: Keys, complaint: str) -> ClutchestError:
    """An error about the key ``keys`` of a vehicle file that was read before, with its line."""
    if path.is_file():
        return TomlFile.read(path).error(keys, complaint)
    return ClutchestError(f"{path.name}: {complaint}")


def shown(value: Any) -> str:
    """A value as a message can hold it, however long or deep it is."""
    try:
        text = repr(value)
    except (RecursionError, ValueError):
        return f"a {type(value).__name__} that is too long or too deep"
    return text if len(text) <= 80 else f"{text[:77]}…"


def _hint(what: str, line: str) -> str:
    """What is expected in a ``line`` that is not TOML."""
    if "\\" in line and re.search("Unescaped|hex|Unterminated", what):
        return "; expected / between the folders of a path, or '…' around it"
    if re.search(r"=\s*[-+]?\d+,\d", line):
        return "; a number has a decimal point"
    return "; the key stands there twice" if "overwrite" in what else ""


def _line_of(text: str, size: Callable[[str], int]) -> int:
    """The number of the line of which ``size`` is largest."""
    lines = text.splitlines()
    return 1 + max(range(len(lines)), key=lambda k: size(lines[k]), default=0)


def _range(lower: float, upper: float) -> str:
    if isfinite(lower) and isfinite(upper):
        return f"within {lower:g} … {upper:g}"
    return f"at least {lower:g}" if isfinite(lower) else f"at most {upper:g}"


def _split(dotted: str) -> Keys:
    return tuple(part.strip().strip("\"'") for part in dotted.split("."))
