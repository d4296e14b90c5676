"""The compiled filter beside one written by hand in C for the same model: µs per event.

    python benchmarks/by_hand.py [--duration 60] [--repeats 7]

Needs a C compiler (``CC``, else cc).  ``by_hand.c`` is the filter, the equations that it includes
CasADi's C code.  It follows neither energies nor information, which the kernel does, so that the
ratio says how much more a user of the kernel waits, all it does included.  Compared are like and
like: with the model's outputs and their variances at every event, and at few or none.  Processor
time; all run in turn, and a ratio is formed within each turn.
"""

from __future__ import annotations

import argparse
import ctypes
import os
import subprocess
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory
from time import process_time
from typing import Any

import casadi as ca
import numpy as np

import clutchest
from clutchest.compute.step import heun
from clutchest.estimate.initial_state import fresh
from clutchest.estimate.timeline import Timeline, build
from clutchest.estimate.whole_log import (
    ROBUST_LIMIT,
    Compiled,
    FilterOptions,
    compile_model,
    delays,
    run,
)
from clutchest.models.model import Model

HERE = Path(__file__).parent
KERNEL, SPARSE = "kernel, outputs at every event", "kernel, outputs as replay"
BY_HAND, WITH_OUTPUTS = "by hand in C, no outputs", "by hand in C, outputs at every event"
LIKE = ((KERNEL, WITH_OUTPUTS), (SPARSE, BY_HAND))  # what does the same


def write_equations(model: Model, flags: int, folder: Path) -> None:
    """``equations.c``: a step with F and Q, and the readings with H, by columns; sizes."""
    e = model.expressions()
    taken = heun(model, e)
    over = [e.x, e.u, taken.u1, taken.dt, e.w, e.p, e.g, taken.q, taken.noise]
    F, H = ca.jacobian(taken.x, e.x), ca.jacobian(e.readings, e.x)
    code = ca.CodeGenerator("casadi.c", {"casadi_real": "double"})
    step = ca.Function("model_step", over, [taken.x, ca.densify(F), ca.densify(taken.Q)])
    at = [e.x, e.u, e.w, e.p, e.g]
    reading = ca.Function("model_reading", at, [ca.densify(e.readings), ca.densify(H)])
    by_input = ca.jacobian(e.outputs, e.u)
    results = [e.outputs, ca.jacobian(e.outputs, e.x), by_input]
    outputs = ca.Function("model_outputs", at, [ca.densify(each) for each in results])
    for function in (step, reading, outputs):
        code.add(function)
    code.generate(f"{folder}/")
    scales = [i for i, state in enumerate(model.states) if state.factor]
    doubted = [model.state(name) for name in model.doubted]
    sizes = {
        "N": len(model.states),
        "M": len(model.sensors),
        "INPUTS": len(model.inputs),
        "FLAGS": flags,
        "SCALES": len(scales),
        "DOUBTED": len(doubted),
        "OUTPUTS": len(model.outputs),
        "WORK": 1 + max(f.sz_w() for f in (step, reading, outputs)),
        "WHOLE": 1 + max(f.sz_iw() for f in (step, reading, outputs)),
        "GIVEN": max(f.sz_arg() for f in (step, reading, outputs)),
        "TAKEN": max(f.sz_res() for f in (step, reading, outputs)),
    }
    lines = [f"enum {{ {', '.join(f'{key} = {value}' for key, value in sizes.items())} }};"]
    for name, places in (("scales", scales), ("doubted", doubted)):
        lines.append(f"static const int {name}[] = {{ {', '.join(map(str, [*places, 0]))} }};")
    text = "\n".join([*lines, '#include "casadi.c"'])
    (folder / "equations.c").write_text(text + "\n", encoding="utf-8")


def compiled_by_hand(folder: Path) -> Any:
    """The function ``by_hand`` of the C file."""
    library = folder / "by_hand.so"
    command = [os.environ.get("CC", "cc"), "-O3", "-march=native", "-shared", "-fPIC", "-I"]
    source = str(HERE / "by_hand.c")
    subprocess.run([*command, str(folder), source, "-lm", "-o", str(library)], check=True)
    function = ctypes.CDLL(str(library)).by_hand
    function.restype = ctypes.c_double
    return function


