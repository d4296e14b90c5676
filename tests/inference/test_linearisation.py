"""Innovations as a function of every unknown number, and their derivatives.

Most drives here are quiet: sensors a thousand times better than the vehicle file says, and no
rounding by the bus.  At the numbers that the drive was made with, next to nothing is then left.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
import pytest

import clutchest
from clutchest.generator import Sampled
from clutchest.inference.innovations import NormalisedInnovations
from clutchest.inference.linearisation import Modulation
from clutchest.inference.objective import Objective
from clutchest.inference.problem import Problem
from clutchest.inference.unknowns import (
    InitialState,
    SignalDelay,
    StatedGain,
    Unknown,
    UnknownGain,
    UnknownParameter,
)
from clutchest.models import machine_of
from clutchest.signals import Floats, Signal, Signals
from clutchest.simulated import simulate_sampled
from clutchest.vehicle import Vehicle

DURATION = 300.0  # s
LIBRARY = tuple(machine_of("dry_clutch").effects.values())
# Where the torque and the inertia of the engine come in, derivatives are taken at a torque that
# the slope of the engine speed implies, and are less smooth than the differences.  A delay acts by
# slopes that are smoothed as far as the signal is noisy.
ROUGH = {
    "engine_inertia": 0.3,
    "torque_gain": 0.1,
    "position_hysteresis": 0.2,
    "position_delay": 0.04,
}


@pytest.fixture(scope="module")
def truck() -> Vehicle:
    return clutchest.load_vehicle("truck")


def quiet(
    vehicle: Vehicle,
    seed: int,
    effects: Mapping[str, Mapping[str, float]] | None = None,
    duration: float = DURATION,
) -> Signals:
    """A drive in town of the nominal truck with ``effects``, all but without noise."""
    fine = {n: replace(s, noise=1e-3 * s.noise, noise_ar=0.0) for n, s in vehicle.signals.items()}
    made: Sampled = simulate_sampled(
        replace(vehicle, signals=fine), "city", seed, effects, nominal=True, duration=duration
    )
    signals = {n: Signal.of(n, "", time, value) for n, (time, value) in made.signals.items()}
    return Signals(signals, end=duration, truth=made.truth)


def truth(problem: Problem, *drives: Signals, **gains: tuple[str, float]) -> Floats:
    """θ (m) with the starts that the drives truly had, and ``gains``: effect → (key, value)."""
    theta = np.zeros(len(problem.thetas))
    for k, t in enumerate(problem.thetas):
        if isinstance(t, InitialState):
            drive, made = problem.drives[t.drive], drives[t.drive].truth
            assert made is not None
            start = np.interp(drive.line.t[0], made.time, made.columns[t.state])
            theta[k] = (start - drive.nominal[drive.compiled.model.state(t.state)]) / t.unit
    for effect, (key, value) in gains.items():
        k = problem.index(f"{effect}.{key}")
        theta[k] = value / problem.units[k]
    return theta


def misses(rows: NormalisedInnovations) -> float:
    """What the innovations are made of beside noise, as a share of its variance."""
    return float(np.mean(rows.r**2))


def implied(problem: Problem, theta: Floats) -> NormalisedInnovations:
    """The first drive at ``theta``, derivatives at the inputs that ``theta`` implies."""
    return problem.linearise(theta, {}, at=problem.implied(theta, {}))[0]


def rough(unknown: Unknown) -> float:
    """By how much a derivative may differ from the difference."""
    match unknown:
        case UnknownGain(effect):
            return ROUGH.get(effect, 0.02)
        case UnknownParameter(key):
            return ROUGH.get(key, 0.02)
        case SignalDelay():
            return 0.04
    return 0.02


@pytest.fixture(scope="module")
def drive(truck: Vehicle) -> Signals:
    return quiet(truck, 1)


@pytest.fixture(scope="module")
def problem(truck: Vehicle, drive: Signals) -> Problem:
    return Problem.of(drive, truck, LIBRARY)


@pytest.fixture(scope="module")
def at_truth(problem: Problem, drive: Signals) -> tuple[Floats, NormalisedInnovations]:
    theta = truth(problem, drive)
    return theta, implied(problem, theta)


def difference(problem: Problem, theta: Floats, k: int, size: float, base: Floats) -> Floats:
    """Derivative of the innovations by the k-th number, by finite differences of second order; from
    above only where below is no physics."""
    step, none = np.zeros(len(theta)), np.zeros(0, int)  # no derivatives needed
    step[k] = size
    above = problem.linearise(theta + step, {}, none)[0].r
    t = problem.thetas[k]
    if isinstance(t, UnknownGain) and t.lower == 0.0:
        further = problem.linearise(theta + 2 * step, {}, none)[0].r
        return (-3 * base + 4 * above - further) / (2 * size)
    return (above - problem.linearise(theta - step, {}, none)[0].r) / (2 * size)


def agreement(numeric: Floats, analytic: Floats) -> tuple[float, float]:
    """By how much the difference goes with the derivative, and what it has beside that, relative
    to the derivative's length."""
    square = analytic @ analytic
    return numeric @ analytic / square, np.linalg.norm(numeric - analytic) / np.sqrt(square)


