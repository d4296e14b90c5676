"""Rerun as the program loads it: less of it, with the same names."""

from __future__ import annotations

import json
import subprocess
import sys

LOADED = """
import importlib, json, sys
from clutchest.record.light_rerun import lighten_rerun
if {light}:
    lighten_rerun()
import rerun, rerun.blueprint
print(len([name for name in sys.modules if name.split(".")[0] == "rerun"]))
found = {{}}
for package in ("rerun", "rerun.archetypes", "rerun.components", "rerun.encodings",
                "rerun.blueprint", "rerun.blueprint.archetypes", "rerun.blueprint.views"):
    module = importlib.import_module(package)
    for name in {names}[package] if {light} else dir(module):
        thing = getattr(module, name)
        if isinstance(thing, type):
            found.setdefault(package, {{}})[name] = f"{{thing.__module__}}.{{thing.__qualname__}}"
print(json.dumps(found))
try:
    rerun.no_such_name
except AttributeError as problem:
    print(problem)
"""


def loaded(light: bool, names: dict[str, dict[str, str]]) -> tuple[int, dict, str]:
    """How many modules are loaded at first, the classes by package and name, and what is said of a
    name that there is not."""
    program = LOADED.format(light=light, names=names)
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    count, found, words = done.stdout.splitlines()
    return int(count), json.loads(found), words


def test_every_class_is_the_same_and_few_are_loaded() -> None:
    many, whole, missing = loaded(False, {})
    few, light, missing_too = loaded(True, whole)
    assert sum(map(len, whole.values())) > 500
    assert (light, missing_too) == (whole, missing)
    assert few < many / 4
