"""Patches as earlier versions wrote them, Python files ``patch_effects.py``, read as curves.

The file is not run: what it states is read from its syntax tree.
"""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any
from warnings import catch_warnings

import numpy as np

from clutchest.models.error_curve import ErrorCurve, matrix, rounded
from clutchest.signals import Floats
from clutchest.vehicle.toml import TomlFile

if TYPE_CHECKING:
    from clutchest.models.machine import Machine

_MARK = "Written by `clutchest discover`."
_COVARIATE = re.compile(r"(?:goes with|a curve over) `(\w+)`")


@dataclass(frozen=True, slots=True)
class EarlierPatch:
    """A curve times numbers of effects: ``parts`` (effect, number, values at the knots).

    Of the delay of a ``signal`` the values are in s and there is no ``error_term``.
    """

    error_term: str
    signal: str
    covariate: str
    knots: tuple[float, ...]
    parts: tuple[tuple[str, str, Floats], ...]

    @property
    def effects(self) -> tuple[str, ...]:
        """The names under which it stands in a vehicle file."""
        return tuple(dict.fromkeys(effect for effect, _, _ in self.parts))

    def curve(
        self,
        file: TomlFile,
        effects: Mapping[str, Any],
        spreads: Mapping[str, Any],
        machine: Machine,
    ) -> ErrorCurve:
        """The curve with the numbers that ``[effects]`` and ``[effects_spread]`` state."""
        error_term, unit = self._unit(machine)
        values = np.zeros(len(self.knots))
        covariance = np.zeros((len(values), len(values)))
        for effect, key, part in self.parts:
            entry, std = effects.get(effect, {}), spreads.get(effect, {}).get(key, 0.0)
            given = file.quantity(("effects", effect, key), entry.get(key, 0.0), "1")
            spread = file.number(("effects_spread", effect, key), std, 0.0) or given.spread
            values += given.value * part / unit
            covariance += (spread / unit) ** 2 * np.outer(part, part)
        stated = matrix(covariance) if covariance.any() else ()
        return ErrorCurve(error_term, self.covariate, self.knots, rounded(values), stated)

    def _unit(self, machine: Machine) -> tuple[str, float]:
        """The error term, and the size of the values' unit."""
        if not self.signal:
            return self.error_term, 1.0
        lates = {key: each.late for key, each in machine.error_terms.items() if each.late}
        return next((key, s) for key, (signal, s) in lates.items() if signal == self.signal)


def read_patch(path: Path) -> EarlierPatch | None:
    """The patch in a file of effects; None where the file is a user's own."""
    text = path.read_text(encoding="utf-8", errors="replace")
    if _MARK not in text:
        return None
    try:
        with catch_warnings(action="ignore"):  # of its syntax
            return _stated(text)
    except (SyntaxError, LookupError, TypeError, ValueError, StopIteration):  # another file's form
        return None
    except (RecursionError, MemoryError):  # nested without end
        return None


def _stated(text: str) -> EarlierPatch | None:
    tree = ast.parse(text)
    covariate = _COVARIATE.search(ast.get_docstring(tree) or "")
    if covariate is None:
        return None
    constants = dict(_constants(tree.body))
    classes = [node for node in tree.body if isinstance(node, ast.ClassDef)]
    named = [(dict(_constants(node.body)), node) for node in classes]
    effects = [(str(values["name"]), node) for values, node in named if "name" in values]
    if term := re.search(r'FLAWS\["(.+?)"\]', text):
        ((name, _),) = effects
        rows = [constants["VALUES"], *constants.get("BENDS", ())]
        keys = ["size", *(f"bend_{k}" for k in range(1, len(rows)))]
        parts = tuple((name, key, np.array(row)) for key, row in zip(keys, rows, strict=True))
        return EarlierPatch(term[1], "", covariate[1], constants["KNOTS"], parts)
    return _of_delay(covariate[1], constants, effects)


def _of_delay(
    covariate: str,
    constants: Mapping[str, Any],
    effects: Sequence[tuple[str, ast.ClassDef]],
) -> EarlierPatch:
    signal, knots, parts = "", (), []
    for name, node in effects:
        call = next(each for each in ast.walk(node) if isinstance(each, ast.Call) and _late(each))
        _, at, seconds = call.args
        knots = constants["KNOTS"] if isinstance(at, ast.Name) else ast.literal_eval(at)
        signal = re.findall(r"'(\w+)': Lateness", ast.unparse(node))[0]
        parts.append((name, "size", np.array(ast.literal_eval(seconds))))
    return EarlierPatch("", signal, covariate, knots, tuple(parts))


def _late(call: ast.Call) -> bool:
    return isinstance(call.func, ast.Name) and call.func.id == "Lateness"


def _constants(body: Sequence[ast.stmt]) -> Iterator[tuple[str, Any]]:
    """Names that are assigned literals, and these."""
    for node in body:
        if isinstance(node, ast.Assign) and isinstance(node.targets[0], ast.Name):
            try:
                yield node.targets[0].id, ast.literal_eval(node.value)
            except ValueError:
                continue