def unknown(problem: Problem) -> Problem:
    """The same problem, none of whose runs is remembered."""
    return replace(problem, drives=[replace(drive) for drive in problem.drives])


def test_two_halves_of_a_drive_are_the_whole(
    problem: Problem,
    at_truth: tuple[Floats, NormalisedInnovations],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    theta, _ = at_truth
    monkeypatch.setattr("clutchest.inference.propagation.halved", lambda _: False)
    (whole,) = unknown(problem).linearise(theta, {})
    monkeypatch.setattr("clutchest.inference.propagation.halved", lambda _: True)
    (halves,) = unknown(problem).linearise(theta, {})
    np.testing.assert_array_equal(halves.r, whole.r)
    np.testing.assert_array_equal(halves.implied.states, whole.implied.states)
    scale = np.abs(whole.psi).max(axis=0)
    assert np.all(np.abs(halves.psi - whole.psi) <= 1e-9 * scale)


def test_nothing_is_left_at_the_truth(at_truth):
    _, rows = at_truth
    assert len(rows.r) > 3000
    assert misses(rows) < 0.0025
    assert np.abs(rows.r).max() < 1.0


def test_derivatives_are_those_of_the_innovations(problem, at_truth):
    """Of all nuisances, and of gains of all effects that this drive excites.

    Not those by how late the reported torque is: they jump where a slip begins and ends.
    """
    theta, rows = at_truth
    seen = set()
    for k, t in enumerate(problem.thetas):
        analytic = rows.psi[:, k]
        late = t.signal if isinstance(t, SignalDelay) else problem.delayed.get(k)
        if late == "engine_torque" or not analytic.any():
            continue
        size = 0.5 if isinstance(t, SignalDelay) else 0.0025 if isinstance(t, UnknownGain) else 0.05
        numeric = difference(problem, theta, k, size, rows.r)
        along, beside = agreement(numeric, analytic)
        assert abs(along - 1.0) < 0.03 and beside < rough(t), (t, along, beside)
        seen.add(t.effect if isinstance(t, UnknownGain) else type(t))
    assert seen >= set(problem.effects) - {"friction_fade", "torque_delay"}
    assert seen >= {UnknownParameter, InitialState, SignalDelay}


def test_an_effect_that_this_drive_does_not_excite_leaves_no_trace(problem, at_truth):
    """The disc stays below 200 °C; from 40 °C on there is something to fade."""
    theta, rows = at_truth
    k = problem.index("friction_fade.slope")
    assert not rows.psi[:, k].any()
    low = {("friction_fade", "onset"): 40.0}
    shaped = problem.linearise(theta, low)[0]
    assert shaped.psi[:, k].any()
    step = np.zeros(len(theta))
    step[k] = 0.0025
    numeric = (problem.linearise(theta + step, low)[0].r - shaped.r) / step[k]
    along, beside = agreement(numeric, shaped.psi[:, k])
    assert abs(along - 1.0) < 0.03 and beside < 0.03


def test_derivatives_bear_noise(truck):
    """On a drive as the bus carries it: derivatives share no noise with the innovations."""
    drive = clutchest.simulate(truck, "city", 2, nominal=True, duration=DURATION)
    noisy = Problem.of(drive, truck, LIBRARY)
    theta = truth(noisy, drive)
    rows = implied(noisy, theta)
    assert 0.09 < misses(rows) < 1.44
    for effect, key in [
        ("engine_inertia", "change"),
        ("friction_speed", "slope"),
        ("torque_gain", "change"),
        ("torque_bias", "bias"),
        ("position_offset", "offset"),
        ("viscous_drag", "coefficient"),
        ("expansion_disc", "change"),
        ("heat_split", "fraction"),
    ]:
        k = noisy.index(f"{effect}.{key}")
        along, _ = agreement(difference(noisy, theta, k, 0.01, rows.r), rows.psi[:, k])
        assert abs(along - 1.0) < 0.03, (effect, along)
        if effect == "engine_inertia":
            # the same number as a parameter, in another unit
            j = noisy.index("engine_inertia")
            np.testing.assert_allclose(rows.psi[:, k] * 0.03 / 0.4, rows.psi[:, j], rtol=1e-6)


@pytest.mark.parametrize(
    ("name", "size"),
    [("friction_speed.slope", 1e30), ("torque_cubic", -1e160), ("conductance_disc_body", -1e6)],
)
def test_from_where_the_equations_run_away_there_is_a_way_back(problem, at_truth, name, size):
    """What such numbers imply of the inputs is finite: derivatives taken there are."""
    theta, rows = at_truth
    away = theta.copy()
    away[problem.index(name)] = size
    with np.errstate(all="ignore"):
        lost = problem.linearise(away, {})[0]
    assert not np.isfinite(lost.table).all()
    back = problem.linearise(theta, {}, at=[lost.implied])[0]
    np.testing.assert_array_equal(back.r, rows.r)
    assert np.isfinite(back.table).all()


def test_active_ones_answer_as_all_do(problem, at_truth):
    theta, _ = at_truth
    rows = implied(problem, theta)
    gains = [problem.index("friction_speed.slope"), problem.index("wear.rate")]
    active = np.array([*gains, *problem.nuisances[[0, 5, -3, -1]]])
    some = problem.linearise(theta, {}, active, problem.implied(theta, {}))[0]
    np.testing.assert_array_equal(some.r, rows.r)
    scale = np.abs(rows.psi).max(axis=0)
    assert np.all(np.abs(some.psi - rows.psi)[:, active] <= 1e-9 * scale[active])
    # a small delay and the effect of its signal's delay are one derivative in two units
    late = [k for k, t in enumerate(problem.thetas) if isinstance(t, SignalDelay)]
    both = [of for k, of in zip(late, problem.delayed, strict=True) if k in active]
    others = np.setdiff1d(np.arange(len(theta)), [*active, *both])
    assert not some.psi[:, others].any()
    assert rows.psi[:, others].any()


@pytest.mark.parametrize(("signal", "late"), [("torque", 0.05), ("position", 0.03)])
def test_a_delay_is_undone_by_its_gain(truck, problem, drive, signal, late):
    effect = f"{signal}_delay"
    delayed = quiet(truck, 1, {effect: {"delay": late}})
    found = Problem.of(delayed, truck, LIBRARY)
    sensor = found.drives[0].readings.sensor

    def most(theta: Floats) -> float:
        """Misses of the sensor that shows the delay most: the other dilutes them."""
        r = found.linearise(theta, {})[0].r
        return max(float(np.mean(r[sensor == own] ** 2)) for own in np.unique(sensor))

    left = most(truth(found, delayed))
    undone = most(truth(found, delayed, **{effect: ("delay", late)}))
    assert left > 0.09
    assert undone < 0.01 * left + 0.0025


def test_a_small_delay_is_any_signals(problem, at_truth):
    """The nuisance of every signal that can be late is its delay in a small unit."""
    _, rows = at_truth
    small = {t.signal: k for k, t in enumerate(problem.thetas) if isinstance(t, SignalDelay)}
    assert set(small) == {"engine_torque", "slave_position"}
    assert set(small.values()) <= set(problem.nuisances)
    for signal, k in small.items():
        of = problem.index(f"{signal.split('_')[1]}_delay.delay")
        np.testing.assert_allclose(
            rows.psi[:, k] / problem.units[k], rows.psi[:, of] / problem.units[of], atol=1e-12
        )
        both, alone = np.zeros((2, len(problem.thetas)))
        both[k], both[of] = 2.0, 0.1
        alone[k] = 2.0 + 0.1 * problem.units[of] / problem.units[k]
        np.testing.assert_allclose(
            *(problem.linearise(theta, {}, np.zeros(0, np.int64))[0].r for theta in (both, alone)),
            atol=1e-9,
        )


def test_several_drives_start_each_for_itself(truck, drive):
    second = quiet(truck, 2, duration=150.0)
    both = Problem.of(replace(drive, later=(second,)), truck, LIBRARY)
    starts = [
        [k for k, t in enumerate(both.thetas) if isinstance(t, InitialState) and t.drive == i]
        for i in (0, 1)
    ]
    assert [str(both.thetas[k]) for k in starts[0]] == [str(both.thetas[k]) for k in starts[1]]
    assert set(starts[0] + starts[1]) <= set(both.nuisances)
    theta = truth(both, drive, second)
    rows = both.linearise(theta, {})
    assert misses(rows[0]) < 0.0025 and misses(rows[1]) < 0.01
    for own, other in ((0, 1), (1, 0)):
        assert rows[own].psi[:, starts[own]].any(axis=0).all()
        assert not rows[own].psi[:, starts[other]].any()
    moved = theta.copy()
    moved[starts[1]] += 1.0
    again = both.linearise(moved, {})
    np.testing.assert_array_equal(again[0].r, rows[0].r)
    assert misses(again[1]) > 1.0


def test_an_effect_in_the_vehicle_file_is_not_sought(truck):
    """It acts as the file says; the rest is sought beside it."""
    worn = replace(truck, effects={"centrifugal": {"slope": 0.06}})
    drive = quiet(worn, 1)
    known = Problem.of(drive, worn, LIBRARY)
    assert "centrifugal" not in known.effects
    assert set(known.effects) == {e.name for e in LIBRARY} - {"centrifugal"}
    k = known.index("centrifugal.slope")
    assert isinstance(known.thetas[k], StatedGain)
    assert k not in known.gains and k not in known.nuisances
    assert misses(known.linearise(truth(known, drive), {})[0]) < 0.0025
    unknown = Problem.of(drive, truck, LIBRARY)
    without = unknown.linearise(truth(unknown, drive), {})[0]
    assert misses(without) > 0.1
    found = truth(unknown, drive, centrifugal=("slope", 0.06))
    assert misses(unknown.linearise(found, {})[0]) < 0.0025


def test_numbers_are_in_their_units(problem):
    """θ counts prior standard deviations of nuisances and largest plausible sizes of gains."""
    theta = np.zeros(len(problem.thetas))
    inertia, slope = problem.index("engine_inertia"), problem.index("friction_speed.slope")
    theta[[inertia, slope]] = 2.0, 0.5
    p, g, *_ = problem.numbers(theta, {("friction_slip", "speed"): 33.0})
    compiled = problem.compiled
    keys = [q.key for q in compiled.model.parameters]
    numbers = [(effect.name, key) for effect, key in compiled.model.numbers]
    assert p[keys.index("engine_inertia")] == pytest.approx(3.2 + 2 * 0.096)
    assert g[numbers.index(("friction_speed", "slope"))] == pytest.approx(0.15)
    assert g[numbers.index(("friction_slip", "speed"))] == 33.0
    changed = [keys.index("engine_inertia")]
    assert np.array_equal(np.delete(p, changed), np.delete(compiled.p, changed))
    assert problem.thetas[slope] == UnknownGain("friction_speed", "slope", 0.3)
    assert set(problem.gains).isdisjoint(problem.nuisances)
    assert len(problem.gains) + len(problem.nuisances) == len(problem.thetas)


def test_derivatives_by_a_constant_curve_are_those_by_the_gain_itself(truck, monkeypatch):
    """At an operating point far from nominal: what a curve over a covariate does is compared with
    what nuisances do, to one part in a million, so both are taken at the same inputs."""
    drive = clutchest.simulate(truck, "launches", 6, {"wear": {"amount": 1.0}}, duration=120.0)
    problem = Problem.of(drive, truck, LIBRARY)
    theta = np.zeros(len(problem.thetas))
    theta[problem.index("wear.amount")] = 1.0 / problem.units[problem.index("wear.amount")]
    gains = problem.gains
    ones = Modulation(np.ones((len(problem.drives[0].line.t), 1)), np.zeros(len(gains), np.int64))

    def differ() -> float:
        fit = Objective.of(problem).linearise_at(theta)
        curve = Objective.of(problem).modulated(fit, gains, [ones])
        size = np.linalg.norm(fit.psi[:, gains], axis=0)
        off = np.linalg.norm(curve - fit.psi[:, gains], axis=0)[size > 1.0] / size[size > 1.0]
        return float(np.max(off))

    assert differ() < 1e-6
    monkeypatch.setattr("clutchest.inference.problem.STEPS", 1)
    assert differ() > 1e-3  # what one step leaves
