"""Two engines, one answer: the compiled kernel and filterpy's filter, event by event."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import casadi as ca
import numpy as np
import pytest

from bench import BENCHES, Bench
from clutchest.estimate import initial_state, timeline, whole_log
from clutchest.estimate.ekf import OnlineFilter
from clutchest.estimate.whole_log import CONSIDERING, Compiled, FilterOptions
from clutchest.models.regimes import Mode
from clutchest.signals import Signals
from clutchest.simulated import simulate
from clutchest.vehicle import load_vehicle

BenchOf = Callable[[str], Bench]


def compare(compiled: Compiled, bench: Bench, signals: Signals) -> None:
    """|Δx_i| ≤ 1e-9 max(|x_i|, σ_i), |ΔP_ij| ≤ 1e-9 σ_i σ_j at every event."""
    line = timeline.build(signals, bench.vehicle, compiled.model, 10.0, {})
    line = replace(line, emit=np.arange(len(line.t)))
    belief = initial_state.fresh(bench.vehicle, compiled, line)
    ours = whole_log.run(compiled, line, belief, FilterOptions(signature=False))
    xs, Ps, total = OnlineFilter(compiled, belief, line).run()
    std = np.sqrt(np.einsum("kii->ki", Ps))
    assert np.all(np.abs(ours.x - xs) <= 1e-9 * np.maximum(np.abs(xs), std))
    assert np.all(np.abs(ours.P - Ps) <= 1e-9 * std[:, :, None] * std[:, None, :])
    assert ours.log_likelihood == pytest.approx(total, rel=1e-9)
    assert np.array_equal(ours.P, ours.P.transpose(0, 2, 1))


@pytest.mark.slow
def test_engines_agree_on_what_parameters_may_do(bench: BenchOf) -> None:
    """Schmidt's filter, once with the parameters as states and once through their signatures."""
    made = bench("dry_clutch")
    vehicle = load_vehicle("truck")
    compiled = whole_log.compile_model(vehicle, made.model, ())
    assert np.count_nonzero(compiled.spread) > 10
    line = timeline.build(noisy(made), vehicle, compiled.model, 10.0, {})
    line = replace(line, emit=np.arange(len(line.t)))
    belief = initial_state.fresh(vehicle, compiled, line)
    ours = whole_log.run(compiled, line, belief, CONSIDERING)
    xs, Ps, total = OnlineFilter(compiled, belief, line, consider=True).run()
    n = len(belief.x)
    std = np.sqrt(np.einsum("kii->ki", Ps))[:, :n]
    assert np.all(np.abs(ours.x - xs[:, :n]) <= 1e-9 * np.maximum(np.abs(xs[:, :n]), std))
    assert np.all(np.abs(np.sqrt(ours.total) - std) <= 1e-9 * std)
    assert ours.log_likelihood == pytest.approx(total, rel=1e-9)
    naive = whole_log.run(compiled, line, belief)
    ratio = ours.total / naive.total
    assert np.all(ratio.mean(axis=0) <= 1.001), "the wiser gain is not the worse"
    assert np.any(ratio[-1] < 0.5)
    assert np.all(xs[:, n + 1 :] == 0.0), "no measurement moves a parameter"


def with_every_effect(bench: Bench) -> Compiled:
    """Every effect at work at a tenth of its largest plausible size, step maps included."""
    full = bench.full
    sizes = [
        n.default if n.shape else 0.1 * n.upper for e in full.model.effects for n in e.parameters
    ]
    e = full.model.expressions()
    assert full.functions.HAS_MAP != ca.is_equal(e.mapped, e.x, 1)
    return replace(full, g=np.array(sizes))


def noisy(bench: Bench, share: float = 1.0) -> Signals:
    """A share of the bench's drive, with the noise of the vehicle's sensors."""
    return bench.setup.drive(bench.vehicle, share * bench.setup.duration, 1.0)


@pytest.mark.slow
@pytest.mark.parametrize("model", list(BENCHES))
def test_engines_agree_over_a_drive(model: str, bench: BenchOf) -> None:
    made = bench(model)
    line = made.timeline(made.bare)
    assert {Mode(m).name for m in line.mode} == set(made.setup.modes), "the drive has its modes"
    assert 2 * len({*line.row}) >= len(line.W), "and half the regimes there may be"
    compare(made.bare, made, noisy(made))


@pytest.mark.slow
@pytest.mark.parametrize("model", list(BENCHES))
def test_engines_agree_with_every_effect_at_work(model: str, bench: BenchOf) -> None:
    made = bench(model)
    compare(with_every_effect(made), made, noisy(made, 0.2))


@pytest.mark.slow
@pytest.mark.parametrize(
    ("effects", "duration"), [(False, 300.0), (True, 200.0)], ids=["plain", "every effect"]
)
def test_engines_agree_over_minutes(effects: bool, duration: float, bench: BenchOf) -> None:
    made = bench("dry_clutch")
    signals = simulate(made.vehicle, "city", 3, duration=duration)
    compare(with_every_effect(made) if effects else made.bare, made, signals)
