"""The active differential estimated: its reduced model against the full one, replays of simulated
runs on rig and car, what no signal tells, wrong starts."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from itertools import product

import numpy as np
import pytest
from numpy.typing import NDArray

from clutchest.compute.forward import forward
from clutchest.estimate.initial_state import fresh
from clutchest.estimate.replay import replay
from clutchest.estimate.run import Run
from clutchest.estimate.timeline import build
from clutchest.estimate.whole_log import compile_model, run
from clutchest.models import machine_of
from clutchest.models.alsd import ALSD, at_rest, full
from clutchest.signals import Signals
from clutchest.simulated import simulate
from clutchest.vehicle import load_vehicle
from drawn import draw

SEEDS = range(4)
LENGTH = 12.0  # s


@cache
def steps(seed: int, vehicle: str = "alsd_rig", scenario: str = "rig-steps") -> Signals:
    return simulate(vehicle, scenario, seed, duration=LENGTH)


@cache
def replayed(seed: int) -> Run:
    return replay(steps(seed), "alsd_rig", rate=50.0)


def truth(signals: Signals, name: str, time: NDArray[np.float64]) -> NDArray[np.float64]:
    assert signals.truth is not None
    return np.interp(time, signals.truth.time, signals.truth.columns[name])


# --- the reduced model ---


@pytest.mark.slow
@pytest.mark.parametrize(("amps", "rpm"), [(12.0, 25.0), (7.0, 25.0), (2.5, 25.0), (12.0, 0.5)])
def test_what_the_reduction_costs(amps: float, rpm: float) -> None:
    """Open loop on the full model's voltage: RMS error within a per cent of full scale."""
    p = {key: value.value for key, value in load_vehicle("alsd_rig").parameters.items()}
    names = ("motor_angle", "pack_force", "clutch_torque", "motor_speed")
    whole = forward(full.RIG, (*names, "armature_voltage", "slip_speed"))
    reduced = forward(ALSD, names)
    t = np.arange(2601) * 1e-3
    given = {
        "current_request": np.interp(t, (0.5, 0.515, 1.6, 1.615), (0.0, amps, amps, 0.0)),
        "slip_request": np.full(len(t), rpm * np.pi / 30),
        "oil_temp": np.full(len(t), 25.0),
    }
    start = full.rest(full.RIG, p["free_play"], 25.0)
    start["drive_speed"] = rpm * np.pi / 30 * p["final_drive_ratio"]
    a = whole.run(p, start, given, 1e-3, 20)
    inputs = {
        "armature_voltage": a["armature_voltage"],
        "slip_speed": a["slip_speed"],
        "oil_temp": given["oil_temp"],
    }
    nought = dict.fromkeys((s.name for s in ALSD.states), 0.0)
    b = reduced.run(p, nought | at_rest(p, {"oil_temp": 25.0}), inputs, 1e-3, 4)
    for name in names:
        apart = np.sqrt(np.mean((a[name] - b[name]) ** 2)) / np.abs(a[name]).max()
        assert apart < 1e-2, (name, apart)


# --- replay ---


def test_a_run_tells_free_play_and_friction() -> None:
    """Far closer than the priors of 30 µm and 11 %, within what is said of them."""
    far = []
    for seed in SEEDS:
        track, signals = replayed(seed).tracks[0], steps(seed)
        for name, useful in (("free_play", 3e-6), ("friction", 0.03)):
            estimate = track.states[name]
            error = estimate.value[-1] - truth(signals, name, track.time[-1:])[0]
            assert abs(error) < useful, (seed, name, error)
            far.append(error / estimate.std[-1])
    assert np.sqrt(np.mean(np.square(far))) < 2.0


def test_intervals_hold_the_truth() -> None:
    """Engaged, of all runs together; the motor's states are known at any time."""
    inside: dict[str, list[NDArray[np.bool_]]] = {}
    for seed in SEEDS:
        track, signals = replayed(seed).tracks[0], steps(seed)
        pressed = (track.time > 3.0) & (truth(signals, "pack_force", track.time) > 100.0)
        columns = {**track.states, "clutch_torque": track.clutch_torque}
        for name in (
            "current",
            "motor_speed",
            "motor_angle",
            "pack_force",
            "temp_armature",
            "temp_pack",
            "clutch_torque",
        ):
            error = columns[name].value - truth(signals, name, track.time)
            inside.setdefault(name, []).append(
                np.abs(error[pressed]) < 1.96 * columns[name].std[pressed]
            )
    for name, parts in inside.items():
        assert np.mean(np.concatenate(parts)) > 0.85, name


