"""`import clutchest`: quick, complete, and known to type checkers."""

from __future__ import annotations

import ast
import os
import subprocess
import sys
from pathlib import Path

import pytest

import clutchest


def test_dir_and_getattr_agree():
    for name in dir(clutchest):
        assert getattr(clutchest, name) is not None
    assert {"load_vehicle", "read_log", "replay", "simulate", "Signals", "Run"} <= set(
        dir(clutchest)
    )
    with pytest.raises(AttributeError, match="no attribute 'relpay'"):
        _ = clutchest.relpay


def test_type_checkers_see_the_same_names():
    tree = ast.parse(Path(clutchest.__file__).read_text(encoding="utf-8"))
    imported = {
        (node.module, alias.name)
        for node in ast.walk(tree)
        if isinstance(node, ast.ImportFrom)
        for alias in node.names
    }
    assert {(home, name) for name, home in clutchest._HOMES.items()} <= imported
    assert set(clutchest.__all__) == {*clutchest._HOMES, "fleet", "identify", "__version__"}


def test_rooms_are_called_by_their_own_name(tmp_path):
    """In whichever order they are imported."""
    code = (
        "import sys, clutchest\n"
        "from clutchest.identify import procedures\n"
        "print('noise' in procedures(clutchest.load_vehicle('truck').machine))\n"
        "for call in (lambda: clutchest.identify('nothing', 'demo', 'truck'),\n"
        "             lambda: clutchest.fleet('nowhere', 'truck', 'out')):\n"
        "    try: call()\n"
        "    except clutchest.ClutchestError as problem: print(problem)\n"
    )
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)}
    done = subprocess.run(
        [sys.executable, "-c", code],
        env=environment,
        text=True,
        capture_output=True,
        timeout=60,
        cwd=tmp_path,
    )
    first, second, third = done.stdout.splitlines()
    assert first == "True"
    assert "'nothing'" in second and "nowhere" in third


def test_import_loads_nothing_heavy():
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)}
    code = (
        "import sys, clutchest; "
        "print([n for n in ('numpy', 'pandas', 'numba', 'rerun', 'casadi') if n in sys.modules])"
    )
    done = subprocess.run(
        [sys.executable, "-c", code], env=environment, text=True, capture_output=True, timeout=60
    )
    assert done.stdout.strip() == "[]", done.stderr


def test_reading_a_log_loads_no_equations():
    """What the log road needs neither to load a vehicle nor to read a log."""
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)}
    heavy = ("numba", "casadi", "scipy", "matplotlib", "rerun", "distributed")
    code = (
        "import sys, clutchest\n"
        "signals = clutchest.read_log('demo', 'truck')\n"
        f"print(len(signals), [n for n in {heavy} if n in sys.modules])"
    )
    done = subprocess.run(
        [sys.executable, "-c", code], env=environment, text=True, capture_output=True, timeout=60
    )
    assert done.stdout.split(maxsplit=1)[1].strip() == "[]", done.stderr
