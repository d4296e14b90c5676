"""The blind suite's oracle: it knows the generator only, and is right where the answer is known."""

from __future__ import annotations

import ast
import sys
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.signal import lfilter
from scipy.stats import chi2

BENCHMARKS = Path(__file__).parents[1] / "benchmarks"
JUDGED = ("inference", "estimate", "compute", "discovery", "identify", "diagnosis")


@pytest.fixture(scope="module", autouse=True)
def blind() -> Iterator[None]:
    """The suite stands beside the benchmarks, not in the package."""
    sys.path.insert(0, str(BENCHMARKS))
    yield
    sys.path.remove(str(BENCHMARKS))


@pytest.fixture(scope="module")
def oracle() -> Any:
    """Of two minutes of a drive."""
    from blind import drives
    from blind.drives import Drive
    from blind.oracle import Oracle

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(drives, "SHORTEST", 120.0)
        patch.setattr(drives, "LONGEST", 130.0)
        drive = Drive(8, "ar05")
        assert drive.duration < 131.0
        return Oracle(drive)


def _imported(module: str) -> set[str]:
    """What a module of the suite imports, and what those of the suite among it do."""
    tree = ast.parse((BENCHMARKS / f"{module.replace('.', '/')}.py").read_text())
    own = {a.name for n in ast.walk(tree) if isinstance(n, ast.Import) for a in n.names}
    own |= {n.module or "" for n in ast.walk(tree) if isinstance(n, ast.ImportFrom)}
    return own.union(*(_imported(name) for name in own if name.startswith("blind.")))


@pytest.mark.parametrize("module", ["blind.oracle", "blind.cases", "blind.plan"])
def test_what_is_hidden_is_measured_by_nothing_that_is_judged(module):
    imported = _imported(module)
    assert "clutchest.generator.replay" in imported or module == "blind.plan"
    rooms = {name.split(".")[1] for name in imported if name.startswith("clutchest.")}
    assert not rooms & set(JUDGED)


# --- noise ---------------------------------------------------------------------------------------


def _covariance(n: int, slope: Any, per_torque: float, noise: Any) -> Any:
    """Of n speed readings, written down: own noise, and twice the integral of interpolated
    noise."""
    lags = np.abs(np.subtract.outer(np.arange(n), np.arange(n)))
    speed, torque, place = (one.std**2 * one.ar**lags for one in noise)
    halves = np.tril(np.ones((n, n)), -1) + np.tril(np.ones((n, n)))
    halves[:, 0] -= 1.0  # what acts between two readings is the mean of theirs
    integral = per_torque * halves
    return speed + integral @ (torque + np.outer(slope, slope) * place) @ integral.T


@pytest.mark.parametrize("ar", [0.0, 0.5, 0.9])
def test_innovations_weigh_as_the_covariance_of_the_readings_does(ar):
    from blind.white import UNKNOWN, SensorNoise, SpeedFilter

    random, n, step, inertia = np.random.default_rng(3), 80, 0.01, 3.2
    noise = [SensorNoise(std, ar) for std in (0.06, 15.0, 0.01)]
    slope = -800.0 + 300.0 * random.standard_normal(n).cumsum() / 10.0
    signals = random.standard_normal((n, 2)).cumsum(axis=0) / 10.0
    covariance = _covariance(n, slope, 0.5 * step / inertia, noise) + UNKNOWN**2
    innovations = SpeedFilter.of(slope, inertia, step, noise).innovations(signals)
    expected = signals.T @ np.linalg.solve(covariance, signals)
    assert innovations.T @ innovations == pytest.approx(expected, rel=1e-3)


@pytest.mark.parametrize("ar", [0.0, 0.8])
def test_what_is_known_of_a_constant_torque_is_what_can_be_written_down(ar):
    """Exact speeds leave the noise of the torque report and of the position: d′ of a constant
    error of the torque is that of a mean of n readings."""
    from blind.white import SensorNoise, SpeedFilter

    n, step, inertia, slope, bias = 4000, 0.01, 3.2, 700.0, 2.0
    noise = [SensorNoise(1e-6, 0.0), SensorNoise(15.0, ar), SensorNoise(0.01, ar)]
    grown = (bias / inertia * step * np.arange(n))[:, None]
    found = SpeedFilter.of(np.full(n, slope), inertia, step, noise).innovations(grown)
    std = np.hypot(15.0, 0.01 * slope) * np.sqrt((1.0 + ar) / (1.0 - ar))
    assert np.linalg.norm(found) == pytest.approx(bias * np.sqrt(n) / std, rel=0.01)