def call(
    function: Any, compiled: Compiled, line: Timeline, x: Any, P: Any, outputs: bool = False
) -> tuple[Any, Any, Any]:
    """States, covariances and, where asked for, outputs with their variances at every event."""
    n, K = len(x), len(line.t)
    xs, Ps = np.empty((K, n)), np.empty((K, n, n))
    ys = np.empty((K, len(compiled.model.outputs), 2)) if outputs else None
    given = [line.t, line.sensor, line.z, line.R, line.u, line.row, line.W, line.Q]
    given += [line.longest, line.noise, compiled.p, compiled.g]
    kept = [np.ascontiguousarray(array) for array in given]
    begin = [np.array(x), np.array(P)]
    variance = np.ascontiguousarray(line.variance)
    filled = [*kept, *begin, xs, Ps, variance, *([] if ys is None else [ys])]
    pointers = [ctypes.c_void_p(array.ctypes.data) for array in filled]
    limit = ctypes.c_double(ROBUST_LIMIT)
    none = [] if outputs else [ctypes.c_void_p(None)]
    function(ctypes.c_long(K), *pointers[:12], limit, *pointers[12:], *none)
    return xs, Ps, ys


def _require_same_outputs(own: Any, by_hand: Any) -> None:
    """Ends where the outputs (K, outputs, value and variance) of both are not the same."""
    largest = np.abs(own).max(axis=0) + 1e-300
    assert np.max(np.abs(own - by_hand) / largest) < 1e-9


def compare(drive: clutchest.Signals, vehicle: clutchest.Vehicle, repeats: int) -> dict[str, Any]:
    """µs per event of each way, (repeats,), and the largest ``difference`` of a state, in standard
    deviations at the start."""
    compiled = compile_model(vehicle, vehicle.machine.equations(drive))
    sparse = build(drive, vehicle, compiled.model, 10.0, delays(vehicle))
    line = replace(sparse, emit=np.arange(len(sparse.t)))
    start, plain = fresh(vehicle, compiled, line), FilterOptions(signature=False)
    with TemporaryDirectory() as place:
        write_equations(compiled.model, line.W.shape[1], Path(place))
        function = compiled_by_hand(Path(place))
        ways: dict[str, Callable[[], Any]] = {
            KERNEL: lambda: run(compiled, line, start, plain).x,
            SPARSE: lambda: run(compiled, sparse, start, plain).x,
            BY_HAND: lambda: call(function, compiled, line, start.x, start.P)[0],
            WITH_OUTPUTS: lambda: call(function, compiled, line, start.x, start.P, True)[0],
        }
        _require_same_outputs(
            run(compiled, line, start, plain).outputs,
            call(function, compiled, line, start.x, start.P, True)[2],
        )
        difference = np.abs(ways[KERNEL]() - ways[BY_HAND]()) / np.sqrt(start.P.diagonal())
        times: dict[str, list[float]] = {name: [] for name in ways}
        for _ in range(repeats):
            for name, way in ways.items():
                begin = process_time()
                way()
                times[name].append((process_time() - begin) / len(line.t) * 1e6)
    return {
        "events": len(line.t),
        "states": len(start.x),
        "us_per_event": times,
        "difference": float(difference.max()),
    }


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--vehicle", default="truck")
    parser.add_argument("--scenario", default="city")
    parser.add_argument("--duration", type=float, default=60.0, help="s")
    parser.add_argument("--repeats", type=int, default=7)
    given = parser.parse_args()
    vehicle = clutchest.load_vehicle(given.vehicle)
    drive = clutchest.simulate(vehicle, given.scenario, 1, duration=given.duration)
    result = compare(drive, vehicle, given.repeats)
    times = result["us_per_event"]
    print(
        f"{given.vehicle}: {result['events']} events, {result['states']} states, "
        f"{given.repeats} turns"
    )
    print(f"{'µs per event':48}{'min':>7}{'median':>9}{'max':>8}")
    for name, values in times.items():
        print(f"{name:48}{min(values):7.2f}{np.median(values):9.2f}{max(values):8.2f}")
    for name, like in LIKE:
        ratio = np.array(times[name]) / np.array(times[like])
        what = f"{name}, by hand: ratio"
        print(f"{what:48}{min(ratio):7.2f}{np.median(ratio):9.2f}{max(ratio):8.2f}")
    print(f"largest difference of a state: {result['difference']:.1e} standard deviations")


if __name__ == "__main__":
    main()