def test_modes_are_the_truths() -> None:
    track, signals = replayed(0).tracks[0], steps(0)
    assert signals.truth is not None
    at = np.clip(np.searchsorted(signals.truth.time, track.time), 0, len(signals.truth.time) - 1)
    found = np.array(track.mode_names)[track.mode]
    assert np.mean(found == signals.truth.columns["mode"][at]) > 0.97


def test_without_torque_the_friction_is_said_to_be_unknown() -> None:
    signals = steps(0)
    mute = replace(signals, signals={n: signals[n] for n in signals if n != "clutch_torque"})
    run = replay(mute, "alsd_rig")
    state = run.summary["states"]["friction"]
    assert not state["valid"] and "no torque signal" in state["why"]
    assert run.summary["states"]["free_play"]["valid"]


@pytest.mark.statistics
def test_on_the_road_wheels_and_half_shafts_tell_the_friction() -> None:
    signals = steps(0, "alsd_car", "car")
    run = replay(signals, "alsd_car")
    track = run.tracks[0]
    error = track.states["friction"].value[-1] - truth(signals, "friction", track.time[-1:])[0]
    assert abs(error) < max(3.0 * track.states["friction"].std[-1], 0.03)
    assert run.summary["sensors"]["shaft_torque"]["count"] > 100


@pytest.mark.parametrize(
    ("key", "wrong"),
    [
        ("free_play", 1.5),
        ("free_play", 0.5),
        ("friction_coefficient", 1.2),
        ("friction_coefficient", 0.8),
    ],
)
def test_a_wrong_start_is_recovered_from(key: str, wrong: float) -> None:
    """Free play half off, friction a fifth: the vehicle file says so, and allows for it."""
    signals = simulate("alsd_rig", "rig-steps", 1, duration=LENGTH, nominal=True)
    rig = load_vehicle("alsd_rig")
    parameter = rig.parameters[key]
    believed = replace(parameter, value=wrong * parameter.value, spread=0.5 * parameter.value)
    track = replay(signals, replace(rig, parameters={**rig.parameters, key: believed})).tracks[0]
    nominal = 1.0 / wrong if key == "friction_coefficient" else parameter.value
    state = "friction" if key == "friction_coefficient" else "free_play"
    assert track.states[state].value[-1] == pytest.approx(nominal, rel=0.03)


@pytest.mark.slow
def test_both_wrong_at_once_are_recovered_from() -> None:
    """On the reduced model's own data, free play by half (3.2 σ) and friction by a fifth."""
    rig = load_vehicle("alsd_rig")
    known = {
        k: v if k in ("free_play", "friction_coefficient") else replace(v, spread=0.0)
        for k, v in rig.parameters.items()
    }
    rig = replace(rig, parameters=known)
    signals = simulate(rig, "rig-steps", 3, duration=LENGTH, nominal=True)
    compiled = compile_model(rig, machine_of("alsd").equations(set(signals)))
    line = build(signals, rig, compiled.model, 10.0, {})
    prior, rest = fresh(rig, compiled, line), line.t[line.emit >= 0] > 1.0
    play, friction = map(compiled.model.state, ("free_play", "friction"))
    errors, inside = [], []
    for seed, (more, rougher) in product(range(3), product((-1, 1), repeat=2)):
        truth = prior.x.copy()
        truth[play] += more * 9.5e-5
        truth[friction] += rougher * 0.2
        drawn = draw(compiled, line, prior, seed, truth, None)
        found = run(compiled, drawn.timeline, prior)
        error = (found.x - drawn.x)[rest][:, [play, friction]]
        errors.append(error)
        std = np.sqrt(found.P[rest][:, [play, friction], [play, friction]])
        inside.append(np.abs(error) < 3.0 * std)
    left = np.sqrt(np.mean(np.square(errors), axis=(0, 1)))
    assert left[0] < 0.05 * 9.5e-5
    assert left[1] < 0.05 * 0.2
    assert np.mean(inside) > 0.95


def test_free_play_and_friction_are_carried_over() -> None:
    first = replayed(0)
    later = simulate("alsd_rig", "rig-steps", 1, duration=2.0)  # a higher seed is a later run
    track = replay(later, "alsd_rig", state=first.final).tracks[0]
    for name in ("free_play", "friction"):
        left = first.tracks[0].states[name]
        assert track.states[name].std[0] < 2.0 * left.std[-1] + 1e-6
        assert abs(track.states[name].value[0] - left.value[-1]) < 0.02 * left.value[-1]