def test_means_of_readings_scatter_as_they_are_said_to():
    from blind.white import SensorNoise

    random, count = np.random.default_rng(4), 100
    for ar in (0.0, 0.9):
        white = random.standard_normal(100 * 2000) * np.sqrt(1 - ar**2)
        means = lfilter([1.0], [1.0, -ar], white).reshape(-1, count)[1:].mean(axis=1)
        assert SensorNoise(1.0, ar).of_mean(count) == pytest.approx(np.std(means), rel=0.06)
    long = SensorNoise(2.0, 0.5)
    assert long.of_mean(20_000) * 20_000**0.5 == pytest.approx(long.of_sum, rel=1e-3)


def test_noise_as_it_is_drawn_leaves_nothing_but_white_ones(oracle):
    """Inputs with noise move the replay, speeds and means have noise of their own: of what no
    nuisance explains, every effect's share scatters by one."""
    random, seen, found = np.random.default_rng(6), oracle.clean, []
    columns = [oracle._columns(seen, (name,), {}) for name in oracle.effects]
    columns = np.column_stack(columns)
    own = seen.nuisances
    left = columns - own @ np.linalg.solve(own.T @ own + np.eye(own.shape[1]), own.T @ columns)
    left = left[:, np.linalg.norm(left, axis=0) > 1e-3]
    left, _ = np.linalg.qr(left / np.linalg.norm(left, axis=0))
    for _ in range(20):
        drawn = _noisy(oracle, random)
        found.append(left.T @ seen.white((drawn - seen._raw)[:, None])[:, 0])
    total, count = float(np.sum(np.square(found))), np.size(found)
    assert chi2.ppf(0.001, count) < total < chi2.isf(0.001, count)


def _noisy(oracle: Any, random: np.random.Generator) -> Any:
    """A raw misfit with noise: of inputs by a replay, of readings added."""
    seen = oracle.clean
    recorded = seen.recorded

    def noise(name: str, n: int) -> Any:
        one = seen._noise[name]
        white = random.standard_normal(n) * np.r_[1.0, np.full(n - 1, np.sqrt(1 - one.ar**2))]
        return one.std * lfilter([1.0], [1.0, -one.ar], white)

    shown = dict(recorded.signals)
    for name in ("slave_position", "engine_torque", "coolant_temp", "ambient_temp"):
        times = np.arange(0.0, recorded.time[-1] + 2.0, seen._period[name])
        shown[name] = shown[name] + np.interp(recorded.time, times, noise(name, len(times)))
    told = oracle.truck.replay(replace(recorded, signals=shown), seen.nought, {})
    plain = oracle.truck.replay(recorded, seen.nought, {})
    moved = np.r_[0.0, np.cumsum(told.zero_position - plain.zero_position)]
    begins, ends = seen._blocks.T
    parts = [
        (plain.speed - told.speed)[rows] + noise("engine_speed", len(plain.speed[rows]))
        for rows in seen._stretches
    ]
    rest = seen._std * random.standard_normal(len(begins))
    rest -= (moved[ends] - moved[begins]) / (ends - begins)
    return seen._raw + np.concatenate([*parts, rest])


# --- distances -----------------------------------------------------------------------------------


def test_a_drive_without_noise_lies_at_its_own_truck(oracle):
    assert np.linalg.norm(oracle.clean.residual) < 0.3


def test_what_has_the_same_signature_is_at_no_distance(oracle):
    """Worn pads are a zero position that lies lower: with a prior of 0.2 mm, 3 mm are 15, and a
    little less as heat may have moved it too; both together are worth no more."""
    assert 14.0 < oracle.per_largest("wear.amount") < 3.0 / 0.2
    assert 14.0 / 3.0 < oracle.per_largest("position_offset.offset") < 1.0 / 0.2
    assert oracle.per_largest("wear.amount", "position_offset") < 3.0
    level = oracle.per_largest("friction_level.change")
    assert level < 0.5 / 0.02, "healthy trucks' friction scatters by 2 %"


@pytest.mark.slow
def test_a_cause_explains_itself_whatever_its_size(oracle):
    for name, key, size in (
        ("friction_level", "change", -0.2),
        ("torque_gain", "change", 0.1),
        ("torque_delay", "delay", 0.06),
    ):
        twin = oracle.twin({name: {key: size}})
        assert oracle.distance(twin) > 4.0
        assert oracle.distance(twin, [name]) < 0.3
    near = oracle.nearest(twin, whole=False)
    assert near["torque_delay"] < 3.0 < 4.0 < near["wear"]


def test_small_causes_are_as_far_as_the_first_order_says(oracle):
    for gain, largest in (("torque_gain.change", 0.3), ("position_hysteresis.play", 0.5)):
        name, key = gain.split(".")
        size = 2.0 / oracle.per_largest(gain) * largest
        twin = oracle.twin({name: {key: size}})
        assert oracle.distance(twin) == pytest.approx(2.0, rel=0.15)
