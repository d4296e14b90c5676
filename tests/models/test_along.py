"""Threads that work on a model's expressions at the same time."""

from __future__ import annotations

import ast
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from concurrent.futures import TimeoutError as Waits
from pathlib import Path
from threading import Event

import numpy as np
import pytest

import clutchest
from clutchest.casadi_later import one_at_a_time

SOURCE = Path(clutchest.__file__).parent
SUBSTITUTED = """
from concurrent.futures import ThreadPoolExecutor

import casadi as ca

from clutchest.casadi_later import one_at_a_time


@one_at_a_time
def substitute(e, x):
    ca.substitute(e, x[:3], ca.DM([1.0, 2.0, 0.5]))


def several(_):
    x = ca.SX.sym("x", 30)
    e = x
    for _ in range(6):
        e = 2.0 * ca.sin(e) + 0.5 * e * ca.if_else(e > 1.0, e, 0.5) + 1.0
    for _ in range(2000):
        substitute(e, x)


with ThreadPoolExecutor(4) as pool:
    list(pool.map(several, range(4)))
"""


def test_one_thread_at_a_time_works_on_expressions():
    truck = clutchest.load_vehicle("truck")
    e = truck.machine.to_fit(truck.signals).expressions()
    moments = [np.ones((3, each.numel())) for each in (e.x, e.u, e.w)]
    numbers = [np.ones(each.numel()) for each in (e.p, e.g)]
    works, done = Event(), Event()
    with ThreadPoolExecutor(2) as others:
        others.submit(one_at_a_time(lambda: works.set() or done.wait()))
        works.wait()
        values = others.submit(e.along, e.rate, *moments, *numbers)
        try:
            with pytest.raises(Waits):
                values.result(0.2)
        finally:
            done.set()
        assert values.result(60.0).shape == (e.rate.numel(), 3)


def test_threads_that_share_no_symbol_wait_for_each_other():
    """Without waiting, three programs of three ended with a segmentation fault or an abort."""
    subprocess.run([sys.executable, "-c", SUBSTITUTED], check=True, timeout=300)


def test_whatever_substitutes_waits():
    found = []
    for file in SOURCE.rglob("*.py"):
        for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
            if isinstance(node, ast.FunctionDef) and "ca.substitute(" in ast.unparse(node):
                waits = "one_at_a_time" in map(ast.unparse, node.decorator_list)
                found.append((file.name, node.name, waits))
    assert len(found) > 3 and [each for each in found if not each[-1]] == []
