"""Outside their own rooms no name of a machine occurs in code: the syntax trees say so."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from pathlib import Path

from clutchest.models import shipped_machines

SOURCE = Path(__file__).parent.parent / "src" / "clutchest"
OWN_ROOMS = {"models", "generator", "reproduce"}
GENERAL = {
    "current": "now",
    "friction": "the engine's own, a key of [signals.*] beside J1939's percent torque",
    "wear": "a section of summary.json, a key of [limits] and a fault of every machine that wears",
    "clutch_torque": "what output files call a machine's output",
    "slip_energy": "what output files call the energy dissipated since the drive began",
}


def machine_names() -> set[str]:
    """States, signals, parameters, effects and the names of the machines themselves."""
    names = set()
    for machine in shipped_machines():
        names |= {machine.name, *machine.units, *machine.effects, *machine.rates, *machine.peaks}
        names |= {state.name for state in machine.states}
        names |= {parameter.key for parameter in machine.parameters}
        names |= {item.name for item in machine.inputs}
        names |= {sensor.name for sensor in machine.sensors}
    return names - set(GENERAL)


def occurrences(path: Path, names: set[str]) -> Iterator[str]:
    """Every name, attribute, argument and string constant that is one of ``names``."""
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        word = None
        if isinstance(node, ast.Constant) and isinstance(node.value, str):
            word = node.value
        elif isinstance(node, ast.Attribute):
            word = node.attr
        elif isinstance(node, ast.Name):
            word = node.id
        elif isinstance(node, ast.arg | ast.keyword):
            word = node.arg
        elif isinstance(node, ast.FunctionDef | ast.ClassDef):
            word = node.name
        if word in names:
            yield f"{path.relative_to(SOURCE)}:{node.lineno} {word}"


def test_no_name_of_a_machine_outside_its_room() -> None:
    names = machine_names()
    assert len(names) > 100
    elsewhere = [p for p in SOURCE.rglob("*.py") if p.relative_to(SOURCE).parts[0] not in OWN_ROOMS]
    assert len(elsewhere) > 150
    assert [hit for path in sorted(elsewhere) for hit in occurrences(path, names)] == []


def test_a_name_is_seen_where_it_stands() -> None:
    """Of the truck's own files hundreds are seen: the search works."""
    names = machine_names()
    own = [hit for p in (SOURCE / "models").rglob("*.py") for hit in occurrences(p, names)]
    assert len(own) > 300
